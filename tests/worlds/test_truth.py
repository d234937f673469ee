import math
from dataclasses import replace

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from closedrooms.core.grid import GridFrame
from closedrooms.core.pose import Pose2
from closedrooms.worlds.closing import closable_rooms
from closedrooms.worlds.geometry import door_gap, room_interior, wall_area
from closedrooms.worlds.library import load_world
from closedrooms.worlds.plan import FloorPlan, PlanDoor, PlanRoom
from closedrooms.worlds.start_pose import start_pose
from closedrooms.worlds.truth import rasterise, reachable, true_rooms, truth_bounds


def frame_around(plan: FloorPlan, map_T_world: Pose2, resolution: float = 0.05) -> GridFrame:
    x0, y0, x1, y1 = truth_bounds(plan, map_T_world)
    rows, cols = math.ceil((y1 - y0) / resolution) + 8, math.ceil((x1 - x0) / resolution) + 8
    return GridFrame(resolution, x0 - 4 * resolution, y0 - 4 * resolution, rows, cols)


@settings(max_examples=8, deadline=None)
@given(
    st.sampled_from(["office-08", "office-10", "school-03", "school-04"]),
    st.floats(-20, 20),
    st.floats(-20, 20),
    st.floats(-math.pi, math.pi),
)
def test_a_cell_is_occupied_exactly_when_its_centre_lies_in_a_wall(name: str, x: float, y: float, theta: float) -> None:
    plan = load_world(name)
    map_T_world = Pose2(x, y, theta)
    frame = frame_around(plan, map_T_world, 0.4)
    cells = np.stack(np.meshgrid(np.arange(frame.rows), np.arange(frame.cols), indexing="ij"), axis=-1)
    centres = shapely.points(map_T_world.inverse().transform(frame.to_points(cells)))
    walls, rooms = wall_area(plan), shapely.union_all([room.polygon for room in plan.rooms])
    shapely.prepare([walls, rooms])
    clear = ~shapely.dwithin(centres, walls.boundary, 1e-9) & ~shapely.dwithin(centres, rooms.boundary, 1e-9)
    truth = rasterise(plan, frame, map_T_world)
    in_wall = shapely.contains(walls, centres)
    assert (truth.occupied == in_wall)[clear].all()
    assert (truth.free == (shapely.contains(rooms, centres) & ~in_wall))[clear].all()


def test_truth_holds_no_furniture_and_no_leaves(small: FloorPlan) -> None:
    frame = frame_around(small, Pose2())
    truth = rasterise(small, frame, Pose2())
    for door in small.doors:
        row, col = frame.to_cells(np.array(door.midpoint))
        assert truth.free[row, col]
    assert truth.unknown[0, 0]


def test_true_rooms_are_interiors_in_the_map_frame_with_their_doors(small: FloorPlan) -> None:
    map_T_world = Pose2(3.0, 1.0, 0.4).inverse()
    (room,) = true_rooms(small, ["d0"], map_T_world)
    assert room.doors == ("d0",)
    back = shapely.transform(room.polygon, map_T_world.inverse().transform)
    assert back.symmetric_difference(room_interior(small, "r1")).area < 1e-9


def test_a_room_behind_two_closed_doors_names_both(small: FloorPlan) -> None:
    (room,) = true_rooms(small, ["d1", "d2"], Pose2())
    assert room.doors == ("d1", "d2")


def test_a_closed_door_that_hides_nothing_gives_no_room(small: FloorPlan) -> None:
    assert true_rooms(small, ["d1"], Pose2()) == []


@pytest.mark.parametrize("theta", [0.0, 0.3, math.pi / 4, 1.2])
@pytest.mark.parametrize("resolution", [0.025, 0.05, 0.1])
def test_nothing_leaks_past_closed_doors(small: FloorPlan, theta: float, resolution: float) -> None:
    map_T_world = Pose2(0.37, -0.21, theta)
    frame = frame_around(small, map_T_world, resolution)
    got = reachable(small, ["d0"], frame, map_T_world, (3.0, 1.0))
    for point, inside in [((3.0, 1.0), True), ((2.0, 3.5), False), ((6.0, 3.5), True), ((10.0, 3.5), True)]:
        row, col = frame.to_cells(map_T_world.transform(np.array(point)))
        assert got[row, col] == inside, point


@pytest.mark.parametrize("name", ["office-07", "office-10", "school-04"])
def test_closing_every_closable_room_hides_exactly_their_cells(name: str) -> None:
    plan = load_world(name)
    closable = closable_rooms(plan)
    closed = [door for doors in closable.values() for door in doors]
    start = start_pose(plan)
    map_T_world = start.inverse()
    frame = frame_around(plan, map_T_world)
    truth = rasterise(plan, frame, map_T_world)
    open_cells = reachable(plan, [], frame, map_T_world, (start.x, start.y))
    left = reachable(plan, closed, frame, map_T_world, (start.x, start.y))
    assert (open_cells == truth.free).mean() > 0.999
    rooms = true_rooms(plan, closed, map_T_world)
    assert len(rooms) == len(closable)
    hidden_area = (open_cells & ~left).sum() * frame.resolution**2
    assert hidden_area == pytest.approx(sum(room.polygon.area for room in rooms), rel=0.02)


def test_a_start_in_a_wall_reaches_nothing(small: FloorPlan) -> None:
    frame = frame_around(small, Pose2())
    assert not reachable(small, [], frame, Pose2(), (0.0, 0.0)).any()


