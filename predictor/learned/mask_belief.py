"""Where a room may be: as its rectangles say, and as the network's mask says."""

from collections.abc import Sequence
from dataclasses import replace

import cv2
import numpy as np

from closedrooms.core.arrays import FloatArray
from closedrooms.predictor.confidence.belief import Belief, Spread
from closedrooms.predictor.learned.patches import CELL, Patch
from closedrooms.predictor.learned.ratings import WORDS
from closedrooms.predictor.learned.sides import SeenRoom

# What the mask counts beside the rectangles, whose sides are sharper.
MASK = 0.5
# Numbers that say how clear a choice is, before those of its features.
DOUBT = 4


def believe_cells(belief: Belief, heard: Sequence[tuple[Patch, SeenRoom]]) -> Belief:
    """Mix the mask of the network into where a room may be.

    Args:
        belief: By the rectangles: cells that they never reach, and those that known space and its walls take, stay 0.
            Of what was measured, how clear the choice is and what the network said stay.
        heard: What the network was shown and what it said, of each door of the room.
    """
    spread = belief.spread
    masks = np.mean([_sample_mask(patch, seen, spread) for patch, seen in heard], axis=0)
    share = np.where(spread.share > 0.0, (1.0 - MASK) * spread.share + MASK * masks, 0.0)
    return replace(
        belief,
        spread=replace(spread, share=share),
        evidence=(*belief.evidence[:DOUBT], *belief.evidence[-len(WORDS) :]),
    )


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
