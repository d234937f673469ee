import math

import numpy as np

from closedrooms.core.pose import Pose2
from closedrooms.core.robot import RobotConfig
from closedrooms.core.scan import LaserScan
from closedrooms.navigation.config import NavigationConfig
from closedrooms.navigation.driving.driver import Driver

CONFIG = NavigationConfig().for_robot(RobotConfig())
PATH = np.array([(0.0, 0.0), (3.0, 0.0)])


def scan_at(stamp: float, *, ahead: float = 5.0, behind: float = 5.0) -> LaserScan:
    """A wall straight ahead and one straight behind, at the given distances [m]."""
    angles = -math.pi + 2 * math.pi / 720 * np.arange(720)
    cosine = np.cos(angles)
    with np.errstate(divide="ignore"):
        ranges = np.where(cosine > 0, ahead / np.maximum(cosine, 1e-9), behind / np.maximum(-cosine, 1e-9))
    return LaserScan(np.minimum(ranges, 19.0), -math.pi, 2 * math.pi / 720, 20.0, stamp=stamp)


def test_a_path_is_driven_and_the_end_reported() -> None:
    driver, pose = Driver(CONFIG), Pose2()
    driver.follow(PATH, 0.0)
    for tick in range(100):
        v, w = driver.command(pose, scan_at(0.1 * tick), 0.1 * tick)
        pose = pose @ Pose2(v * 0.1, 0.0, w * 0.1)
        if driver.state == "arrived":
            break
    assert driver.state == "arrived"
    assert math.dist((pose.x, pose.y), (3.0, 0.0)) <= CONFIG.goal_tolerance


def test_a_robot_that_does_not_get_on_backs_off_and_turns_to_either_side() -> None:
    driver, turns = Driver(CONFIG), []
    for attempt in range(2):
        driver.follow(PATH, 20.0 * attempt)
        states, commands = [], []
        for tick in range(150):
            stamp = 20.0 * attempt + 0.1 * tick
            commands.append(driver.command(Pose2(), scan_at(stamp), stamp))
            states.append(driver.state)
            if driver.state == "idle":
                break
        assert states.count("stuck") == 1
        assert any(v < 0.0 for v, _ in commands)
        turns.append(next(w for (_, w), state in zip(commands, states, strict=True) if state == "recovering" and w))
    assert turns[0] == -turns[1]


def test_a_robot_does_not_back_into_a_wall() -> None:
    driver = Driver(CONFIG)
    driver.follow(PATH, 0.0)
    for tick in range(100):
        v, _ = driver.command(Pose2(), scan_at(0.1 * tick, behind=0.21), 0.1 * tick)
        assert v >= 0.0


def test_before_an_obstacle_the_robot_stops() -> None:
    driver = Driver(CONFIG)
    driver.follow(PATH, 0.0)
    v, _ = driver.command(Pose2(), scan_at(0.0, ahead=0.2), 0.0)
    assert v == 0.0


def test_an_obstacle_close_to_the_end_of_the_path_counts_as_arrival() -> None:
    driver = Driver(CONFIG)
    driver.follow(np.array([(0.0, 0.0), (0.5, 0.0)]), 0.0)
    for tick in range(30):
        driver.command(Pose2(), scan_at(0.1 * tick, ahead=0.2), 0.1 * tick)
        if driver.state == "arrived":
            return
    raise AssertionError(driver.state)


def test_a_robot_that_is_pressed_against_from_ahead_gives_up_sooner_and_backs_off_until_it_bumps_behind() -> None:
    def seconds_until_stuck(*bumps: float) -> float:
        driver = Driver(CONFIG)
        driver.follow(np.array([[0.0, 0.0], [5.0, 0.0]]), 0.0)
        for tick in range(100):
            driver.command(Pose2(), scan_at(0.1 * tick), 0.1 * tick, bumps)
            if driver.state == "stuck":
                return 0.1 * tick
        return math.inf

    assert seconds_until_stuck(0.3) < 0.5 * seconds_until_stuck()
    assert seconds_until_stuck(math.pi) == seconds_until_stuck()
    driver = Driver(CONFIG)
    driver.follow(np.array([[0.0, 0.0], [5.0, 0.0]]), 0.0)
    tick = 0
    while driver.state != "stuck":
        driver.command(Pose2(), scan_at(0.1 * tick), 0.1 * tick, (0.0,))
        tick += 1
    assert driver.command(Pose2(), scan_at(0.1 * tick), 0.1 * tick)[0] < 0.0
    assert driver.command(Pose2(), scan_at(0.1 * tick), 0.1 * tick, (3.0,))[0] == 0.0
