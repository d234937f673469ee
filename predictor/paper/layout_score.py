"""The evaluation functions of a layout (paper, section 3.4), as printed and as the authors' logs show them."""

from dataclasses import dataclass

import numpy as np
import shapely

from closedrooms.core.arrays import BoolArray, FloatArray, IntArray
from closedrooms.predictor.config import Phi, Weights
from closedrooms.predictor.paper.arrangement import Arrangement


@dataclass(frozen=True, slots=True, eq=False)
class Terms:
    """Quantities of k layouts that the evaluation functions are made of (paper, section 3.4); fields of shape (k,).

    Attributes:
        area: Area [m2].
        hull: Area of the convex hull [m2].
        faces: Number of faces.
        free_edges: Number of face edges shared with an unknown face of no room.
        free_length: Length of those edges [m].
        contour: Length of the external contour [m].
        two_free: Number of faces with exactly two free edges.
        more_free: Number of faces with three or more free edges.
        proportion: Long side over short side of the bounding box along the door's edge.
    """

    area: FloatArray
    hull: FloatArray
    faces: FloatArray
    free_edges: FloatArray
    free_length: FloatArray
    contour: FloatArray
    two_free: FloatArray
    more_free: FloatArray
    proportion: FloatArray


def free_faces_penalty(terms: Terms, phi: Phi) -> FloatArray:
    """Compute ``FFP``: a face with two free edges counts 1; with three, 1 as printed and 5 as the logs show."""
    return terms.two_free + (5.0 if phi == "as-run" else 1.0) * terms.more_free


def score_layouts(terms: Terms, weights: Weights, phi: Phi, *, dependent: bool) -> FloatArray:
    """Compute ``Phi_dep`` or ``Phi_ind`` of each layout, shape (k,).

    ``as-run`` counts free edges a face where the text takes the ratio of lengths, subtracts the penalty for free
    faces from independent rooms too where the text adds it, takes the hull ratio from 1 and the proportion beyond 2.

    Args:
        terms: Of k layouts.
        weights: ``w1`` to ``w6``, the area's a metre.
        phi: Which of the two readings.
        dependent: Whether the room touches another one's layout.
    """
    size = weights.area * np.sqrt(terms.area)
    hull = terms.hull / terms.area
    penalty = free_faces_penalty(terms, phi)
    if phi == "as-run":
        value = size - weights.hull * (hull - 1.0)
        free = terms.free_edges / terms.faces
        stretch = np.maximum(terms.proportion - 2.0, 0.0)
        independent_penalty = -weights.free_faces * penalty
    else:
        value = size - weights.hull * hull
        free = terms.free_length / terms.contour
        stretch = terms.proportion
        independent_penalty = weights.free_faces * penalty
    if not dependent:
        return np.asarray(value - weights.free_independent * free + independent_penalty)
    return np.asarray(
        value
        - weights.free_dependent * free
        - np.maximum(weights.free_faces * (penalty - 1.0), 0.0)
        - weights.proportion * stretch * np.minimum(penalty, 1.0)
    )


