"""Where a room may be: as its rectangles say, and as the network's mask says."""

from collections.abc import Sequence
from dataclasses import replace

import cv2
import numpy as np

from closedrooms.core.arrays import FloatArray
from closedrooms.core.shapes import Shape
from closedrooms.predictor.confidence.belief import Belief, Spread
from closedrooms.predictor.learned.patches import CELL, Patch
from closedrooms.predictor.learned.seen_room import SeenRoom

# What the mask counts beside the rectangles, whose sides are sharper: of 0 to 0.75 the best Brier and log score on both
# kinds of maps of the use ``choose``.
MASK = 0.3


def believe_cells(belief: Belief, shape: Shape, heard: Sequence[tuple[Patch, SeenRoom]]) -> Belief:
    """Mix the mask of the network into where a room may be.

    Args:
        belief: By the rectangles: cells that they never reach, and those that known space and its walls take, stay 0.
            Of what was measured, what the network said stays: with more of it, confidence tells right rooms from
            wrong ones less well on maps of another kind than those that it was fitted on.
        shape: Of the room; its overlap (IoU) with the mask is evidence too.
        heard: What the network was shown and what it said, of each door of the room.
    """
    spread = belief.spread
    masks = np.mean([_sample_mask(patch, seen, spread) for patch, seen in heard], axis=0)
    masks = np.where(spread.share > 0.0, masks, 0.0)
    inside = spread.inside(shape)
    overlap = float(masks[inside].sum() / max(inside.sum() + masks[~inside].sum(), 1.0))
    share = (1.0 - MASK) * spread.share + MASK * masks
    return replace(belief, spread=replace(spread, share=share), evidence=(belief.evidence[-1], overlap))


def _sample_mask(patch: Patch, seen: SeenRoom, spread: Spread) -> FloatArray:
    """Sample the mask of a patch at the cells of a spread, 0 outside, shape ``spread.share.shape``."""
    across = np.array([-spread.along[1], spread.along[0]])
    axes = np.array([patch.along, patch.inward]) @ np.stack((spread.along, across), axis=1)
    first = patch.to_patch(spread.origin + (spread.along + across) * spread.resolution / 2)
    matrix = np.column_stack((axes * (spread.resolution / CELL), first / CELL - 0.5))
    rows, cols = spread.share.shape
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    found = cv2.warpAffine(seen.mask.astype(np.float32), matrix, (cols, rows), flags=flags, borderValue=0.0)
    return np.asarray(found, dtype=np.float64)