def cells_of(frame: GridFrame, mask: np.ndarray, map_T_world: Pose2) -> np.ndarray:
    """Middles of marked cells in the building frame, shape (n, 2)."""
    return map_T_world.inverse().transform(frame.to_points(np.argwhere(mask)))


def test_rooms_drawn_apart_by_their_wall_are_joined_by_their_doorways_alone(small: FloorPlan) -> None:
    inside = tuple(replace(room, polygon=room.polygon.buffer(-0.1, join_style="mitre")) for room in small.rooms)
    out = PlanDoor("e0", ((5.0, 0.0), (6.0, 0.0)), ("r0", None), opens_into="r0")
    plan = replace(small, rooms=inside, doors=(*small.doors, out))
    map_T_world = Pose2(0.3, -0.2, 0.5)
    frame = frame_around(plan, map_T_world)
    truth = rasterise(plan, frame, map_T_world)
    centres = cells_of(frame, np.ones(frame.shape, dtype=bool), map_T_world)
    inner = [p for p in plan.passages if None not in p.rooms]
    doorways = shapely.union_all([door_gap(plan, passage) for passage in inner])
    rooms, walls = shapely.union_all([room.polygon for room in inside]), wall_area(plan)
    # Doorways are cut a centimetre deeper than their walls.
    sure = ~shapely.dwithin(shapely.unary_union([doorways.boundary, rooms.boundary, walls.boundary]),
                            shapely.points(centres), 0.011)  # fmt: skip
    free = shapely.contains_xy(rooms | doorways, *centres.T) & ~shapely.contains_xy(walls, *centres.T)
    assert (truth.free.ravel() == free)[sure].all()
    # The way out is neither wall nor room.
    row, col = frame.to_cells(map_T_world.transform(np.array([5.5, 0.0])))
    assert truth.unknown[row, col]


def test_true_rooms_that_are_joined_by_open_passages_are_one_with_the_passage(small: FloorPlan) -> None:
    # Only d0 and d1 lead to r1, r2 and r3, of which d2 joins two.
    plan = replace(small, openings=())
    (left, right) = true_rooms(plan, ["d1", "d0"], Pose2())
    assert (left.doors, right.doors) == (("d0",), ("d1",))
    assert left.polygon.symmetric_difference(room_interior(plan, "r1")).area < 1e-9
    joined = room_interior(plan, "r2") | room_interior(plan, "r3") | door_gap(plan, plan.doors[2])
    assert right.polygon.symmetric_difference(joined).area < 0.9 * 0.02 + 1e-6
    # Closed as well, they are two rooms, and d2 is a door of both.
    rooms = true_rooms(plan, ["d0", "d1", "d2"], Pose2())
    assert [room.doors for room in rooms] == [("d0",), ("d1", "d2"), ("d2",)]


@pytest.mark.parametrize("theta", [0.0, 0.7, -2.0])
def test_bounds_hold_walls_and_rooms_tightly(small: FloorPlan, theta: float) -> None:
    map_T_world = Pose2(5.0, -3.0, theta)
    porch = replace(small, rooms=(*small.rooms, PlanRoom("r9", "porch", shapely.box(12, 6, 14, 8))))
    for plan in (small, porch, replace(small, walls=small.walls[4:])):
        area = shapely.union_all([wall_area(plan), *(room.polygon for room in plan.rooms)])
        expected = shapely.transform(area, map_T_world.transform).bounds
        assert truth_bounds(plan, map_T_world) == pytest.approx(expected, abs=1e-5)


@pytest.mark.parametrize("resolution", [0.02, 0.1, 0.25])
def test_a_shut_door_takes_no_more_than_its_leaf_or_a_cell(small: FloorPlan, resolution: float) -> None:
    frame, start = frame_around(small, Pose2(), resolution), (3.0, 1.0)
    free = rasterise(small, frame, Pose2()).free
    shut = reachable(small, ["d1"], frame, Pose2(), start)
    assert np.array_equal(reachable(small, [], frame, Pose2(), start), free)
    # r2 is still reached through r3; what is lost lies in the band of the leaf.
    lost = cells_of(frame, free & ~shut, Pose2())
    half = max(0.025, 0.51 * resolution)
    assert len(lost)
    assert (np.abs(lost[:, 1] - 2.0) <= half + 1e-9).all()
    assert ((lost[:, 0] > 5.5 - 1e-6) & (lost[:, 0] < 6.4 + 1e-6)).all()
    for row in np.unique(np.round(lost[:, 1], 6)):
        assert np.sum(np.isclose(lost[:, 1], row)) == pytest.approx(0.9 / resolution, abs=1.0)


def test_a_start_outside_the_frame_reaches_nothing(small: FloorPlan) -> None:
    frame = frame_around(small, Pose2())
    for start in ((50.0, 1.0), (-50.0, 1.0), (3.0, 50.0), (3.0, -50.0)):
        assert not reachable(small, [], frame, Pose2(), start).any()


def test_cells_that_touch_at_corners_alone_are_not_connected() -> None:
    # Two rooms that meet at a point.
    rooms = (PlanRoom("a", "room", shapely.box(0, 0, 2, 2)), PlanRoom("b", "room", shapely.box(2, 2, 4, 4)))
    plan = FloorPlan("x", rooms, (), ())
    frame = GridFrame(0.5, 0.0, 0.0, 8, 8)
    got = reachable(plan, [], frame, Pose2(), (0.25, 0.25))
    assert np.argwhere(got).max() == 3
    assert got.sum() == 16
