"""Lines of panes: places side by side that may be glass, joined, and let go on up to the wall that they stand in."""

import math
from collections.abc import Sequence

import cv2
import numpy as np

from closedrooms.core.arrays import BoolArray, FloatArray, IntArray
from closedrooms.core.grid import OccupancyGrid, is_occupied

ALONE, LENGTH, SHORT = 0.75, 0.45, 0.09
"""Shortest run of places that is a pane with a solid wall at one end, between two (a person is 0.4 m wide), and there
where it was open before [m]. Where no wall is it is what somebody who walked was seen along, unless it was hit, gone
through and hit again."""
FEWEST = 4
"""Fewest places of a pane."""
THICK = 0.12
"""Standard deviation across a pane up to which its cells are in line [m]: walls are seen from both sides."""
FRAME = 0.5
"""How far beyond what was hit a pane goes on up to the solid wall in its line [m]: less than a door is wide."""
WIDE = 1.5
"""The same once all has been seen [m]: of what is open somebody has seen by then that it is."""
MARGIN = 0.05
"""How far a pane goes on in any case [m]: a cell, or beams slip through between its end and the wall."""
BODY = 0.1
"""Distance from where the robot was up to which nothing stands [m]: no robot is narrower."""
FARTHEST = 2.0
"""How far beyond what was hit a pane goes on at most, all in all [m]; a short one only up to the next wall."""
MOST_TURNED = math.radians(10.0)
"""How far a pane may be turned into the line of the walls beside it [rad]: normals are known to some 8 degrees."""


def extend_line(
    line: FloatArray,
    grid: OccupancyGrid,
    may_be: FloatArray,
    before: FloatArray,
    no_pane: FloatArray,
    driven: FloatArray,
    widest: float,
    farthest: float,
) -> tuple[FloatArray, int]:
    """Let a pane go on up to the solid wall in its line, where nothing speaks against it.

    Args:
        line: Its ends as they were hit, shape (2, 2) [m].
        grid: The map.
        may_be: Places that may be on a pane, shape (n, 2) [m].
        before: Places on panes that were found before, shape (n, 2) [m]: what is drawn of a pane hides what it was
            drawn from.
        no_pane: Places that are not on a pane, shape (n, 2) [m].
        driven: Where the robot was, shape (n, 2) [m].
        widest: Gap in the line that is bridged [m].
        farthest: How far it goes on at most, all in all [m].

    Returns:
        Its ends, shape (2, 2) [m], and at how many of them there is a solid wall.
    """
    along = line[1] - line[0]
    along = along / np.hypot(*along)
    across = np.array([-along[1], along[0]])
    step = grid.frame.resolution
    steps = np.arange(step, farthest + step / 2.0, step)
    ends, walls = [], 0
    for end, direction in ((line[0], -along), (line[1], along)):
        places = end + steps[:, None] * direction
        against = _within(1.5 * step, places, no_pane) | _within(BODY, places, driven)
        on_pane, as_before = _within(step, places, may_be), _within(step, places, before)
        aside = _across(step)
        solid_beside = _solid(grid, places[:, None] + aside[:, None] * across)
        # Where the pane ends, a wall may stand behind it; further on it is in line.
        counts = (np.abs(aside) < 1.5 * step) | (steps[:, None] < FRAME)
        at_wall = np.asarray((solid_beside & counts).any(axis=1))
        solid, wall = 0.0, False
        for number, t in enumerate(steps.tolist()):
            if t - solid > widest or against[number]:
                break
            if on_pane[number]:
                solid = t
            elif at_wall[number]:
                solid, wall = t, True
            elif as_before[number]:
                solid = t
        ends.append(end + (solid + MARGIN) * direction)
        walls += wall
    return np.array(ends), walls


def _across(step: float) -> FloatArray:
    """List how far aside of a pane what is in line with it may be [m]: a wall may end at its back."""
    return np.asarray(np.arange(-round(THICK / step), round(THICK / step) + 1) * step, dtype=np.float64)


