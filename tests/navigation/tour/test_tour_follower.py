"""What the robot finds behind an opened door is not what was predicted: driven in a world of cells."""

import math
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
import pytest
from shapely.geometry import Polygon, box

from closedrooms.core.door import ClosedDoor
from closedrooms.core.grid import OccupancyGrid
from closedrooms.core.observation import Observation
from closedrooms.core.pose import Pose2
from closedrooms.core.robot import RobotConfig
from closedrooms.core.room import Room
from closedrooms.core.scan import LaserScan
from closedrooms.coverage.config import CoverageConfig
from closedrooms.coverage.tour.tour_planner import plan_coverage
from closedrooms.mapping.config import MapperConfig
from closedrooms.mapping.mapper import Mapper
from closedrooms.navigation.config import NavigationConfig
from closedrooms.navigation.control_loop import LoopLog, run_loop
from closedrooms.navigation.tour.opened_doors import ReopenedMap
from closedrooms.navigation.tour.tour_follower import TourFollower, TourOutcome, TourPlan
from closedrooms.predictor.inpainting import inpaint
from closedrooms.predictor.methods import predict
from closedrooms.predictor.prediction import Prediction

RESOLUTION, BEAMS, RANGE, RADIUS = 0.05, 240, 8.0, 0.2
# The world's cell (0, 0) in the map frame, which begins where the robot starts [m].
ORIGIN = np.array([-2.0, -2.0])
# A corridor 9 m long and 2 m wide from (-1, -1); above it, behind a wall of 0.15 m, a door at x = 3.0 to 3.9.
DOOR = ClosedDoor("d00", (3.45, 1.075), ((3.0, 1.075), (3.9, 1.075)), 0.9)


@dataclass(frozen=True)
class Driven:
    log: LoopLog
    outcome: TourOutcome
    grid: OccupancyGrid


class CellWorld:
    """World whose walls are cells, its door a row of them; the robot is a disc that stops at both."""

    period = 0.1

    def __init__(self, *rooms: tuple[float, float, float, float], jammed: bool = False) -> None:
        self.walls = np.ones((200, 220), dtype=np.uint8)
        for part in ((-1.0, -1.0, 8.0, 1.0), *rooms):
            self.walls[self._window(*part)] = 0
        self.pose, self.time, self._jammed = Pose2(), 0.0, jammed
        self._build()

    def _window(self, x0: float, y0: float, x1: float, y1: float) -> tuple[slice, slice]:
        (c0, r0), (c1, r1) = np.rint((np.array([[x0, y0], [x1, y1]]) - ORIGIN) / RESOLUTION).astype(int).tolist()
        return slice(r0, r1), slice(c0, c1)

    def _build(self) -> None:
        self._gap: Any = cv2.distanceTransform((1 - self.walls).astype(np.uint8), cv2.DIST_L2, 5) * RESOLUTION

    def _cells(self, x: Any, y: Any) -> tuple[Any, Any]:
        rows, cols = ((np.asarray(v) - o) / RESOLUTION for v, o in ((y, ORIGIN[1]), (x, ORIGIN[0])))
        return np.floor(rows).astype(int).clip(0, 199), np.floor(cols).astype(int).clip(0, 219)

    def open_door(self) -> None:
        if not self._jammed:
            self.walls[self._window(3.0, 1.0, 3.9, 1.15)] = 0
            self._build()

    def observe(self) -> Observation:
        angles = -math.pi + 2.0 * math.pi / BEAMS * np.arange(BEAMS) + self.pose.theta
        s = np.arange(0.0, RANGE, RESOLUTION / 2)
        hit = self.walls[
            self._cells(self.pose.x + np.cos(angles)[:, None] * s, self.pose.y + np.sin(angles)[:, None] * s)
        ]
        ranges = np.where(hit.any(axis=1), s[hit.argmax(axis=1)], np.inf)
        return Observation(LaserScan(ranges, -math.pi, 2.0 * math.pi / BEAMS, RANGE, stamp=self.time), self.pose)

    def step(self, v: float, w: float, duration: float) -> None:
        self.time += duration
        for _ in range(5):
            pose = self.pose @ Pose2(v * duration / 5, 0.0, w * duration / 5)
            if self._gap[self._cells(pose.x, pose.y)] < RADIUS:
                pose = Pose2(self.pose.x, self.pose.y, pose.theta)
            self.pose = pose


