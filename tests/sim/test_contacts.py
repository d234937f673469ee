"""The robot's disc against exact geometry."""

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely.geometry import Point, Polygon, box

from closedrooms.core.pose import Pose2
from closedrooms.core.robot import RobotConfig
from closedrooms.sim import contacts
from closedrooms.sim.config import SimConfig, noise_level
from closedrooms.sim.contacts import (
    CELL,
    SKIN,
    Obstacles,
    SolidEdge,
    distance,
    edges_of,
    leaf_edges,
    move_disc,
    offset,
)
from closedrooms.sim.robot.differential_drive import Drive
from closedrooms.sim.robot.driven_robot import Motion
from closedrooms.sim.simulation import Simulation
from closedrooms.worlds.library import bundled_names, load_world
from closedrooms.worlds.plan import FloorPlan

Solids = Callable[[Simulation], shapely.Geometry]

RADIUS = 0.2
speeds = st.floats(-1e6, 1e6) | st.sampled_from([math.inf, -math.inf, 1.0])


def drive_in(area: shapely.Geometry, x: float, y: float, theta: float, config: RobotConfig | None = None) -> Drive:
    config = config or RobotConfig(radius=RADIUS)
    return Drive(config, Obstacles(edges_of(area), Drive.reach(config)), x, y, theta)


def ignore(_: Motion) -> None:
    pass


def test_stops_two_millimetres_or_less_from_a_wall_it_meets_head_on() -> None:
    drive = drive_in(box(3, -5, 3.2, 5), 0.0, 0.0, 0.0)
    for _ in range(80):
        drive.advance(1.0, 0.0, 0.1, ignore)
    assert drive.collided
    assert 0.0 <= 3.0 - RADIUS - drive.x <= 2e-3
    assert abs(drive.y) < 1e-12
    assert drive.v == 0.0


def test_slides_along_a_wall_it_meets_at_an_angle() -> None:
    drive = drive_in(box(3, -50, 3.2, 50), 2.0, 0.0, math.radians(60))
    for _ in range(100):
        drive.advance(1.0, 0.0, 0.1, ignore)
    assert 0.0 <= 3.0 - RADIUS - drive.x <= 2e-3
    assert drive.y > 3.0


def test_passes_a_gap_two_millimetres_wider_than_itself_and_not_a_narrower_one() -> None:
    for extra, passes in ((0.002, True), (-0.002, False)):
        half = RADIUS + extra / 2
        walls = shapely.union_all([box(1, half, 1.2, 3), box(1, -3, 1.2, -half)])
        drive = drive_in(walls, 0.0, 0.0, 0.0)
        for _ in range(40):
            drive.advance(1.0, 0.0, 0.1, ignore)
        assert (drive.x > 2.0) is passes
        assert drive.collided is not passes


@given(
    st.lists(st.tuples(st.floats(-3, 3), st.floats(-3, 3)), min_size=3, max_size=7, unique=True),
    st.floats(-math.pi, math.pi),
    st.floats(0.001, 0.3),
)
def test_a_moved_disc_is_never_inside_and_touches_within_two_millimetres(
    corners: list[tuple[float, float]], direction: float, length: float
) -> None:
    hull = shapely.convex_hull(shapely.multipoints(corners))
    if not isinstance(hull, Polygon) or hull.area < 1e-3 or hull.distance(Point(0, 0)) < RADIUS + SKIN:
        return
    dx, dy = length * math.cos(direction), length * math.sin(direction)
    moved = move_disc(0.0, 0.0, dx, dy, RADIUS, [tuple(e) for e in edges_of(hull).tolist()])
    gap = hull.distance(Point(moved.x, moved.y)) - RADIUS
    assert gap >= 0.0
    swept = hull.distance(shapely.LineString([(0, 0), (dx, dy)])) - RADIUS
    if swept > SKIN + 1e-6:
        assert not moved.touched
        assert math.hypot(moved.x - dx, moved.y - dy) < 1e-9
    elif swept < -2e-3:
        assert moved.touched


