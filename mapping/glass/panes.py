"""Panes of glass: surfaces that only come into view near their normal, and that all other beams go through.

A cell of a map cannot tell such a pane from something that has gone: both were hit, and both were seen through. What
tells them apart is the angle, as in VisAGGE (Foster, Sun, Park, Kuipers, ICRA 2013): a pane returns every beam near its
normal and none of the others; what moves returns the same beams now and not then.
"""

import math
from collections.abc import Sequence

import numpy as np

from closedrooms.core.arrays import BoolArray, FloatArray, IntArray
from closedrooms.core.grid import GridFrame, OccupancyGrid
from closedrooms.mapping.beams import Beams
from closedrooms.mapping.glass.before_glass import before_glass
from closedrooms.mapping.glass.met_surfaces import Glimpse, MetSurfaces
from closedrooms.mapping.glass.pane_lines import (
    ALONE,
    FARTHEST,
    FRAME,
    LENGTH,
    WIDE,
    draw_lines,
    extend_line,
    find_candidates,
    join_lines,
    sample,
    turn_into_walls,
    without_covered,
)
from closedrooms.mapping.glass.testimony import (
    DEPTH,
    HIT_NEAR,
    NOTHING_SAID,
    OBLIQUE,
    PAST_OBLIQUE,
    Said,
    Witnesses,
)
from closedrooms.mapping.graph.keyframe import Keyframe
from closedrooms.mapping.log_odds_grid import EvidenceGrid

CROSSED = 1
"""Scans that went through a place from which on it is asked about, however many met something there: who comes up to a
pane from the front sees little else."""
SEEN_THROUGH = 1
"""Fewest scans that went through it at an angle."""
DOUBT = 0.34
"""Scans of the wrong kind for each of the right kind from which on a place is no pane."""
GONE, TURNS = 0.1, 0.25
"""The same of all places on a short pane together (on a longer one 1), and the share of its places that must have
been hit, gone through and hit again. Of 14 short panes in runs with glass the first was at most 0.15, nearly always 0,
and the second mostly above 0.39; where somebody had been, in six runs with people, one of the two was on the other
side. Of 80 longer ones the first was at most 0.34."""
SOLID = 0.10
"""Distance from a solid surface up to which what was seen through is its noise [m]."""
CHANGED = 0.10
"""Change of an end of a pane from which on the scans are drawn anew [m]."""


