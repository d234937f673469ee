"""A robot on wheels on an empty floor: where it is, what its encoders count, and what it feels."""

import math
from collections.abc import Iterator
from dataclasses import replace

import pytest
from shapely.geometry import box

from closedrooms.core.pose import Pose2
from closedrooms.core.robot import RobotConfig
from closedrooms.sim.config import STEPS
from closedrooms.sim.physics_world import PhysicsWorld
from closedrooms.sim.robot.driven_robot import Motion
from closedrooms.sim.robot.robot_model import RobotModel, make_model, robot_mass
from closedrooms.sim.robot.wheeled_robot import WheeledRobot
from closedrooms.worlds.extrusion import extrude

ROBOT = RobotConfig()
START = (1.5, -2.0, 0.7)


@pytest.fixture
def physics() -> Iterator[PhysicsWorld]:
    with PhysicsWorld(stepped=True) as physics:
        yield physics


def made(
    physics: PhysicsWorld, model: RobotModel | None = None, start: tuple[float, float, float] = START
) -> WheeledRobot:
    return WheeledRobot(physics, model or make_model(ROBOT, 0.3), ROBOT, start)


def ignore(_: Motion) -> None:
    pass


@pytest.mark.parametrize("heading", [0.0, 0.9, -2.0])
@pytest.mark.parametrize("offset", [(0.0, 0.0), (0.12, -0.05)])
@pytest.mark.parametrize("foreign", [True, False])
def test_it_stands_where_it_was_put_whichever_way_its_base_looks(
    physics: PhysicsWorld, heading: float, offset: tuple[float, float], foreign: bool
) -> None:
    model = replace(make_model(ROBOT, 0.3), heading=heading, offset=offset, foreign=foreign)
    for start in (START, (-3.0, 4.0, 2.9)):
        robot = made(physics, model, start)
        robot._locate()
        assert (robot.x, robot.y, robot.theta) == pytest.approx(start, abs=1e-6)
    assert robot.tilt == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("rate", [1.5, -1.5])
def test_its_heading_is_counted_on_over_whole_turns(physics: PhysicsWorld, rate: float) -> None:
    robot = made(physics)
    for _ in range(12):
        robot.advance(0.0, rate, 0.5, ignore)
    assert robot.theta - START[2] == pytest.approx(6.0 * rate, abs=0.5)


def test_time_that_is_no_whole_step_is_made_up_for(physics: PhysicsWorld, monkeypatch: pytest.MonkeyPatch) -> None:
    robot, steps = made(physics), []
    monkeypatch.setattr(physics, "step", lambda: steps.append(1))
    counts = []
    for _ in range(12):
        robot.advance(0.0, 0.0, 1.25 / STEPS, ignore)
        counts.append(len(steps))
    # 1.25 steps each: one more with every fourth.
    assert counts == [1, 2, 3, 5, 6, 7, 8, 10, 11, 12, 13, 15]
    steps.clear()
    told: list[Motion] = []
    robot.advance(0.0, 0.0, 10.0 / STEPS, told.append)
    # Encoders are read every four steps, and at the end.
    assert (len(steps), len(told)) == (10, 3)
    robot.advance(0.0, 0.0, 8.0 / STEPS, told.append)
    assert len(told) == 5


def test_commands_are_ramped_step_by_step(physics: PhysicsWorld) -> None:
    robot = made(physics)
    robot.advance(0.5, 1.0, 0.1, ignore)
    assert robot.v == pytest.approx(0.1 * ROBOT.max_acceleration)
    assert robot.w == pytest.approx(0.1 * ROBOT.max_turn_acceleration)
    robot.advance(0.5, 1.0, 1.0, ignore)
    assert (robot.v, robot.w) == (0.5, 1.0)


@pytest.mark.parametrize(("v", "w"), [(0.6, 0.0), (-0.4, 0.0), (0.0, 1.2), (0.5, -0.8)])
def test_encoders_count_where_the_robot_goes(physics: PhysicsWorld, v: float, w: float) -> None:
    robot, told = made(physics), []
    robot.advance(0.0, 0.0, 0.5, ignore)
    begin = Pose2(robot.x, robot.y, robot.theta)
    robot.advance(v, w, 3.0, told.append)
    robot.advance(0.0, 0.0, 1.0, told.append)
    counted = Pose2()
    for motion in told:
        counted = counted @ Pose2(*motion)
    true = begin.inverse() @ Pose2(robot.x, robot.y, robot.theta)
    assert counted.distance(true) < 0.03
    assert math.remainder(counted.theta - true.theta, math.tau) == pytest.approx(0.0, abs=0.05)
    # As far as it was told to, but for the ramps, which take as long at the end as at the beginning.
    assert sum(motion.dx for motion in told) == pytest.approx(3.0 * v, abs=0.05)
    assert sum(motion.turn for motion in told) == pytest.approx(3.0 * w, abs=0.1)


@pytest.mark.parametrize("side", [-0.8, 0.0, 0.8])
def test_it_feels_what_it_presses_against_and_from_where(physics: PhysicsWorld, side: float) -> None:
    physics.add_static(*extrude(box(0.5, -3.0, 0.7, 3.0)))
    robot = made(physics, start=(0.0, 0.0, side))
    robot.advance(0.5, 0.0, 0.3, ignore)
    assert robot.bumps == ()
    robot.advance(0.5, 0.0, 1.5, ignore)
    assert robot.collided
    assert all(abs(bump + side) < 0.4 for bump in robot.bumps)
    assert list(robot.bumps) == sorted({round(bump, 1) for bump in robot.bumps})


def test_a_robot_without_figures_gets_motors_that_let_its_wheels_slip(physics: PhysicsWorld) -> None:
    model = replace(make_model(ROBOT, 0.3), torque=math.inf)
    robot = made(physics, model)
    # Two wheels and casters, which weigh next to nothing, carry it: the force of both is twice its weight.
    weight = 9.81 * (robot_mass(ROBOT) + 2 * 0.5 + 2 * 0.01)
    assert 2 * robot._torque / model.wheel_radius == pytest.approx(2 * weight, rel=1e-6)
    assert made(physics)._torque == make_model(ROBOT, 0.3).torque


def test_a_body_that_is_tipped_says_by_how_much(physics: PhysicsWorld) -> None:
    robot = made(physics)
    bullet, client = physics.bullet, physics.client
    for angle in (0.2, -0.3):
        for axis in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.6, 0.8, 0.0)):
            q = [math.sin(angle / 2) * part for part in axis] + [math.cos(angle / 2)]
            bullet.resetBasePositionAndOrientation(robot._body, [0, 0, 1], q, physicsClientId=client)
            assert robot.tilt == pytest.approx(abs(angle), abs=1e-6)
    turned = [0.0, 0.0, math.sin(0.5), math.cos(0.5)]
    bullet.resetBasePositionAndOrientation(robot._body, [0, 0, 1], turned, physicsClientId=client)
    assert robot.tilt == pytest.approx(0.0, abs=1e-6)
