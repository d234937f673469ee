import math

import numpy as np
import pytest

from closedrooms.core.pose import Pose2
from closedrooms.core.robot import RobotConfig
from closedrooms.core.scan import LaserScan
from closedrooms.navigation.config import NavigationConfig
from closedrooms.navigation.driving.driver import Driver

CONFIG = NavigationConfig().for_robot(RobotConfig())
PATH = np.array([(0.0, 0.0), (3.0, 0.0)])
PLACE = Pose2()


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


FREE = LaserScan(np.full(720, 19.0), -math.pi, 2 * math.pi / 720, 20.0)
BENT = np.array([(0.0, 0.0), (2.0, 0.0), (2.0, 3.0)])


def test_the_path_ahead_begins_at_the_robot_and_goes_in_steps_of_a_tenth() -> None:
    driver = Driver(CONFIG)
    assert driver.ahead(1.0).shape == (0, 2)
    driver.follow(BENT, 0.0)
    assert driver.remaining == 5.0
    for distance, points in ((0.0, 2), (0.05, 2), (0.35, 5), (1.0, 11), (9.0, 51), (math.inf, 51)):
        ahead = driver.ahead(distance)
        assert len(ahead) == points
        assert ahead[0].tolist() == [0.0, 0.0]
        length = np.hypot(*np.diff(ahead, axis=0).T)
        assert length.sum() == pytest.approx(min(distance, 5.0))
        assert length.max(initial=0.0) <= 0.1 + 1e-9
    driver.command(Pose2(1.5, 0.1, 0.0), FREE, 0.1)
    assert driver.remaining == pytest.approx(3.5, abs=0.7)
    begun = 5.0 - driver.remaining
    assert driver.ahead(0.3)[0] == pytest.approx([begun, 0.0])
    driver.stop()
    assert driver.ahead(1.0).shape == (0, 2)
    assert driver.command(Pose2(), FREE, 0.2) == (0.0, 0.0)
    assert driver.state == "idle"


def test_a_robot_turns_to_a_place_until_it_faces_it() -> None:
    driver = Driver(CONFIG)
    for bearing in (-3.0, -1.0, -0.26, -0.24, 0.0, 0.24, 0.26, 2.0):
        place = (1.0 + 2.0 * math.cos(0.5 + bearing), 2.0 + 2.0 * math.sin(0.5 + bearing))
        turn = driver.face(Pose2(1.0, 2.0, 0.5), place)
        assert (turn is None) == (abs(bearing) < 0.25)
        if turn is not None:
            assert turn[0] == 0.0
            assert math.copysign(1.0, turn[1]) == math.copysign(1.0, bearing)
        fine = driver.face(Pose2(1.0, 2.0, 0.5), place, tolerance=0.1)
        assert (fine is None) == (abs(bearing) < 0.1)


def stood(
    points: np.ndarray, *, pose: Pose2 = PLACE, ahead: float = 0.2, bumps: tuple[float, ...] = ()
) -> tuple[str, float]:
    """What a robot that does not move says first but that it drives, and when [s]."""
    driver = Driver(CONFIG)
    driver.follow(points, 5.0)
    for tick in range(200):
        stamp = 5.0 + 0.05 * tick
        driver.command(pose, scan_at(stamp, ahead=ahead), stamp, bumps)
        if driver.state != "driving":
            return driver.state, 0.05 * tick
    return "driving", math.inf


def test_how_long_a_robot_that_does_not_move_is_waited_for() -> None:
    far, near = np.array([(0.0, 0.0), (3.0, 0.0)]), np.array([(0.0, 0.0), (0.55, 0.0)])
    assert stood(far) == ("stuck", pytest.approx(2.05))
    # Half a second where something presses from ahead, and at the end of its path, which it has then reached.
    for bumps, seconds in (((1.5,), 0.55), ((-1.5, 3.0), 0.55), ((1.6,), 2.05), ((math.pi,), 2.05)):
        assert stood(far, bumps=bumps) == ("stuck", pytest.approx(seconds))
    assert stood(near) == ("arrived", pytest.approx(0.55))
    assert stood(np.array([(0.0, 0.0), (0.65, 0.0)]))[0] == "stuck"
    # A robot that looks the other way may turn for half a turn before.
    behind = Pose2(0.0, 0.0, math.pi)
    turning = math.pi / CONFIG.robot.max_turn_rate
    state, seconds = stood(far, pose=behind, ahead=5.0)
    assert (state, seconds) == ("stuck", pytest.approx(2.0 + turning, abs=0.06))


