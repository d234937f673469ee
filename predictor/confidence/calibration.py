"""Numbers that turn beliefs into probabilities, by method: fitted by ``benchmarks/fitting/fit_confidence.py``."""

from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from closedrooms.core.arrays import FloatArray
from closedrooms.core.files.incoming import read_json

FILE = Path(__file__).parent / "calibration.json"
# Whose numbers a method of another package gets.
ANY = "paper"


@dataclass(frozen=True, slots=True, eq=False)
class Curve:
    """Growing function through knots, level beyond them (isotonic regression)."""

    x: FloatArray
    y: FloatArray

    def at(self, values: Any) -> FloatArray:
        """Interpolate between the knots, in the shape of ``values``."""
        return np.asarray(np.interp(values, self.x, self.y))


@dataclass(frozen=True, slots=True, eq=False)
class Calibration:
    """Numbers of one method.

    Attributes:
        mean: Of each feature of a room, shape (k,).
        weights: Of each feature less its mean (ridge regression on the IoU), shape (k,).
        intercept: IoU of a mean room.
        confidence: From the regression to the expected IoU.
        cells: From the joint spread of all rooms to the probability of a cell to be free.
        nearest: From the share of belief nearest to a shape to the probability that it is nearest to the truth.
        variants: How often each of the shapes of ``variants.py`` came nearest to the true room, by kind of room.
    """

    mean: FloatArray
    weights: FloatArray
    intercept: float
    confidence: Curve
    cells: Curve
    nearest: Curve
    variants: dict[str, FloatArray]

    def expect_iou(self, features: FloatArray) -> float:
        """Predict the IoU with the true room from the features of a room, shape (k,)."""
        return float(self.confidence.at(self.intercept + (features - self.mean) @ self.weights))


def calibration_of(method: str) -> Calibration:
    """Look up the numbers of a method; those of :data:`ANY` for one that nobody calibrated."""
    known = read_calibrations()
    return known.get(method) or known[ANY]


@cache
def read_calibrations() -> dict[str, Calibration]:
    """Read the shipped numbers by method."""
    data = read_json(FILE, what="the calibration of confidence")
    return {method: _parse(numbers) for method, numbers in data["methods"].items()}


def _parse(numbers: dict[str, Any]) -> Calibration:
    """Make a calibration from its JSON object."""
    curves = {name: Curve(*np.array(numbers[name], dtype=np.float64).T) for name in ("confidence", "cells", "nearest")}
    return Calibration(
        np.array(numbers["mean"]),
        np.array(numbers["weights"]),
        float(numbers["intercept"]),
        variants={kind: np.array(shares) for kind, shares in numbers["variants"].items()},
        **curves,
    )