@dataclass(frozen=True, slots=True, eq=False)
class FaceSet:
    """Faces that may make up one layout, with what every subset's terms are summed from.

    Attributes:
        faces: Indices into the arrangement, shape (n,).
        areas: [m2], shape (n,).
        perimeters: [m], shape (n,).
        outer_free: Edges a face has in common with unknown faces of no room outside this set, shape (n,).
        outer_length: Length of those edges [m], shape (n,).
        inner: Edges between faces of this set, 0 or 1, shape (n, n).
        inner_length: Length of those edges [m], shape (n, n).
        returnable: Faces of this set that count as free while a layout leaves them out, shape (n,).
        boxes: Extent of each face along and across the door's edge, ``low, high, low, high`` [m], shape (n, 4).
        corners: Corner points of each face [m].
    """

    faces: IntArray
    areas: FloatArray
    perimeters: FloatArray
    outer_free: FloatArray
    outer_length: FloatArray
    inner: FloatArray
    inner_length: FloatArray
    returnable: BoolArray
    boxes: FloatArray
    corners: tuple[FloatArray, ...]

    def terms(self, chosen: BoolArray, *, hulls: bool = True) -> Terms:
        """Compute the terms of layouts given as rows of ``chosen``, shape (k, n).

        Without ``hulls`` the hull is taken as the area itself, its lower bound: the value is then an upper bound.
        """
        some = chosen.astype(np.float64)
        left_out = (~chosen & self.returnable).astype(np.float64)
        free = np.where(chosen, self.outer_free + left_out @ self.inner, 0.0)
        length = np.where(chosen, self.outer_length + left_out @ self.inner_length, 0.0)
        area = some @ self.areas
        shared = ((some @ self.inner_length) * some).sum(axis=1)
        low = np.where(chosen[:, :, None], self.boxes[None, :, 0::2], np.inf).min(axis=1)
        high = np.where(chosen[:, :, None], self.boxes[None, :, 1::2], -np.inf).max(axis=1)
        sides = high - low
        counts = np.rint(free)
        return Terms(
            area=area,
            hull=np.array([self.hull(row) for row in chosen]) if hulls else area,
            faces=some.sum(axis=1),
            free_edges=free.sum(axis=1),
            free_length=length.sum(axis=1),
            contour=some @ self.perimeters - shared,
            two_free=(counts == 2).sum(axis=1).astype(np.float64),
            more_free=(counts > 2).sum(axis=1).astype(np.float64),
            proportion=sides.max(axis=1) / sides.min(axis=1),
        )

    def hull(self, chosen: BoolArray) -> float:
        """Measure the convex hull [m2] of the faces chosen, shape (n,)."""
        points = np.concatenate([self.corners[i] for i in np.flatnonzero(chosen)])
        return float(shapely.area(shapely.convex_hull(shapely.multipoints(points))))


def face_set(
    arrangement: Arrangement, faces: IntArray, returnable: BoolArray, free: BoolArray, along: FloatArray
) -> FaceSet:
    """Gather what the terms of layouts made of ``faces`` need.

    Args:
        arrangement: All faces.
        faces: Indices that layouts may contain, shape (n,).
        returnable: Which of them are unassigned unknown faces when a layout leaves them out, shape (n,).
        free: All unknown faces that belong to no room, of the whole arrangement.
        along: Unit vector of the door's edge, shape (2,).
    """
    position = {int(face): i for i, face in enumerate(faces)}
    count = len(position)
    outer_free, outer_length = np.zeros(count), np.zeros(count)
    inner, inner_length = np.zeros((count, count)), np.zeros((count, count))
    for face, i in position.items():
        for other, edge in arrangement.neighbours[face].items():
            j = position.get(other)
            if j is not None:
                inner[i, j] = 1.0
                inner_length[i, j] = arrangement.edge_lengths[edge]
            elif free[other]:
                outer_free[i] += 1.0
                outer_length[i] += arrangement.edge_lengths[edge]
    axes = np.stack((along, (-along[1], along[0])), axis=1)
    corners = tuple(shapely.get_coordinates(arrangement.faces[face].exterior)[:-1] for face in position)
    turned = [points @ axes for points in corners]
    boxes = np.array([(*np.ravel(np.stack((t.min(axis=0), t.max(axis=0)), axis=1)),) for t in turned]).reshape(-1, 4)
    return FaceSet(
        faces=np.array(list(position), dtype=np.int64),
        areas=arrangement.areas[list(position)],
        perimeters=np.array([arrangement.faces[face].length for face in position]),
        outer_free=outer_free,
        outer_length=outer_length,
        inner=inner,
        inner_length=inner_length,
        returnable=returnable,
        boxes=boxes,
        corners=corners,
    )
