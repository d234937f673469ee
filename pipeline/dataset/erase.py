"""Maps as they would be with some doors closed, redrawn from one exploration with all doors open.

Nothing is painted over. Scans taken behind a closed door are dropped whole. Every other ray is cut at the plane of the
closed leaf, on the true geometry, and ends there as a hit with the sensor's noise; the door is seen by the same rays.
Rays that ended on the leaf where it stood open are cast anew in the plan. The map is then drawn from the scans at their
estimated poses, as the mapper draws it.
"""

from collections.abc import Collection
from dataclasses import dataclass, replace

import numpy as np
import shapely

from closedrooms.core.arrays import FloatArray, IntArray
from closedrooms.core.door import ClosedDoor, DoorSighting
from closedrooms.core.grid import OccupancyGrid
from closedrooms.core.pose import Pose2
from closedrooms.core.random import stream
from closedrooms.core.scan import LaserScan
from closedrooms.mapping.beams import Beams, clean
from closedrooms.mapping.doors import fuse_doors
from closedrooms.mapping.evidence import EvidenceGrid
from closedrooms.mapping.keyframe import Keyframe
from closedrooms.pipeline.dataset.open_survey import OpenSurvey
from closedrooms.pipeline.dataset.rays import first_hits
from closedrooms.sim.building import building_solids
from closedrooms.sim.contacts import edges_of, leaf_edges
from closedrooms.sim.leaves import Leaf, door_leaves
from closedrooms.worlds.closing import check_closed, hidden_rooms
from closedrooms.worlds.geometry import areal

# A ray counts as ended on an open leaf when it went this far, less so many standard deviations of the range [m]. Rays
# that ended just before it come along: they are cast anew, which gives what they measured but for the noise.
NEAR_LEAF, SIGMAS = 0.02, 4.0


@dataclass(frozen=True, slots=True, eq=False)
class ErasedMap:
    """What the robot would have brought home with some doors closed.

    Attributes:
        grid: The map.
        doors: Closed doors as seen, map frame.
        keyframes: Which keyframes of the survey are left, indices.
        scans: They, as they are with the doors closed.
    """

    grid: OccupancyGrid
    doors: list[ClosedDoor]
    keyframes: IntArray
    scans: tuple[LaserScan, ...]


@dataclass(frozen=True, slots=True, eq=False)
class _Crossings:
    """Beams that meet something: keyframe and beam, shape (n,) each, and the distance [m]."""

    scan: IntArray
    beam: IntArray
    distance: FloatArray


