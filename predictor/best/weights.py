"""What each kind of evidence counts in the method ``best``: the few constants that it holds.

Found on 182 rooms of 29 of the authors' maps (those with 2, 5, 8, 11 and 14 closed doors, 8 buildings), 100 rooms of
the 20 bundled worlds (five closed doors each, noise medium) and 54 rooms of ideal maps of 6 other real floor plans: the
weights of a log-linear model that expects the largest IoU (L-BFGS, ridge of 0.1 towards a guess by hand), mixed 0.7 to
0.3 with the previous weights, which were tuned on all 88 of the authors' maps and 18 other plans, then coordinate
search on the IoU after the joint choice. Those maps are therefore in sample; docs/prediction-failures.md gives the
figures with whole buildings held out. The three of symmetric buildings were set by hand, with one of the authors'
buildings in view; halves and doubles of them were tried on 55 maps of other floors. Features are shares or logarithms,
so that weights have no unit.
"""

from closedrooms.core.arrays import FloatArray

SIDE_WEIGHTS: dict[str, float] = {
    "log area": 1.85,
    "log area squared": -0.59,
    "log proportion squared": -1.76,
    "overlap": -1.71,
    "door margin": -10.46,
    "side closed": 0.68,
    "side tight": 1.38,
    "side sliver": -2.58,
    "side gap": -1.41,
    "side aligned": 1.37,
    "side middle": 1.64,
    "side stub": 2.35,
    "back closed": 2.9,
    "back tight": 3.48,
    "back sliver": -1.25,
    "back gap": -1.35,
    "back aligned": 0.95,
    "log depth squared": -1.68,
    "outside": -0.8,
    "outside area": -0.77,
    "lone outside": -2.97,
    "open": -0.34,
    "open area": -0.39,
    "front taken": -15.2,
    "front closed": 2.67,
    "beyond front": -1.71,
    "sticks out": -0.68,
    "side free": -0.85,
    "back free": -2.06,
    "near aligned": 1.24,
    "side outer": 0.82,
    "back outer": 3.41,
    "passage end": 0.53,
    "width seen": 1.93,
    "depth seen": 1.95,
    "side mirrored": 2.0,
    "back mirrored": 3.0,
    "mirrored free": 1.0,
}

PAIR_WEIGHTS: dict[str, float] = {
    "overlap": -20.0,
    "same depth": 2.65,
    "shared wall": 0.69,
    "strip between": -0.89,
    "gap between": -0.44,
    "same width": 3.75,
}


def weights_of(table: dict[str, float], names: tuple[str, ...]) -> FloatArray:
    """The weights of features in their order, shape (len(names),)."""
    import numpy as np

    return np.array([table[name] for name in names], dtype=np.float64)
