"""One seed a run, one independent stream for each source of noise."""

import zlib

import numpy as np


def stream(seed: int, *names: str) -> np.random.Generator:
    """Make a generator that depends on the run's seed and on the name of what it is for, and on nothing else.

    Changing how often one source draws leaves the others' draws alone.
    """
    keys = [zlib.crc32(name.encode()) for name in names]
    return np.random.default_rng(np.random.SeedSequence([seed, *keys]))
