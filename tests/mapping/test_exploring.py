from typing import Any

import numpy as np
import pytest

from closedrooms.core.pose import Pose2
from closedrooms.mapping.config import NavigationConfig
from closedrooms.mapping.exploring import Explorer, barrier
from closedrooms.mapping.mapper import Mapper

RADIUS = 0.2
START = Pose2(3.0, 2.0, 0.0)
# A room of 6 x 5 m; a passage of 1 m on the right leads to a second room, behind a screen that hides most of it, a
# passage on the upper left to a third one.
ROOMS = [
    (0, 0, 14, 0), (0, 0, 0, 9), (6, 0, 6, 2), (6, 3, 6, 9), (0, 5, 0.6, 5), (1.6, 5, 14, 5), (14, 0, 14, 5),
    (0, 9, 6, 9), (7.5, 1.2, 7.5, 3.8),
]  # fmt: skip
GLASS = (6.0, 2.0, 6.0, 3.0)


def clearance(walls: np.ndarray, x: float, y: float) -> float:
    a, d = walls[:, :2], walls[:, 2:] - walls[:, :2]
    t = np.clip((((x, y) - a) * d).sum(axis=1) / (d**2).sum(axis=1), 0, 1)
    return float(np.hypot(*(a + t[:, None] * d - (x, y)).T).min())


def explored(world: Any, unseen: list[tuple[float, ...]]) -> tuple[Explorer, Mapper]:
    """Drive a disc through a world in which some walls stop it but are not seen."""
    walls = np.vstack((world.segments, np.array(unseen).reshape(-1, 4)))
    explorer, mapper, pose, odometry = Explorer(NavigationConfig()), Mapper(), START, Pose2()
    for i in range(900):
        scan = world.scan(pose, beams=360, stamp=0.1 * i)
        v, w = explorer.command(mapper.process(scan, odometry), scan, mapper.grid)
        if explorer.status != "exploring":
            break
        for _ in range(5):
            ahead = pose @ Pose2(0.02 * v, 0.0, 0.02 * w)
            if clearance(walls, ahead.x, ahead.y) < RADIUS:
                ahead = Pose2(pose.x, pose.y, ahead.theta)
            odometry, pose = odometry @ (pose.inverse() @ ahead), ahead
    return explorer, mapper


def test_what_cannot_be_reached_does_not_end_the_search_for_the_rest(segment_world: Any) -> None:
    explorer, mapper = explored(segment_world(ROOMS), [GLASS])
    assert explorer.status == "complete"
    frame = mapper.grid().frame.covering(-3.0, -2.0, 11.0, 7.0)
    grid = mapper.grid().on(frame)
    places = frame.to_cells(START.inverse().transform(np.array([(4.5, 8.0), (13.0, 1.0)])))
    third, second = grid.known[tuple(places.T)]
    assert third
    assert not second


def test_a_barrier_stands_across_the_way_and_is_as_wide_as_the_robot_needs() -> None:
    config = NavigationConfig()
    pose = Pose2(1.0, 1.0, 0.3)
    points = barrier(pose, np.array([[1.0, 1.0], [1.0, 1.5]]), config)
    assert points[:, 1] == pytest.approx(1.0 + config.required_clearance + 0.05)
    assert np.ptp(points[:, 0]) == pytest.approx(2 * config.required_clearance)
    nowhere = pose.inverse().transform(barrier(pose, np.empty((0, 2)), config))
    assert nowhere[:, 0] == pytest.approx(config.required_clearance + 0.05)
