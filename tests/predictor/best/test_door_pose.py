"""Which way doors look, where their rooms begin, and what known space leaves of a rectangle, on maps drawn by hand."""

import math

import numpy as np
import pytest
import shapely
from shapely.geometry import box

from closedrooms.core.door import ClosedDoor
from closedrooms.core.grid import FREE, GridFrame, OccupancyGrid
from closedrooms.predictor.best.door_frame import TurnedMap, door_frame
from closedrooms.predictor.best.door_pose import DoorPose, enter, face_door, see_doors
from closedrooms.predictor.best.room_shape import _name_kind, _rate_piece, subtract_known
from closedrooms.predictor.structure.doorways import Doorway, FacingDoor

SIZE, CELL, THICKNESS = 200, 0.05, 4
# Into the room by quarter, as (x, y).
INWARD = [(0.0, 1.0), (-1.0, 0.0), (0.0, -1.0), (1.0, 0.0)]


def turned(free, known=(), angle=0.0):
    """A map of 10 m with rectangles ``x0, y0, x1, y1`` [cells] of free cells and of known ones."""
    masks = np.zeros((2, SIZE, SIZE), dtype=np.bool_)
    for number, boxes in enumerate((free, (*free, *known))):
        for x0, y0, x1, y1 in boxes:
            masks[number, y0:y1, x0:x1] = True
    return TurnedMap(angle, np.zeros(2), CELL, *masks)


def door(x, y, name="d"):
    """At a place in cells."""
    return ClosedDoor(name, (x * CELL, y * CELL))


def quarter_turned(map_, quarter):
    """The same map turned to the left about its middle, so that what lay along +y lies along INWARD[quarter]."""
    masks = [np.rot90(mask, -quarter).copy() if quarter else mask for mask in (map_.free, map_.known)]
    return TurnedMap(map_.angle, map_.origin, map_.resolution, *masks)


def place(x, y, quarter):
    x, y = x - SIZE / 2, y - SIZE / 2
    for _ in range(quarter):
        x, y = -y, x
    return x + SIZE / 2, y + SIZE / 2


# Free below row 100, a wall of two cells.
HALF = turned([(40, 60, 160, 100)], [(40, 100, 160, 102)])


@pytest.mark.parametrize("quarter", range(4))
def test_a_door_looks_from_free_space_to_unknown_space(quarter):
    pose = face_door(door(*place(100.5, 101.5, quarter)), quarter_turned(HALF, quarter), reach=1.0)
    assert isinstance(pose, DoorPose)
    assert pose.quarter == quarter
    assert pose.facing.inward == pytest.approx(INWARD[quarter], abs=1e-12)
    assert pose.looks(0.0, quarter)
    assert not pose.looks(0.0, (quarter + 1) % 4)
    assert not pose.looks(0.1, quarter)


def test_a_door_of_a_turned_map_looks_along_its_walls():
    slanted = TurnedMap(0.3, np.zeros(2), CELL, HALF.free, HALF.known)
    middle = slanted.to_map(np.array([100.5, 101.5]))
    pose = face_door(ClosedDoor("d", (float(middle[0]), float(middle[1]))), slanted, reach=1.0)
    assert isinstance(pose, DoorPose)
    assert pose.facing.inward == pytest.approx([-math.sin(0.3), math.cos(0.3)])
    assert (pose.angle, pose.quarter) == (0.3, 0)


@pytest.mark.parametrize("at", [(-1.0, 50.0), (50.0, -1.0), (200.0, 50.0), (50.0, 200.0), (100.0, 150.0), (10.0, 10.0)])
def test_a_door_beyond_what_is_known_has_no_room(at):
    assert face_door(door(*at), HALF, reach=1.0) == "it lies outside the known map"


def test_a_door_needs_a_wall_within_reach_unknown_space_behind_and_free_space_before_it():
    assert face_door(door(100.5, 80.5), HALF, reach=0.5) == "no wall within 0.5 m"
    # The wall's first row, 20 cells away, is 1 m away.
    assert isinstance(face_door(door(100.5, 80.5), HALF, reach=1.0), DoorPose)
    assert face_door(door(100.5, 79.5), HALF, reach=1.0) == "no wall within 1 m"
    both = turned([(40, 60, 160, 100), (40, 102, 160, 150)], [(40, 100, 160, 102)])
    assert face_door(door(100.5, 101.5), both, reach=1.0) == "no unknown space behind it"
    wall = turned([], [(40, 60, 160, 102)])
    assert face_door(door(100.5, 101.5), wall, reach=1.0) == "no free space in front of it"


