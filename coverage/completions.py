"""What the rooms behind closed doors may be, drawn jointly from what a prediction thinks of each.

A predicted room is its own shape, one of its alternatives, or nothing. How probable each is by itself, the prediction
says; jointly, rooms do not overlap. Draws come from Gibbs sampling: room by room, given all others.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from closedrooms.core.arrays import BoolArray, FloatArray, IntArray
from closedrooms.core.grid import OccupancyGrid
from closedrooms.core.room import Room
from closedrooms.core.shapes import Shape, fill_shape

# Two shapes exclude each other when they share more than this of the smaller one: outlines are off by a wall or two.
SHARED = 0.1
# How much less probable a pair that excludes each other is. Not 0: methods whose rooms overlap have no other start.
EXCLUDED = 1e-3
# Rounds over all rooms before the first draw, and between two draws.
FIRST, BETWEEN = 20, 5


@dataclass(frozen=True, slots=True, eq=False)
class Possibilities:
    """Shapes that one room may have, with their probabilities.

    Attributes:
        room: As predicted.
        shapes: Its own, its alternatives, and ``None`` for no room at all.
        chances: Of each by itself, shape (len(shapes),); they sum to 1.
    """

    room: Room
    shapes: tuple[Shape | None, ...]
    chances: FloatArray


def list_possibilities(room: Room, probability: OccupancyGrid | None) -> Possibilities:
    """List what a room may be.

    Its alternatives have their probabilities, and its own shape the rest. That there is no room has what is left of the
    most probable cell of its shape: where there is any room, that cell is free.

    Args:
        room: With its alternatives.
        probability: Of each cell to be free [percent]; without it there is a room for certain.
    """
    others = np.array([other.probability for other in room.alternatives])
    others = others / max(float(others.sum()), 1.0)
    none = 0.0 if probability is None else _find_none(room.polygon, probability)
    chances = np.array([(1.0 - others.sum()) * (1.0 - none), *(others * (1.0 - none)), none])
    shapes = (room.polygon, *(other.polygon for other in room.alternatives), None)
    return Possibilities(room, shapes, chances)


def _find_none(shape: Shape, probability: OccupancyGrid) -> float:
    """Find the probability that there is no room: 0 where the map knows all of its cells."""
    frame = probability.frame
    inside = np.zeros(frame.shape, dtype=np.bool_)
    fill_shape(shape, frame, inside)
    percent = probability.cells[inside]
    percent = percent[percent >= 0]
    return 1.0 - float(percent.max()) / 100.0 if percent.size else 0.0


def sample_rooms(possible: Sequence[Possibilities], count: int, rng: np.random.Generator) -> Iterator[list[int]]:
    """Draw what all rooms together may be.

    Args:
        possible: One a room.
        count: Number of draws.
        rng: Of the draws.

    Yields:
        Which of its possibilities each room is, an index a room.
    """
    owner = np.repeat(np.arange(len(possible)), [len(own.shapes) for own in possible])
    first = np.searchsorted(owner, np.arange(len(possible)))
    excluded = _find_excluded([shape for own in possible for shape in own.shapes], owner)
    state = first.copy()
    for number in range(count):
        for _ in range(BETWEEN if number else FIRST):
            for room in rng.permutation(len(possible)).tolist():
                own = slice(int(first[room]), int(first[room]) + len(possible[room].shapes))
                met = excluded[own][:, np.delete(state, room)].sum(axis=1)
                weights = possible[room].chances * EXCLUDED**met
                state[room] = own.start + int(rng.choice(len(weights), p=weights / weights.sum()))
        yield (state - first).tolist()


def _find_excluded(shapes: Sequence[BaseGeometry | None], owner: IntArray) -> BoolArray:
    """Find the shapes of different rooms that overlap by more than walls, shape (n, n)."""
    excluded = np.zeros((len(shapes), len(shapes)), dtype=np.bool_)
    solid = np.array([shapely.Polygon() if shape is None else shape for shape in shapes], dtype=object)
    if not len(solid):
        return excluded
    a, b = shapely.STRtree(solid).query(solid, predicate="intersects")
    apart = owner[a] != owner[b]
    a, b = a[apart], b[apart]
    area = shapely.area(solid)
    shared = shapely.area(shapely.intersection(solid[a], solid[b]))
    excluded[a, b] = shared > SHARED * np.minimum(area[a], area[b])
    return excluded
