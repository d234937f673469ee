"""What holds of the robot whatever its body is, and what only a body on wheels does."""

import dataclasses
import itertools
import math
from collections.abc import Callable

import numpy as np
import pytest
import shapely
from shapely.geometry import Point, box

from closedrooms.core.errors import InvalidInputError
from closedrooms.core.pose import Pose2
from closedrooms.core.robot import RobotConfig
from closedrooms.sim.config import Body, LidarConfig, SimConfig, noise_level
from closedrooms.sim.simulation import Simulation
from closedrooms.worlds.plan import FloorPlan, Furniture

Solids = Callable[[Simulation], shapely.Geometry]
QUIET = noise_level("none")
DOORS = ["hinged", "double", "sliding"]
# Contacts in PyBullet give way by so much [m].
SOFT = {"wheels": 3e-3, "kinematic": 0.0}


@pytest.fixture(params=["wheels", "kinematic"])
def body(request: pytest.FixtureRequest) -> Body:
    which: Body = request.param
    return which


def facing(plan: FloorPlan, x: float, y: float, heading: float) -> FloorPlan:
    return dataclasses.replace(plan, start=(x, y, heading))


def drive(sim: Simulation, v: float, w: float, seconds: float) -> None:
    for _ in range(round(seconds / 0.1)):
        sim.step(v, w, 0.1)


def test_passes_through_nothing_at_random_commands(plan: FloorPlan, body: Body, solids_now: Solids) -> None:
    rng = np.random.default_rng(5)
    touched = 0
    with Simulation(facing(plan, 1.0, 5.5, 0.0), ["hinged"], SimConfig(body=body, noise=QUIET), 0) as sim:
        solids = solids_now(sim)
        for _ in range(300):
            v, w = rng.choice([1.0, 1.0, -0.6]), rng.uniform(-2.0, 2.0)
            for _ in range(5):
                sim.step(v, w, 0.05)
                gap = solids.distance(Point(sim.world_T_robot.x, sim.world_T_robot.y)) - sim.config.robot.radius
                assert gap >= -SOFT[body]
                touched += sim.collided
    assert touched > 50


@pytest.mark.parametrize("door", DOORS)
def test_a_closed_door_stops_the_robot_and_an_opened_one_lets_it_through(
    plan: FloorPlan, body: Body, door: str
) -> None:
    middle = next(d.midpoint for d in plan.doors if d.id == door)
    ahead = facing(plan, middle[0], 3.0, math.pi / 2)
    with Simulation(ahead, DOORS, SimConfig(body=body, noise=QUIET), 0) as sim:
        drive(sim, 0.8, 0.0, 3.0)
        assert abs(4.0 - 0.025 - 0.2 - sim.world_T_robot.y) < 4e-3
        assert sim.door_states()[door] == 0.0
        drive(sim, -0.5, 0.0, 1.0)
        sim.open_door(door)
        drive(sim, 0.0, 0.0, 3.0)
        assert sim.door_states()[door] > 0.98
        drive(sim, 0.8, 0.0, 4.0)
        assert sim.world_T_robot.y > 5.0


def test_the_entrance_is_shut(plan: FloorPlan, body: Body) -> None:
    with Simulation(facing(plan, 10.0, 1.75, 0.0), [], SimConfig(body=body, noise=QUIET), 0) as sim:
        drive(sim, 1.0, 0.0, 4.0)
        assert abs(sim.world_T_robot.x - (12 - 0.08 - 0.2)) < 4e-3


def test_furniture_stops_the_robot(plan: FloorPlan, body: Body) -> None:
    blocked = dataclasses.replace(facing(plan, 2.0, 2.0, 0.0), furniture=(Furniture("chest", box(5, 1, 6, 3)),))
    with Simulation(blocked, [], SimConfig(body=body, noise=QUIET), 0) as sim:
        drive(sim, 1.0, 0.0, 5.0)
        assert abs(sim.world_T_robot.x - 4.8) < 4e-3


