"""How thick the walls of a map are (method ``best``)."""

from dataclasses import dataclass

import numpy as np

from closedrooms.core.arrays import BoolArray, IntArray
from closedrooms.predictor.best.door_frame import STRIP, TurnedMap, laid_out, wall_faces

# Walls thicker than this are no walls but shafts [cells], 0.95 m.
THICKEST = 19
# Both sides of a wall show this much free space across [cells], 0.4 m: less is a speck inside a smeared wall.
CLEAR = 8
# Thickness where too few walls were seen from both sides [cells], 0.2 m: usual for inner walls.
DEFAULT, FEWEST = 4, 20
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
    right, left = wall_faces(free, known), wall_faces(free[:, ::-1], known[:, ::-1])[:, ::-1]
    # Runs of free cells from edge to edge; a wall lies between one and the next of its row.
    padded = np.pad(free, ((0, 0), (1, 1)))
    starts, ends = np.flatnonzero(padded[:, 1:] != padded[:, :-1]).reshape(-1, 2).T
    clear = ends - starts >= CLEAR
    before, after = clear[:-1] & right.ravel()[ends[:-1]], clear[1:] & left.ravel()[starts[1:]]
    row = starts // right.shape[1]
    thick = (starts[1:] - ends[:-1])[before & after & (row[1:] == row[:-1])]
    return np.bincount(thick[thick <= THICKEST], minlength=THICKEST + 1)
