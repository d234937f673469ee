import math

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from closedrooms.core.grid import GridFrame
from closedrooms.core.pose import Pose2
from closedrooms.worlds.closing import closable_rooms
from closedrooms.worlds.geometry import room_interior, wall_area
from closedrooms.worlds.library import load_world
from closedrooms.worlds.plan import FloorPlan
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
