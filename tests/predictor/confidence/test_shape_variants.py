import math

import numpy as np
import pytest
import shapely
from shapely.geometry import box

from closedrooms.core.door import ClosedDoor
from closedrooms.core.errors import InvalidInputError
from closedrooms.core.grid import FREE, OCCUPIED, UNKNOWN, GridFrame, OccupancyGrid
from closedrooms.predictor.baselines import geometric, line_of_sight
from closedrooms.predictor.config import FacesConfig
from closedrooms.predictor.inpainting import find_passage, inpaint
from closedrooms.predictor.methods import predict
from closedrooms.predictor.structure.clutter import filter_clutter, free_islands
from closedrooms.predictor.structure.doorways import FacingDoor
from closedrooms.predictor.structure.rose import find_rose
from closedrooms.predictor.structure.wall_thickness import free_interior, measure_taken

FACES = FacesConfig()


@pytest.mark.parametrize("degrees", [0, 20, 48])
def test_rose_finds_the_two_directions_of_a_building(mapped, degrees):
    rose = find_rose(mapped(angle=math.radians(degrees)).grid)
    found = np.sort(np.degrees(rose.angles) % 90)
    assert rose.angles.size == 2
    np.testing.assert_allclose((found - degrees + 45) % 90 - 45, 0.0, atol=0.5)


def test_clutter_goes_and_walls_stay(mapped):
    grid = mapped().grid
    cells = grid.cells.copy()
    rng = np.random.default_rng(1)
    inside = grid.frame.to_cells(np.column_stack((rng.uniform(0.5, 20.0, 40), rng.uniform(0.5, 1.5, 40))))
    cells[inside[:, 0], inside[:, 1]] = OCCUPIED
    cluttered = OccupancyGrid(grid.frame, cells)
    cleaned = filter_clutter(cluttered)
    assert cleaned.free[inside[:, 0], inside[:, 1]].all()
    assert (cleaned.occupied == grid.occupied).mean() > 0.999
    assert (cleaned.unknown == grid.unknown).all()


def test_a_map_without_directions_keeps_its_clutter():
    cells = np.full((80, 80), FREE, dtype=np.int8)
    cells[40, 40] = OCCUPIED
    grid = OccupancyGrid(GridFrame(0.05, 0, 0, 80, 80), cells)
    assert filter_clutter(grid) is grid


def _with_boxes(grid, *boxes):
    """Outlines of boxes [m] drawn into a map, their insides unknown, as a robot sees tables and cupboards."""
    cells = grid.cells.copy()
    for shape in boxes:
        (col0, row0), (col1, row1) = (grid.frame.to_corners(np.array(p)).round().astype(int) for p in shape)
        cells[row0:row1, col0:col1] = OCCUPIED
        cells[row0 + 1 : row1 - 1, col0 + 1 : col1 - 1] = UNKNOWN
    return OccupancyGrid(grid.frame, cells)


def test_small_pieces_that_free_space_surrounds_are_freed_with_their_hollows(mapped):
    grid = mapped().grid
    table, beside_wall, large = ((0.5, 3.5), (2.0, 5.0)), ((9.0, 2.15), (10.0, 3.0)), ((13.0, 3.5), (15.5, 6.0))
    cleaned = free_islands(_with_boxes(grid, table, beside_wall, large), 4.0, (), 1.0)
    assert (cleaned.cells == _with_boxes(grid, beside_wall, large).cells).all()
    assert free_islands(grid, 4.0, (), 1.0) is grid


def test_a_piece_of_wall_and_a_crossing_of_walls_between_open_doors_are_no_furniture(mapped):
    wall, bar, post = ((0.5, 3.0), (3.5, 3.2)), ((0.5, 5.0), (3.5, 5.2)), ((1.9, 4.0), (2.1, 6.2))
    grid = _with_boxes(mapped().grid, wall, bar, post)
    assert free_islands(grid, 4.0, (), 1.0) is grid


def test_a_closet_with_a_door_in_the_middle_of_a_hall_is_no_furniture(mapped):
    grid = _with_boxes(mapped().grid, ((0.5, 3.5), (2.0, 5.0)))
    assert free_islands(grid, 4.0, [(0.5, 4.2)], 1.0) is grid
    assert free_islands(grid, 4.0, [(4.0, 4.2)], 1.0) is not grid


@pytest.mark.parametrize("name", ["paper", "best"])
def test_tables_in_a_known_room_change_nothing_behind_the_doors(mapped, iou, name):
    scene = mapped(closed=("t1", "t3"))
    tables = [((9.2 + x, 3.0 + y), (10.6 + x, 4.0 + y)) for x in (0.0, 1.7) for y in (0.0, 2.0)]
    furnished = _with_boxes(scene.grid, *tables)
    bare, full = (predict(grid, scene.doors, name) for grid in (scene.grid, furnished))
    for before, after in zip(bare.rooms, full.rooms, strict=True):
        assert iou(before.polygon, after.polygon) > 0.99
    kept = full.grid.on(furnished.frame)
    assert (kept.occupied >= furnished.occupied)[furnished.known & (scene.grid.cells == FREE)].all()


