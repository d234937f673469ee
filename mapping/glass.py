"""Panes of glass: surfaces that only come into view near their normal, and that all other beams go through.

A cell of a map cannot tell such a pane from something that has gone: both were hit, and both were seen through. What
tells them apart is the angle, as in VisAGGE (Foster, Sun, Park, Kuipers, ICRA 2013): a pane returns every beam near its
normal and none of the others; what moves returns the same beams now and not then.
"""

import math
from collections.abc import Sequence

import cv2
import numpy as np
import numpy.typing as npt

from closedrooms.core.arrays import FloatArray, IntArray
from closedrooms.core.grid import OccupancyGrid
from closedrooms.core.pose import Pose2
from closedrooms.mapping.beams import Beams
from closedrooms.mapping.graph.keyframe import Keyframe
from closedrooms.mapping.lattice import grown
from closedrooms.mapping.log_odds_grid import EvidenceGrid
from closedrooms.mapping.met_surfaces import Glimpse, MetSurfaces
from closedrooms.mapping.scan_view import View

NEAR, OBLIQUE = math.radians(9.0), math.radians(22.0)
"""Incidence up to which a pane returns every beam, and from which on it returns none [rad]."""
ASKEW = math.radians(30.0)
"""Incidence from which on a beam that ends there tells a wall [rad]: normals are known to some 8 degrees."""
DEPTH = 0.15
"""Distance from a place up to which a beam that ends there hits it [m]: three cells; twice as far it went past."""
REACH = 12.0
"""Distance from which a scan says something about a place [m]."""
SEEN_THROUGH = 1
"""Fewest scans that went through it at an angle."""
DOUBT = 0.34
"""Scans of the wrong kind for each of the right kind from which on a place is no pane."""
LENGTH = 0.5
"""Shortest pane [m]: a person is 0.4 m wide."""
FEWEST = 4
"""Fewest places of a pane."""
THICK = 0.12
"""Standard deviation across a pane up to which its cells are in line [m]: walls are seen from both sides."""
SOLID = 0.10
"""Distance from a solid surface up to which what was seen through is its noise [m]."""
FRAME = 0.5
"""How far beyond what was hit a pane goes on up to the solid wall in its line [m]: less than a door is wide."""
MARGIN = 0.05
"""How far a pane goes on in any case [m]: a cell, or beams slip through between its end and the wall."""
FARTHEST = 2.0
"""How far beyond what was hit a pane goes on at most, all in all [m]."""
SAMPLES = 16
"""Places on a pane at which a scan is asked whether it went through."""
CHANGED = 0.10
"""Change of an end of a pane from which on the scans are drawn anew [m]."""

