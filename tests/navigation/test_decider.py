"""What exploring and following a tour have in common, with a driver that does as it is told."""

from typing import Any

import numpy as np
import pytest

from closedrooms.core.grid import GridFrame, OccupancyGrid
from closedrooms.core.pose import Pose2
from closedrooms.core.robot import RobotConfig
from closedrooms.core.scan import LaserScan
from closedrooms.navigation.config import NavigationConfig
from closedrooms.navigation.decider import Decider, Situation

NOW = Situation(
    Pose2(1.0, 2.0, 0.5), LaserScan(np.ones(4), 0.0, 0.1, 5.0, stamp=7.5),
    lambda: OccupancyGrid(GridFrame(1.0, 0.0, 0.0, 1, 1), np.zeros((1, 1), dtype=np.int8)), (0.3,),
)  # fmt: skip


class Obedient:
    """Driver in a state that is given."""

    def __init__(self, state: str, recoveries: int = 0) -> None:
        self.state, self.recoveries, self.asked = state, recoveries, []

    def command(self, *words: Any) -> tuple[float, float]:
        self.asked.append(words)
        return (0.4, -0.2)


class Noting(Decider):
    """Decider that notes what it is asked."""

    def __init__(self, driver: Any, *, ready: bool = True, goal: bool = True) -> None:
        super().__init__(NavigationConfig(max_recoveries=3).for_robot(RobotConfig()))
        self._driver, self.ready, self.goal, self.notes = driver, ready, goal, []

    def _is_ready(self, now: Situation) -> bool:
        self.notes.append("ready")
        return super()._is_ready(now) and self.ready

    def _has_goal(self, now: Situation) -> bool:  # noqa: ARG002
        self.notes.append("goal")
        return self.goal

    def _arrive(self, now: Situation) -> None:  # noqa: ARG002
        self.notes.append("arrive")

    def _get_stuck(self, now: Situation) -> None:  # noqa: ARG002
        self.notes.append("stuck")


def test_a_situation_is_of_the_time_of_its_scan() -> None:
    assert NOW.stamp == 7.5


@pytest.mark.parametrize(
    ("state", "notes"),
    [
        ("driving", ["ready", "goal"]),
        ("idle", ["ready", "goal"]),
        ("arrived", ["ready", "goal", "arrive"]),
        ("recovering", ["ready"]),
    ],
)
def test_the_driver_is_asked_once_there_is_a_goal_or_while_it_frees_itself(state: str, notes: list[str]) -> None:
    driver = Obedient(state)
    decider = Noting(driver)
    assert decider.command(NOW) == (0.4, -0.2)
    assert decider.notes == notes
    assert driver.asked == [(NOW.pose, NOW.scan, 7.5, (0.3,))]
    assert decider.status is None


def test_without_a_goal_or_before_it_is_ready_or_when_it_has_ended_the_robot_stands() -> None:
    for settings, notes in (({"ready": False}, ["ready"]), ({"goal": False}, ["ready", "goal"])):
        driver = Obedient("driving")
        decider = Noting(driver, **settings)
        assert decider.command(NOW) == (0.0, 0.0)
        assert decider.notes == notes
        assert driver.asked == []
    decider = Noting(Obedient("driving"))
    decider.status = "complete"
    assert decider.command(NOW) == (0.0, 0.0)
    assert decider.notes == []


@pytest.mark.parametrize(("recoveries", "ended"), [(0, None), (3, None), (4, "stuck"), (5, "stuck")])
def test_a_robot_that_freed_itself_too_often_on_one_path_is_stuck(recoveries: int, ended: str | None) -> None:
    class GetsStuck(Obedient):
        def command(self, *words: Any) -> tuple[float, float]:
            self.state = "stuck"
            return super().command(*words)

    decider = Noting(GetsStuck("driving", recoveries))
    assert decider.command(NOW) == (0.4, -0.2)
    assert decider.notes == ["ready", "goal", "stuck"]
    assert decider.status == ended
    # Then it is freed, without another thought about the goal.
    if ended is None:
        decider.command(NOW)
        assert decider.notes == ["ready", "goal", "stuck", "ready"]
