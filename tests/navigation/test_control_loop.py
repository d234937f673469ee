"""The control loop, exploring in a world of cells: a ray caster as simulation and a mapper that knows its pose."""

import math
from typing import Any

import cv2
import numpy as np
import pytest

from closedrooms.core.arrays import FloatArray
from closedrooms.core.door import ClosedDoor
from closedrooms.core.grid import GridFrame, OccupancyGrid
from closedrooms.core.observation import Observation
from closedrooms.core.pose import Pose2
from closedrooms.core.robot import RobotConfig
from closedrooms.core.scan import LaserScan
from closedrooms.navigation.config import NavigationConfig
from closedrooms.navigation.control_loop import EarlyEnd, LoopLog, Step, run_loop
from closedrooms.navigation.explorer import Explorer

RESOLUTION, BEAMS, RANGE, RADIUS = 0.05, 180, 6.0, 0.2


class CellWorld:
    """World whose walls are cells; the robot is a disc that stops at them."""

    period = 0.1

    def __init__(self, walls: np.ndarray, start: tuple[float, float], *, radius: float = RADIUS) -> None:
        self.walls = walls
        self.radius = radius
        self.pose = Pose2(*start)
        self.time = 0.0
        self.jammed = False
        self._gap: Any = cv2.distanceTransform((1 - walls).astype(np.uint8), cv2.DIST_L2, 5) * RESOLUTION

    def observe(self) -> Observation:
        angles = -math.pi + 2.0 * math.pi / BEAMS * np.arange(BEAMS) + self.pose.theta
        s = np.arange(0.0, RANGE, RESOLUTION / 2)
        rows = ((self.pose.y + np.sin(angles)[:, None] * s) / RESOLUTION).astype(int).clip(0, self.walls.shape[0] - 1)
        cols = ((self.pose.x + np.cos(angles)[:, None] * s) / RESOLUTION).astype(int).clip(0, self.walls.shape[1] - 1)
        hit = self.walls[rows, cols] > 0
        ranges = np.where(hit.any(axis=1), s[hit.argmax(axis=1)], np.inf)
        scan = LaserScan(ranges, -math.pi, 2.0 * math.pi / BEAMS, RANGE, stamp=self.time)
        return Observation(scan, self.pose)

    def step(self, v: float, w: float, duration: float) -> None:
        self.time += duration
        if self.jammed:
            return
        for _ in range(5):
            pose = self.pose @ Pose2(v * duration / 5, 0.0, w * duration / 5)
            if self._gap[int(pose.y / RESOLUTION), int(pose.x / RESOLUTION)] < self.radius:
                pose = Pose2(self.pose.x, self.pose.y, pose.theta)
            self.pose = pose


class CellMapper:
    """Mapper that draws every fourth scan at the true pose."""

    def __init__(self, shape: tuple[int, int]) -> None:
        self._cells = np.full(shape, -1, dtype=np.int8)
        self._count = 0

    def process(self, scan: LaserScan, odometry: Pose2, sightings: Any = ()) -> Pose2:  # noqa: ARG002
        if self._count % 4 == 0:
            reach = np.minimum(scan.ranges, scan.range_max)
            s = np.arange(0.0, RANGE, RESOLUTION / 2)
            before = s[None, :] < reach[:, None] - RESOLUTION / 2
            angles = np.broadcast_to((scan.angles + odometry.theta)[:, None], before.shape)[before]
            self._set(odometry, angles, np.broadcast_to(s, before.shape)[before], 0)
            hits = scan.hits
            self._set(odometry, scan.angles[hits] + odometry.theta, scan.ranges[hits], 100)
        self._count += 1
        return odometry

    def _set(self, pose: Pose2, angles: FloatArray, ranges: FloatArray, value: int) -> None:
        rows = ((pose.y + np.sin(angles) * ranges) / RESOLUTION).astype(int)
        cols = ((pose.x + np.cos(angles) * ranges) / RESOLUTION).astype(int)
        inside = (rows >= 0) & (cols >= 0) & (rows < self._cells.shape[0]) & (cols < self._cells.shape[1])
        rows, cols = rows[inside], cols[inside]
        if value == 0:
            walls = self._cells[rows, cols] == 100
            rows, cols = rows[~walls], cols[~walls]
        self._cells[rows, cols] = value

    def grid(self) -> OccupancyGrid:
        return OccupancyGrid(GridFrame(RESOLUTION, 0.0, 0.0, *self._cells.shape), self._cells.copy())

    def doors(self) -> list[ClosedDoor]:
        return []