@settings(deadline=None, max_examples=40)
@given(
    st.lists(st.tuples(speeds, speeds, st.floats(0.01, 3.0)), min_size=1, max_size=6),
    st.floats(-math.pi, math.pi),
    st.sampled_from([RobotConfig(), RobotConfig(max_speed=80.0, max_acceleration=1e4, max_turn_rate=50.0)]),
)
def test_never_leaves_a_closed_room_at_any_command(
    commands: list[tuple[float, float, float]], heading: float, config: RobotConfig
) -> None:
    room = box(-2, -1.5, 2, 1.5).difference(box(0.9, -0.4, 1.6, 0.3))
    shell = box(-2.05, -1.55, 2.05, 1.55).difference(room)
    drive = drive_in(shell, 0.0, 0.0, heading, config)
    for v, w, duration in commands:
        drive.advance(v, w, duration, ignore)
        assert room.contains(Point(drive.x, drive.y))
        assert shell.distance(Point(drive.x, drive.y)) >= config.radius - 1e-9


def assert_contacts_exact(sim: Simulation, solids: shapely.Geometry, steps: int) -> int:
    """Drive at random; the disc never enters ``solids``, and says that it touches only where it does."""
    rng = np.random.default_rng(5)
    radius = sim.config.robot.radius
    touched = 0
    v = w = 0.0
    shapely.prepare(solids)
    for _ in range(steps):
        if rng.random() < 0.02:
            v, w = rng.choice([1.0, 1.0, -0.5]), rng.uniform(-1.5, 1.5)
        sim.step(v, w, 0.02)
        gap = solids.distance(Point(sim.world_T_robot.x, sim.world_T_robot.y)) - radius
        assert gap >= 0.0
        if sim.collided:
            touched += 1
            assert gap <= 2e-3
    return touched


@pytest.mark.simulation
def test_contacts_agree_with_exact_geometry_on_a_bundled_plan(exact_config: SimConfig, solids_now: Solids) -> None:
    with Simulation(load_world(bundled_names()[0]), [], exact_config, 0) as sim:
        assert assert_contacts_exact(sim, solids_now(sim), 1500) > 20


@pytest.mark.simulation
def test_contacts_agree_with_exact_geometry_on_an_imported_plan(
    shared_plans: Path, exact_config: SimConfig, solids_now: Solids
) -> None:
    world = load_world(str(shared_plans / "luperto/school/Sabadell1_updated.xml"))
    with Simulation(world, [], exact_config, 0) as sim:
        assert assert_contacts_exact(sim, solids_now(sim), 1500) > 20


@pytest.mark.simulation
def test_rays_and_contacts_mean_the_same_wall(plan: FloorPlan, exact_config: SimConfig) -> None:
    with Simulation(plan, ["hinged", "double", "sliding"], exact_config, 0) as sim:
        for _ in range(200):
            sim.step(0.6, 0.0, 0.1)
        ranges = sim.observe().scan.ranges
    assert sim.collided
    assert abs(np.nanmin(ranges) - sim.config.robot.radius) < 2e-3


@pytest.mark.simulation
def test_a_closed_door_stops_the_robot_and_an_open_one_lets_it_through(plan: FloorPlan) -> None:
    config = SimConfig(noise=noise_level("none"), heading=math.pi / 2)
    for closed, passes in (([], True), (["hinged"], False)):
        with Simulation(plan, closed, config, 0) as sim:
            for _ in range(50):
                sim.step(0.8, 0.0, 0.1)
            assert (sim.world_T_robot.y > 5.0) is passes
            if not passes:
                # The leaf is 5 cm thick, on the wall's centre line.
                assert abs(4.0 - 0.025 - 0.2 - sim.world_T_robot.y) < 2e-3


@pytest.mark.simulation
def test_the_entrance_of_the_building_is_shut(plan: FloorPlan) -> None:
    config = SimConfig(noise=noise_level("none"), heading=0.0)
    with Simulation(plan, [], config, 0) as sim:
        assert "entrance" not in sim.door_states()
        for _ in range(200):
            sim.step(1.0, 0.0, 0.1)
        assert abs(sim.world_T_robot.x - (12 - 0.08 - 0.2)) < 2e-3
        assert sim.true_ranges(Pose2(10.0, 1.75, 0.0)).max() < 13.0


