"""Settings of navigation: bounds, and what follows from them and from the robot."""

from dataclasses import fields
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from closedrooms.core.errors import InvalidInputError
from closedrooms.core.robot import RobotConfig
from closedrooms.navigation.config import NavigationConfig

POSITIVE = ("preferred_clearance", "lookahead", "time_limit", "cpu_limit", "most_cells")


@pytest.mark.parametrize(
    ("name", "good", "bad"),
    [
        *((name, (1e-6, 1e6), (0.0, -1.0, float("nan"))) for name in POSITIVE),
        *((name, (0.02, 1.0), (0.019, 1.01, float("nan"))) for name in ("planning_resolution", "frontier_resolution")),
        ("braking_reserve", (1.0, 9.0), (0.99, -1.0, float("nan"))),
    ],
)
def test_settings_are_taken_up_to_their_bounds(name: str, good: tuple[float, ...], bad: tuple[float, ...]) -> None:
    for value in good:
        assert getattr(NavigationConfig(**{name: value}), name) == value
    for value in bad:
        with pytest.raises(InvalidInputError, match=name):
            NavigationConfig(**{name: value})


@given(st.floats(0.05, 1.5), st.floats(0.0, 0.2), st.floats(0.1, 2.0), st.floats(0.1, 2.0), st.floats(1.0, 4.0))
def test_distances_follow_the_robot_where_it_is_wide(
    radius: float, margin: float, preferred: float, far: float, reserve: float
) -> None:
    settings = NavigationConfig(
        clearance_margin=margin, preferred_clearance=preferred, far_approach=far, braking_reserve=reserve
    )
    robot = RobotConfig(radius=radius, max_acceleration=1.2)
    config = settings.for_robot(robot)
    assert config.robot is robot
    assert all(getattr(config, item.name) == getattr(settings, item.name) for item in fields(settings))
    assert config.required_clearance == pytest.approx(radius + margin)
    assert config.passage_width == pytest.approx(2.0 * (radius + margin))
    # 0.3 m beyond what it needs, at least.
    assert config.open_clearance == pytest.approx(max(preferred, radius + margin + 0.3))
    assert config.farthest_approach == pytest.approx(max(far, radius + margin + 0.3))
    # It brakes from a speed in a distance that is so much longer than it takes.
    assert config.deceleration * reserve == pytest.approx(1.2)


def test_by_default_a_small_robot_passes_a_door_and_goes_round_what_is_near() -> None:
    config: Any = NavigationConfig().for_robot(RobotConfig())
    assert 2.0 * config.robot.radius < config.passage_width < 0.8
    assert config.required_clearance < config.preferred_clearance == config.open_clearance < 1.0
    assert config.approach < config.far_approach == config.farthest_approach < 2.0
    # Cells of planning are no wider than the robot, those of frontiers finer, and both hold whole cells of a map.
    assert 0.05 <= config.frontier_resolution < config.planning_resolution <= 2.0 * config.robot.radius
    # A frontier is worth a visit where it is as wide as a beam's neighbours are apart, or a patch as large.
    assert 2 * config.frontier_resolution < config.min_frontier < config.passage_width
    assert config.min_frontier**2 < config.min_unknown_area < config.large_area
    assert config.goal_tolerance < config.approach
    assert config.goal_tolerance < config.lookahead < 1.0
    assert 0.0 < config.switch_ratio < 1.0
    # It looks for what is new more often than for something else, and both before it counts as stuck for good.
    assert 0.1 < config.check_interval < config.replan_interval
    assert config.check_interval < config.stuck_time < 5.0
    assert config.back_off < config.approach