HIT_NEAR, HIT_OBLIQUE, PAST_NEAR, PAST_OBLIQUE = 1, 2, 3, 4


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
        # What keyframes (rows) say about the places that are asked about (columns): one of the codes above, or 0.
        self._said: npt.NDArray[np.int8] = np.zeros((0, 0), dtype=np.int8)
        self._said_from: list[Pose2] = []
        self._sensors: FloatArray = np.zeros((0, 2))
        self.segments: FloatArray = np.zeros((0, 2, 2))

    def glimpse(self, glimpse: Glimpse) -> None:
        """Take note of the surfaces that a scan met."""
        self._glimpses.append(glimpse)

    def update(self, keyframes: Sequence[Keyframe], evidence: EvidenceGrid, *, moved: bool) -> FloatArray:
        """Take in what was seen since, and find the panes.

        Args:
            keyframes: All of them.
            evidence: The map as it stands, drawn.
            moved: Whether poses were corrected since.

        Returns:
            The panes that are new, gone or of another length, as they were and as they are, shape (n, 2, 2).
        """
        if moved:
            self._met.clear()
        new = self._glimpses[len(self._met) :]
        self._met.add(new, [keyframes[glimpse.keyframe].pose for glimpse in new])
        # What was met near its normal, and scans went through it all the same.
        places, normals = self._met.near_normal(*evidence.crossed(SOLID), OBLIQUE)
        if len(places):
            self._places = np.concatenate((self._places, places))
            self._normals = np.concatenate((self._normals, normals))
            self._asked = np.concatenate((self._asked, np.setdiff1d(self._in_question(), self._asked)))
        if not len(self._asked):
            return self.segments[:0]
        self._ask(keyframes)
        before, found = self.segments, self._find(evidence.grid())
        # A pane that is as before keeps its ends, so that nothing is drawn anew for it.
        kept = [_like(line, before) for line in found]
        self.segments = np.array([line if old is None else old for line, old in zip(found, kept, strict=True)])
        self.segments = self.segments.reshape(-1, 2, 2)
        gone = [line for line in before if _like(line, self.segments) is None]
        new = [line for line, old in zip(found, kept, strict=True) if old is None]
        return np.array(gone + new).reshape(-1, 2, 2)

    def _in_question(self) -> IntArray:
        """List the places that could be on a pane, or where one could go on: few are so many side by side."""
        reach = FARTHEST + FRAME
        near = np.zeros(len(self._places), dtype=np.bool_)
        groups = _groups(self._places, self._resolution)
        order = np.argsort(groups, kind="stable")
        firsts = np.flatnonzero(np.diff(groups[order], prepend=-1))
        lows = np.minimum.reduceat(self._places[order], firsts, axis=0)
        highs = np.maximum.reduceat(self._places[order], firsts, axis=0)
        large = np.diff(firsts, append=len(groups)) >= FEWEST
        large &= np.hypot(*(highs - lows).T) >= LENGTH
        for low, high in zip(lows[large], highs[large], strict=True):
            near |= ((self._places > low - reach) & (self._places < high + reach)).all(axis=1)
        return np.flatnonzero(near)

    def _ask(self, keyframes: Sequence[Keyframe]) -> None:
        """Bring up to date what the keyframes say about the places: new ones about all, the others about new ones."""
        rows, cols = self._said.shape
        self._said = grown(self._said, ((0, len(keyframes) - rows), (0, len(self._asked) - cols)))
        poses = [keyframe.pose for keyframe in keyframes]
        anew = [k for k, (pose, said) in enumerate(zip(poses, self._said_from, strict=False)) if pose is not said]
        anew += range(rows, len(keyframes))
        self._said_from = poses
        self._sensors = np.concatenate((self._sensors, np.zeros((len(keyframes) - rows, 2))))
        for k in anew:
            self._sensors[k] = poses[k].transform(keyframes[k].beams.origin[None])[0]
        self._ask_some(keyframes, anew, 0)
        if cols < len(self._asked):
            self._ask_some(keyframes, np.setdiff1d(np.arange(rows), anew).tolist(), cols)

    def _ask_some(self, keyframes: Sequence[Keyframe], chosen: Sequence[int], first: int) -> None:
        """Find what some keyframes, by their indices, say about the places from the ``first`` one asked about on."""
        asked = self._asked[first:]
        places, normals = self._places[asked], self._normals[asked]
        self._said[chosen, first:] = 0
        middle, reach = (places.min(axis=0) + places.max(axis=0)) / 2.0, np.ptp(places, axis=0) / 2.0 + REACH
        in_reach = (np.abs(self._sensors[chosen] - middle) < reach).all(axis=1)
        for k in np.asarray(chosen)[in_reach].tolist():
            self._said[k, first:] = self._codes(keyframes[k], places, normals)

    def _view(self, keyframe: Keyframe) -> View:
        if keyframe.index not in self._views:
            self._views[keyframe.index] = View(keyframe.beams)
        return self._views[keyframe.index]

    def seen_through(self, keyframe: Keyframe, segments: FloatArray) -> bool:
        """Check whether beams of a keyframe went through one of the panes, map frame, shape (n, 2, 2) [m]."""
        shares = np.linspace(0.0, 1.0, SAMPLES)[:, None, None]
        places = segments[:, 0] + shares * (segments[:, 1] - segments[:, 0])
        local = keyframe.pose.inverse().transform(places.reshape(-1, 2))
        return bool(np.any(self._view(keyframe).beyond(local, 0.0) > DEPTH))

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
        beyond = view.beyond(local)
        met = np.abs((offsets[near] * normals[near]).sum(axis=1)) / np.maximum(away[near], 1e-9)
        incidence = np.arccos(np.minimum(met, 1.0))
        with np.errstate(invalid="ignore"):
            hit, past = np.abs(beyond) <= DEPTH, beyond > 2.0 * DEPTH
        # Of a place that is near, so many beams are beside it that some meet the pane near its normal.
        askew = np.flatnonzero(hit & (incidence >= ASKEW))
        hit[askew] = np.abs(view.beyond(local[askew], 0.0)) <= DEPTH
        found = np.zeros(len(near), dtype=np.int8)
        found[hit & (incidence < OBLIQUE)] = HIT_NEAR
        found[hit & (incidence >= ASKEW)] = HIT_OBLIQUE
        found[past & (incidence < NEAR)] = PAST_NEAR
        found[past & (incidence >= OBLIQUE)] = PAST_OBLIQUE
        codes[near] = found
        return codes

    def _find(self, grid: OccupancyGrid) -> FloatArray:
        # In the order in which they were met, not in that in which they were asked about.
        order = np.argsort(self._asked)
        places, normals = self._places[self._asked[order]], self._normals[self._asked[order]]
        codes = (HIT_NEAR, HIT_OBLIQUE, PAST_NEAR, PAST_OBLIQUE)
        hit, askew, past, through = (np.count_nonzero(self._said == code, axis=0)[order] for code in codes)
        hit = np.maximum(hit, 1)  # a glimpse between two keyframes at least
        glass = (past <= DOUBT * hit) & (through >= SEEN_THROUGH) & (askew <= DOUBT * through)
        no_pane = (past > 1) & (past > hit)
        lines = _lines(places[glass], normals[glass], self._resolution)
        may_be = places[~no_pane & (through >= SEEN_THROUGH)]
        segments = [self._extended(line, grid, places[no_pane], may_be) for line in lines]
        return np.array(segments).reshape(-1, 2, 2)

    @staticmethod
    def _extended(line: FloatArray, grid: OccupancyGrid, no_pane: FloatArray, may_be: FloatArray) -> FloatArray:
        """Let a pane go on up to the solid wall in its line, where no scan speaks against it."""
        along = line[1] - line[0]
        along = along / np.hypot(*along)
        across = np.array([-along[1], along[0]])
        frame, occupied = grid.frame, grid.occupied
        step = frame.resolution
        ends = []
        for end, direction in ((line[0], -along), (line[1], along)):
            solid = 0.0
            for t in np.arange(step, FARTHEST, step):
                place = end + t * direction
                if t - solid > FRAME or (len(no_pane) and np.hypot(*(no_pane - place).T).min() < step):
                    break
                cells = frame.to_cells(place + np.array([-step, 0.0, step])[:, None] * across)
                inside = ((cells >= 0) & (cells < np.array(frame.shape))).all(axis=1)
                if occupied[cells[inside, 0], cells[inside, 1]].any() or np.hypot(*(may_be - place).T).min() < step:
                    solid = float(t)
            ends.append(end + (solid + MARGIN) * direction)
        return np.array(ends)