coordinates = st.integers(-6000, 6000).map(lambda number: number / 1000)
edges = st.tuples(coordinates, coordinates, coordinates, coordinates)


@given(st.lists(edges, max_size=6), st.lists(edges, max_size=3), coordinates, coordinates, st.floats(0.05, 2.0))
def test_every_edge_within_reach_is_looked_up_and_none_far_beyond(
    fixed: list[SolidEdge], leaves: list[SolidEdge], x: float, y: float, reach: float
) -> None:
    obstacles = Obstacles(np.array(fixed).reshape(-1, 4), reach)
    for number, (ax, ay, bx, by) in enumerate(leaves):
        obstacles.add_leaf(("leaf", number), (min(ax, bx), min(ay, by), max(ax, bx), max(ay, by)))
        obstacles.move_leaf(("leaf", number), [(ax, ay, bx, by)])
    found = obstacles.near(x, y)
    near = [edge for edge in (*fixed, *leaves) if exact_distance(x, y, edge) <= reach]
    assert all(edge in found for edge in near)
    # Fixed edges are sorted in by their distance, up to a cell's diagonal.
    far = [edge for edge in fixed if exact_distance(x, y, edge) > reach + math.sqrt(2.0) * CELL + 1e-6]
    assert not any(edge in found for edge in far if edge not in leaves)
    assert len(found) <= len(fixed) + len(leaves)


def exact_distance(x: float, y: float, edge: SolidEdge) -> float:
    return float(shapely.LineString([edge[:2], edge[2:]]).distance(Point(x, y)))


def test_a_leaf_is_where_it_was_last_put_and_looked_up_within_its_box_alone() -> None:
    obstacles = Obstacles(np.zeros((0, 4)), 0.3)
    obstacles.add_leaf(("door", 1), (0.0, 0.0, 1.0, 1.0))
    for y in (0.0, 1.0):
        obstacles.move_leaf(("door", 1), [(0.0, y, 1.0, y)])
        assert list(obstacles.near(0.5, 0.5)) == [(0.0, y, 1.0, y)]
    for x, y in ((2.1, 0.5), (-1.1, 0.5), (0.5, 2.1), (0.5, -1.1)):
        assert list(obstacles.near(x, y)) == []
    for x, y in ((1.29, 1.29), (-0.29, -0.29), (1.29, -0.29)):
        assert len(obstacles.near(x, y)) == 1


@given(coordinates, coordinates, edges | coordinates.map(lambda v: (v, 1.0, v, 1.0)))
def test_the_offset_leads_from_the_nearest_point_of_an_edge(x: float, y: float, edge: SolidEdge) -> None:
    dx, dy = offset(x, y, edge)
    line = shapely.LineString([edge[:2], edge[2:]])
    assert math.hypot(dx, dy) == pytest.approx(line.distance(Point(x, y)), abs=1e-6)
    assert line.distance(Point(x - dx, y - dy)) < 1e-6
    other = (9.0, 9.0, 8.0, 7.0)
    nearest = min(exact_distance(x, y, edge), exact_distance(x, y, other))
    assert distance(x, y, [edge, other]) == distance(x, y, [other, edge]) == pytest.approx(nearest, abs=1e-6)
    assert distance(x, y, []) == math.inf


def test_the_edges_of_an_area_are_those_of_all_its_rings() -> None:
    ring = box(0, 0, 4, 3) - box(1, 1, 2, 2)
    area = shapely.MultiPolygon([ring, box(6, 0, 7, 1)])
    found = edges_of(area)
    assert found.shape == (12, 4)
    assert np.hypot(*(found[:, 2:] - found[:, :2]).T).sum() == pytest.approx(area.boundary.length)
    assert shapely.union_all(shapely.linestrings(found.reshape(-1, 2, 2))).equals(area.boundary)
    assert edges_of(shapely.MultiPolygon()).shape == (0, 4)


def test_a_leaf_has_an_edge_from_each_corner_to_the_next() -> None:
    corners = np.array([(0.0, 0.0), (2.0, 0.0), (2.0, 1.0), (0.0, 1.0)])
    assert leaf_edges(corners) == [(0, 0, 2, 0), (2, 0, 2, 1), (2, 1, 0, 1), (0, 1, 0, 0)]


