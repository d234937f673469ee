"""Closed doors proposed from the occupancy grid alone.

A closed leaf is thinner than its wall and stands back from the wall's face. Seen from the free side, the face steps
back at one jamb, runs straight over the width of a door, and steps forward again at the other; behind the leaf all is
unknown, and wide enough for a room. Faces are looked at as profiles: depth of the face over the distance along the
wall, one profile for each wall direction and each line of faces. A piece of a profile that lies back is a candidate;
how clearly it does so against the roughness of the face, and how complete the face is there, make its score; rows of
windows, and what is in the back wall of a row of rooms, score low.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from closedrooms.core.arrays import BoolArray, FloatArray, IntArray
from closedrooms.core.door import Point, Segment
from closedrooms.core.grid import OccupancyGrid, is_free, is_known
from closedrooms.predictor.structure.door_proposal_config import ProposalConfig
from closedrooms.predictor.structure.room_rows import LEAST_IN_ROW, count_rooms_in_row
from closedrooms.predictor.structure.wall_directions import find_wall_directions
from closedrooms.predictor.structure.wall_faces import WallFaces, find_faces
from closedrooms.predictor.structure.window_rows import Niche, find_window_rows

# Faces belong to a wall whose free side is within this of theirs [rad].
ALIKE = math.radians(30.0)
# A line of faces needs this much wall beside the leaf and this much set back [m].
LEAST_WALL, LEAST_LEAF = 0.20, 0.35
# Share of the width of a leaf over which its face was seen at least.
LEAST_SEEN = 0.70
# Roughness below which a face is as smooth as a grid can show it [m].
SMOOTH = 0.01
# Contrast (recess over roughness) below which nothing is looked at any closer.
LEAST_CONTRAST = 1.3
# Score: logistic regression of log(contrast) and share of the leaf's face that was seen, fitted on every other bundled
# world (office-01, -03, ... school-08) at medium noise by benchmarks/quality/door_proposals.py.
INTERCEPT, PER_CONTRAST, PER_SEEN = -10.87, 3.04, 8.37
# Share of its score that a window keeps: the clearest niche, at 0.99, ends below everything that is proposed.
WINDOW = 0.2
# A wall and what noise put behind it take so many cells behind a leaf.
WALL_CELLS = 4.0
# Share of a room that the map may know by mistake.
STRAY = 0.10
# Candidates that overlap by more than this share of the narrower one are the same door.
OVERLAP = 0.3


@dataclass(frozen=True, slots=True)
class DoorProposal:
    """A place that looks like a closed door.

    Attributes:
        segment: The two jambs on the leaf's face, map frame [m].
        width: From jamb to jamb [m].
        score: How much it looks like a door, 0..1.
        recess: How far the leaf stands back from the wall's face [m].
        rough: Standard deviation of leaf and wall about their own depths [m].
        seen: Share of the leaf's width over which its face was seen, 0..1.
    """

    segment: Segment
    width: float
    score: float
    recess: float
    rough: float
    seen: float

    @property
    def midpoint(self) -> Point:
        """Middle between the jambs, map frame [m]."""
        (x0, y0), (x1, y1) = self.segment
        return ((x0 + x1) / 2, (y0 + y1) / 2)


@dataclass(frozen=True, slots=True, eq=False)
class _Line:
    """Depth of the face along one line of a wall, in the frame (along, outward) of its direction.

    Attributes:
        along: Unit vector along the wall.
        outward: Unit vector to the free side.
        start: Coordinate along the wall of the middle of the first bin [m].
        face: Coordinate across the wall of the line [m].
        depth: Of the face against the line, one value a bin of one cell, negative is set back, 0 where unseen [m].
        seen: Bins in which there is a face.
    """

    along: FloatArray
    outward: FloatArray
    start: float
    face: float
    depth: FloatArray
    seen: BoolArray


@dataclass(frozen=True, slots=True, eq=False)
class _Recesses:
    """Pieces of one line that lie back; arrays of shape (n,), lengths in metres, bins counted from the line's first."""

    first: IntArray
    bins: IntArray
    recess: FloatArray
    rough: FloatArray
    leaf: FloatArray
    seen: FloatArray


def propose_doors(grid: OccupancyGrid, config: ProposalConfig | None = None) -> tuple[DoorProposal, ...]:
    """Find places of the map that look like closed doors, the best first.

    Args:
        grid: The map.
        config: Width, recess, and the score below which a proposal is left out.

    Returns:
        Proposals that do not overlap; empty where no wall is seen.
    """
    config = config or ProposalConfig()
    bounds = grid.known_bounds()
    if bounds is None:
        return ()
    grid = grid.on(grid.frame.cropped(*bounds))
    directions = find_wall_directions(grid)
    if directions is None:
        return ()
    lines = _lines(find_faces(grid), directions.angles, grid.frame.resolution, config)
    found = [pair for line in lines for pair in _on_line(grid, line, config)]
    found.sort(key=lambda pair: (-pair[0].score, pair[0].segment))
    kept: list[tuple[DoorProposal, Niche]] = []
    for proposal, niche in found:
        if all(
            math.dist(proposal.midpoint, other.midpoint) > max(proposal.width, other.width) / 2 for other, _ in kept
        ):
            kept.append((proposal, niche))
    windows = find_window_rows(grid, [niche for _, niche in kept]).tolist()
    scored = []
    for (proposal, niche), window in zip(kept, windows, strict=True):
        # What would be left out anyhow is not looked at.
        likely = proposal.score >= config.min_score
        if window or (likely and count_rooms_in_row(grid, niche) >= LEAST_IN_ROW):
            scored.append(replace(proposal, score=WINDOW * proposal.score))
        else:
            scored.append(proposal)
    scored.sort(key=lambda proposal: (-proposal.score, proposal.segment))
    return tuple(proposal for proposal in scored if proposal.score >= config.min_score)