@pytest.mark.parametrize(("unknown", "found"), [(4, False), (5, True)])
def test_a_quarter_of_what_lies_ahead_must_be_unknown(unknown, found):
    # From 0.4 to 1.4 m ahead lie 20 rows.
    ahead = turned([(40, 60, 160, 100)], [(40, 100, 160, 109 + 20 - unknown)])
    assert isinstance(face_door(door(100.5, 101.5), ahead, reach=1.0), DoorPose) == found


@pytest.mark.parametrize("standing", [0.0, 2.0, 4.0])
def test_a_room_begins_a_wall_behind_the_face_before_its_door(standing):
    frame = door_frame(HALF, 0, THICKNESS)
    (pose,) = poses((100.5, 100.0 + standing), map_=HALF)
    entry = enter(frame, pose, [pose])
    assert (entry.u, entry.v) == pytest.approx((100.5, 100.0 + standing))
    # The face is at 100: the wall ends at 104, and no more than half of one lies behind the door.
    assert entry.v0 == round(100.0 + standing + max(min(4.0 - standing, 2.0), 0.5))
    assert entry.front == (40, 160)
    assert entry.span == (entry.u, entry.u)


def poses(*places, map_=HALF):
    found = [face_door(door(x, y, f"d{number}"), map_, reach=1.0) for number, (x, y) in enumerate(places)]
    assert all(isinstance(pose, DoorPose) for pose in found)
    return found


def test_the_next_doors_of_the_same_wall_are_its_neighbours():
    all_ = poses((60.5, 101.5), (90.5, 100.5), (100.5, 101.5), (150.5, 101.5))
    frame = door_frame(HALF, 0, THICKNESS)
    entries = [enter(frame, pose, all_) for pose in all_]
    assert [(entry.left, entry.right, entry.row) for entry in entries] == [
        (None, pytest.approx(90.5), 4),
        (pytest.approx(60.5), pytest.approx(100.5), 4),
        (pytest.approx(90.5), pytest.approx(150.5), 4),
        (pytest.approx(100.5), None, 4),
    ]
    # Those that look another way, or from a wall 1.5 m behind, are none.
    here = DoorPose(FacingDoor(door(100.5, 101.5), np.array([0.0, 1.0])), 0.0, 0)
    others = [
        DoorPose(FacingDoor(door(80.5, 101.5), np.array([0.0, -1.0])), 0.0, 2),
        DoorPose(FacingDoor(door(80.5, 101.5), np.array([0.0, 1.0])), 0.1, 0),
        DoorPose(FacingDoor(door(120.5, 131.5), np.array([0.0, 1.0])), 0.0, 0),
        DoorPose(FacingDoor(door(130.5, 131.4), np.array([0.0, 1.0])), 0.0, 0),
    ]
    entry = enter(frame, here, [here, *others])
    assert (entry.left, entry.right, entry.row) == (None, pytest.approx(130.5), 2)


def test_free_space_before_a_door_goes_on_over_gaps_of_half_a_metre():
    for gap, first in ((9, 40), (10, 80)):
        split = turned([(40, 60, 80 - gap, 100), (80, 60, 130, 100), (130 + gap, 60, 160, 100)], [(40, 100, 160, 102)])
        (pose,) = poses((100.5, 101.5), map_=split)
        entry = enter(door_frame(split, 0, THICKNESS), pose, [pose])
        assert entry.front == (first, 160 if gap == 9 else 130)
    # Only what lies 0.25 to 0.9 m before the wall counts.
    for rows, front in (((84, 97), (90, 110)), ((97, 100), (100, 101)), ((60, 83), (100, 101))):
        strip = turned([(90, rows[0], 110, rows[1])], [(40, 100, 160, 102)])
        pose = DoorPose(FacingDoor(door(100.5, 101.5), np.array([0.0, 1.0])), 0.0, 0)
        assert enter(door_frame(strip, 0, THICKNESS), pose, [pose]).front == front


def test_doors_are_seen_from_the_frame_of_another_in_the_sides_of_their_rooms():
    frames = [door_frame(HALF, quarter, THICKNESS) for quarter in range(4)]
    all_ = [DoorPose(FacingDoor(door(100.0, 90.0), np.array(INWARD[q])), 0.0, q) for q in range(4)]
    entries = [(frame, enter(frame, pose, [pose])) for frame, pose in zip(frames, all_, strict=True)]
    seen = see_doors(frames[0], all_, entries)
    # One that looks up is in the front of its room (v0), one that looks left in its right side (u1).
    assert seen.columns.tolist() == [1, 2, 3, 0]
    for number, (pose, (own, entry)) in enumerate(zip(all_, entries, strict=True)):
        middle = pose.facing.middle
        assert frames[0].to_map(seen.behind[number]) == pytest.approx(middle + 0.8 * pose.facing.inward)
        depth = (entry.v0 - entry.v) * CELL
        assert frames[0].to_map(seen.leaves[number]) == pytest.approx(middle + depth * pose.facing.inward, abs=1e-9)
        assert own is frames[number]
    again = see_doors(frames[1], all_, entries)
    assert again.columns.tolist() == [0, 1, 2, 3]
    slanted = door_frame(TurnedMap(0.3, np.zeros(2), CELL, HALF.free, HALF.known), 0, THICKNESS)
    assert see_doors(slanted, all_, entries).columns.tolist() == [-1] * 4
    assert seen.without(1).columns.tolist() == [1, 3, 0]
    assert see_doors(frames[0], [], []).behind.shape == (0, 2)


