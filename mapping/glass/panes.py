"""Panes of glass: surfaces that only come into view near their normal, and that all other beams go through.

A cell of a map cannot tell such a pane from something that has gone: both were hit, and both were seen through. What
tells them apart is the angle, as in VisAGGE (Foster, Sun, Park, Kuipers, ICRA 2013): a pane returns every beam near its
normal and none of the others; what moves returns the same beams now and not then.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from closedrooms.core.arrays import BoolArray, FloatArray, IntArray
from closedrooms.core.grid import GridFrame, OccupancyGrid
from closedrooms.core.pose import Pose2
from closedrooms.mapping.beams import Beams
from closedrooms.mapping.glass.met_surfaces import Glimpse, MetSurfaces
from closedrooms.mapping.glass.pane_lines import FARTHEST, FRAME, LENGTH, WIDE, draw_lines, extend_line, find_candidates
from closedrooms.mapping.glass.scan_view import LATERAL, View
from closedrooms.mapping.graph.keyframe import Keyframe
from closedrooms.mapping.log_odds_grid import EvidenceGrid

NEAR, OBLIQUE = math.radians(9.0), math.radians(22.0)
"""Incidence up to which a pane returns every beam, and from which on it returns none [rad]."""
ASKEW = math.radians(30.0)
"""Incidence from which on a beam that ends there tells a wall [rad]: normals are known to some 8 degrees."""
DEPTH = 0.15
"""Distance from a place up to which a beam that ends there hits it [m]: three cells; twice as far it went past."""
EXACT = 0.08
"""The same of a beam that meets it askew [m]: the end of a wall beside a pane is hit not far beyond."""
REACH = 12.0
"""Distance from which a scan says something about a place [m]."""
CROSSED_SHARE = 0.1
"""Scans that went through a place, for each that saw a surface there, from which on it is asked about."""
SEEN_THROUGH = 1
"""Fewest scans that went through it at an angle."""
DOUBT = 0.34
"""Scans of the wrong kind for each of the right kind from which on a place is no pane."""
SOLID = 0.10
"""Distance from a solid surface up to which what was seen through is its noise [m]."""
VIEWPOINT = 0.2
"""Size of the squares of which each counts as one place to see from [m]: a robot that turns on the spot learns nothing
new of what it hits."""
CHANGED = 0.10
"""Change of an end of a pane from which on the scans are drawn anew [m]."""

HIT_NEAR, HIT_OBLIQUE, PAST_NEAR, PAST_OBLIQUE = 1, 2, 3, 4


@dataclass(frozen=True, slots=True, eq=False)
class Said:
    """What keyframes say about places: entries, shape (n,) each; about most places a keyframe says nothing.

    Attributes:
        keyframes: Index of the keyframe.
        places: Index of the place.
        codes: One of the codes above.
    """

    keyframes: npt.NDArray[np.int32]
    places: npt.NDArray[np.int32]
    codes: npt.NDArray[np.int8]

    @staticmethod
    def joined(parts: Sequence["Said"]) -> "Said":
        """Join entries."""
        return Said(
            np.concatenate([part.keyframes for part in parts]),
            np.concatenate([part.places for part in parts]),
            np.concatenate([part.codes for part in parts]),
        )

    def kept(self, chosen: BoolArray) -> "Said":
        """Keep some entries, shape (n,)."""
        return Said(self.keyframes[chosen], self.places[chosen], self.codes[chosen])

    def count_viewpoints(self, sensors: FloatArray, count: int) -> list[IntArray]:
        """Count for each code from how many viewpoints keyframes said it of each place, shape (count,) each.

        Args:
            sensors: Where the keyframes were taken, shape (keyframes, 2) [m].
            count: Number of places.
        """
        _, viewpoints = np.unique(np.floor(sensors / VIEWPOINT), axis=0, return_inverse=True)
        seen_from = viewpoints.ravel()[self.keyframes]
        counts = []
        for code in (HIT_NEAR, HIT_OBLIQUE, PAST_NEAR, PAST_OBLIQUE):
            mine = self.codes == code
            once = np.unique(self.places[mine] * np.int64(len(sensors)) + seen_from[mine])
            counts.append(np.bincount(once // max(len(sensors), 1), minlength=count))
        return counts


NOTHING_SAID = Said(np.zeros(0, dtype=np.int32), np.zeros(0, dtype=np.int32), np.zeros(0, dtype=np.int8))


class Panes:
    """The panes found so far, map frame."""

    def __init__(self, resolution: float) -> None:
        self._resolution = resolution
        self._glimpses: list[Glimpse] = []
        self._views: dict[int, View] = {}
        self.start_again()

    def start_again(self) -> None:
        """Forget what was found, but not what the scans met: what was found early was found from less."""
        self._met = MetSurfaces(self._resolution)
        self._places: FloatArray = np.zeros((0, 2))
        self._normals: FloatArray = np.zeros((0, 2))
        self._asked: IntArray = np.zeros(0, dtype=np.int64)
        # What keyframes say about the places that are asked about, and so many of those.
        self._said, self._told = NOTHING_SAID, 0
        self._said_from: list[Pose2] = []
        self._sensors: FloatArray = np.zeros((0, 2))
        self._driven: FloatArray = np.zeros((0, 2))
        self.segments: FloatArray = np.zeros((0, 2, 2))

    def glimpse(self, glimpse: Glimpse) -> None:
        """Take note of the surfaces that a scan met."""
        self._glimpses.append(glimpse)

    def update(
        self, keyframes: Sequence[Keyframe], evidence: EvidenceGrid, *, moved: bool, last: bool = False
    ) -> FloatArray:
        """Take in what was seen since, and find the panes.

        Args:
            keyframes: All of them.
            evidence: The map as it stands, drawn.
            moved: Whether poses were corrected since.
            last: Whether nothing more will be seen.

        Returns:
            The panes that are new, gone or of another length, as they were and as they are, shape (n, 2, 2).
        """
        if moved:
            self._met.clear()
            self._driven = self._driven[:0]
        new = self._glimpses[len(self._met) :]
        poses = [keyframes[glimpse.keyframe].pose for glimpse in new]
        self._met.add(new, poses)
        at = [pose @ glimpse.keyframe_T_robot for pose, glimpse in zip(poses, new, strict=True)]
        self._driven = np.concatenate((self._driven, np.array([(p.x, p.y) for p in at]).reshape(-1, 2)))
        # What was met near its normal, and scans went through it all the same.
        within = _corners(evidence.grid().frame) if last else None
        asked = evidence.crossed(SOLID, share=CROSSED_SHARE, within=within)
        places, normals = self._met.near_normal(*asked, OBLIQUE)
        if len(places):
            self._places = np.concatenate((self._places, places))
            self._normals = np.concatenate((self._normals, normals))
            self._asked = np.concatenate(
                (self._asked, np.setdiff1d(find_candidates(self._places, self._resolution), self._asked))
            )
        if not len(self._asked):
            return self.segments[:0]
        self._ask(keyframes)
        before, found = self.segments, self._find(evidence.grid(), keyframes, last=last)
        # A pane that is as before keeps its ends, so that nothing is drawn anew for it.
        kept = [_alike(line, before) for line in found]
        self.segments = np.array([line if old is None else old for line, old in zip(found, kept, strict=True)])
        self.segments = self.segments.reshape(-1, 2, 2)
        gone = [line for line in before if _alike(line, self.segments) is None]
        new = [line for line, old in zip(found, kept, strict=True) if old is None]
        return np.array(gone + new).reshape(-1, 2, 2)

    def _ask(self, keyframes: Sequence[Keyframe]) -> None:
        """Bring up to date what the keyframes say about the places: new ones about all, the others about new ones."""
        rows, cols = len(self._said_from), self._told
        poses = [keyframe.pose for keyframe in keyframes]
        anew = [k for k, (pose, said) in enumerate(zip(poses, self._said_from, strict=False)) if pose is not said]
        anew += range(rows, len(keyframes))
        self._said_from, self._told = poses, len(self._asked)
        self._sensors = np.concatenate((self._sensors, np.zeros((len(keyframes) - rows, 2))))
        for k in anew:
            self._sensors[k] = poses[k].transform(keyframes[k].beams.origin[None])[0]
        places, normals = self._places[self._asked], self._normals[self._asked]
        still = np.ones(len(keyframes), dtype=np.bool_)
        still[anew] = False
        self._said = Said.joined(
            [
                self._said.kept(still[self._said.keyframes]),
                self._said_by(keyframes, anew, places, normals, 0),
                self._said_by(keyframes, np.flatnonzero(still).tolist(), places, normals, cols),
            ]
        )

    def _said_by(
        self, keyframes: Sequence[Keyframe], chosen: Sequence[int], places: FloatArray, normals: FloatArray, first: int
    ) -> Said:
        """Find what some keyframes, by their indices, say about places, shape (n, 2), from the ``first`` one on."""
        parts = [NOTHING_SAID]
        # Places from left to right: those within reach of a keyframe stand side by side.
        order = first + np.argsort(places[first:, 0], kind="stable")
        x = places[order, 0]
        sensors = self._sensors[chosen, 0]
        begins, ends = np.searchsorted(x, sensors - REACH), np.searchsorted(x, sensors + REACH, side="right")
        for k, begin, end in zip(chosen, begins.tolist(), ends.tolist(), strict=True):
            if begin < end:
                asked = order[begin:end]
                codes = self._codes(keyframes[k], places[asked], normals[asked])
                told = np.flatnonzero(codes)
                who = np.full(len(told), k, dtype=np.int32)
                parts.append(Said(who, asked[told].astype(np.int32), codes[told]))
        return Said.joined(parts)

    def _view(self, keyframe: Keyframe) -> View:
        if keyframe.index not in self._views:
            self._views[keyframe.index] = View(keyframe.beams)
        return self._views[keyframe.index]

    def seen_through(self, keyframe: Keyframe, segments: FloatArray) -> bool:
        """Check whether beams of a keyframe went through one of the panes, map frame, shape (n, 2, 2) [m]."""
        return before_glass(keyframe.beams, keyframe.pose, segments) is not keyframe.beams

    def _codes(
        self, keyframe: Keyframe, places: FloatArray, normals: FloatArray
    ) -> np.ndarray[tuple[int], np.dtype[np.int8]]:
        codes = np.zeros(len(places), dtype=np.int8)
        offsets = places - self._sensors[keyframe.index]
        away = np.hypot(*offsets.T)
        near = np.flatnonzero(away < REACH)
        if not len(near):
            return codes
        view, local = self._view(keyframe), keyframe.pose.inverse().transform(places[near])
        met = np.abs((offsets[near] * normals[near]).sum(axis=1)) / np.maximum(away[near], 1e-9)
        incidence = np.arccos(np.minimum(met, 1.0))
        # A place that lies before or behind the pane by the noise is seen as far aside as the pane is askew.
        beyond = view.beyond(local, LATERAL * np.where(incidence < OBLIQUE, 1.0, np.sin(incidence)))
        with np.errstate(invalid="ignore"):
            hit, past = np.abs(beyond) <= DEPTH, beyond > 2.0 * DEPTH
        # Of a place that is near, so many beams are beside it that some meet the pane near its normal.
        askew = np.flatnonzero(hit & (incidence >= ASKEW))
        hit[askew] = np.abs(view.beyond(local[askew], 0.0)) <= EXACT
        found = np.zeros(len(near), dtype=np.int8)
        found[hit & (incidence < OBLIQUE)] = HIT_NEAR
        found[hit & (incidence >= ASKEW)] = HIT_OBLIQUE
        found[past & (incidence < NEAR)] = PAST_NEAR
        found[past & (incidence >= OBLIQUE)] = PAST_OBLIQUE
        codes[near] = found
        return codes

    def _find(self, grid: OccupancyGrid, keyframes: Sequence[Keyframe], *, last: bool) -> FloatArray:
        # In the order in which they were met, not in that in which they were asked about.
        order = np.argsort(self._asked)
        places, normals = self._places[self._asked[order]], self._normals[self._asked[order]]
        hit, askew, past, through = (counts[order] for counts in self._said.count_viewpoints(self._sensors, self._told))
        hit = np.maximum(hit, 1)  # a glimpse between two keyframes at least
        glass = (past <= DOUBT * hit) & (through >= SEEN_THROUGH) & (askew <= DOUBT * through)
        no_pane = (past > 1) & (past > hit)
        may_be = places[~no_pane & (through >= SEEN_THROUGH)]
        lines = draw_lines(places[glass], normals[glass], self._resolution)
        opened = self._open_along(lines, keyframes) if last else [places[no_pane]] * len(lines)
        segments = []
        for line, against in zip(lines, opened, strict=True):
            long = math.dist(*line) >= LENGTH
            gap, reach = (WIDE if last else FRAME, FARTHEST) if long else (FRAME, FRAME)
            segment, bounded = extend_line(line, grid, may_be, against, self._driven, gap, reach)
            if long or (bounded and self._was_open(line, last=last)):
                segments.append(segment)
        return np.array(segments).reshape(-1, 2, 2)

    def _was_open(self, line: FloatArray, *, last: bool) -> bool:
        """Check that a pane was gone through before it was hit, and until all has been seen also after.

        Who stood there at first has left; who has come since may leave.
        """
        places = self._places[self._asked]
        on_line = (np.hypot(*(places - line[0]).T) + np.hypot(*(places - line[1]).T)) < math.dist(*line) + DEPTH
        said = self._said.kept(on_line[self._said.places])
        hits, throughs = (said.keyframes[said.codes == code] for code in (HIT_NEAR, PAST_OBLIQUE))
        if not (len(hits) and len(throughs)):
            return False
        return bool(throughs.min() < hits.max() and (last or hits.min() < throughs.max()))

    def _open_along(self, lines: Sequence[FloatArray], keyframes: Sequence[Keyframe]) -> list[FloatArray]:
        """List for each line the places in it that keyframes went through near its normal, which it tells best."""
        if not lines:
            return []
        on, facing = [], []
        for a, b in lines:
            length = math.dist(a, b)
            along = (b - a) / length
            on.append(a + np.arange(-FARTHEST, length + FARTHEST, self._resolution)[:, None] * along)
            facing.append(np.broadcast_to(np.array([-along[1], along[0]]), on[-1].shape))
        places, normals = np.concatenate(on), np.concatenate(facing)
        said = self._said_by(keyframes, range(len(keyframes)), places, normals, 0)
        hit, _, past, _ = said.count_viewpoints(self._sensors, len(places))
        opened = np.split(past > hit, np.cumsum([len(some) for some in on])[:-1])
        return [some[here] for some, here in zip(on, opened, strict=True)]


def _corners(frame: GridFrame) -> tuple[FloatArray, FloatArray]:
    """Compute the middles of the lower left and the upper right cell of a map, ``(x, y)`` [m]."""
    ends = frame.to_points(np.array([(0, 0), (frame.rows - 1, frame.cols - 1)]))
    return ends[0], ends[1]


def _alike(line: FloatArray, others: FloatArray) -> FloatArray | None:
    """Find the pane that has nearly the same ends, in either order."""
    for other in others:
        if min(np.abs(line - other).max(), np.abs(line - other[::-1]).max()) < CHANGED:
            return np.asarray(other)
    return None


def before_glass(beams: Beams, map_T_robot: Pose2, segments: FloatArray) -> Beams:
    """End a scan's beams at the panes that they went through; the same object where none did.

    Args:
        beams: A scan.
        map_T_robot: From where.
        segments: Panes, map frame, shape (n, 2, 2) [m].
    """
    if not len(segments):
        return beams
    local = map_T_robot.inverse().transform(segments.reshape(-1, 2)).reshape(-1, 2, 2)
    outline = _cut(beams.outline, beams.origin, local)
    points = _cut(beams.points, beams.origin, local)
    shorter = np.hypot(*(outline - beams.outline).T) > DEPTH
    if not shorter.any():
        return beams
    kept = np.hypot(*(points - beams.points).T) <= DEPTH
    return Beams(np.concatenate((beams.points[kept], outline[shorter])), outline, beams.origin)


def _cut(points: FloatArray, origin: FloatArray, segments: FloatArray) -> FloatArray:
    """Move points that lie behind a segment, seen from ``origin``, onto it; shape (n, 2)."""
    result = points - origin
    for ends in segments - origin:
        turn = float(ends[0, 0] * ends[1, 1] - ends[0, 1] * ends[1, 0])
        a, b = ends if turn >= 0.0 else ends[::-1]
        x, y = result[:, 0], result[:, 1]
        within = np.flatnonzero((a[0] * y - a[1] * x > 0.0) & (x * b[1] - y * b[0] > 0.0))
        # The beam to p meets the line through a and b at t p.
        beam = result[within]
        t = abs(turn) / (beam[:, 0] * (b[1] - a[1]) - beam[:, 1] * (b[0] - a[0]))
        crossed = (t > 0.0) & ((1.0 - t) * np.hypot(*beam.T) > DEPTH)
        result[within[crossed]] *= t[crossed, None]
    moved: FloatArray = result + origin
    return moved