def _lines(faces: WallFaces, directions: FloatArray, resolution: float, config: ProposalConfig) -> Iterator[_Line]:
    """Find every line of faces on which a leaf might be set back, for every wall direction and both sides of walls."""
    for direction in directions.tolist():
        for angle in (direction + quarter * math.pi / 2 for quarter in range(4)):
            outward = np.array([math.cos(angle), math.sin(angle)])
            along = np.array([outward[1], -outward[0]])
            alike = np.abs(np.mod(faces.angles - angle + np.pi, 2 * np.pi) - np.pi) < ALIKE
            points = faces.points[alike & (faces.outward @ outward > 0.3)]
            if not len(points):
                continue
            s, t = points @ along, points @ outward
            order = np.argsort(t, kind="stable")
            s, t = s[order], t[order]
            # Bins are centred on the cells: on their borders, rounding would leave every other one empty.
            bins = np.floor((s - s.min()) / resolution + 0.5).astype(np.int64)
            for face in np.arange(t[0], t[-1] + resolution, resolution):
                low, mid, high = np.searchsorted(
                    t, (face - config.max_recess - resolution, face - 0.3 * resolution, face + 0.8 * resolution)
                )
                if (high - mid) * resolution < LEAST_WALL or (mid - low) * resolution < LEAST_LEAF:
                    continue
                first = int(bins[low:high].min())
                depth = np.full(int(bins[low:high].max()) - first + 1, -np.inf)
                np.maximum.at(depth, bins[low:high] - first, t[low:high] - face)
                seen = np.isfinite(depth)
                start = float(s.min()) + first * resolution
                yield _Line(along, outward, start, float(face), np.where(seen, depth, 0.0), seen)


def _on_line(grid: OccupancyGrid, line: _Line, config: ProposalConfig) -> Iterator[tuple[DoorProposal, Niche]]:
    """Find proposals on one line that have free cells in front and unknown ones behind, where a room has room."""
    resolution = grid.frame.resolution
    found = _recesses(line, resolution, config)
    for i in _best(found):
        low = line.start + (float(found.first[i]) - 0.5) * resolution
        high = low + float(found.bins[i]) * resolution
        leaf = line.face + found.leaf[i]
        unknown, free = _around(grid, line, low, high, leaf, config)
        if unknown < config.min_unknown or free < 0.5 or not _has_room_behind(grid, line, low, high, leaf, config):
            continue
        contrast = found.recess[i] / math.hypot(found.rough[i], SMOOTH)
        logit = INTERCEPT + PER_CONTRAST * math.log(contrast) + PER_SEEN * found.seen[i]
        a, b = (low * line.along + leaf * line.outward, high * line.along + leaf * line.outward)
        segment = ((float(a[0]), float(a[1])), (float(b[0]), float(b[1])))
        score = 1.0 / (1.0 + math.exp(-logit))
        figures = (float(found.recess[i]), float(found.rough[i]), float(found.seen[i]))
        middle = (low + high) / 2.0 * line.along + leaf * line.outward
        niche = Niche(middle, line.outward, high - low, float(found.recess[i]))
        yield DoorProposal(segment, high - low, score, *figures), niche