def test_line_of_sight_fills_a_gap_and_ends_at_the_bounds_of_the_map(mapped, iou):
    scene = mapped(closed=("t1", "b3"))
    prediction = line_of_sight(scene.grid, scene.doors, FACES)
    row, col, rows, cols = scene.grid.known_bounds()
    x0, y0, x1, y1 = scene.grid.frame.cropped(row, col, rows, cols).bounds
    for room in prediction.rooms:
        assert iou(room.polygon, scene.hidden[room.doors[0]]) > 0.8
        assert room.polygon.within(box(x0, y0, x1, y1).buffer(0.1))


def test_geometric_takes_the_faces_in_sight(mapped, iou):
    scene = mapped(closed=("t1", "t2"))
    prediction = geometric(scene.grid, scene.doors, FACES)
    both = shapely.union_all(list(scene.hidden.values()))
    for room in prediction.rooms:  # nothing parts the two: each sees into the other
        assert iou(room.polygon, both) > 0.8


@pytest.mark.parametrize("degrees", [0, 30])
def test_the_thickness_of_walls_is_measured(mapped, degrees):
    angle = math.radians(degrees)
    measured = measure_taken(mapped(angle=angle).grid, np.array([angle, angle + math.pi / 2]))
    assert measured == pytest.approx(0.2, abs=0.05)


def _two_rooms(gap, specks=()):
    """Two rooms of 4 x 6 m, ``gap`` [m] of unknown and a cell of wall on either side of it between them."""
    cells = np.full((120, 200), FREE, dtype=np.int8)
    cells[:, 80 : 80 + round(gap / 0.05)] = UNKNOWN
    cells[:, [80, 79 + round(gap / 0.05)]] = OCCUPIED
    for row in specks:
        cells[row, 76:79:2] = OCCUPIED
    return OccupancyGrid(GridFrame(0.05, 0, 0, 120, 200), cells)


def test_specks_beside_a_wall_have_no_thickness():
    upright = np.array([math.pi / 2])
    assert measure_taken(_two_rooms(0.15), upright) == pytest.approx(0.15)
    assert measure_taken(_two_rooms(0.15, specks=range(0, 110)), upright) != pytest.approx(0.05)


def test_thick_walls_take_no_more_of_a_room_than_usual_ones():
    assert measure_taken(_two_rooms(0.45), np.array([math.pi / 2])) == pytest.approx(0.20)


def test_thin_walls_are_assumed_where_none_is_seen_from_both_sides():
    grid = OccupancyGrid(GridFrame(0.05, 0, 0, 40, 40), np.full((40, 40), FREE, dtype=np.int8))
    assert measure_taken(grid, np.array([0.0, math.pi / 2])) == pytest.approx(0.10)


def test_walls_take_half_their_thickness_and_all_of_it_beside_known_space():
    frame = GridFrame(0.05, -1.0, -1.0, 140, 140)
    cells = np.full(frame.shape, UNKNOWN, dtype=np.int8)
    cells[:20] = FREE  # free below y = 0: the wall is above it
    interior = free_interior(box(0.0, 0.0, 4.0, 3.0), OccupancyGrid(frame, cells), 0.2)
    x0, y0, x1, y1 = interior.bounds
    assert (x0, x1, y1) == pytest.approx((0.1, 3.9, 2.9))
    assert y0 == pytest.approx(0.2, abs=0.051)


def test_a_layout_that_is_all_wall_stays():
    grid = OccupancyGrid(GridFrame(0.05, 0, 0, 40, 40), np.full((40, 40), UNKNOWN, dtype=np.int8))
    thin = box(0.0, 0.0, 2.0, 0.1)
    assert free_interior(thin, grid, 0.3) is thin


def test_a_room_is_drawn_free_inside_and_occupied_on_its_outline():
    grid = OccupancyGrid(GridFrame(0.1, 0, 0, 20, 20), np.full((20, 20), UNKNOWN, dtype=np.int8))
    out = inpaint(grid, [box(0.5, 0.5, 1.5, 1.5)], [])
    assert out.frame == grid.frame
    assert out.free[6:14, 6:14].all()
    assert out.occupied[5, 5:15].all()
    assert out.unknown[:4].all()
    grown = inpaint(grid, [box(-1.03, 0.5, 1.5, 3.0)], [])
    assert grown.frame.origin_x == pytest.approx(-1.3)
    assert grown.frame.bounds[3] >= 3.0


def test_a_room_of_too_many_cells_is_refused():
    grid = OccupancyGrid(GridFrame(1e-4, 0, 0, 10, 10), np.full((10, 10), UNKNOWN, dtype=np.int8))
    with pytest.raises(InvalidInputError, match=r"rooms over 5 x 5 m in cells of 0.0001 m"):
        inpaint(grid, [box(0.0, 0.0, 5.0, 5.0)], [])


def test_a_passage_leads_from_free_space_into_the_room():
    frame = GridFrame(0.05, 0.0, 0.0, 80, 80)
    cells = np.full(frame.shape, UNKNOWN, dtype=np.int8)
    cells[:30] = FREE
    cells[30:32] = OCCUPIED
    door = FacingDoor(ClosedDoor("d", (2.0, 1.6)), np.array([0.0, 1.0]))
    way = find_passage(OccupancyGrid(frame, cells), box(0, 1.8, 4, 4), door, width=0.8, reach=1.0)
    x0, y0, x1, y1 = way.bounds
    assert (x0, x1) == pytest.approx((1.6, 2.4))
    assert y0 < 1.5
    assert y1 > 1.85