def rectangle(x0, y0, x1, y1):
    """Corners in the map [m] of cells."""
    return np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]]) * CELL


FACING = FacingDoor(door(100.0, 102.0), np.array([0.0, 1.0]))


def left(corners, map_=HALF, *, thickness=2, doorways=(), narrow=7):
    return subtract_known(map_, corners, thickness, FACING, doorways, narrow=narrow)


def test_a_rectangle_in_unknown_space_stays_as_it_is():
    corners = rectangle(80, 104, 120, 150)
    shape = left(corners)
    assert shape.equals(shapely.Polygon(corners))
    # A wall of two cells around free space: from row 102 on nothing is taken.
    assert left(rectangle(80, 102, 120, 150)).equals(shapely.Polygon(rectangle(80, 102, 120, 150)))


@pytest.mark.parametrize("thickness", [1, 2, 5])
def test_known_space_and_its_walls_are_taken_off(thickness):
    shape = left(rectangle(80, 90, 120, 150), thickness=thickness)
    low = (100 + thickness) * CELL
    # Outlines run a quarter of a cell inside of the cells.
    assert shape.hausdorff_distance(box(80 * CELL, low, 120 * CELL, 150 * CELL)) < 0.4 * CELL


def test_what_is_all_known_leaves_nothing_and_what_lies_beyond_the_map_is_unknown():
    assert left(rectangle(60, 70, 90, 95)) is None
    for corners in (rectangle(-60, -60, -10, -10), rectangle(300, 300, 340, 340), rectangle(180, 180, 240, 240)):
        assert left(corners).equals(shapely.Polygon(corners))


def test_strips_narrower_than_a_room_are_left_out():
    # Between free space of two rooms, so many cells of a strip are open beside a room of 40.
    for strip, kept in ((6, False), (7, True)):
        map_ = turned([(40, 60, 80, 100), (40, 104 + strip, 80, 150)])
        shape = left(rectangle(50, 102, 130, 140), map_, narrow=7)
        whole = box(82 * CELL, 102 * CELL, 130 * CELL, 140 * CELL)
        more = box(50 * CELL, 102 * CELL, 82 * CELL, (102 + strip) * CELL)
        assert shape.intersection(more).area == pytest.approx(more.area if kept else 0.0, abs=0.1)
        assert shape.intersection(whole).area == pytest.approx(whole.area, abs=0.15)


def test_of_two_pieces_the_large_one_near_the_door_stays():
    assert _rate_piece(np.ones((10, 20), dtype=np.bool_), np.array([5.0, 5.0])) == 200.0
    # Half as much where its nearest cell is a metre away.
    assert _rate_piece(np.ones((10, 20), dtype=np.bool_), np.array([5.0, -20.0])) == 100.0
    assert _rate_piece(np.ones((10, 20), dtype=np.bool_), np.array([-40.0, 0.0])) == pytest.approx(200.0 / 5.0)
    mask = np.zeros((10, 20), dtype=np.bool_)
    mask[2, 3] = True
    assert _rate_piece(mask, np.array([3.0 + 12.0, 2.0 - 16.0])) == pytest.approx(1.0 / 2.0)


def test_free_space_in_an_opening_ends_at_a_leaf_and_takes_nothing_of_the_room():
    # A recess of the wall: free up to row 104 between columns 95 and 105.
    recess = turned([(40, 60, 160, 100), (95, 100, 105, 104)], [(40, 100, 160, 102)])
    doorway = Doorway(FACING, -0.25, 0.25, 0.1, -0.1)
    corners = rectangle(80, 102, 120, 150)
    assert left(corners, recess).area < shapely.Polygon(corners).area - 0.05
    assert left(corners, recess, doorways=[doorway]).equals(shapely.Polygon(corners))


GRID = OccupancyGrid(GridFrame(CELL, 0.0, 0.0, 100, 100), np.full((100, 100), FREE, dtype=np.int8))


