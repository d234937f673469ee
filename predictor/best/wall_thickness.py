"""How thick the walls of a map are (method ``best``)."""

from dataclasses import dataclass

import numpy as np

from closedrooms.core.arrays import BoolArray, IntArray
from closedrooms.predictor.best.door_frame import FACE_DEPTH, STRIP, TurnedMap
from closedrooms.predictor.best.lattice import in_cells
from closedrooms.predictor.structure.wall_faces import find_face_edges, lay_out

# Walls thicker than this are no walls but shafts [cells].
THICKEST = in_cells(0.95)
# Both sides of a wall show this much free space across [cells]: less is a speck inside a smeared wall.
CLEAR = in_cells(0.4)
# Thickness where less wall than FEWEST was seen from both sides [cells]: usual for inner walls.
DEFAULT, FEWEST = in_cells(0.2), in_cells(1.0)
# No wall is thinner [cells].
THINNEST = in_cells(0.1)


@dataclass(frozen=True, slots=True)
class WallThickness:
    """Thickness of the walls of a map [cells].

    Attributes:
        usual: Half of all wall is thinner: what a wall that was not seen is expected to have.
        least: A quarter of all wall is thinner: what is left of a room that lies behind a wall has at least this.
    """

    usual: int
    least: int


NOT_MEASURED = WallThickness(DEFAULT, DEFAULT)


def measure_walls(turned: TurnedMap) -> WallThickness:
    """Measure the walls seen from both sides, by their length."""
    counts = np.zeros(THICKEST + 1, dtype=np.int64)
    for free, known in ((turned.free, turned.known), (turned.free.T, turned.known.T)):
        for row in range(0, len(free), STRIP):
            strip = slice(row, row + STRIP)
            counts += _count(lay_out(free[strip]), lay_out(known[strip]))
    if counts.sum() < FEWEST:
        return NOT_MEASURED
    least, usual = np.searchsorted(np.cumsum(counts), counts.sum() * np.array([0.25, 0.5]))
    return WallThickness(max(int(usual), THINNEST), max(int(least), THINNEST))


def _count(free: BoolArray, known: BoolArray) -> IntArray:
    """Count cells of wall by thickness, across the columns."""
    right = find_face_edges(free, known, depth=FACE_DEPTH)
    left = find_face_edges(free[:, ::-1], known[:, ::-1], depth=FACE_DEPTH)[:, ::-1]
    # Runs of free cells from edge to edge; a wall lies between one and the next of its row.
    padded = np.pad(free, ((0, 0), (1, 1)))
    starts, ends = np.flatnonzero(padded[:, 1:] != padded[:, :-1]).reshape(-1, 2).T
    clear = ends - starts >= CLEAR
    before, after = clear[:-1] & right.ravel()[ends[:-1]], clear[1:] & left.ravel()[starts[1:]]
    row = starts // right.shape[1]
    thick = (starts[1:] - ends[:-1])[before & after & (row[1:] == row[:-1])]
    return np.bincount(thick[thick <= THICKEST], minlength=THICKEST + 1)
