"""Buildings of two equal halves: what is hidden in one may have been seen in the other (method ``best``)."""

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from closedrooms.core.arrays import BoolArray
from closedrooms.predictor.best.door_frame import STRIP, TurnedMap, Window, find_faces_in
from closedrooms.predictor.best.lattice import in_cells

# Faces are counted in blocks of so many cells, and mirrored onto each other within one block.
BLOCK = in_cells(0.1)
# A map is symmetric about an axis when at least so much of its wall lies where the other half is known, when of that
# wall at least so much has its counterpart, and when no other axis, at least 1 m away, comes nearer than so much.
KNOWN, ALIKE, AHEAD = 0.5, 0.5, 0.2
APART = in_cells(1.0)

ComplexArray = npt.NDArray[np.complexfloating]


@dataclass(frozen=True, slots=True)
class Axis:
    """A line across a turned map about which it is symmetric.

    Attributes:
        total: Twice its place: an edge ``e`` between cells has its counterpart at ``total - e`` [cells].
        alike: Share of the faces there that have a counterpart.
    """

    total: int
    alike: float


def mirror(turned: TurnedMap) -> TurnedMap | None:
    """Lay the halves of a symmetric building over each other, or return ``None`` where it is not symmetric.

    Args:
        turned: The map along its walls.

    Returns:
        On the same cells, what is known of the counterpart of each; about both axes where there are two.
    """
    upright = find_axis(turned.free, turned.known)
    level = find_axis(turned.free.T, turned.known.T)
    if upright is None and level is None:
        return None
    free, known = np.zeros_like(turned.free), np.zeros_like(turned.known)
    for axis, transposed in ((upright, False), (level, True)):
        if axis is None:
            continue
        for target, source in ((free, turned.free), (known, turned.known)):
            one, other = (target.T, source.T) if transposed else (target, source)
            _flip(other, one, axis.total)
    return TurnedMap(turned.angle, turned.origin, turned.resolution, free, known)


def _flip(source: BoolArray, target: BoolArray, total: int) -> None:
    """Add to ``target`` the cells of ``source`` at ``total - 1 - column``."""
    cols = source.shape[1]
    low, high = max(total - cols, 0), min(total, cols)
    target[:, low:high] |= source[:, total - high : total - low][:, ::-1]


def find_axis(free: BoolArray, known: BoolArray) -> Axis | None:
    """Find the axis across the columns about which the faces of walls are symmetric.

    Faces along the axis and faces across it are counted apart, and the fewer counterparts decide: the walls of a
    corridor alone are symmetric about any axis across it, its side walls about its own middle.

    Args:
        free: Free cells, shape (rows, cols).
        known: Known cells, of the same shape.

    Returns:
        ``None`` where no axis is clear.
    """
    size = cv2.getOptimalDFTSize(2 * (free.shape[1] // BLOCK + 1))

    def transform(mask: BoolArray) -> ComplexArray:
        return np.asarray(np.fft.rfft(mask.astype(np.float32), size, axis=1))

    # Faces across the axis have their counterpart facing the other way, those along it facing the same way.
    alike, seen, walls = np.zeros((2, size)), np.zeros((2, size)), np.zeros(2)
    for first in range(0, len(free), STRIP):
        strip = Window(first, 0, min(first + STRIP, len(free)), free.shape[1])
        place = transform(_reduce(np.pad(known[strip.of], ((0, 0), (0, 1)))))
        # Of edges between rows those below each cell.
        edges = [
            find_faces_in(free, known, side, strip)[: strip.v1 - strip.v0]
            for side in ("right", "left", "top", "bottom")
        ]
        faces = [_reduce(found) for found in edges]
        own, others = [transform(found) for found in faces], [transform(_widen(found)) for found in faces]
        for family, pairs in enumerate((((0, 1), (1, 0)), ((2, 2), (3, 3)))):
            for one, other in pairs:
                walls[family] += np.count_nonzero(faces[one])
                alike[family] += np.fft.irfft((own[one] * others[other]).sum(axis=0), size)
                seen[family] += np.fft.irfft((own[one] * place).sum(axis=0), size)
    if not walls.all():
        return None
    share = np.where(seen >= KNOWN * walls[:, None], alike / np.maximum(seen, 1.0), 0.0).min(axis=0)
    best = int(share.argmax())
    away = np.abs(np.arange(size) - best) * BLOCK >= APART
    if share[best] < ALIKE or share[best] - share[away].max(initial=0.0) < AHEAD:
        return None
    return Axis(_refine(free, known, best * BLOCK), float(share[best]))


def _refine(free: BoolArray, known: BoolArray, total: int) -> int:
    """Find the place of an axis to the cell."""
    counts = dict.fromkeys(range(total - BLOCK, total + 2 * BLOCK + 1), 0)
    for first in range(0, len(free), STRIP):
        strip = Window(first, 0, min(first + STRIP, len(free)), free.shape[1])
        right, left = (find_faces_in(free, known, side, strip) for side in ("right", "left"))
        for at in counts:
            counterpart = np.zeros_like(left)
            # Edges, of which there is one more than cells.
            _flip(left, counterpart, at + 1)
            counts[at] += int(np.count_nonzero(counterpart & right))
    return max(counts, key=lambda at: (counts[at], -abs(at - total)))


def _reduce(mask: BoolArray) -> BoolArray:
    """Reduce a mask to whether any cell of each block of two by two is set, shape (rows, cols) in blocks."""
    even = np.pad(mask, ((0, mask.shape[0] % BLOCK), (0, mask.shape[1] % BLOCK)))
    rows = even[::BLOCK] | even[1::BLOCK]
    return rows[:, ::BLOCK] | rows[:, 1::BLOCK]


def _widen(mask: BoolArray) -> BoolArray:
    """Widen a mask by one cell to every side."""
    return np.asarray(cv2.dilate(mask.view(np.uint8), np.ones((3, 3), np.uint8))).view(np.bool_)