WALL = [(1.0, -9.0, 1.0, 9.0)]


@given(st.floats(-1.2, 1.2), st.floats(0.1, 3.0))
def test_what_a_wall_takes_of_a_motion_is_what_leads_into_it(direction: float, length: float) -> None:
    dx, dy = length * math.cos(direction), length * math.sin(direction)
    moved = move_disc(0.0, 0.0, dx, dy, RADIUS, WALL)
    stop = 1.0 - RADIUS - SKIN
    assert moved.x == pytest.approx(min(dx, stop), abs=1e-6)
    assert moved.y == pytest.approx(dy, abs=1e-6)
    if abs(dx - stop) > 1e-6:
        assert moved.touched == (dx > stop)


@pytest.mark.parametrize(("dx", "dy"), [(3.0, 1.0), (1.0, 3.0), (3.0, 3.0), (2.0, 5.0)])
def test_in_a_corner_the_disc_comes_to_rest_whichever_wall_it_meets_first(dx: float, dy: float) -> None:
    corner = [*WALL, (-9.0, 1.5, 9.0, 1.5)]
    moved = move_disc(0.0, 0.0, dx, dy, RADIUS, corner)
    assert moved.x == pytest.approx(min(dx, 1.0 - RADIUS - SKIN), abs=1e-6)
    assert moved.y == pytest.approx(min(dy, 1.5 - RADIUS - SKIN), abs=1e-6)
    assert moved.touched
    # Out of it the way is free.
    away = move_disc(moved.x, moved.y, -0.5, -0.25, RADIUS, corner)
    assert (away.x, away.y, away.touched) == (pytest.approx(moved.x - 0.5), pytest.approx(moved.y - 0.25), False)


def test_in_a_wedge_the_disc_stops_where_both_sides_touch() -> None:
    # Two walls that meet at (2, 0) at half a right angle each to the way.
    wedge = [(0.0, 2.0, 2.0, 0.0), (2.0, 0.0, 0.0, -2.0)]
    moved = move_disc(0.0, 0.0, 3.0, 0.3, RADIUS, wedge)
    reach = (RADIUS + SKIN) * math.sqrt(2.0)
    assert (moved.x, moved.y) == (pytest.approx(2.0 - reach, abs=1e-4), pytest.approx(0.0, abs=1e-4))


def test_round_the_end_of_a_wall_the_disc_rolls() -> None:
    # Its lower end is 0.1 m above the way: the disc passes below it, at its own distance.
    end = [(1.0, 0.1, 1.0, 5.0)]
    moved = move_disc(0.0, 0.0, 1.5, 0.0, RADIUS, end)
    assert moved.touched
    assert moved.y < 0.0
    assert exact_distance(moved.x, moved.y, end[0]) >= RADIUS


@given(
    edges=st.lists(st.tuples(*[coordinates] * 4), max_size=12),
    reach=st.floats(0.1, 1.0),
    most=st.sampled_from([1, 200, 1_000_000]),
)
@settings(max_examples=50, deadline=None)
def test_every_edge_within_reach_of_a_place_is_found_in_order(
    edges: list[tuple[float, float, float, float]], reach: float, most: int
) -> None:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(contacts, "MOST_CELLS", most)
        obstacles = Obstacles(np.array(edges).reshape(-1, 4), reach)
    for x, y in np.random.default_rng(0).uniform(-10.0, 10.0, (40, 2)).tolist():
        found = list(obstacles.near(x, y))
        assert found == [edge for edge in edges if edge in found]
        lines = [shapely.LineString([edge[:2], edge[2:]]) for edge in edges]
        within = [edge for edge, line in zip(edges, lines, strict=True) if line.distance(Point(x, y)) <= reach]
        assert {*within} <= {*found}
        # The middle of the cell that a place lies in is at most 0.36 m from it.
        far = [edge for edge, line in zip(edges, lines, strict=True) if line.distance(Point(x, y)) > reach + 0.71]
        assert not {*far} & {*found}