@pytest.mark.parametrize("side", range(4))
@pytest.mark.parametrize(("beyond", "kind"), [(0.49, "independent"), (0.51, "border")])
def test_a_room_half_a_metre_beyond_the_map_lies_at_its_border(side, beyond, kind):
    low, high = [1.0, 1.0], [4.0, 4.0]
    if side < 2:
        low[side] = -beyond
    else:
        high[side - 2] = 5.0 + beyond
    corners = np.array([low, [high[0], low[1]], high, [low[0], high[1]]])
    assert _name_kind(corners, [], GRID, THICKNESS) == kind


@pytest.mark.parametrize(("gap", "kind"), [(0.46, "dependent"), (0.51, "independent")])
def test_rooms_with_a_wall_and_a_little_between_them_depend_on_each_other(gap, kind):
    # A wall of 0.2 m and 0.3 m; they face each other over 2 m.
    one, other = rectangle(20, 20, 40, 60), rectangle(0, 0, 20, 40) + np.array([2.0 + gap, 1.0])
    assert _name_kind(one, [other], GRID, THICKNESS) == kind
    assert _name_kind(one, [rectangle(80, 80, 90, 90), other], GRID, THICKNESS) == kind
    assert _name_kind(one, [], GRID, THICKNESS) == "independent"


# Free up to row 104 in a recess of the wall between columns 95 and 105, and its opening up to the leaf.
RECESS = turned([(40, 60, 160, 100), (95, 100, 105, 104)], [(40, 100, 160, 102)])
OPENING = Doorway(FACING, -0.25, 0.25, 0.1, -0.1)


@pytest.mark.parametrize(
    ("corners", "thickness"),
    [
        (rectangle(100, 102, 140, 150), 2),  # over its right half
        (rectangle(60, 102, 100, 150), 2),  # over its left half
        (rectangle(80, 108, 120, 150), 5),  # from beyond its leaf on
    ],
)
def test_an_opening_that_reaches_beyond_a_rectangle_takes_nothing_of_it(corners, thickness):
    assert left(corners, RECESS, thickness=thickness).area < shapely.Polygon(corners).area - 0.05
    assert left(corners, RECESS, thickness=thickness, doorways=[OPENING]).equals(shapely.Polygon(corners))


@pytest.mark.parametrize("place", [(0.0, 6.0), (8.0, 0.0), (-8.0, 0.0), (0.0, -6.0), (8.0, 6.0), (-8.0, -6.0)])
def test_an_opening_elsewhere_changes_nothing(place):
    corners = rectangle(80, 90, 120, 150)
    away = FacingDoor(door(100.0 + 20 * place[0], 102.0 + 20 * place[1]), np.array([0.0, 1.0]))
    other = Doorway(away, -0.25, 0.25, 0.1, -0.1)
    assert left(corners, RECESS, doorways=[other]).equals(left(corners, RECESS))
    assert left(corners, RECESS, doorways=[other, OPENING]).equals(left(corners, RECESS, doorways=[OPENING]))
    assert not left(corners, RECESS, doorways=[OPENING]).equals(left(corners, RECESS))


@pytest.mark.parametrize("angle", [0.0, 0.5])
def test_what_is_left_of_a_rectangle_lies_where_it_was_in_the_map(angle):
    map_ = TurnedMap(angle, np.array([3.0, -2.0]), CELL, HALF.free, HALF.known)
    cells = np.array([[80, 90], [120, 90], [120, 150], [80, 150]], dtype=np.float64)
    facing = FacingDoor(ClosedDoor("d", tuple(map_.to_map(np.array([100.0, 102.0])))), np.array([0.0, 1.0]))
    shape = subtract_known(map_, map_.to_map(cells), 2, facing, [], narrow=7)
    expected = shapely.Polygon(map_.to_map(np.array([[80, 102], [120, 102], [120, 150], [80, 150]], dtype=np.float64)))
    assert shape.hausdorff_distance(expected) < 0.4 * CELL


def test_a_hundredth_that_known_space_takes_leaves_the_rectangle_whole():
    corners = rectangle(100, 110, 150, 160)  # 2500 cells
    for cells, whole in ((24, True), (25, False)):
        # A row of free cells right before it takes a row of cells, with walls of one.
        map_ = turned([(100 + 1, 109, 100 + cells - 1, 110)])
        shape = left(corners, map_, thickness=1)
        assert shape.equals(shapely.Polygon(corners)) == whole


def test_of_two_pieces_the_nearer_one_stays_unless_the_other_is_much_larger():
    # Free space of two metres width between a piece on the door's side and one beyond.
    for far, kept in ((100, "near"), (250, "far")):
        map_ = turned([(60, 120, 140, 160)])
        corners = rectangle(80, 102, 120, 162 + far)
        shape = left(corners, map_)
        near = shape.bounds[1] < 110 * CELL
        assert near == (kept == "near")
