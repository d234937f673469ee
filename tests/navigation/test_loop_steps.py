"""The control loop step by step, with a robot, a mapper and a decider that note what they are asked."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest

from closedrooms.core.door import DoorSighting
from closedrooms.core.grid import GridFrame, OccupancyGrid
from closedrooms.core.observation import Observation
from closedrooms.core.pose import Pose2
from closedrooms.core.robot import RobotConfig
from closedrooms.core.scan import LaserScan
from closedrooms.navigation.config import NavigationConfig, RobotNavigation
from closedrooms.navigation.control_loop import EarlyEnd, Limits, LoopLog, Step, StepClock, run_loop
from closedrooms.navigation.decider import Decider, Situation

SETTINGS = NavigationConfig().for_robot(RobotConfig())
DOOR = DoorSighting("d0", ((1.0, 0.0), (1.0, 1.0)), 3.0)


class Robot:
    """Robot that drives along x, from a time of its own on."""

    period = 0.25

    def __init__(self, notes: list[Any], begin: float = 3.0) -> None:
        self.notes, self.time, self.x = notes, begin, 0.0

    def observe(self) -> Observation:
        self.notes.append("observe")
        scan = LaserScan(np.ones(4), 0.0, 0.1, 5.0, stamp=self.time)
        return Observation(scan, Pose2(self.x, 0.0), (DOOR,), (0.7,))

    def step(self, v: float, w: float, duration: float) -> None:
        self.notes.append(("step", v, w, duration))
        self.time += duration
        self.x += v * duration


class Mapper:
    """Mapper that believes odometry, and has a map of some cells."""

    def __init__(self, notes: list[Any], rows: int = 4, cols: int = 5) -> None:
        self.notes, self.rows, self.cols = notes, rows, cols

    def process(self, scan: LaserScan, odometry: Pose2, sightings: Sequence[DoorSighting] = ()) -> Pose2:
        self.notes.append(("process", scan.stamp, tuple(sightings)))
        return Pose2(0.0, 1.0) @ odometry

    def grid(self) -> OccupancyGrid:
        return OccupancyGrid(GridFrame(0.1, 0.0, 0.0, self.rows, self.cols), np.zeros((self.rows, self.cols), np.int8))


class Script(Decider):
    """Decider that drives on for some steps and then ends."""

    def __init__(self, notes: list[Any], steps: int, status: Any = "complete", *, looks: bool = False) -> None:
        super().__init__(SETTINGS)
        self.notes, self.steps, self.ends, self.looks = notes, steps, status, looks

    def command(self, now: Situation) -> tuple[float, float]:
        self.notes.append(("command", now.pose.x, now.stamp, now.bumps))
        if self.looks:
            now.grid()
        self.steps -= 1
        if self.steps == 0:
            self.status = self.ends
        return (0.5, -0.1)

    def _has_goal(self, now: Situation) -> bool: ...  # type: ignore[empty-body]

    def _arrive(self, now: Situation) -> None: ...

    def _get_stuck(self, now: Situation) -> None: ...


def run(steps: int = 3, config: RobotNavigation = SETTINGS, **options: Any) -> tuple[LoopLog, list[Any]]:
    notes: list[Any] = []
    decider = Script(notes, steps, options.pop("status", "complete"), looks=options.pop("looks", False))
    log = run_loop(
        Robot(notes), Mapper(notes), decider, config, on_step=lambda step: notes.append(("seen", step.stamp)), **options
    )
    return log, notes


def test_each_pass_senses_maps_decides_tells_and_only_then_moves() -> None:
    log, notes = run(3)
    passes = []
    for number in range(3):
        stamp = 3.0 + 0.25 * number
        passes += ["observe", ("process", stamp, (DOOR,)), ("command", 0.125 * number, stamp, (0.7,)), ("seen", stamp)]
        passes += [("step", 0.5, -0.1, 0.25)] if number < 2 else []
    assert notes == passes
    assert (log.status, log.reason) == ("complete", "")
    assert log.stamps.tolist() == [3.0, 3.25, 3.5]
    assert log.path.tolist() == [[0.0, 1.0], [0.125, 1.0], [0.25, 1.0]]
    assert (log.distance, log.seconds, log.scans) == (0.25, 0.5, 3)
    assert list(log.wall_seconds) == ["sense", "map", "navigate", "observe", "move"]


def test_a_robot_that_is_stuck_is_told_so() -> None:
    log, _ = run(1, status="stuck")
    assert log.status == "stuck"
    assert "free" in log.reason
    assert (log.seconds, log.scans, log.distance) == (0.0, 1, 0.0)


def test_the_time_limit_counts_from_the_first_observation() -> None:
    for limit, scans in ((1.0, 5), (1.01, 6), (0.24, 2), (1e-3, 2)):
        log, _ = run(20, NavigationConfig(time_limit=limit).for_robot(RobotConfig()))
        assert (log.status, log.scans) == ("limit", scans)
        assert f"{limit:g} simulated seconds" in log.reason


def test_a_map_of_so_many_cells_is_small_enough_and_of_one_more_is_not() -> None:
    for most, scans in ((20, 4), (19, 1)):
        config = NavigationConfig(most_cells=most).for_robot(RobotConfig())
        log, _ = run(4, config, looks=True)
        assert log.scans == scans
        assert log.status == ("complete" if scans == 4 else "limit")
    assert "20 cells, more than 19" in log.reason
    # Nobody has looked at the map.
    assert run(4, config)[0].status == "complete"


def test_processor_time_is_that_of_the_run(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = iter([100.0, 104.9, 105.0, 105.5])
    monkeypatch.setattr("closedrooms.navigation.control_loop.process_time", lambda: next(clock))
    log, _ = run(20, NavigationConfig(cpu_limit=5.0).for_robot(RobotConfig()))
    assert (log.status, log.scans, log.cpu_seconds) == ("limit", 2, 5.5)
    assert "5 s of processor time" in log.reason


def test_what_is_done_is_not_stopped_and_limits_come_before_a_stop() -> None:
    def stop(step: Step) -> EarlyEnd | None:
        return EarlyEnd("outside", "out there") if step.map_T_robot.x > 0.2 else None

    log, notes = run(9, stop=stop)
    assert (log.status, log.reason, log.scans) == ("outside", "out there", 3)
    assert notes[-1][0] == "seen"
    assert run(3, stop=stop)[0].status == "complete"
    short = NavigationConfig(time_limit=0.5).for_robot(RobotConfig())
    assert run(9, short, stop=stop)[0].status == "limit"


def test_a_limit_that_is_met_but_for_rounding_is_met() -> None:
    limits = Limits(NavigationConfig(time_limit=0.3), Mapper([]))
    observed = [
        Step(Observation(LaserScan(np.ones(1), 0.0, 0.1, 5.0, stamp=stamp), Pose2()), Pose2())
        for stamp in (0.0, 0.2999, math.nextafter(0.3, 0.0))
    ]
    assert [limits.check(step) is None for step in observed] == [True, True, False]


def test_a_clock_counts_laps_by_their_names(monkeypatch: pytest.MonkeyPatch) -> None:
    times = iter([10.0, 10.5, 12.0, 12.25])
    monkeypatch.setattr("closedrooms.navigation.control_loop.perf_counter", lambda: next(times))
    clock = StepClock()
    for name in ("a", "b", "a"):
        clock.lap(name)
    assert clock.seconds == {"a": 0.75, "b": 1.5}


@pytest.mark.parametrize(
    ("status", "goes_on", "ended", "scans"),
    [("complete", False, "complete", 3), ("complete", True, "limit", 5), ("stuck", True, "stuck", 3)],
)
def test_what_is_complete_may_go_on_all_the_same(status: str, goes_on: bool, ended: str, scans: int) -> None:
    asked: list[bool] = []

    def again() -> bool:
        asked.append(goes_on)
        return goes_on

    log, _ = run(3, status=status, again=again, stop=lambda step: EarlyEnd("limit", "") if step.stamp >= 4.0 else None)
    assert (log.status, log.scans) == (ended, scans)
    assert len(asked) == (status == "complete")
