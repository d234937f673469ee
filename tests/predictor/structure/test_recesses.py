"""Where a line of faces lies back, against every stretch of it looked at by itself."""

import math

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from closedrooms.predictor.structure.door_proposal_config import ProposalConfig
from closedrooms.predictor.structure.door_proposals import LEAST_CONTRAST, LEAST_SEEN, SMOOTH, _Line, _recesses

CELL = 0.1
CONFIG = ProposalConfig()


def clearest(depth: np.ndarray, seen: np.ndarray, first: int) -> tuple[int, float, float] | None:
    """The width in bins, the recess and the gain of the clearest leaf that begins at a bin."""
    beside = max(2, round(CONFIG.jamb / CELL))

    def stretch(low: int, high: int) -> np.ndarray:
        inside = np.arange(max(low, 0), max(min(high, len(seen)), 0))
        return depth[inside[seen[inside]]]

    best = None
    narrowest, widest = max(3, math.ceil(CONFIG.min_width / CELL - 1e-6)), math.floor(CONFIG.max_width / CELL + 1e-6)
    for bins in range(narrowest, widest + 1):
        leaf, left = stretch(first + 1, first + bins - 1), stretch(first - 1 - beside, first - 1)
        right = stretch(first + bins + 1, first + bins + 1 + beside)
        if len(leaf) < LEAST_SEEN * (bins - 2) or min(len(left), len(right)) < 2 or first + bins > len(seen):
            continue
        wall = np.concatenate((left, right))
        recess = min(left.mean(), right.mean()) - leaf.mean()
        rough = math.sqrt((leaf.var() * len(leaf) + wall.var() * len(wall)) / (len(leaf) + len(wall)))
        gain = len(leaf) * len(wall) / (len(leaf) + len(wall)) * (wall.mean() - leaf.mean()) ** 2
        fits = CONFIG.min_recess <= recess <= CONFIG.max_recess and abs(wall.mean()) <= CELL
        if fits and recess >= LEAST_CONTRAST * math.hypot(rough, SMOOTH) and (best is None or gain > best[2]):
            best = (bins, recess, gain)
    return best


@given(seed=st.integers(0, 10_000), size=st.integers(5, 60), share=st.floats(0.3, 1.0))
@settings(max_examples=60, deadline=None)
def test_the_clearest_recess_from_each_bin_is_found_and_no_other(seed: int, size: int, share: float) -> None:
    rng = np.random.default_rng(seed)
    seen = rng.random(size) < share
    depth = rng.normal(0.0, 0.01, size)
    at, width = int(rng.integers(0, size)), int(rng.integers(6, 14))
    depth[at : at + width] -= 0.15
    depth = np.where(seen, depth, 0.0)
    found = _recesses(_Line(np.array([1.0, 0.0]), np.array([0.0, 1.0]), 0.0, 0.0, depth, seen), CELL, CONFIG)
    expected = {first: best for first in range(size) if (best := clearest(depth, seen, first)) is not None}
    assert sorted(found.first.tolist()) == sorted(expected)
    for first, bins, recess in zip(found.first.tolist(), found.bins.tolist(), found.recess.tolist(), strict=True):
        assert bins == expected[first][0]
        assert abs(recess - expected[first][1]) < 1e-9
