"""How thick the walls of a map are (preset ``best``)."""

from dataclasses import dataclass

import numpy as np

from closedrooms.core.arrays import BoolArray, IntArray
from closedrooms.predictor.best.frame import TurnedMap, laid_out, wall_faces

# Walls thicker than this are no walls but shafts [cells], 0.95 m.
THICKEST = 19
# Both sides of a wall show this much free space across [cells], 0.4 m: less is a speck inside a smeared wall.
CLEAR = 8
# Thickness where too few walls were seen from both sides [cells], 0.2 m: usual for inner walls.
DEFAULT, FEWEST = 4, 20
# Rows of cells looked at at once.
STRIP = 512
# No wall is thinner [cells].
THINNEST = 2


@dataclass(frozen=True, slots=True)
class WallThickness:
    """Thickness of the walls of a map [cells].

    Attributes:
        usual: Half of all wall is thinner: what a wall that was not seen is expected to have.
        least: A quarter of all wall is thinner: what is left of a room that lies behind a wall has at least this.
    """

    usual: int
    least: int


def wall_thickness(turned: TurnedMap) -> WallThickness:
    """Of the walls seen from both sides, by their length."""
    counts = np.zeros(THICKEST + 1, dtype=np.int64)
    for free, known in ((turned.free, turned.known), (turned.free.T, turned.known.T)):
        for row in range(0, len(free), STRIP):
            strip = slice(row, row + STRIP)
            counts += _thicknesses(laid_out(free[strip]), laid_out(known[strip]))
    if counts.sum() < FEWEST:
        return WallThickness(DEFAULT, DEFAULT)
    least, usual = np.searchsorted(np.cumsum(counts), counts.sum() * np.array([0.25, 0.5]))
    return WallThickness(max(int(usual), THINNEST), max(int(least), THINNEST))


def _thicknesses(free: BoolArray, known: BoolArray) -> IntArray:
    """Cells of wall by thickness, across the columns."""
    rows, cols = free.shape
    right, left = wall_faces(free, known), wall_faces(free[:, ::-1], known[:, ::-1])[:, ::-1]
    total = np.zeros((rows, cols + 1), dtype=np.int32)
    np.cumsum(free, axis=1, out=total[:, 1:])
    before, after = np.zeros_like(right), np.zeros_like(left)
    before[:, CLEAR:] = total[:, CLEAR:] - total[:, :-CLEAR] == CLEAR
    after[:, :-CLEAR] = total[:, CLEAR:] - total[:, :-CLEAR] == CLEAR
    right, left = right & before, left & after
    counts = np.zeros(THICKEST + 1, dtype=np.int64)
    row, col = np.nonzero(right)
    for thick in range(1, THICKEST + 1):
        inside = col + thick <= cols
        r, c = row[inside], col[inside]
        counts[thick] = (left[r, c + thick] & (total[r, c + thick] == total[r, c])).sum()
    return counts