def test_speeds_and_their_changes_keep_to_the_limits(plan: FloorPlan, body: Body) -> None:
    robot = RobotConfig(max_speed=0.7, max_turn_rate=1.1)
    config = SimConfig(body=body, noise=QUIET, robot=robot)
    with Simulation(facing(plan, 1.0, 2.0, 0.0), [], config, 0) as sim:
        sim.step(50.0, 0.0, 0.2)
        assert sim.world_T_robot.x - 1.0 <= 0.5 * 1.5 * 0.2**2 + 5e-3
        drive(sim, 50.0, 0.0, 1.0)
        before = sim.world_T_robot
        sim.step(50.0, 0.0, 1.0)
        assert sim.world_T_robot.distance(before) == pytest.approx(0.7, abs=0.01)
        drive(sim, 0.0, 0.0, 1.0)
        drive(sim, 0.0, 50.0, 0.5)
        before = sim.world_T_robot
        sim.step(0.0, 50.0, 1.0)
        assert sim.world_T_robot.theta - before.theta == pytest.approx(1.1, abs=0.02)


def test_the_same_seed_gives_the_same_bytes(plan: FloorPlan, body: Body) -> None:
    def bytes_of(seed: int) -> bytes:
        kept = b""
        with Simulation(plan, DOORS, SimConfig(body=body), seed) as sim:
            for i in range(40):
                seen = sim.observe()
                kept += seen.scan.ranges.tobytes() + np.array(seen.odometry.as_tuple()).tobytes()
                kept += repr((seen.sightings, seen.bumps, sim.world_T_robot)).encode()
                sim.step(0.8, 0.7 * math.sin(i / 4), 0.1)
                if i == 10:
                    sim.open_door("double")
        return kept

    assert bytes_of(3) == bytes_of(3)
    assert bytes_of(3) != bytes_of(4)


def test_without_noise_the_odometry_follows_a_free_drive(plan: FloorPlan, body: Body) -> None:
    with Simulation(facing(plan, 2.0, 2.0, 0.0), DOORS, SimConfig(body=body, noise=QUIET), 0) as sim:
        for v, w in ((0.8, 0.1), (0.5, -0.6), (0.0, 2.0), (-0.4, 0.3), (0.9, 0.0)) * 2:
            drive(sim, v, w, 1.0)
            assert not sim.collided
        odometry, true = sim.observe().odometry, sim.map_T_robot
    assert odometry.distance(true) < 0.02
    assert abs(odometry.theta - true.theta) < 0.02


def test_a_bump_tells_its_direction(plan: FloorPlan, body: Body) -> None:
    for heading, v, expected in (
        (math.pi / 2, 0.6, 0.0),
        (math.pi / 2 + 0.4, 0.6, -0.4),
        (-math.pi / 2, -0.6, math.pi),
    ):
        with Simulation(facing(plan, 8.4, 3.4, heading), DOORS, SimConfig(body=body, noise=QUIET), 0) as sim:
            assert sim.observe().bumps == ()
            for _ in range(20):
                sim.step(v, 0.0, 0.1)
                if sim.collided:
                    break
            bumps = sim.observe().bumps
            assert bumps
            assert all(abs(math.remainder(bump - expected, 2 * math.pi)) < 0.35 for bump in bumps)
            drive(sim, -v, 0.0, 0.5)
            assert sim.observe().bumps == ()


def test_closed_doors_are_sighted_and_opened_ones_are_not(plan: FloorPlan, body: Body) -> None:
    with Simulation(facing(plan, 2.0, 2.0, 1.0), ["hinged", "double"], SimConfig(body=body, noise=QUIET), 0) as sim:
        assert {door.id for door in sim.observe().sightings} == {"hinged", "double"}
        sim.open_door("hinged")
        drive(sim, 0.0, 0.0, 0.5)
        assert {door.id for door in sim.observe().sightings} == {"double"}


