"""Examples in random order, mirrored and disturbed, batch by batch."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from closedrooms.core.arrays import FloatArray, IntArray
from closedrooms.core.random import stream
from closedrooms.experiments.training.examples import AHEAD_CELLS, ASIDE_CELLS, WHOLE, Bytes, Examples, unpack_patches
from closedrooms.predictor.learned.patches import BEHIND, CELL, SIZE

Floats = npt.NDArray[np.float32]
# A side is taken to be where it is with this standard deviation [m]: a cell of the patch.
BLUR = 0.25
# Walls are drawn up to so many times as thick or thin, up to this share of their cells is lost, and lines run askew by
# this standard deviation [rad]: what lidars and mappers do to them.
THICKER, LOST, ASKEW = 2.2, 0.3, 0.02
# Up to so many pieces of known space a patch are hidden, of up to so many cells a side: furniture, leaves of open
# doors.
POCKETS, POCKET = 6, 6


@dataclass(frozen=True, slots=True, eq=False)
class Batch:
    """Patches, and what the network should say of them.

    Attributes:
        patches: Shape (n, 5, SIZE, SIZE).
        masks: Share of each cell in the room, shape (n, SIZE, SIZE).
        sides: Probabilities of left, right and back by cell, shapes (n, ASIDE_CELLS) twice and (n, AHEAD_CELLS).
    """

    patches: Floats
    masks: Floats
    sides: tuple[Floats, Floats, Floats]


def draw_batches(examples: Examples, of: IntArray, size: int, seed: int, epoch: int) -> Iterator[Batch]:
    """Draw batches in random order, each example as it is or mirrored, with pockets in known space and worse walls.

    Args:
        examples: All.
        of: Which of them.
        size: Of a batch; what is left over at the end waits for the next epoch.
        seed: Of the training.
        epoch: Everything drawn depends on these two alone, so that a training that was stopped goes on the same.
    """
    rng = stream(seed, "epoch", str(epoch))
    order = rng.permutation(of)
    for first in range(0, max(len(order) - size, 0) + 1, size):
        chosen = order[first : first + size]
        shown, masks = examples.shown[chosen].copy(), examples.masks[chosen].copy()
        for one, mask in zip(shown, masks, strict=True):
            hide_pockets(one, mask, rng)
            wear_walls(one, rng)
            skew(one, mask, rng)
        mirrored = rng.random(len(chosen)) < 0.5
        shown[mirrored], masks[mirrored] = shown[mirrored][..., ::-1], masks[mirrored][..., ::-1]
        sides = examples.sides[chosen]
        sides[mirrored] = sides[mirrored][:, [1, 0, 2]]
        yield make_batch(shown, masks, sides)


def still_batches(examples: Examples, of: IntArray, size: int) -> Iterator[Batch]:
    """Yield the examples in their order, as they are."""
    for first in range(0, len(of), size):
        chosen = of[first : first + size]
        yield make_batch(examples.shown[chosen], examples.masks[chosen], examples.sides[chosen])


def make_batch(shown: Bytes, masks: Bytes, sides: FloatArray) -> Batch:
    """Make a batch of what examples keep."""
    lengths = (ASIDE_CELLS, ASIDE_CELLS, AHEAD_CELLS)
    blurred = [blur(at, length) for at, length in zip(sides.T, lengths, strict=True)]
    share: Floats = np.asarray(masks / WHOLE, dtype=np.float32)
    return Batch(unpack_patches(shown), share, (blurred[0], blurred[1], blurred[2]))


def blur(at: FloatArray, length: int) -> Floats:
    """Compute probabilities of ``length`` cells around distances [m] of shape (n,), shape (n, length)."""
    centres = (np.arange(length) + 0.5) * CELL
    inside = np.clip(at, centres[0], centres[-1])
    weight = np.exp(-0.5 * ((centres - inside[:, None]) / BLUR) ** 2)
    return np.asarray(weight / weight.sum(axis=1, keepdims=True), dtype=np.float32)


def hide_pockets(shown: Bytes, mask: Bytes, rng: np.random.Generator) -> None:
    """Hide pieces of known space away from the room, their outline occupied.

    Args:
        shown: Of one example, shape (3, SIZE, SIZE); changed.
        mask: Its room, shape (SIZE, SIZE).
        rng: Draws where.
    """
    rows, cols = np.nonzero(shown[0] == WHOLE)
    if not len(rows):
        return
    for _ in range(int(rng.integers(0, POCKETS + 1))):
        at = int(rng.integers(len(rows)))
        height, width = rng.integers(1, POCKET + 1, size=2).tolist()
        piece = slice(rows[at], rows[at] + height), slice(cols[at], cols[at] + width)
        if mask[piece].any() or shown[2][piece].any():
            continue
        part = shown[(slice(None), *piece)]
        part[0] = 0
        edge = np.ones(part.shape[1:], dtype=np.bool_)
        edge[1:-1, 1:-1] = False
        part[1] = np.where(edge, FACE, 0)


def wear_walls(shown: Bytes, rng: np.random.Generator) -> None:
    """Draw walls thicker or thinner, and lose some of their cells, as lidars and mappers do.

    Args:
        shown: Of one example, shape (3, SIZE, SIZE); changed.
        rng: Draws how.
    """
    factor = THICKER ** rng.uniform(-1.0, 1.0)
    kept = rng.random(shown.shape[1:]) >= rng.uniform(0.0, LOST)
    occupied = np.minimum(np.rint(shown[1] * factor * kept), WHOLE).astype(np.uint8)
    shown[0] = np.minimum(shown[0], WHOLE - occupied)
    shown[1] = occupied


def skew(shown: Bytes, mask: Bytes, rng: np.random.Generator) -> None:
    """Lay lines askew around the door, those along its wall and those across it each by an angle of their own.

    Args:
        shown: Of one example, shape (3, SIZE, SIZE); changed.
        mask: Its room, shape (SIZE, SIZE); changed.
        rng: Draws the angles.
    """
    along, across = rng.normal(0.0, ASKEW, size=2)
    rows, cols = np.indices(mask.shape)
    door = round(BEHIND / CELL), SIZE // 2
    from_rows = np.clip(rows + np.rint(along * (cols - door[1])).astype(int), 0, SIZE - 1)
    from_cols = np.clip(cols + np.rint(across * (rows - door[0])).astype(int), 0, SIZE - 1)
    shown[:], mask[:] = shown[:, from_rows, from_cols], mask[from_rows, from_cols]


# Occupied cells of the map in a cell of a patch that a wall's face runs through.
FACE = 7
