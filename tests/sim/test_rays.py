"""The lidar against exact geometry."""

import dataclasses
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely

from closedrooms.core.grid import GridFrame
from closedrooms.core.pose import Pose2
from closedrooms.sim.config import Body, LidarConfig, SimConfig, noise_level
from closedrooms.sim.lidar import Lidar
from closedrooms.sim.physics_world import PhysicsWorld
from closedrooms.sim.simulation import Simulation
from closedrooms.worlds.closing import draw_closed
from closedrooms.worlds.library import bundled_names, load_world
from closedrooms.worlds.plan import FloorPlan
from closedrooms.worlds.truth import rasterise, truth_bounds

Solids = Callable[[Simulation], shapely.Geometry]


def exact_ranges(solids: shapely.Geometry, pose: Pose2, config: LidarConfig) -> np.ndarray:
    """Distance along each beam to the boundary of ``solids`` by shapely, infinity without one."""
    angles = pose.theta + config.angle_min + config.angle_increment * np.arange(config.beams)
    start = np.array([pose.x, pose.y])
    ends = start + config.range_max * np.column_stack((np.cos(angles), np.sin(angles)))
    rays = shapely.linestrings(np.stack((np.broadcast_to(start, ends.shape), ends), axis=1))
    edges = shapely.intersection(rays, solids.boundary)
    distances = shapely.distance(edges, shapely.Point(start))
    return np.where(np.isnan(distances), math.inf, distances)


def free_poses(solids: shapely.Geometry, count: int, rng: np.random.Generator) -> list[Pose2]:
    x0, y0, x1, y1 = solids.bounds
    inside = shapely.Polygon(shapely.get_exterior_ring(shapely.convex_hull(solids)))
    poses: list[Pose2] = []
    while len(poses) < count:
        x, y, theta = rng.uniform((x0, y0, -math.pi), (x1, y1, math.pi))
        point = shapely.Point(x, y)
        if solids.distance(point) > 0.2 and inside.contains(point):
            poses.append(Pose2(x, y, theta))
    return poses


def assert_rays_exact(sim: Simulation, solids: shapely.Geometry, poses: int) -> None:
    wrong = total = 0
    for pose in free_poses(solids, poses, np.random.default_rng(1)):
        exact, cast = exact_ranges(solids, pose, sim.config.lidar), sim.true_ranges(pose)
        # Two neighbouring beams at a corner's edge may disagree on which side of it they pass by rounding.
        with np.errstate(invalid="ignore"):
            wrong += int(np.sum(~((np.abs(exact - cast) < 1e-3) | (np.isinf(exact) & np.isinf(cast)))))
        total += exact.size
    assert wrong <= 1e-4 * total


@pytest.mark.simulation
def test_rays_agree_with_exact_geometry_on_a_plan_made_by_hand(
    plan: FloorPlan, exact_config: SimConfig, solids_now: Solids
) -> None:
    with Simulation(plan, ["double"], exact_config, 0) as sim:
        assert_rays_exact(sim, solids_now(sim), 25)


@pytest.mark.simulation
def test_rays_agree_with_exact_geometry_on_a_bundled_plan(exact_config: SimConfig, solids_now: Solids) -> None:
    world = load_world(bundled_names()[0])
    with Simulation(world, draw_closed(world, 3, np.random.default_rng(0)), exact_config, 0) as sim:
        assert_rays_exact(sim, solids_now(sim), 10)


@pytest.mark.parametrize("name", ["luperto/school/Sabadell1_updated.xml", "luperto/office/AtlanticSuites.xml"])
@pytest.mark.simulation
def test_rays_agree_with_exact_geometry_on_an_imported_plan(
    name: str, shared_plans: Path, exact_config: SimConfig, solids_now: Solids
) -> None:
    world = load_world(str(shared_plans / name))
    with Simulation(world, draw_closed(world, 3, np.random.default_rng(0)), exact_config, 0) as sim:
        assert_rays_exact(sim, solids_now(sim), 10)


@pytest.mark.simulation
def test_rays_cast_short_first_are_the_rays_cast_whole(plan: FloorPlan, exact_config: SimConfig) -> None:
    rng = np.random.default_rng(3)
    with Simulation(plan, ["hinged"], exact_config, 0) as sim:
        warm = Lidar(exact_config.lidar, exact_config.noise, sim.physics, 0)
        for _ in range(20):
            pose = Pose2(rng.uniform(0.3, 11.7), rng.uniform(0.3, 3.7), rng.uniform(-math.pi, math.pi))
            short, whole = warm.track(pose), warm.cast(pose)
            np.testing.assert_allclose(short[0], whole[0], rtol=0, atol=1e-9)
            # Where an open leaf lies flush with the wall, either may be named.
            assert np.mean(short[1] != whole[1]) < 0.005


