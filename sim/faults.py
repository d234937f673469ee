"""What fails on real robots: odometry that freezes or forgets, scans that are lost, doors that are not there."""

import dataclasses
import math

import numpy as np

from closedrooms.core.door import DoorSighting, Point
from closedrooms.core.pose import Pose2
from closedrooms.core.random import stream
from closedrooms.core.scan import LaserScan
from closedrooms.sim.config import FaultConfig
from closedrooms.worlds.plan import FloorPlan

# A phantom is as wide as a door [m] and seen from up to here [m], in this share of the sweeps.
PHANTOM_WIDTH, PHANTOM_RANGE, PHANTOM_SHARE = 0.9, 6.0, 0.5
# What a ray to a phantom may miss the wall by [m].
ON_WALL = 0.4


class Faults:
    """Faults applied to measurements, each by a random stream of its own."""

    def __init__(self, config: FaultConfig, plan: FloorPlan, seed: int) -> None:
        self.config = config
        self._lost = stream(seed, "faults", "lost scans")
        self._freezes = stream(seed, "faults", "frozen odometry")
        self._drops = stream(seed, "faults", "dropped odometry")
        self._seen = stream(seed, "faults", "phantoms seen")
        self._phantoms = phantom_places(plan, config.phantom_doors, seed)
        self._frozen: Pose2 | None = None
        self._frozen_until = -math.inf
        self._stamp = 0.0
        self._before = Pose2()
        self._kept = Pose2()

    def odometry(self, pose: Pose2, stamp: float) -> Pose2:
        """Spoil the odometry read at ``stamp`` [s]: it may stand still for a while, or forget a motion."""
        config, passed = self.config, stamp - self._stamp
        self._stamp = stamp
        before, self._before = self._before, pose
        draws = self._drops.random()
        if not (config.odometry_drops > 0.0 and draws < config.odometry_drops * passed / 60.0):
            self._kept = self._kept @ (before.inverse() @ pose)
        if stamp < self._frozen_until and self._frozen is not None:
            return self._frozen
        draws = self._freezes.random()
        if config.odometry_freezes > 0.0 and draws < config.odometry_freezes * passed / 60.0:
            self._frozen, self._frozen_until = self._kept, stamp + config.freeze_seconds
        return self._kept

    def scan(self, scan: LaserScan) -> LaserScan:
        """Lose a share of the scans: such a scan comes back without any measurement (NaN)."""
        lost = self._lost.random() < self.config.lost_scans
        return dataclasses.replace(scan, ranges=np.full(scan.ranges.size, np.nan)) if lost else scan

    def phantoms(self, scan: LaserScan, world_T_robot: Pose2) -> tuple[DoorSighting, ...]:
        """Report doors where there is plain wall in sight, robot frame [m]."""
        found = []
        sensor = world_T_robot @ Pose2(*scan.robot_T_sensor)
        for number, (a, b) in enumerate(self._phantoms):
            shown = self._seen.random() < PHANTOM_SHARE
            middle = ((a[0] + b[0]) / 2, (a[1] + b[1]) / 2)
            away = math.dist((sensor.x, sensor.y), middle)
            angle = math.atan2(middle[1] - sensor.y, middle[0] - sensor.x) - sensor.theta - scan.angle_min
            beam = round(angle % (2.0 * math.pi) / scan.angle_increment)
            if not shown or away > PHANTOM_RANGE or beam >= scan.ranges.size:
                continue
            if abs(scan.ranges[beam] - away) < ON_WALL:
                inverse = world_T_robot.inverse()
                ends = tuple(_moved(inverse, end) for end in (a, b))
                found.append(DoorSighting(f"phantom{number:02d}", (ends[0], ends[1]), scan.stamp))
        return tuple(found)


def phantom_places(plan: FloorPlan, count: int, seed: int) -> list[tuple[Point, Point]]:
    """Draw places on walls, by length, building frame [m]; the first ones are the same however many are drawn."""
    rng = stream(seed, "faults", "phantoms", plan.name)
    walls = [wall.segment for wall in plan.walls if math.dist(*wall.segment) > PHANTOM_WIDTH]
    if not walls or count == 0:
        return []
    lengths = np.array([math.dist(*segment) for segment in walls])
    ends = np.cumsum(lengths)
    found = []
    for where, along_it in rng.random((count, 2)):
        index = min(int(np.searchsorted(ends, where * ends[-1])), len(walls) - 1)
        a, b = np.array(walls[index])
        along = (b - a) / lengths[index]
        first = a + along * along_it * (lengths[index] - PHANTOM_WIDTH)
        last = first + along * PHANTOM_WIDTH
        found.append(((float(first[0]), float(first[1])), (float(last[0]), float(last[1]))))
    return found


def _moved(b_T_a: Pose2, point: Point) -> Point:
    """Transform a point from frame a to frame b [m]."""
    pose = b_T_a @ Pose2(*point)
    return (pose.x, pose.y)