def _recesses(line: _Line, resolution: float, config: ProposalConfig) -> _Recesses:
    """Find for every first bin the width over which the face lies back most clearly.

    The face inside is compared with ``config.jamb`` metres beside each jamb; the bins at the jambs themselves belong
    to neither.
    """
    beside = max(2, round(config.jamb / resolution))
    narrowest = max(3, math.ceil(config.min_width / resolution - 1e-6))
    widest = math.floor(config.max_width / resolution + 1e-6)
    size = line.seen.size
    # Running sums of how many, depth and depth squared, with room for every window that reaches over an end.
    before, after = beside + 1, widest + beside + 1
    values = np.stack((line.seen.astype(np.float64), line.depth, line.depth**2))
    sums = np.cumsum(np.pad(values, ((0, 0), (before + 1, after))), axis=1)

    # Where nothing is seen beside the left jamb there is none: of a line through a large map, nearly everywhere.
    first = np.flatnonzero(sums[0, before - 1 :][:size] - sums[0, before - 1 - beside :][:size] >= 2)

    def window(low: int, high: int) -> FloatArray:
        """Add up each of the three sums over the bins from ``first + low`` up to ``first + high``, shape (3, n)."""
        return np.asarray(sums[:, first + before + high] - sums[:, first + before + low])

    columns, gains = [], []
    for bins in range(narrowest, widest + 1):
        n, total, squares = window(1, bins - 1)
        n_left, left, squares_left = window(-1 - beside, -1)
        n_right, right, squares_right = window(bins + 1, bins + 1 + beside)
        with np.errstate(divide="ignore", invalid="ignore"):
            leaf = total / n
            wall, n_wall = (left + right) / (n_left + n_right), n_left + n_right
            recess = np.minimum(left / n_left, right / n_right) - leaf
            spread = squares - n * leaf**2 + squares_left + squares_right - n_wall * wall**2
            rough = np.sqrt(np.maximum(spread, 0.0) / (n + n_wall))
            # What is gained by telling leaf and wall apart, as a sum of squares: largest at the true jambs.
            gain = n * n_wall / (n + n_wall) * (wall - leaf) ** 2
            good = (
                (n >= LEAST_SEEN * (bins - 2)) & (np.minimum(n_left, n_right) >= 2) & (first + bins <= size)
                & (recess >= config.min_recess) & (recess <= config.max_recess)
                & (recess >= LEAST_CONTRAST * np.hypot(rough, SMOOTH)) & (np.abs(wall) <= resolution)
            )  # fmt: skip
        columns.append((np.full(first.size, bins), recess, rough, leaf, n / (bins - 2)))
        gains.append(np.where(good, gain, -np.inf))
    if not (gains and first.size):
        return _Recesses(first[:0], first[:0], *[np.zeros(0)] * 4)
    table = np.array(gains)  # (widths, n)
    width = table.argmax(axis=0)
    there = np.flatnonzero(np.isfinite(table.max(axis=0)))
    there = there[np.argsort(-table[width[there], there], kind="stable")]
    bins_, recess_, rough_, leaf_, seen_ = (np.array([c[k] for c in columns])[width[there], there] for k in range(5))
    return _Recesses(first[there], bins_.astype(np.int64), recess_, rough_, leaf_, seen_)


def _best(found: _Recesses) -> list[int]:
    """Keep recesses that do not overlap a clearer one; ``found`` is sorted, the clearest first."""
    kept: list[int] = []
    for i in range(found.first.size):
        low, high = found.first[i], found.first[i] + found.bins[i]
        apart = (
            min(high, found.first[k] + found.bins[k]) - max(low, found.first[k])
            < OVERLAP * min(found.bins[i], found.bins[k])
            for k in kept
        )
        if all(apart):
            kept.append(i)
    return kept


def _around(
    grid: OccupancyGrid, line: _Line, low: float, high: float, leaf: float, config: ProposalConfig
) -> tuple[float, float]:
    """Measure the shares of unknown cells behind a leaf (outside the map counts) and of free cells in front of it."""
    frame, resolution = grid.frame, grid.frame.resolution
    s = np.arange(low + 1.5 * resolution, high - resolution, resolution)

    def cells_at(t: FloatArray) -> tuple[IntArray, BoolArray]:
        points = (s[:, None, None] * line.along + t[None, :, None] * line.outward).reshape(-1, 2)
        cells = frame.to_cells(points)
        inside = frame.contains(cells)
        return cells[inside], inside

    # The leaf itself and what noise put behind it take three cells.
    steps = np.arange(1, max(2, round(config.depth / resolution)), dtype=np.float64) * resolution
    behind, inside = cells_at(leaf - 2.0 * resolution - steps)
    unknown = np.count_nonzero(~is_known(grid.cells[behind[:, 0], behind[:, 1]])) + (~inside).sum()
    front, there = cells_at(leaf + steps)
    free = np.count_nonzero(is_free(grid.cells[front[:, 0], front[:, 1]]))
    return float(unknown / max(inside.size, 1)), float(free / max(there.size, 1))


def _has_room_behind(
    grid: OccupancyGrid, line: _Line, low: float, high: float, leaf: float, config: ProposalConfig
) -> bool:
    """Check whether a square room of ``config.min_room`` [m] fits into the unknown, the leaf in its near side.

    What the map knows behind the wall, free or occupied, leaves no room; outside of the map all is unknown.
    """
    frame, resolution = grid.frame, grid.frame.resolution
    side = config.min_room
    if side <= 0.0:
        return True
    # Half of the leaf at least lies in the room's side.
    s = np.arange((low + high) / 2.0 - side, (low + high) / 2.0 + side, resolution)
    t = leaf - WALL_CELLS * resolution - np.arange(0.0, side, resolution)
    cells = frame.to_cells(s[:, None, None] * line.along + t[None, :, None] * line.outward)
    inside = frame.contains(cells)
    known = np.zeros(inside.shape, dtype=np.bool_)
    known[inside] = is_known(grid.cells[cells[inside][:, 0], cells[inside][:, 1]])
    # A few cells are what noise put behind the wall.
    width = max(round(side / resolution), 1)
    count = np.concatenate(([0], np.cumsum(known.sum(axis=1))))
    return bool((count[width:] - count[:-width] <= STRAY * width * t.size).any())