def turn_into_walls(line: FloatArray, grid: OccupancyGrid, reach: float) -> FloatArray:
    """Turn a pane about its middle, and shift it by up to a cell, so that most of what lies beyond its ends is wall.

    It stands in a wall, and places within half a metre do not tell its direction to a cell two metres on.

    Args:
        line: Its ends as they were hit, shape (2, 2) [m].
        grid: The map.
        reach: How far beyond its ends is looked at [m].

    Returns:
        Its ends, shape (2, 2) [m], two cells from where they were at most: as they were where no turn is better.
    """
    step = grid.frame.resolution
    middle, half = line.mean(axis=0), math.dist(*line) / 2.0
    most = min(math.atan2(step, half), MOST_TURNED)
    count = math.ceil(most * (half + reach) / step)
    turns = most * np.arange(-count, count + 1) / max(count, 1)
    turns = turns[np.argsort(np.abs(turns), kind="stable")]
    along = (line[1] - line[0]) / (2.0 * half)
    across = np.array([-along[1], along[0]])
    directions = np.cos(turns)[:, None] * along + np.sin(turns)[:, None] * across
    beyond = half + np.arange(step, reach + step / 2.0, step)
    middles = middle + np.array([0.0, -step, step])[:, None] * across
    places = middles[:, None, None] + np.concatenate((-beyond, beyond))[:, None] * directions[:, None]
    shift, turn = np.divmod(np.argmax(_solid(grid, places).sum(axis=2)), len(directions))
    return np.asarray(middles[shift] + np.outer([-half, half], directions[turn]))


def _solid(grid: OccupancyGrid, places: FloatArray) -> BoolArray:
    """Mark the places, shape (..., 2) [m], whose cell is occupied."""
    cells = grid.frame.to_cells(places)
    inside = grid.frame.contains(cells)
    cells[~inside] = 0
    return np.asarray(inside & is_occupied(grid.cells[cells[..., 0], cells[..., 1]]))


def _within(distance: float, places: FloatArray, others: FloatArray) -> BoolArray:
    """Mark the places, shape (n, 2), that have one of others, shape (m, 2), within a distance [m]."""
    low, high = places.min(axis=0) - distance, places.max(axis=0) + distance
    x, y = others[:, 0], others[:, 1]
    near = others[(x > low[0]) & (x < high[0]) & (y > low[1]) & (y < high[1])]
    within: BoolArray = (np.hypot(*(near[:, None] - places).transpose(2, 0, 1)) < distance).any(axis=0)
    return within


def without_covered(segments: FloatArray) -> FloatArray:
    """Leave out the panes, shape (n, 2, 2) [m], that lie along a longer one."""
    lengths = np.hypot(*(segments[:, 1] - segments[:, 0]).T)
    kept: list[int] = []
    for number in np.argsort(-lengths, kind="stable").tolist():
        for a, b in segments[kept]:
            along = b - a
            share = np.clip((segments[number] - a) @ along / (along @ along), 0.0, 1.0)
            if (np.hypot(*(segments[number] - a - share[:, None] * along).T) < THICK).all():
                break
        else:
            kept.append(number)
    return segments[sorted(kept)]


def sample(segments: FloatArray, step: float) -> FloatArray:
    """List places along panes, shape (n, 2, 2), at most ``step`` apart, shape (m, 2) [m]."""
    counts = np.ceil(np.hypot(*(segments[:, 1] - segments[:, 0]).T) / step).astype(np.int64).tolist()
    return np.concatenate(
        [np.zeros((0, 2)), *(np.linspace(a, b, n + 1) for (a, b), n in zip(segments, counts, strict=True))]
    )


def find_candidates(places: FloatArray, unasked: IntArray, resolution: float) -> IntArray:
    """List which of some places could be on a pane, or where one could go on: few are so many side by side.

    Args:
        places: All of them, shape (n, 2) [m].
        unasked: Indices of those that are in question, shape (m,).
        resolution: Size of a cell [m].
    """
    reach = FARTHEST + FRAME
    here = places[unasked]
    near = np.zeros(len(here), dtype=np.bool_)
    groups = _groups(places, resolution)
    order = np.argsort(groups, kind="stable")
    firsts = np.flatnonzero(np.diff(groups[order], prepend=-1))
    lows = np.minimum.reduceat(places[order], firsts, axis=0)
    highs = np.maximum.reduceat(places[order], firsts, axis=0)
    large = np.diff(firsts, append=len(groups)) >= FEWEST
    large &= np.hypot(*(highs - lows).T) >= SHORT
    for low, high in zip(lows[large], highs[large], strict=True):
        near |= ((here > low - reach) & (here < high + reach)).all(axis=1)
    return unasked[near]


def draw_lines(places: FloatArray, normals: FloatArray, resolution: float) -> list[FloatArray]:
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
        groups = _groups(places[chosen], resolution)
        for number in np.unique(groups):
            lines += _lines(places[chosen][groups == number], angles[chosen][groups == number])
    return lines