class Notes:
    """Record of what an exploration tells."""

    def __init__(self) -> None:
        self.goals: list[tuple[float, float]] = []
        self.scans = 0

    def take(self, explorer: Explorer) -> None:
        self.scans += 1
        if explorer.goal is not None:
            self.goals.append(explorer.goal.place)


def explore(world: CellWorld, mapper: CellMapper, config: NavigationConfig, notes: Notes | None = None) -> LoopLog:
    settings = config.for_robot(RobotConfig(radius=world.radius))
    explorer, notes = Explorer(settings), notes or Notes()
    return run_loop(world, mapper, explorer, settings, on_step=lambda _: notes.take(explorer))


def building(*, closed: bool = False) -> np.ndarray:
    """A corridor of 2 m with three rooms of 4 m on either side, doors of 0.8 m; ``closed`` shuts one of them."""
    walls = np.ones((260, 280), dtype=np.uint8)
    walls[110:150, 10:270] = 0
    for row, doors in ((20, 107), (153, 150)):
        for number, col in enumerate((10, 98, 186)):
            walls[row : row + 87, col : col + 84] = 0
            walls[doors : doors + 3, col + 20 + 15 * number : col + 36 + 15 * number] = 0
    if closed:
        walls[107:110, 10:94] = 1
    return walls


def free_share(world: CellWorld, mapper: CellMapper, start: tuple[float, float]) -> float:
    """How much of the free space connected to the start the map knows."""
    _, labels = cv2.connectedComponents((1 - world.walls).astype(np.uint8), connectivity=4)
    labels = np.asarray(labels)
    reachable = labels == labels[int(start[1] / RESOLUTION), int(start[0] / RESOLUTION)]
    return float((mapper.grid().known & reachable).sum() / reachable.sum())


START = (1.5, 6.5)


def test_every_room_is_explored_and_the_run_ends_by_itself() -> None:
    world = CellWorld(building(), START)
    mapper, notes = CellMapper(world.walls.shape), Notes()
    result = explore(world, mapper, NavigationConfig(time_limit=400.0), notes)
    assert result.status == "complete"
    assert free_share(world, mapper, START) >= 0.98
    assert notes.scans == result.scans
    assert result.distance > 15.0
    assert set(result.wall_seconds) == {"sense", "map", "navigate", "observe", "move"}


@pytest.mark.slow
def test_a_closed_room_is_left_out_and_the_rest_is_explored() -> None:
    world = CellWorld(building(closed=True), START)
    mapper = CellMapper(world.walls.shape)
    result = explore(world, mapper, NavigationConfig(time_limit=400.0))
    assert result.status == "complete"
    assert free_share(world, mapper, START) >= 0.98
    assert (mapper.grid().cells[25:100, 15:90] == -1).all()


def test_the_same_world_is_explored_the_same_way_twice() -> None:
    runs = []
    for _ in range(2):
        world, notes = CellWorld(building(closed=True), START), Notes()
        result = explore(world, CellMapper(world.walls.shape), NavigationConfig(time_limit=15.0), notes)
        runs.append((result.status, result.seconds, result.distance, notes.goals))
    assert runs[0] == runs[1]


def test_the_limit_ends_the_run_with_a_status() -> None:
    world = CellWorld(building(), START)
    result = explore(world, CellMapper(world.walls.shape), NavigationConfig(time_limit=5.0))
    assert result.status == "limit"
    assert result.seconds == pytest.approx(5.0)


def test_a_map_that_grows_too_large_ends_the_run_and_says_so() -> None:
    world = CellWorld(building(), START)
    result = explore(world, CellMapper(world.walls.shape), NavigationConfig(most_cells=10_000))
    assert result.status == "limit"
    assert "72800 cells" in result.reason
    assert result.seconds < 5.0


def test_processor_time_ends_a_run_too() -> None:
    world = CellWorld(building(), START)
    result = explore(world, CellMapper(world.walls.shape), NavigationConfig(cpu_limit=0.1))
    assert result.status == "limit"
    assert "processor time" in result.reason


