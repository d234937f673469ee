"""Fourier transforms of pictures by scipy's compiled pocketfft, without what its package imports beside it."""

import importlib
from functools import cache
from typing import Any

import numpy as np
import numpy.typing as npt

from closedrooms.core.runtime.compiled import load_compiled

Spectrum = npt.NDArray[np.complex64]
# How pocketfft scales: not at all, or by the number of cells.
PLAIN, BY_SIZE = 0, 2


def quick_size(least: int) -> int:
    """Find the smallest size from ``least`` on that has small prime factors only: a transform of it is quick."""
    return int(_pocketfft().good_size(least, False))


def transform(picture: npt.NDArray[np.float32]) -> Spectrum:
    """Compute the spectrum of a picture, shape (n, n)."""
    spectrum: Spectrum = _pocketfft().c2c(picture, (0, 1), True, PLAIN, None, 1)
    return spectrum


def transform_back(spectrum: Spectrum) -> Spectrum:
    """Compute the picture of a spectrum, shape (n, n), in the place of the spectrum."""
    picture: Spectrum = _pocketfft().c2c(spectrum, (0, 1), False, BY_SIZE, spectrum, 1)
    return picture


@cache
def _pocketfft() -> Any:
    """Import SciPy's compiled transform.

    ``import scipy.fft`` takes 0.2 s, a third of ``closedrooms cover``, for array libraries that nobody uses here.
    """
    module = "scipy.fft._pocketfft.pypocketfft"
    return load_compiled(module, "c2c", "good_size") or importlib.import_module(module)
