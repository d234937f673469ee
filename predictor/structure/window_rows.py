"""Which places that look like closed doors are windows: niches of one kind in a row along a wall.

A leaf and the sill of a window both stand back from the face of their wall, and behind both all is unknown. Two things
tell rows of windows: each door leads to a room, so that doors do not follow each other at less than the width of a
room; and doors in a row are those of a corridor, while windows in a row light a room, which is deeper.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from closedrooms.core.arrays import BoolArray, FloatArray
from closedrooms.core.grid import OccupancyGrid, is_free
from closedrooms.core.median import median

# So many alike make a row; where they are uneven, five.
LEAST_IN_ROW = 3
# Niches of one row: their directions [rad], faces, widths and recesses [m] differ by no more than this.
TURNED, SHIFTED, WIDER, DEEPER = math.radians(5.0), 0.12, 0.25, 0.06
# Spacings of an even row are whole multiples (one or two: one was not seen) of a step, up to this share of it.
UNEVEN = 0.15
# Doors to rooms of their own are farther apart [m]; the narrowest rooms of the bundled worlds measure 2.0 m.
NARROWEST_ROOM = 2.1
# Windows are no farther apart [m]: at that, a row may be the doors of any rooms.
WIDEST_STEP = 5.0
# What is deeper in front is a room, not a corridor [m]; corridors of the bundled worlds measure 1.8 to 3.0 m.
WIDEST_CORRIDOR = 3.2


@dataclass(frozen=True, slots=True, eq=False)
class Niche:
    """A piece of a wall's face that stands back.

    Attributes:
        middle: On its face, map frame [m], shape (2,).
        outward: Unit vector to the free side.
        width: [m].
        recess: [m].
    """

    middle: FloatArray
    outward: FloatArray
    width: float
    recess: float


def find_window_rows(grid: OccupancyGrid, niches: Sequence[Niche]) -> BoolArray:
    """Find which of some niches stand in a row of windows, shape (n,).

    Args:
        grid: The map.
        niches: All that was found, good doors or not.
    """
    windows = np.zeros(len(niches), dtype=np.bool_)
    if len(niches) < LEAST_IN_ROW:
        return windows
    for line in _lines(niches):
        spacings = _spacings(niches, line)
        for row in _runs(line, spacings, lambda run: bool(run.max() < NARROWEST_ROOM)):
            windows[row] = True
        for row in _runs(line, spacings, _lights_a_room):
            depths = [_depth_in_front(grid, niches[number]) for number in row]
            windows[row] |= median(depths) > WIDEST_CORRIDOR
    return windows


def _lines(niches: Sequence[Niche]) -> list[list[int]]:
    """Group niches of one kind on one line of a wall: numbers, in order along it; every niche on one line at most."""
    left = set(range(len(niches)))
    lines = []
    for first, one in enumerate(niches):
        if first not in left:
            continue
        alike = [
            number
            for number in sorted(left)
            if float(niches[number].outward @ one.outward) > math.cos(TURNED)
            and abs(float((niches[number].middle - one.middle) @ one.outward)) <= SHIFTED
            and abs(niches[number].width - one.width) <= WIDER
            and abs(niches[number].recess - one.recess) <= DEEPER
        ]
        if len(alike) >= LEAST_IN_ROW:
            along = np.array([one.outward[1], -one.outward[0]])
            places = [float(niches[number].middle @ along) for number in alike]
            lines.append([alike[position] for position in np.argsort(places, kind="stable")])
            left -= set(alike)
    return lines


def _spacings(niches: Sequence[Niche], line: list[int]) -> FloatArray:
    """Measure the distances between neighbours [m]."""
    middles = np.array([niches[number].middle for number in line])
    spacings: FloatArray = np.hypot(*np.diff(middles, axis=0).T)
    return spacings


def _runs(line: list[int], spacings: FloatArray, holds: Callable[[FloatArray], bool]) -> list[list[int]]:
    """Find the longest pieces of a line, from its beginning on, of whose spacings something holds."""
    runs, first = [], 0
    while first <= len(line) - LEAST_IN_ROW:
        lasts = [last for last in range(first + LEAST_IN_ROW - 1, len(line)) if holds(spacings[first:last])]
        if lasts:
            runs.append(line[first : lasts[-1] + 1])
        first = lasts[-1] if lasts else first + 1
    return runs


def _lights_a_room(spacings: FloatArray) -> bool:
    """Check whether a row is one of windows if what they light is a room: evenly spaced, or five of them."""
    many = len(spacings) >= 4 and float(spacings.max()) <= WIDEST_STEP
    return many or (float(spacings.min()) <= WIDEST_STEP and _even(spacings))


def _even(spacings: FloatArray) -> bool:
    """Check whether spacings are all one step or two, as those of windows are."""
    step = float(spacings.min())
    times = np.round(spacings / step)
    return bool((times <= 2).all() and (np.abs(spacings - times * step) <= UNEVEN * step).all())


def _depth_in_front(grid: OccupancyGrid, niche: Niche) -> float:
    """Measure from a niche across free cells to whatever comes next [m]; the median over its width."""
    resolution = grid.frame.resolution
    along = np.array([niche.outward[1], -niche.outward[0]])
    across = np.linspace(-0.3, 0.3, 5)[:, None] * niche.width * along
    # The face itself and what noise put before it take two cells.
    away = np.arange(2.5 * resolution, 2.0 * WIDEST_CORRIDOR, resolution / 2.0)
    points = niche.middle + across[:, None, :] + away[None, :, None] * niche.outward
    cells = grid.frame.to_cells(points)
    inside = grid.frame.contains(cells)
    free = np.zeros(inside.shape, dtype=np.bool_)
    free[inside] = is_free(grid.cells[cells[inside][:, 0], cells[inside][:, 1]])
    ends = np.where(free.all(axis=1), away[-1], away[np.argmin(free, axis=1)])
    return median(ends)
