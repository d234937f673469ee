import numpy as np
import pytest

from closedrooms.core.door import ClosedDoor
from closedrooms.core.pose import Pose2
from closedrooms.core.scan import LaserScan
from closedrooms.mapping.mapper import Mapper
from closedrooms.navigation.tour.opened_doors import ReopenedMap

# A corridor along x, 2 m wide; in its upper wall at y = 1 a door from x = 2.05 to x = 2.95, a room of 3 m behind it.
DOOR = ClosedDoor("d00", (2.5, 1.0), ((2.05, 1.0), (2.95, 1.0)), 0.9)
WALLS = [((-3, -1), (8, -1)), ((-3, 1), (2.05, 1)), ((2.95, 1), (8, 1)), ((-3, -1), (-3, 1)), ((8, -1), (8, 1))]
ROOM = [((1, 1), (1, 4)), ((1, 4), (4, 4)), ((4, 4), (4, 1))]
LEAF = ((2.05, 1.0), (2.95, 1.0))


def _scan(pose: Pose2, segments: list, stamp: float) -> LaserScan:
    """An exact sweep of 720 beams."""
    angles = -np.pi + np.arange(720) * 2 * np.pi / 720
    directions = np.column_stack((np.cos(angles + pose.theta), np.sin(angles + pose.theta)))
    ranges = np.full(720, np.inf)
    for a, b in segments:
        start, along = np.array(a, dtype=float) - (pose.x, pose.y), np.subtract(b, a).astype(float)
        cross = directions[:, 0] * along[1] - directions[:, 1] * along[0]
        with np.errstate(divide="ignore", invalid="ignore"):
            t = (start[0] * along[1] - start[1] * along[0]) / cross
            s = (start[0] * directions[:, 1] - start[1] * directions[:, 0]) / cross
        hit = (t > 0) & (s >= 0) & (s <= 1)
        ranges[hit] = np.minimum(ranges[hit], t[hit])
    return LaserScan(ranges, -np.pi, 2 * np.pi / 720, 20.0, stamp=stamp)


def _drive(mapper: Mapper, xs: np.ndarray, segments: list, stamp: float) -> float:
    for x in xs:
        pose = Pose2(float(x), 0.0)
        mapper.process(_scan(pose, segments, stamp), pose)
        stamp += 0.1
    return stamp


def _leaf_cells(grid, depth: float = 0.1) -> np.ndarray:
    cells = np.argwhere(np.ones(grid.frame.shape, dtype=bool))
    points = grid.frame.to_points(cells)
    inside = (np.abs(points[:, 0] - 2.5) < 0.35) & (np.abs(points[:, 1] - 1.0) < depth)
    return grid.cells[cells[inside, 0], cells[inside, 1]]


def _mapper_after_many_passes() -> tuple[Mapper, float]:
    mapper = Mapper()
    stamp = 0.0
    for xs in (np.arange(0.0, 5.0, 0.2), np.arange(5.0, 0.0, -0.2)) * 2:
        stamp = _drive(mapper, xs, [*WALLS, LEAF], stamp)
    return mapper, stamp


def test_the_leaf_of_an_opened_door_is_gone_once_a_ray_has_passed() -> None:
    mapper, stamp = _mapper_after_many_passes()
    assert (_leaf_cells(mapper.grid()) > 65).any()
    reopened = ReopenedMap(mapper, [DOOR])
    assert not (_leaf_cells(reopened.grid()) > 65).any()  # void, and nothing new is known yet
    _drive(mapper, np.arange(0.0, 1.7, 0.2), [*WALLS, *ROOM], stamp)
    assert (_leaf_cells(mapper.grid()) > 65).any()  # the sums remember a little longer
    assert (np.abs(_leaf_cells(reopened.grid())) < 20).all()
    assert (_leaf_cells(reopened.grid()) >= 0).all()


def test_a_door_that_did_not_open_is_seen_again() -> None:
    mapper, stamp = _mapper_after_many_passes()
    reopened = ReopenedMap(mapper, [DOOR])
    _drive(mapper, np.arange(0.0, 2.6, 0.2), [*WALLS, LEAF], stamp)
    assert (_leaf_cells(reopened.grid()) > 65).any()


def test_a_door_that_waits_is_unknown_until_it_opens_and_seen_from_then_on() -> None:
    mapper, stamp = _mapper_after_many_passes()
    reopened = ReopenedMap(mapper, [DOOR], waiting=("d00",))
    stamp = _drive(mapper, np.arange(0.0, 2.6, 0.2), [*WALLS, LEAF], stamp)
    assert (_leaf_cells(reopened.grid()) < 65).all()  # not even what was seen since: it will open
    reopened.note_opened(["d00"])
    _drive(mapper, np.arange(2.6, 0.0, -0.2), [*WALLS, *ROOM], stamp)
    assert (np.abs(_leaf_cells(reopened.grid())) < 20).all()
    assert (_leaf_cells(reopened.grid()) >= 0).all()


def test_all_but_the_doorways_stays_as_the_mapper_has_it() -> None:
    mapper, stamp = _mapper_after_many_passes()
    reopened = ReopenedMap(mapper, [DOOR])
    _drive(mapper, np.arange(0.0, 0.9, 0.2), [*WALLS, *ROOM], stamp)
    own, theirs = reopened.grid(), mapper.grid()
    rows, cols = np.nonzero(own.cells != theirs.cells)
    points = own.frame.to_points(np.column_stack((rows, cols)))
    assert len(points)
    assert (np.abs(points[:, 0] - 2.5) <= 0.45).all()
    assert (np.abs(points[:, 1] - 1.0) <= 0.30).all()
    assert np.array_equal(ReopenedMap(mapper, []).grid().cells, theirs.cells)


@pytest.mark.parametrize(("y", "is_open"), [(0.5, False), (1.0, True)])
def test_a_pane_hides_the_doorway_behind_it_but_a_leaf_of_glass_went_with_its_door(y: float, is_open: bool) -> None:
    class AmongGlass(Mapper):
        panes = np.array([[[-3.0, y], [8.0, y]]])

    mapper = AmongGlass()
    stamp = 0.0
    for xs in (np.arange(0.0, 5.0, 0.2), np.arange(5.0, 0.0, -0.2)) * 2:
        stamp = _drive(mapper, xs, [*WALLS, LEAF], stamp)
    reopened = ReopenedMap(mapper, [DOOR])
    _drive(mapper, np.arange(0.0, 1.3, 0.2), [*WALLS, *ROOM], stamp)
    cells = _leaf_cells(reopened.grid(), 0.03)
    known = np.mean(cells >= 0)
    assert known > 0.8 if is_open else known < 0.2