class Eraser:
    """Redraws maps of one survey; keeps what does not depend on which doors are closed.

    Attributes:
        survey: What the maps are drawn from.
    """

    def __init__(self, survey: OpenSurvey) -> None:
        self.survey = survey
        plan, config = survey.plan, survey.sim
        furniture = areal(shapely.union_all([thing.polygon for thing in plan.furniture]))
        solids = areal(shapely.union_all([building_solids(plan), furniture]))
        self._edges = edges_of(solids)
        self._leaves: dict[str, tuple[Leaf, ...]] = {
            door.id: door_leaves(plan, door, solids, config.swing) for door in plan.doors if None not in door.rooms
        }
        sensor = Pose2(*config.lidar.mount)
        world = [survey.world_T_map @ Pose2(*pose) @ sensor for pose in survey.true_poses]
        self._places = np.array([(pose.x, pose.y) for pose in world])
        angles = config.lidar.angle_min + config.lidar.angle_increment * np.arange(config.lidar.beams)
        self._angles = np.array([pose.theta for pose in world])[:, None] + angles
        self._ranges = np.array([scan.ranges for scan in survey.keyframes.scans])
        draws = stream(survey.seed, "erased", "range").standard_normal(self._ranges.shape)
        self._noise = config.noise.range_sd * draws
        self._beams: dict[int, Beams] = {}
        self._shut: dict[str, _Crossings] = {}
        self._open: dict[str, _Crossings] = {}

    def erase(self, closed: Collection[str]) -> ErasedMap:
        """The map with ``closed`` doors closed.

        Args:
            closed: Ids of doors that hide whole rooms.

        Raises:
            InvalidInputError: Doors that do not exist or close no room.
        """
        survey = self.survey
        closed = check_closed(survey.plan, closed)
        kept = self._outside(closed, survey.true_poses)
        ranges, owner = self._cut(closed)
        grid = EvidenceGrid(survey.mapper)
        keyframes, scans = [], []
        for index in kept:
            number = int(index)
            same = np.array_equal(ranges[number], self._ranges[number], equal_nan=True)
            scan = self._scan(number) if same else replace(self._scan(number), ranges=ranges[number])
            beams = self._beams_of(number) if same else clean(scan, max_range=survey.mapper.max_range)
            pose = Pose2(*survey.poses[number])
            keyframe = Keyframe(number, scan.stamp, pose, beams, np.zeros((0, 2)), 0.0)
            measured = np.unique(owner[number][np.isfinite(ranges[number])])
            for door in measured[measured >= 0]:
                keyframe.remember(self._sighting(closed[int(door)], number), Pose2())
            grid.add(beams, pose)
            keyframes.append(keyframe)
            scans.append(scan)
        return ErasedMap(grid.grid(), fuse_doors(keyframes), kept, tuple(scans))

    def _outside(self, closed: Collection[str], poses_map: FloatArray) -> IntArray:
        """Indices of the true poses, shape (n, 3), map frame, that are not behind a closed door."""
        plan = self.survey.plan
        rooms = {room.id: room.polygon for room in plan.rooms}
        names = [name for part, _ in hidden_rooms(plan, closed) for name in part]
        hidden = shapely.union_all([rooms[name] for name in names])
        points = self.survey.world_T_map.transform(poses_map[:, :2])
        return np.flatnonzero(~shapely.contains_xy(hidden, points[:, 0], points[:, 1]))

    def _scan(self, number: int) -> LaserScan:
        return self.survey.keyframes.scans[number]

    def _beams_of(self, number: int) -> Beams:
        """A scan that no closed door changes, cleaned once."""
        if number not in self._beams:
            self._beams[number] = clean(self._scan(number), max_range=self.survey.mapper.max_range)
        return self._beams[number]

    def _cut(self, closed: tuple[str, ...]) -> tuple[FloatArray, IntArray]:
        """Ranges with the doors closed, shape (k, beams) [m], and by which door (its index) each was cut, else -1."""
        ranges = self._ranges.copy()
        config = self.survey.sim.lidar
        self._cast_anew(closed, ranges)
        limit = np.full(ranges.shape, np.inf)
        owner = np.full(ranges.shape, -1)
        for index, name in enumerate(closed):
            met = self._crossings(name, opened=False)
            nearer = met.distance < limit[met.scan, met.beam]
            limit[met.scan[nearer], met.beam[nearer]] = met.distance[nearer]
            owner[met.scan[nearer], met.beam[nearer]] = index
        measured = limit + self._noise
        # A beam without any measurement stays so; one that ended before the leaf does not get there.
        cut = (ranges > limit) & (limit < config.range_max)
        ranges[cut] = measured[cut]
        ranges[cut & (measured < config.range_min)] = np.nan
        ranges[cut & (measured >= config.range_max)] = np.inf
        owner[~cut] = -1
        return ranges, owner

    def _cast_anew(self, closed: tuple[str, ...], ranges: FloatArray) -> None:
        """Replace, in place, what measured a closed door's leaf where it stood open."""
        survey, lidar = self.survey, self.survey.sim.lidar
        ended = []
        for name in closed:
            met = self._crossings(name, opened=True)
            measured = self._ranges[met.scan, met.beam]
            near = measured >= met.distance - NEAR_LEAF - SIGMAS * survey.sim.noise.range_sd
            ended.append(np.column_stack((met.scan[near], met.beam[near])))
        pairs = np.unique(np.concatenate(ended), axis=0) if ended else np.zeros((0, 2), dtype=np.int64)
        if len(pairs) == 0:
            return
        scan, beam = pairs.T
        leaves = [leaf.at(0.0 if name in closed else leaf.travel) for name, own in self._leaves.items() for leaf in own]
        edges = np.concatenate([self._edges, *(np.array(leaf_edges(corners)) for corners in leaves)])
        angles = self._angles[scan, beam]
        directions = np.column_stack((np.cos(angles), np.sin(angles)))
        true = first_hits(self._places[scan], directions, edges)
        seen = true + self._noise[scan, beam]
        seen = np.where(seen < lidar.range_min, np.nan, np.where(seen >= lidar.range_max, np.inf, seen))
        ranges[scan, beam] = seen

    def _crossings(self, name: str, *, opened: bool) -> _Crossings:
        """Beams that meet a door's leaves where they close it, or where they stood open."""
        known = self._open if opened else self._shut
        if name not in known:
            corners = np.array([leaf.at(leaf.travel if opened else 0.0) for leaf in self._leaves[name]])
            known[name] = self._meeting(corners)
        return known[name]

    def _meeting(self, corners: FloatArray) -> _Crossings:
        """Beams that meet leaves with ``corners``, shape (leaves, 4, 2), building frame [m]."""
        points = corners.reshape(-1, 2)
        middle = points.mean(axis=0)
        radius = float(np.linalg.norm(points - middle, axis=1).max())
        offset = middle - self._places
        distance = np.hypot(offset[:, 0], offset[:, 1])
        half = np.where(distance > radius, np.arcsin(np.minimum(radius / np.maximum(distance, 1e-9), 1.0)), np.pi)
        bearing = np.arctan2(offset[:, 1], offset[:, 0])
        turned = np.abs(np.mod(self._angles - bearing[:, None] + np.pi, 2.0 * np.pi) - np.pi)
        within = distance - radius <= self.survey.sim.lidar.range_max
        scan, beam = np.nonzero((turned <= half[:, None] + 1e-9) & within[:, None])
        angles = self._angles[scan, beam]
        edges = np.concatenate([np.array(leaf_edges(leaf)) for leaf in corners])
        found = first_hits(self._places[scan], np.column_stack((np.cos(angles), np.sin(angles))), edges)
        met = np.isfinite(found)
        return _Crossings(scan[met], beam[met], found[met])

    def _sighting(self, name: str, number: int) -> DoorSighting:
        """A closed door as seen from the true pose of a keyframe, robot frame, as the simulation tells it."""
        door = next(door for door in self.survey.plan.doors if door.id == name)
        robot_T_world = (self.survey.world_T_map @ Pose2(*self.survey.true_poses[number])).inverse()
        (ax, ay), (bx, by) = robot_T_world.transform(np.array(door.segment))
        stamp = float(self._scan(number).stamp)
        return DoorSighting(name, ((float(ax), float(ay)), (float(bx), float(by))), stamp)


def erase(survey: OpenSurvey, closed: Collection[str]) -> ErasedMap:
    """The map of a survey with ``closed`` doors closed; for many maps of one survey, keep one :class:`Eraser`.

    Args:
        survey: An exploration with all doors open.
        closed: Ids of doors that hide whole rooms.

    Raises:
        InvalidInputError: Doors that do not exist or close no room.
    """
    return Eraser(survey).erase(closed)