@pytest.mark.simulation
def test_more_rays_than_pybullet_takes_at_once_are_cast_in_chunks(plan: FloorPlan, solids_now: Solids) -> None:
    config = SimConfig(lidar=LidarConfig(beams=2 * 16_384 + 1), noise=noise_level("none"))
    pose = Pose2(6.0, 2.0, 0.1)
    with Simulation(plan, [], config, 0) as sim:
        ranges = sim.true_ranges(pose)
        assert ranges.shape == (config.lidar.beams,)
        few = SimConfig(lidar=LidarConfig(beams=2 * 16_384 + 1), noise=noise_level("none")).lidar
        exact = exact_ranges(solids_now(sim), pose, few)
    assert np.mean(np.abs(ranges - exact) < 1e-3) > 0.9999


@pytest.mark.simulation
def test_nothing_within_range_is_infinity(plan: FloorPlan) -> None:
    config = SimConfig(lidar=LidarConfig(range_max=1.0), noise=noise_level("none"))
    with Simulation(plan, [], config, 0) as sim:
        scan = sim.observe().scan
    assert np.isposinf(scan.ranges).all()


@pytest.mark.simulation
def test_a_sensor_off_the_centre_measures_from_where_it_sits(plan: FloorPlan) -> None:
    lidar = LidarConfig(beams=4, mount=(0.15, 0.0, math.pi / 2))
    with Simulation(plan, [], SimConfig(lidar=lidar, noise=noise_level("none"), heading=0.0), 0) as sim:
        scan = sim.observe().scan
    assert scan.robot_T_sensor == (0.15, 0.0, math.pi / 2)
    # Beams at -180, -90, 0 and 90 deg of a sensor that looks to the left, at (2.15, 2), walls at 0.08 from the lines.
    np.testing.assert_allclose(scan.ranges[[0, 3]], [2.0 - 0.08, 2.15 - 0.08], atol=1e-6)


@pytest.mark.simulation
def test_a_physics_world_without_bodies_returns_misses() -> None:
    with PhysicsWorld() as physics:
        fractions, bodies = physics.cast(np.array([0.0, 0.0, 0.3]), np.array([[5.0, 0.0, 0.3], [0.0, 5.0, 0.3]]))
    assert (fractions == 1.0).all()
    assert (bodies == -1).all()


@pytest.mark.simulation
def test_rays_and_the_rasterised_truth_mean_the_same_walls(exact_config: SimConfig) -> None:
    world = dataclasses.replace(load_world(bundled_names()[0]), furniture=())
    cell = 0.02
    frame = GridFrame(cell, 0.0, 0.0, 1, 1).covering(*truth_bounds(world, Pose2()))
    truth = rasterise(world, frame, Pose2())
    with Simulation(world, [], exact_config, 0) as sim:
        leaves = shapely.union_all([leaf for name in sim.door_states() for leaf in sim.door_leaves(name)])
        pose = sim.world_T_robot
        ranges = sim.true_ranges(pose)
    angles = pose.theta + exact_config.lidar.angle_min + exact_config.lidar.angle_increment * np.arange(ranges.size)
    rays = np.column_stack((np.cos(angles), np.sin(angles)))
    for beyond, occupied in ((1.5 * cell, True), (-1.5 * cell, False)):
        points = np.array([pose.x, pose.y]) + (ranges + beyond)[:, None] * rays
        on_walls = ~shapely.dwithin(leaves, shapely.points(points), 0.1)
        cells = frame.to_cells(points[on_walls])
        assert len(cells) > 300
        # A grazing ray may end a cell beside the wall: one cell of slack, few of them.
        assert np.mean(truth.occupied[cells[:, 0], cells[:, 1]] == occupied) > 0.95


@pytest.mark.parametrize("turns", ["left", "right"])
@pytest.mark.parametrize("body", ["wheels", "kinematic"])
def test_a_rolling_sweep_measures_every_beam_from_where_the_robot_was(plan: FloorPlan, turns: Any, body: Body) -> None:
    lidar = LidarConfig(sweep="rolling", turns=turns, range_min=0.01, mount=(0.1, 0.0, 0.2))
    with Simulation(plan, [], SimConfig(lidar=lidar, noise=noise_level("none"), body=body), 0) as sim:
        for _ in range(10):
            sim.step(0.5, 1.0, 0.1)
        poses = []
        for _ in range(10):
            poses.append(sim.world_T_robot)
            sim.step(0.5, 1.0, 0.01)
        poses.append(sim.world_T_robot)
        scan = sim.observe().scan
        assert abs(scan.sweep) == pytest.approx(0.1 * 719 / 720)
        for beam in range(0, 720, 24):
            share = beam / 719 if turns == "left" else 1.0 - beam / 719
            at = (1.0 - 719 / 720 + share * 719 / 720) * 10
            i = min(int(at), 9)
            a, b = poses[i], poses[i + 1]
            t = at - i
            pose = Pose2(a.x + t * (b.x - a.x), a.y + t * (b.y - a.y), a.theta + t * (b.theta - a.theta))
            assert scan.ranges[beam] == pytest.approx(sim.true_ranges(pose)[beam], abs=0.02)
    assert LidarConfig().beam_times == (0.0, 0.0)