def _lines(places: FloatArray, normals: FloatArray, resolution: float) -> list[FloatArray]:
    """Join places side by side that face the same way to straight lines, shape (2, 2) each."""
    lines: list[FloatArray] = []
    if not len(places):
        return lines
    angles = np.arctan2(normals[:, 1], normals[:, 0]) % math.pi
    left = np.ones(len(places), dtype=np.bool_)
    while left.any():
        bins = np.bincount((angles[left] / math.pi * 18).astype(np.int64) % 18, minlength=18)
        around = bins + np.roll(bins, 1) + np.roll(bins, -1)
        facing = (np.argmax(around) + 0.5) / 18 * math.pi
        off = np.abs((angles - facing + math.pi / 2.0) % math.pi - math.pi / 2.0)
        chosen = left & (off < math.pi / 9.0)
        left &= ~chosen
        for group in _touching(places[chosen], resolution):
            line = _line(group)
            if line is not None:
                lines.append(line)
    return lines


def _touching(places: FloatArray, resolution: float) -> list[FloatArray]:
    """Part places into groups that hang together, see :func:`_groups`."""
    groups = _groups(places, resolution)
    return [places[groups == number] for number in np.unique(groups)]


def _groups(places: FloatArray, resolution: float) -> IntArray:
    """Number places, shape (n,), by groups that hang together over gaps of at most four cells."""
    cells = np.floor(places / resolution).astype(np.int64)
    cells -= cells.min(axis=0) - 3
    mask = np.zeros(cells.max(axis=0) + 4, dtype=np.uint8)
    mask[cells[:, 0], cells[:, 1]] = 1
    _, labels = cv2.connectedComponents(cv2.dilate(mask, np.ones((5, 5), dtype=np.uint8)), connectivity=8)
    return np.asarray(labels)[cells[:, 0], cells[:, 1]].astype(np.int64)


def _line(places: FloatArray) -> FloatArray | None:
    """Draw the line through places, where they are in line, dense and long enough."""
    if len(places) < FEWEST:
        return None
    middle = places.mean(axis=0)
    _, spread, axes = np.linalg.svd(places - middle, full_matrices=False)
    t = (places - middle) @ axes[0]
    length = float(np.ptp(t))
    if length < LENGTH or spread[1] / math.sqrt(len(places)) > THICK:
        return None
    return np.asarray(middle + np.outer([t.min(), t.max()], axes[0]))


def _like(line: FloatArray, others: FloatArray) -> FloatArray | None:
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