@pytest.mark.parametrize(("step", "stuck"), [(0.06, False), (0.04, True)])
def test_progress_is_what_brings_the_robot_five_centimetres_on(step: float, stuck: bool) -> None:
    driver = Driver(CONFIG)
    driver.follow(np.array([(0.0, 0.0), (9.0, 0.0)]), 0.0)
    states = []
    # A step every 1.9 s; of the smaller ones two are progress, which is too late.
    for tick in range(120):
        stamp = 0.1 * tick
        driver.command(Pose2(step * (tick // 19), 0.0, 0.0), scan_at(stamp, ahead=9.0), stamp)
        states.append(driver.state)
    assert ("stuck" in states) == stuck


def test_a_new_path_on_the_way_leaves_the_time_that_was_waited() -> None:
    driver = Driver(CONFIG)
    driver.follow(PATH, 0.0)
    driver.command(Pose2(), scan_at(1.5, ahead=0.2), 1.5)
    driver.follow(PATH, 1.5)
    driver.command(Pose2(), scan_at(2.1, ahead=0.2), 2.1)
    assert driver.state == "stuck"
    assert driver.recoveries == 1
    # Of one that begins after a stop it begins anew.
    driver = Driver(CONFIG)
    driver.follow(PATH, 0.0)
    driver.command(Pose2(), scan_at(1.5, ahead=0.2), 1.5)
    driver.stop()
    driver.follow(PATH, 1.5)
    driver.command(Pose2(), scan_at(2.1, ahead=0.2), 2.1)
    assert driver.state == "driving"


@pytest.mark.parametrize(
    ("x", "y", "arrived"), [(2.85, 0.0, True), (2.75, 0.0, False), (3.0, 0.19, True), (3.0, 0.21, False)]
)
def test_the_end_is_reached_within_its_tolerance(x: float, y: float, arrived: bool) -> None:
    driver = Driver(CONFIG)
    driver.follow(PATH, 0.0)
    driver._progress = 2.5
    driver.recoveries = 3
    command = driver.command(Pose2(x, y, 0.0), FREE, 0.1)
    assert (driver.state == "arrived") == arrived
    assert (command == (0.0, 0.0)) == arrived
    assert driver.recoveries == (0 if arrived else 3)


def test_a_path_that_comes_past_its_end_is_driven_on() -> None:
    # A loop of 4 m that ends where it began.
    driver = Driver(CONFIG)
    driver.follow(np.array([(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0), (0.0, 0.0)]), 0.0)
    driver.command(Pose2(0.05, 0.0, 0.0), FREE, 0.1)
    assert driver.state == "driving"


def test_a_recovery_backs_off_turns_and_ends() -> None:
    def recover(behind: float, moved: float, bumps: tuple[float, ...] = ()) -> list[tuple[float, float]]:
        """Commands from the one that reports the robot stuck on, in steps of 0.1 s."""
        driver = Driver(CONFIG)
        driver.follow(PATH, 0.0)
        commands, pose, stamp = [], Pose2(), 0.0
        while driver.state != "idle":
            stamp += 0.1
            command = driver.command(pose, scan_at(stamp, ahead=0.2, behind=behind), stamp, bumps)
            if driver.state in {"stuck", "recovering"}:
                commands.append(command)
                pose = pose @ Pose2(moved * command[0] * 0.1, 0.0, 0.0)
        assert driver.ahead(1.0).shape == (0, 2)
        assert commands.pop(0) == (0.0, 0.0)
        return commands

    rate = CONFIG.robot.max_turn_rate
    free = recover(5.0, 1.02)
    # 0.25 m at 0.25 m/s, and 0.8 s of turning.
    assert [command for command in free if command[1] == 0.0] == [(-0.25, 0.0)] * 10
    assert free[-8:] == [(0.0, rate)] * 8
    assert len(free) == 18
    # One that does not get back gives up after twice the time, one with a wall behind it at once.
    held = recover(5.0, 0.0)
    assert held.count((-0.25, 0.0)) in {19, 20}
    assert recover(0.2, 1.02) == [(0.0, rate)] * 8
    assert recover(5.0, 1.02, (math.pi,)) == [(0.0, rate)] * 8
    assert recover(5.0, 1.02, (0.3,)).count((-0.25, 0.0)) == 10


def test_where_the_arc_does_not_fit_the_robot_turns_to_the_path_close_by() -> None:
    # The path goes round a corner to the left; ahead a wall leaves no room for the arc.
    path = np.array([(0.0, 0.0), (0.1, 0.0), (0.1, 3.0)])
    driver = Driver(CONFIG)
    driver.follow(path, 0.0)
    v, w = driver.command(Pose2(0.1, 0.0, 0.8), scan_at(0.0, ahead=0.22), 0.1)
    assert (v, w > 0.0) == (0.0, True)
    # Facing it, the robot goes on as slowly as the obstacle lets it.
    driver.follow(path, 0.0)
    v, w = driver.command(Pose2(0.1, 0.0, math.pi / 2), scan_at(0.0, ahead=0.22), 0.1)
    assert v < 0.08
