"""Maps as they would be with some doors closed, redrawn from one exploration with all doors open.

Nothing is painted over. Scans taken behind a closed door are dropped whole. Every other ray is cut at the plane of the
closed leaf, on the true geometry, and ends there as a hit with the sensor's noise; the door is seen by the same rays.
Rays that ended on the leaf where it stood open are cast anew in the plan. The map is then drawn from the scans at their
estimated poses, as the mapper draws it.
"""

from collections import OrderedDict
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from hashlib import blake2b

import numpy as np
import shapely

from closedrooms.core.arrays import FloatArray, IntArray, frozen
from closedrooms.core.door import ClosedDoor, DoorSighting
from closedrooms.core.grid import OccupancyGrid
from closedrooms.core.pose import Pose2
from closedrooms.core.random import stream
from closedrooms.core.scan import LaserScan
from closedrooms.experiments.dataset.open_survey import OpenSurvey
from closedrooms.experiments.dataset.rays import first_hits
from closedrooms.mapping.beams import Beams, clean_alike
from closedrooms.mapping.door_fusion import fuse_doors
from closedrooms.mapping.graph.keyframe import Keyframe
from closedrooms.mapping.log_odds_grid import EvidenceGrid, Imprint
from closedrooms.sim.building import building_solids
from closedrooms.sim.contacts import edges_of, leaf_edges
from closedrooms.sim.door_leaves import Leaf, door_leaves
from closedrooms.worlds.closing import check_closed, hidden_rooms
from closedrooms.worlds.geometry import areal

# A ray counts as ended on an open leaf when it went this far, less so many standard deviations of the range [m]. Rays
# that ended just before it come along: they are cast anew, which gives what they measured but for the noise.
NEAR_LEAF, SIGMAS = 0.02, 4.0
# Most memory of the drawn scans that are remembered, most of them with some doors closed [bytes]: about 2,000 scans of
# school-08, whose maps ask for 24,000. 6,100 of these differ; with 2,500 fewer than 7,200 are drawn, with 500 17,600.
KEPT = 104_000_000
# Of the objects of a drawn scan beside its arrays [bytes].
OVERHEAD = 2500
# Scans that are cleaned in one go: less time, the same numbers.
TOGETHER = 32
NOTHING = Beams(*(frozen(np.zeros(shape)) for shape in ((0, 2), (0, 2), 2)))