def test_processor_time_of_the_run_before_counts() -> None:
    config = NavigationConfig(time_limit=1.0).for_robot(RobotConfig())

    def run(spent: float) -> LoopLog:
        world = CellWorld(building(), START)
        return run_loop(world, CellMapper(world.walls.shape), Explorer(config), config, spent=spent)

    first = run(0.0)
    assert 0.0 < first.cpu_seconds < config.cpu_limit
    assert "simulated" in first.reason
    second = run(config.cpu_limit)
    assert (second.status, second.scans) == ("limit", 1)
    assert f"{config.cpu_limit:g} s of processor time" in second.reason
    assert second.cpu_seconds > config.cpu_limit


def test_whoever_knows_more_may_stop_the_run() -> None:
    world = CellWorld(building(), START)
    config = NavigationConfig().for_robot(RobotConfig())

    def after_a_second(step: Step) -> EarlyEnd | None:
        return EarlyEnd("outside", "far out") if step.stamp >= 0.95 else None

    result = run_loop(world, CellMapper(world.walls.shape), Explorer(config), config, stop=after_a_second)
    assert (result.status, result.reason) == ("outside", "far out")
    assert result.seconds == pytest.approx(1.0)


def test_a_robot_as_wide_as_the_doors_is_planned_for_as_it_is() -> None:
    # Doors of 0.8 m: a robot of 0.3 m radius enters every room, one of 0.42 m none, and it does not get stuck in one.
    known = {}
    for radius in (0.3, 0.42):
        world = CellWorld(building(), START, radius=radius)
        mapper = CellMapper(world.walls.shape)
        assert explore(world, mapper, NavigationConfig(time_limit=600.0)).status == "complete"
        known[radius] = free_share(world, mapper, START)
        free = mapper.grid().free
        assert free[110:150, 10:270].mean() > 0.99  # the corridor
    assert known[0.3] > 0.97
    assert known[0.42] < known[0.3]


def test_a_wall_that_the_map_has_lost_is_gone_round() -> None:
    # Two halls of 10 x 3 m, joined by a door at their left end, a room behind the further one at its right end. Both
    # halls are known, and the wall between them is free on the map: scans from poses that do not agree erased it.
    walls = np.ones((190, 220), dtype=np.uint8)
    walls[10:70, 10:210] = walls[73:133, 10:210] = walls[136:180, 150:210] = 0
    walls[70:73, 14:34] = walls[133:136, 170:190] = 0

    class Forgetful(CellMapper):
        def grid(self) -> OccupancyGrid:
            self._cells[68:75, 10:210] = 0
            return super().grid()

    world, mapper = CellWorld(walls, (9.0, 2.0)), Forgetful(walls.shape)
    mapper._cells[:136] = np.where(walls[:136] > 0, 100, 0)
    # Two bumps at one place would be too many.
    result = explore(world, mapper, NavigationConfig(time_limit=200.0, max_recoveries=1))
    assert result.status == "complete"
    assert mapper.grid().known[136:180, 150:210].mean() > 0.98


def test_a_robot_that_cannot_move_ends_as_stuck() -> None:
    world = CellWorld(building(), START)
    world.jammed = True
    result = explore(world, CellMapper(world.walls.shape), NavigationConfig(max_recoveries=1, stuck_time=1.0))
    assert result.status == "stuck"
    assert result.reason
    assert result.seconds < 60.0


def test_a_closed_cell_is_complete_at_once() -> None:
    walls = np.ones((120, 120), dtype=np.uint8)
    walls[20:100, 20:100] = 0
    result = explore(CellWorld(walls, (3.0, 3.0)), CellMapper((120, 120)), NavigationConfig(time_limit=60.0))
    assert result.status == "complete"
    assert result.seconds < 10.0


@pytest.mark.slow
def test_a_table_in_the_room_does_not_keep_the_robot_busy() -> None:
    walls = building(closed=True)
    walls[40:48, 120:140] = 1
    walls[60:63, 110:113] = 1
    world = CellWorld(walls, START)
    mapper = CellMapper(walls.shape)
    result = explore(world, mapper, NavigationConfig(time_limit=400.0))
    assert result.status == "complete"
    assert free_share(world, mapper, START) >= 0.98