class Panes:
    """The panes found so far, map frame."""

    def __init__(self, resolution: float) -> None:
        self._resolution = resolution
        self._glimpses: list[Glimpse] = []
        self._witnesses = Witnesses()
        self._all_seen = False
        self.start_again()

    def start_again(self) -> None:
        """Forget what was found, but not what the scans met: what was found early was found from less."""
        self._met = MetSurfaces(self._resolution)
        self._places: FloatArray = np.zeros((0, 2))
        self._normals: FloatArray = np.zeros((0, 2))
        self._asked: IntArray = np.zeros(0, dtype=np.int64)
        # What keyframes say about the places that are asked about, and so many of those.
        self._said, self._told = NOTHING_SAID, 0
        # From how many viewpoints each of the four things was said of each.
        self._counts: IntArray = np.zeros((4, 0), dtype=np.int64)
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
            last: Whether all has been seen by now.

        Returns:
            The panes that are new, gone or of another length, as they were and as they are, shape (n, 2, 2).
        """
        self._all_seen |= last
        if moved:
            self._met.clear()
            self._driven = self._driven[:0]
        new = self._glimpses[len(self._met) :]
        poses = [keyframes[glimpse.keyframe].pose for glimpse in new]
        self._met.add(new, poses)
        at = [pose @ glimpse.keyframe_T_robot for pose, glimpse in zip(poses, new, strict=True)]
        self._driven = np.concatenate((self._driven, np.array([(p.x, p.y) for p in at]).reshape(-1, 2)))
        # What was met near its normal, and scans went through it all the same.
        redrawn = evidence.take_redrawn()
        if last:
            redrawn = _corners(evidence.grid().frame)
        asked = evidence.crossed(SOLID, least=CROSSED, share=0.0, within=redrawn)
        places, normals = self._met.near_normal(*asked, OBLIQUE)
        if len(places):
            self._places = np.concatenate((self._places, places))
            self._normals = np.concatenate((self._normals, normals))
            unasked = np.setdiff1d(np.arange(len(self._places)), self._asked)
            self._asked = np.concatenate((self._asked, find_candidates(self._places, unasked, self._resolution)))
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

    def shown(self, keyframes: Sequence[Keyframe], chosen: Sequence[Keyframe]) -> list[Beams]:
        """List what the map shows of some of the keyframes: their beams up to the panes."""
        if not len(self.segments):
            return [keyframe.beams for keyframe in chosen]
        self._witnesses.call(keyframes)
        crossed = self._witnesses.may_cross([keyframe.index for keyframe in chosen], self.segments)
        return [
            before_glass(keyframe.beams, keyframe.pose, self.segments[mine])
            for keyframe, mine in zip(chosen, crossed, strict=True)
        ]

    def seen_through(self, keyframes: Sequence[Keyframe], segments: FloatArray) -> list[Keyframe]:
        """List the keyframes of which beams went through one of the panes, map frame, shape (n, 2, 2) [m]."""
        crossed = self._witnesses.may_cross(range(len(keyframes)), segments)
        return [
            keyframe
            for keyframe, mine in zip(keyframes, crossed, strict=True)
            if before_glass(keyframe.beams, keyframe.pose, segments[mine]) is not keyframe.beams
        ]

    def _ask(self, keyframes: Sequence[Keyframe]) -> None:
        """Bring up to date what the keyframes say about the places: new ones about all, the others about new ones."""
        self._witnesses.call(keyframes)
        anew = self._witnesses.take_changed()
        told, self._told = self._told, len(self._asked)
        if not anew and told == self._told:
            return
        places, normals = self._places[self._asked], self._normals[self._asked]
        still = np.ones(len(keyframes), dtype=np.bool_)
        still[anew] = False
        kept = still[self._said.keyframes]
        new = [
            self._witnesses.say(anew, places, normals),
            self._witnesses.say(np.flatnonzero(still).tolist(), places, normals, told),
        ]
        changed = np.zeros(len(places), dtype=np.bool_)
        for said in (self._said.kept(~kept), *new):
            changed[said.places] = True
        self._said = Said.joined([self._said.kept(kept), *new])
        # A viewpoint may count for several keyframes: of places about which nothing new was said it stays as it was.
        self._counts = np.concatenate((self._counts, np.zeros((4, len(places) - told), dtype=np.int64)), axis=1)
        of_changed = self._said.kept(changed[self._said.places])
        counts = of_changed.count_viewpoints(self._witnesses.sensors, len(places))
        self._counts[:, changed] = counts[:, changed]

    def _find(self, grid: OccupancyGrid, keyframes: Sequence[Keyframe], *, last: bool) -> FloatArray:
        # In the order in which they were met, not in that in which they were asked about.
        order = np.argsort(self._asked)
        places, normals = self._places[self._asked[order]], self._normals[self._asked[order]]
        hit, askew, past, through = self._counts[:, order]
        hit = np.maximum(hit, 1)  # a glimpse between two keyframes at least
        glass = (past <= DOUBT * hit) & (through >= SEEN_THROUGH) & (askew <= DOUBT * through)
        no_pane = (past > 1) & (past > hit)
        may_be, before = places[~no_pane & (through >= SEEN_THROUGH)], sample(self.segments, self._resolution)
        walls = places[(past <= DOUBT * hit) & (askew > DOUBT * through)]
        lines = join_lines(draw_lines(places[glass], normals[glass], self._resolution), grid, walls)
        lengths = [math.dist(*line) + self._resolution for line in lines]  # from middle to middle of whole cells
        reach = [FARTHEST if length >= LENGTH else FRAME for length in lengths]
        turned = [turn_into_walls(line, grid, far) for line, far in zip(lines, reach, strict=True)]
        opened = self._open_along(turned, keyframes) if last else [places[no_pane]] * len(lines)
        segments = []
        for line, length, far, pane, against in zip(lines, lengths, reach, turned, opened, strict=True):
            long, widest = length >= LENGTH, WIDE if last else FRAME
            around = may_be, before, against, self._driven
            segment, ends = extend_line(pane, grid, *around, widest if long else FRAME, far)
            in_turns = length < ALONE and self._all_seen and self._in_turns(line)
            if not long and ends < 2 and in_turns:
                segment, ends = extend_line(pane, grid, *around, widest, WIDE)
            alone = (ends and length >= ALONE and not self._has_left(line, 1.0)) or (long and in_turns)
            if alone or (ends == 2 and (in_turns or self._was_open(line))):
                segments.append(segment)
        return without_covered(np.array(segments).reshape(-1, 2, 2))

    def _was_open(self, line: FloatArray) -> bool:
        """Check that a pane was gone through before it was hit, and until all has been seen once also after.

        Who stood there at first has left; who has come since may leave.
        """
        hits, throughs = (said.keyframes for said in self._said_along(line))
        if not (len(hits) and len(throughs)):
            return False
        return bool(throughs.min() < hits.max() and (self._all_seen or hits.min() < throughs.max()))

    def _in_turns(self, line: FloatArray) -> bool:
        """Check that many places of a short pane were hit, gone through and hit again.

        Who stands somewhere is hit for a while, and gone through before and after.
        """
        hits, throughs = self._said_along(line)
        first, last = np.full(len(self._asked), np.iinfo(np.int32).max), np.full(len(self._asked), -1)
        np.minimum.at(first, hits.places, hits.keyframes)
        np.maximum.at(last, hits.places, hits.keyframes)
        between = (throughs.keyframes > first[throughs.places]) & (throughs.keyframes < last[throughs.places])
        return len(np.unique(throughs.places[between])) > TURNS * len(np.unique(hits.places))

    def _said_along(self, line: FloatArray) -> tuple[Said, Said]:
        """List what says of places on a line that they are of glass: hits near the normal, views through them askew.

        Nothing where too much was seen through them near the normal, too: then somebody was there and left.
        """
        if self._has_left(line, GONE):
            return NOTHING_SAID, NOTHING_SAID
        said = self._said.kept(self._on(line)[self._said.places])
        return said.kept(said.codes == HIT_NEAR), said.kept(said.codes == PAST_OBLIQUE)

    def _has_left(self, line: FloatArray, most: float) -> bool:
        """Check that all along a line more was seen through near the normal than ``most`` of what was hit there."""
        hit, _, past, _ = self._counts[:, self._on(line)].sum(axis=1)
        return bool(past > most * max(hit, 1))

    def _on(self, line: FloatArray) -> BoolArray:
        """Mark the places that are asked about, shape (n,), on a line."""
        places = self._places[self._asked]
        return np.asarray(np.hypot(*(places - line[0]).T) + np.hypot(*(places - line[1]).T) < math.dist(*line) + DEPTH)

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
        said = self._witnesses.say(range(len(keyframes)), places, normals)
        hit, _, past, _ = said.count_viewpoints(self._witnesses.sensors, len(places))
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
