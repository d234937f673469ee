"""What each kind of evidence counts in the preset ``best``: the few constants that it holds.

Found by coordinate search on the maps of the authors' experiments (8 buildings, 547 rooms) together with ideal maps of
18 other real floor plans (422 rooms), starting from a guess by hand. Tuned on the authors' maps alone, the same search
gives the other plans 0.681 mean IoU per room instead of 0.687 (the guess: 0.660). Features are shares or logarithms, so
that weights have no unit.
"""

from closedrooms.core.arrays import FloatArray

SIDE_WEIGHTS: dict[str, float] = {
    "log area": 2.08,
    "log area squared": -0.4,
    "log proportion squared": -1.5,
    "overlap": -3.4,
    "door margin": -4.0,
    "side closed": 0.45,
    "side tight": 0.546,
    "side sliver": -3.978,
    "side gap": -0.5,
    "side aligned": 0.39,
    "side middle": 0.48,
    "side stub": 2.72,
    "back closed": 2.2,
    "back tight": 2.4,
    "back sliver": -1.5,
    "back gap": -0.5,
    "back aligned": 1.0,
    "log depth squared": -1.28,
    "outside": -0.25,
    "outside area": -0.51,
    "lone outside": -5.967,
    "side free": -0.7,
    "back free": -1.3,
    "near aligned": 1.36,
    "side outer": 1.6,
    "back outer": 3.04,
    "passage end": 3.0,
    "width seen": 0.75,
    "depth seen": 1.5,
}

PAIR_WEIGHTS: dict[str, float] = {
    "overlap": -20.0,
    "same depth": 3.2,
    "shared wall": 0.324,
    "strip between": -0.125,
    "gap between": -0.3,
    "same width": 1.7,
}


def weights_of(table: dict[str, float], names: tuple[str, ...]) -> FloatArray:
    """The weights of features in their order, shape (len(names),)."""
    import numpy as np

    return np.array([table[name] for name in names], dtype=np.float64)
