"""Fourier transforms of pictures by scipy's compiled pocketfft, without what its package imports beside it."""

import importlib
import importlib.util
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

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

    ``import scipy.fft`` takes 0.2 s, a third of ``closedrooms cover``, for array libraries that nobody uses here. The
    compiled module needs none of them, so its file is loaded by itself; where a version keeps it elsewhere, by the
    package.
    """
    package = importlib.util.find_spec("scipy")
    for folder in (package.submodule_search_locations or ()) if package else ():
        for path in sorted(Path(folder, "fft", "_pocketfft").glob("pypocketfft.*")):
            try:
                spec = importlib.util.spec_from_file_location("pypocketfft", path)
                if spec is None or spec.loader is None:
                    continue
                module = importlib.util.module_from_spec(spec)
                spec.loader.exec_module(module)
            except ImportError:
                continue
            if hasattr(module, "c2c") and hasattr(module, "good_size"):
                return module
    return importlib.import_module("scipy.fft._pocketfft.pypocketfft")
