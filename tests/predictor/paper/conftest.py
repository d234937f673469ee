"""Faces between lines, doors between faces, and growths of random ones."""

import math

import numpy as np
import pytest
import shapely

from closedrooms.core.door import ClosedDoor
from closedrooms.predictor.paper.arrangement import build_arrangement
from closedrooms.predictor.paper.expansion import Growth
from closedrooms.predictor.paper.initial_faces import enter_face
from closedrooms.predictor.paper.lines import Line


class _Faces:
    @staticmethod
    def cut(xs, ys, slanted=(), size=20.0):
        """The faces of a box, ``size`` to every side, between vertical lines at xs and horizontal ones at ys."""
        box = [Line(a, o, "border") for a in (0.0, math.pi / 2) for o in (-size, size)]
        upright = [Line(math.pi / 2, -float(x)) for x in xs] + [Line(0.0, float(y)) for y in ys]
        return build_arrangement([*upright, *slanted], box)

    @staticmethod
    def at(arrangement, x, y):
        """The face that holds a point."""
        return next(i for i, face in enumerate(arrangement.faces) if face.contains(shapely.Point(x, y)))

    @classmethod
    def entrance(cls, arrangement, name, behind, before):
        """A door in the middle of the edge between the faces at two points."""
        face, other = cls.at(arrangement, *behind), cls.at(arrangement, *before)
        edge = arrangement.neighbours[face][other]
        return enter_face(arrangement, ClosedDoor(name, tuple(arrangement.edges[edge].mean(axis=0))), edge, face)

    @classmethod
    def growth(cls, seed, count):
        """Up to so many doors among faces of which three in four are unknown."""
        rng = np.random.default_rng(seed)
        cuts = [np.sort(rng.choice(np.arange(-18, 19, 3), size=rng.integers(3, 7), replace=False)) for _ in range(2)]
        slanted = [Line(float(rng.uniform(0, np.pi)), float(rng.uniform(-8, 8))) for _ in range(2)]
        arrangement = cls.cut(*cuts, slanted)
        unknown = rng.random(len(arrangement.faces)) < 0.75
        entrances = []
        for face in rng.permutation(np.flatnonzero(unknown))[:count]:
            other, edge = next(iter(arrangement.neighbours[int(face)].items()))
            if other not in {e.face for e in entrances}:
                middle = tuple(arrangement.edges[edge].mean(axis=0))
                entrances.append(enter_face(arrangement, ClosedDoor(f"d{face}", middle), edge, int(face)))
        return Growth(arrangement, unknown, entrances)


@pytest.fixture(scope="session")
def faces():
    """Functions that cut a box into faces and put doors between them."""
    return _Faces