@dataclass(frozen=True, slots=True, eq=False)
class ErasedMap:
    """Map, doors and scans that the robot would have brought home with some doors closed.

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


@dataclass(frozen=True, slots=True, eq=False)
class _Drawn:
    """A keyframe as it stands in the drawing, with the closed doors that its scan measured, but without its beams."""

    scan: LaserScan
    keyframe: Keyframe
    doors: tuple[str, ...]
    imprint: Imprint | None

    @property
    def size(self) -> int:
        """How much memory it takes [bytes]."""
        drawn = 0 if self.imprint is None else self.imprint.nbytes
        return OVERHEAD + self.scan.ranges.nbytes + drawn


# A keyframe, the closed doors in it, and the digest of its ranges.
_Key = tuple[int, tuple[str, ...], bytes]


class Eraser:
    """Editor of the maps of one survey; keeps what does not depend on which doors are closed.

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
        world = [survey.world_T_map @ Pose2(*pose) @ sensor for pose in survey.keyframe_true_poses]
        self._places = np.array([(pose.x, pose.y) for pose in world])
        angles = config.lidar.angle_min + config.lidar.angle_increment * np.arange(config.lidar.beams)
        self._angles = np.array([pose.theta for pose in world])[:, None] + angles
        self._ranges = np.array([scan.ranges for scan in survey.keyframes.scans])
        draws = stream(survey.seed, "erased", "range").standard_normal(self._ranges.shape)
        self._noise = config.noise.range_sd * draws
        self._sightings: dict[tuple[str, int], DoorSighting] = {}
        self._shut: dict[str, _Crossings] = {}
        self._stood_open: dict[str, _Crossings] = {}
        # How far the beams that ended on one open door go before they meet another one, open or closed: ``None``
        # where none does, which is the rule.
        self._behind: dict[tuple[str, str, bool], FloatArray | None] = {}
        # The drawing as it is now: counts are sums, so that going from one set of closed doors to the next only takes
        # out and puts in the scans that differ, and the way there leaves no trace. It begins with all doors open and
        # so keeps the frame of the whole survey.
        self._grid = EvidenceGrid(survey.mapper)
        self._drawn: list[_Drawn | None] = [None] * len(survey.poses)
        self._known: OrderedDict[_Key, _Drawn] = OrderedDict()
        self._kept = 0
        self._draw(np.arange(len(survey.poses)), self._ranges, np.full(self._ranges.shape, -1), ())

    def erase(self, closed: Collection[str]) -> ErasedMap:
        """Redraw the map with ``closed`` doors closed.

        Args:
            closed: Ids of doors that hide whole rooms.

        Raises:
            InvalidInputError: Doors that do not exist or close no room.
        """
        closed = check_closed(self.survey.plan, closed)
        kept = self._outside(closed, self.survey.keyframe_true_poses)
        ranges, owner = self._cut(closed)
        self._draw(kept, ranges, owner, closed)
        drawn = [entry for entry in self._drawn if entry is not None]
        doors = fuse_doors([entry.keyframe for entry in drawn])
        return ErasedMap(self._grid.grid(), doors, kept, tuple(entry.scan for entry in drawn))

    def _draw(self, kept: IntArray, ranges: FloatArray, owner: IntArray, closed: tuple[str, ...]) -> None:
        """Update the drawing to these scans: keyframes ``kept``, ranges and owners of all keyframes."""
        wanted, measured = set(kept.tolist()), np.isfinite(ranges)
        seen = [((owner == index) & measured).any(axis=1) for index in range(len(closed))]
        for first in range(0, len(self._drawn), TOGETHER):
            numbers = range(first, min(first + TOGETHER, len(self._drawn)))
            keys: dict[int, _Key] = {}
            for number in numbers:
                if number in wanted:
                    doors = tuple(name for name, by in zip(closed, seen, strict=True) if by[number])
                    keys[number] = (number, doors, blake2b(ranges[number].tobytes(), digest_size=16).digest())
            self._add_new([key for key in keys.values() if key not in self._known], ranges)
            for number in numbers:
                self._exchange(number, self._known[keys[number]] if number in keys else None)
            for key in keys.values():
                self._known.move_to_end(key)
            while self._kept > KEPT and len(self._known) > 1:
                self._kept -= self._known.popitem(last=False)[1].size

    def _exchange(self, number: int, after: _Drawn | None) -> None:
        """Take a keyframe out of the drawing and put it in as it is now."""
        before = self._drawn[number]
        if after is before:
            return
        self._drawn[number] = after
        if before is not None and before.imprint is not None:
            self._grid.count_imprint(before.imprint, sign=-1)
        if after is not None and after.imprint is not None:
            self._grid.count_imprint(after.imprint)

    def _add_new(self, keys: Sequence[_Key], ranges: FloatArray) -> None:
        """Make keyframes of the survey with other ranges, each with the doors that it sees; keep them, as few show."""
        survey = self.survey
        scans = []
        for number, _, _ in keys:
            scan = survey.keyframes.scans[number]
            same = np.array_equal(ranges[number], self._ranges[number], equal_nan=True)
            scans.append(scan if same else replace(scan, ranges=ranges[number]))
        cleaned = clean_alike(scans, max_range=survey.mapper.max_range) if scans else []
        for key, scan, beams in zip(keys, scans, cleaned, strict=True):
            number, doors, _ = key
            pose = Pose2(*survey.poses[number])
            keyframe = Keyframe(number, scan.stamp, pose, beams, np.zeros((0, 2)), np.zeros((0, 2)), 0.0)
            for name in doors:
                keyframe.remember(self._sighting(name, number), Pose2())
            imprint = self._grid.imprint(beams, pose)
            # Twice as large as all the rest; only what was seen of doors is asked for from here on.
            keyframe.beams = NOTHING
            self._known[key] = drawn = _Drawn(scan, keyframe, doors, imprint)
            self._kept += drawn.size

    def _outside(self, closed: Collection[str], poses_map: FloatArray) -> IntArray:
        """Find the true poses, shape (n, 3), map frame, that are not behind a closed door: their indices."""
        plan = self.survey.plan
        rooms = {room.id: room.polygon for room in plan.rooms}
        names = [name for part, _ in hidden_rooms(plan, closed) for name in part]
        hidden = shapely.union_all([rooms[name] for name in names])
        points = self.survey.world_T_map.transform(poses_map[:, :2])
        return np.flatnonzero(~shapely.contains_xy(hidden, points[:, 0], points[:, 1]))

    def _cut(self, closed: tuple[str, ...]) -> tuple[FloatArray, IntArray]:
        """Cut ranges at the closed doors, shape (k, beams) [m], and say by which door (its index) each was, else -1."""
        ranges = self._ranges.copy()
        config = self.survey.sim.lidar
        self._cast_anew(closed, ranges)
        limit = np.full(ranges.shape, np.inf)
        owner = np.full(ranges.shape, -1)
        for index, name in enumerate(closed):
            met = self._crossings(name)
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
        if not closed:
            return
        lidar = self.survey.sim.lidar
        ended = [self._ended_on(name) for name in closed]
        scan, beam = (np.concatenate([getattr(met, part) for met in ended]) for part in ("scan", "beam"))
        true = np.concatenate([self._past(name, frozenset(closed)) for name in closed])
        seen = true + self._noise[scan, beam]
        seen = np.where(seen < lidar.range_min, np.nan, np.where(seen >= lidar.range_max, np.inf, seen))
        ranges[scan, beam] = seen

    def _ended_on(self, name: str) -> _Crossings:
        """Find beams that ended on the leaves of a door that stood open, and how far the walls let them go without."""
        if name not in self._stood_open:
            met = self._meeting(np.array([leaf.at(leaf.travel) for leaf in self._leaves[name]]))
            measured = self._ranges[met.scan, met.beam]
            near = measured >= met.distance - NEAR_LEAF - SIGMAS * self.survey.sim.noise.range_sd
            scan, beam = met.scan[near], met.beam[near]
            beams = _Crossings(scan, beam, np.full(len(scan), np.inf))
            self._stood_open[name] = replace(beams, distance=self._first_hits(beams, self._edges))
        return self._stood_open[name]

    def _past(self, name: str, closed: frozenset[str]) -> FloatArray:
        """Measure how far beams that ended on the open leaves of ``name`` go with ``closed`` closed, shape (n,) [m]."""
        met = self._ended_on(name)
        distance = met.distance
        for other, leaves in self._leaves.items():
            key = (name, other, other in closed)
            if key not in self._behind:
                corners = [leaf.at(0.0 if other in closed else leaf.travel) for leaf in leaves]
                found = self._first_hits(met, np.concatenate([np.array(leaf_edges(leaf)) for leaf in corners]))
                self._behind[key] = found if np.isfinite(found).any() else None
            behind = self._behind[key]
            if behind is not None:
                distance = np.minimum(distance, behind)
        return distance

    def _first_hits(self, beams: _Crossings, edges: FloatArray) -> FloatArray:
        return first_hits(self._places[beams.scan], self._directions(beams.scan, beams.beam), edges)

    def _directions(self, scan: IntArray, beam: IntArray) -> FloatArray:
        """Compute the unit vectors of beams in the map frame, shape (n, 2)."""
        angles = self._angles[scan, beam]
        return np.column_stack((np.cos(angles), np.sin(angles)))

    def _crossings(self, name: str) -> _Crossings:
        """Find beams that meet a door's leaves where they close it."""
        if name not in self._shut:
            self._shut[name] = self._meeting(np.array([leaf.at(0.0) for leaf in self._leaves[name]]))
        return self._shut[name]

    def _meeting(self, corners: FloatArray) -> _Crossings:
        """Find beams that meet leaves with ``corners``, shape (leaves, 4, 2), building frame [m]."""
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
        edges = np.concatenate([np.array(leaf_edges(leaf)) for leaf in corners])
        found = first_hits(self._places[scan], self._directions(scan, beam), edges)
        met = np.isfinite(found)
        return _Crossings(scan[met], beam[met], found[met])

    def _sighting(self, name: str, number: int) -> DoorSighting:
        """Simulate how a closed door is seen from the true pose of a keyframe, robot frame."""
        if (name, number) not in self._sightings:
            door = next(door for door in self.survey.plan.doors if door.id == name)
            robot_T_world = (self.survey.world_T_map @ Pose2(*self.survey.keyframe_true_poses[number])).inverse()
            (ax, ay), (bx, by) = robot_T_world.transform(np.array(door.segment))
            stamp = float(self.survey.keyframes.scans[number].stamp)
            seen = DoorSighting(name, ((float(ax), float(ay)), (float(bx), float(by))), stamp)
            self._sightings[name, number] = seen
        return self._sightings[name, number]


def erase(survey: OpenSurvey, closed: Collection[str]) -> ErasedMap:
    """Redraw the map of a survey with ``closed`` doors closed; for many maps of one survey, keep one :class:`Eraser`.

    Args:
        survey: An exploration with all doors open.
        closed: Ids of doors that hide whole rooms.

    Raises:
        InvalidInputError: Doors that do not exist or close no room.
    """
    return Eraser(survey).erase(closed)
