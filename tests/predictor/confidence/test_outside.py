import math

import numpy as np
import pytest

from closedrooms.core.door import ClosedDoor
from closedrooms.core.files.incoming import read_json
from closedrooms.core.grid import OccupancyGrid
from closedrooms.predictor.confidence import judge as judging
from closedrooms.predictor.confidence.outside import FEATURES, FILE, find_outside, measure_doors, read_numbers
from closedrooms.predictor.methods import predict
from closedrooms.predictor.structure.doorways import FacingDoor

CLOSED = ("t1", "t2", "b3")


def facing(name, x, y, inward, angle=0.0):
    """A door of the building, turned with it."""
    c, s = math.cos(angle), math.sin(angle)
    turn = np.array([[c, -s], [s, c]])
    return FacingDoor(ClosedDoor(name, tuple((turn @ (x, y)).tolist())), turn @ np.array(inward, dtype=float))


def doors_of(angle=0.0):
    """Doors of three closed rooms, and one at the west end of the corridor, where all rooms of the building end."""
    rooms = [
        facing("t1", 5.7, 2.1, (0, 1), angle),
        facing("t2", 9.9, 2.1, (0, 1), angle),
        facing("b3", 14.1, -0.1, (0, -1), angle),
    ]
    return [*rooms, facing("exit", -0.1, 1.0, (-1, 0), angle)]


def test_a_door_in_the_facade_leads_outside_rather_than_one_between_rooms(mapped):
    found = find_outside(mapped(CLOSED).grid, doors_of())
    assert list(found) == ["t1", "t2", "b3", "exit"]
    assert found["exit"] > 5 * max(found[name] for name in CLOSED)
    assert max(found[name] for name in CLOSED) < 0.05


@pytest.mark.parametrize("angle", [math.pi / 2, 0.4])
def test_neither_the_frame_nor_the_order_of_doors_matters(mapped, angle):
    usual = find_outside(mapped(CLOSED).grid, doors_of())
    turned = find_outside(
        mapped(CLOSED, angle=angle, shift=(3.0, -7.1)).grid, [moved(d) for d in doors_of(angle)][::-1]
    )
    assert_much_the_same(usual, turned)


def assert_much_the_same(chances, others):
    """Within a factor of e of the odds: what is measured depends on a lattice of 0.25 m."""
    assert chances.keys() == others.keys()
    for name, chance in chances.items():
        odds, other = chance / (1 - chance), others[name] / (1 - others[name])
        assert 1 / math.e < other / odds < math.e, name


def moved(door):
    x, y = door.door.midpoint
    return FacingDoor(ClosedDoor(door.door.id, (x + 3.0, y - 7.1)), door.inward)


@pytest.mark.parametrize("resolution", [0.025, 0.1])
def test_the_size_of_cells_hardly_matters(mapped, resolution):
    usual = find_outside(mapped(CLOSED).grid, doors_of())
    other = find_outside(mapped(CLOSED, resolution=resolution).grid, doors_of())
    assert_much_the_same(usual, other)


def test_there_is_a_number_for_each_feature_and_an_empty_map_has_them_too(mapped):
    mean, weights, _ = read_numbers()
    assert mean.shape == weights.shape == (len(FEATURES),)
    assert read_json(FILE, what="numbers")["features"] == [feature.__name__ for feature in FEATURES]
    grid = mapped(CLOSED).grid
    nothing = OccupancyGrid(grid.frame, np.full(grid.frame.shape, -1, dtype=np.int8))
    assert np.isfinite(measure_doors(nothing, doors_of())).all()
    assert find_outside(grid, []) == {}


def test_what_rays_show_through_a_window_is_no_floor(mapped):
    grid = mapped(CLOSED).grid
    row, col = grid.frame.to_cells(np.array([-0.9, 1.0])).tolist()
    cells = grid.cells.copy()
    cells[row - 3 : row + 3, col : col + 18] = 0
    seen = find_outside(OccupancyGrid(grid.frame, cells), doors_of())
    for name, chance in find_outside(grid, doors_of()).items():
        assert seen[name] == pytest.approx(chance, rel=0.1)


def predicted(scene, monkeypatch, method="best", **chances):
    monkeypatch.setattr(judging, "find_outside", lambda *_: chances)
    return predict(scene.grid, scene.doors, method)


def test_where_a_door_leads_is_said_beside_how_sure_its_room_is(mapped, monkeypatch):
    scene = mapped(CLOSED)
    usual, doubted = predicted(scene, monkeypatch), predicted(scene, monkeypatch, t1=0.93)
    for room, before in zip(doubted.rooms, usual.rooms, strict=True):
        assert room.outside == (0.93 if "t1" in room.doors else None)
        assert (room.doors, room.confidence) == (before.doors, before.confidence)
    assert (doubted.probability.cells == usual.probability.cells).all()
    assert doubted.failures == {}
