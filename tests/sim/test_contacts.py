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
from closedrooms.sim.contacts import SKIN, Obstacles, edges_of, move_disc
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


@given(
    edges=st.lists(st.tuples(*[st.floats(-9.0, 9.0)] * 4), max_size=12),
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