def _driven(world: CellWorld, predicted: Polygon) -> tuple[Driven, Prediction]:
    """The corridor is known, ``predicted`` is what was predicted behind the door, and the tour over both is driven."""
    mapper = Mapper(MapperConfig())
    for x in [*np.arange(0.0, 7.0, 0.4), *np.arange(7.0, 0.0, -0.4), 0.0]:
        world.pose = Pose2(float(x), 0.0)
        sensed = world.observe()
        mapper.process(sensed.scan, sensed.odometry)
        world.time += 0.4
    room = Room(predicted, ("d00",), "independent")
    grid = inpaint(mapper.grid(), [predicted], [box(3.0, 0.95, 3.9, 1.3)])
    prediction = Prediction(grid, (room,))
    tour = plan_coverage(prediction.grid, (), CoverageConfig(), start=(0.0, 0.0))
    assert tour.path[:, 1].max() > 2.0  # it leads into the room
    config = NavigationConfig(time_limit=300.0).for_robot(RobotConfig(radius=RADIUS))
    reopened = ReopenedMap(mapper, [DOOR])
    follower = TourFollower(TourPlan(prediction, tour, (DOOR,)), config, predict, CoverageConfig())
    world.open_door()
    log = run_loop(world, reopened, follower, config)
    return Driven(log, follower.outcome(), reopened.grid()), prediction


def _known_free(grid: OccupancyGrid, x0: float, y0: float, x1: float, y1: float) -> float:
    """Share of a rectangle that is known to be free."""
    (r0, c0), (r1, c1) = grid.frame.to_cells(np.array([[x0, y0], [x1, y1]])).tolist()
    return float(grid.free[r0:r1, c0:c1].mean())


def test_a_wall_where_a_passage_was_predicted_is_turned_away_from() -> None:
    # Predicted: 6 m of room to the right of the door. True: a wall after 2 m.
    result, _ = _driven(CellWorld((2.0, 1.15, 4.5, 5.0)), box(2.0, 1.2, 8.0, 5.0))
    assert result.log.status == "complete"
    assert _known_free(result.grid, 2.2, 1.4, 4.3, 4.8) > 0.95
    (room,) = result.outcome.prediction.rooms
    assert room.polygon.intersection(box(5.0, 1.2, 8.0, 5.0)).area < 1.0
    assert result.outcome.replans > 0
    assert result.log.path[-1, 1] < 1.0  # home again


def test_behind_a_door_that_stays_shut_nothing_is_reached_and_the_rest_is_driven() -> None:
    result, _ = _driven(CellWorld((2.0, 1.15, 6.0, 5.0), jammed=True), box(2.0, 1.2, 6.0, 5.0))
    assert result.log.status == "complete"
    assert len(result.outcome.unreachable) > 0
    assert (result.outcome.unreachable[:, 1] > 1.0).all()
    assert result.log.path[:, 1].max() < 1.0
    assert result.log.path[:, 0].max() > 3.0


@pytest.mark.slow
def test_a_room_larger_than_predicted_is_driven_whole() -> None:
    # Predicted: 2.5 m x 2 m. True: an L of which the far arm cannot be seen from the door.
    true = [(2.5, 1.15, 4.5, 7.5), (4.5, 5.5, 8.0, 7.5)]
    result, before = _driven(CellWorld(*true), box(2.5, 1.2, 4.5, 3.5))
    assert result.log.status == "complete"
    shape = box(*true[0]).union(box(*true[1]))
    (room,) = result.outcome.prediction.rooms
    iou = [r.polygon.intersection(shape).area / r.polygon.union(shape).area for r in (before.rooms[0], room)]
    assert iou[0] < 0.4
    assert iou[1] > 0.85
    assert _known_free(result.grid, 5.0, 5.7, 7.8, 7.3) > 0.95
    assert any(revision.changed == ("d00",) and revision.replanned for revision in result.outcome.revisions)