def join_lines(lines: Sequence[FloatArray], grid: OccupancyGrid, met: FloatArray) -> list[FloatArray]:
    """Join lines that go on in each other where something stands between them: a wall behind a pane parts it.

    Args:
        lines: Their ends, shape (2, 2) each [m].
        grid: The map.
        met: Places that are met at any angle: on a pane before the end of a wall, shape (n, 2) [m].
    """
    joined: list[FloatArray] = []
    for one in lines:
        line, number = one, 0
        while number < len(joined):
            both = _joint(line, joined[number], grid, met)
            if both is None:
                number += 1
            else:
                del joined[number]
                line, number = both, 0
        joined.append(line)
    return joined


def _joint(a: FloatArray, b: FloatArray, grid: OccupancyGrid, met: FloatArray) -> FloatArray | None:
    """Draw one line through two with something between them, ``None`` where they are not in line or nothing is.

    A wall that ends behind the pane is a cell or two from the line that the pane was met in, and not solid in it.
    """
    way = b.mean(axis=0) - a.mean(axis=0)
    far = math.hypot(*way)
    if far > (math.dist(*a) + math.dist(*b)) / 2.0 + FRAME + THICK:
        return None
    along = way / max(far, 1e-9)
    across = np.array([-along[1], along[0]])
    ends = np.concatenate((a, b))
    t = (ends - a.mean(axis=0)) @ along
    begin, end = t[:2].max(), t[2:].min()
    if not 0.0 < end - begin < FRAME or np.abs((ends - a.mean(axis=0)) @ across).max() > THICK:
        return None
    step = grid.frame.resolution
    between = a.mean(axis=0) + np.arange(begin, end, step)[:, None] * along
    solid = _solid(grid, between[:, None] + _across(step)[:, None] * across).any()
    if not solid and not _within(THICK, between, met).all():
        return None
    return np.asarray(ends[[np.argmin(t), np.argmax(t)]])


def _groups(places: FloatArray, resolution: float) -> IntArray:
    """Number places, shape (n,), by groups that hang together over gaps of at most four cells."""
    cells = np.floor(places / resolution).astype(np.int64)
    cells -= cells.min(axis=0) - 3
    mask = np.zeros(cells.max(axis=0) + 4, dtype=np.uint8)
    mask[cells[:, 0], cells[:, 1]] = 1
    _, labels = cv2.connectedComponents(cv2.dilate(mask, np.ones((5, 5), dtype=np.uint8)), connectivity=8)
    return np.asarray(labels)[cells[:, 0], cells[:, 1]].astype(np.int64)


def _lines(places: FloatArray, angles: FloatArray) -> list[FloatArray]:
    """Draw the line through places, or one along each face of a thick pane that was met on both."""
    middle = places.mean(axis=0)
    _, spread, axes = np.linalg.svd(places - middle, full_matrices=False)
    parts = [np.ones(len(places), dtype=np.bool_)]
    if spread[-1] / math.sqrt(len(places)) > THICK:
        front = (places - middle) @ axes[-1] < 0.0
        parts = [front, ~front]
        if max(float(np.std((places[part] - middle) @ axes[-1])) for part in parts) > THICK / 2.0:
            return []
    found = (_line(places[part], angles[part]) for part in parts)
    return [line for line in found if line is not None]


def _line(places: FloatArray, angles: FloatArray) -> FloatArray | None:
    """Draw the line through places, whose normals have these angles [rad], where they are in line and long enough."""
    if len(places) < FEWEST:
        return None
    middle = places.mean(axis=0)
    _, spread, axes = np.linalg.svd(places - middle, full_matrices=False)
    if spread[1] / math.sqrt(len(places)) > THICK:
        return None
    along = axes[0]
    if np.ptp((places - middle) @ along) < LENGTH:
        # So few places do not tell in which direction they lie.
        turn = np.arctan2(np.sin(2.0 * angles).mean(), np.cos(2.0 * angles).mean()) / 2.0
        along = np.array([-math.sin(turn), math.cos(turn)])
        across = np.array([math.cos(turn), math.sin(turn)])
        middle = middle + np.median((places - middle) @ across) * across
    t = (places - middle) @ along
    if np.ptp(t) < SHORT:
        return None
    return np.asarray(middle + np.outer([t.min(), t.max()], along))