def test_rays_meet_a_moving_leaf_where_geometry_says(plan: FloorPlan, body: Body) -> None:
    config = SimConfig(body=body, noise=QUIET)
    with Simulation(plan, DOORS, config, 0) as sim:
        for door in DOORS:
            sim.open_door(door)
        drive(sim, 0.0, 0.0, 0.8)
        for x in (1.7, 5.6, 6.4, 10.2):
            leaves = shapely.union_all([leaf for door in DOORS for leaf in sim.door_leaves(door)])
            hit = leaves.intersection(box(x, 3.0, x + 1e-9, 9.0))
            assert not hit.is_empty
            ranges = sim.true_ranges(Pose2(x, 3.0, math.pi / 2))
            assert ranges[config.lidar.beams // 2] == pytest.approx(hit.bounds[1] - 3.0, abs=3e-3)


def test_the_robot_does_not_see_itself_or_the_floor(plan: FloorPlan, body: Body) -> None:
    for height in (0.05, 0.15, 0.3, 0.69):
        config = SimConfig(body=body, noise=QUIET, lidar=LidarConfig(height=height, range_min=0.01))
        with Simulation(plan, DOORS, config, 0) as sim:
            drive(sim, 0.3, 0.0, 0.3)
            assert np.nanmin(sim.observe().scan.ranges) > 1.0


def test_wheels_that_are_held_turn_in_vain(plan: FloorPlan) -> None:
    config = SimConfig(body="wheels", noise=QUIET)
    with Simulation(facing(plan, 8.4, 3.0, math.pi / 2), DOORS, config, 0) as sim:
        drive(sim, 0.8, 0.0, 4.0)
        counted, true = sim.observe().odometry, sim.map_T_robot
    assert true.x < 0.75
    assert counted.x > 2.0


def test_a_door_that_opens_gives_way_to_a_robot_that_stands_there(plan: FloorPlan) -> None:
    into_corridor = dataclasses.replace(plan.doors[0], opens_into="corridor")
    world = dataclasses.replace(plan, doors=(into_corridor,), start=(1.95, 3.4, math.pi))
    with Simulation(world, ["hinged"], SimConfig(body="wheels", noise=QUIET), 0) as sim:
        sim.open_door("hinged")
        drive(sim, 0.0, 0.0, 6.0)
        assert sim.map_T_robot.distance(Pose2()) < 0.1
        assert 0.1 < sim.door_states()["hinged"] < 0.9
        drive(sim, -0.6, 0.0, 4.0)
        assert sim.door_states()["hinged"] > 0.98


@pytest.mark.parametrize("door", ["hinged", "double"])
def test_the_robot_pushes_open_what_is_not_latched(plan: FloorPlan, door: str) -> None:
    middle = next(d.midpoint for d in plan.doors if d.id == door)
    ahead = facing(plan, middle[0], 3.0, math.pi / 2)
    for doors, opened in (("latched", False), ("unlatched", True)):
        config = dataclasses.replace(SimConfig(noise=QUIET, body="wheels"), doors=doors)
        with Simulation(ahead, DOORS, config, 0) as sim:
            assert door in {sighting.id for sighting in sim.observe().sightings}
            drive(sim, 0.6, 0.0, 4.0)
            assert (sim.world_T_robot.y > 4.3) is opened
            assert (sim.door_states()[door] > 0.3) is opened


def test_an_open_leaf_that_is_pushed_stays_where_it_is_left(plan: FloorPlan) -> None:
    # From the room, against the back of a leaf that stands open.
    with Simulation(facing(plan, 1.0, 4.7, 0.0), [], SimConfig(body="wheels", noise=QUIET), 0) as sim:
        drive(sim, 0.5, 0.0, 1.5)
        pushed = sim.door_states()["hinged"]
        drive(sim, -0.5, 0.0, 1.0)
        states = []
        for _ in range(20):
            sim.step(0.0, 0.0, 0.1)
            states.append(sim.door_states()["hinged"])
    assert pushed < 0.9
    assert states[-1] < 0.9
    assert all(abs(b - a) < 1e-3 for a, b in itertools.pairwise(states[-5:]))


def test_a_rate_that_physics_cannot_keep_is_refused() -> None:
    for rate in (7.0, 30.0, 400.0, 200.5):
        with pytest.raises(InvalidInputError, match="rate"):
            SimConfig(body="wheels", lidar=LidarConfig(rate=rate))
        SimConfig(lidar=LidarConfig(rate=rate))
    with pytest.raises(InvalidInputError, match="unlatched"):
        SimConfig(doors="unlatched")
