"""The numbers of a method: a regression and the curve behind it."""

import numpy as np
import pytest

from closedrooms.predictor.confidence.calibration import Calibration, Curve


def test_what_is_expected_of_a_room_is_the_curve_at_its_regression() -> None:
    line = Curve(np.array([0.0, 1.0]), np.array([0.0, 1.0]))
    calibration = Calibration(
        mean=np.array([1.0, 2.0]), weights=np.array([0.1, -0.2]), intercept=0.5, confidence=line, cells=line,
        nearest=line, variants={},
    )  # fmt: skip
    assert calibration.expect_iou(np.array([1.0, 2.0])) == pytest.approx(0.5)
    assert calibration.expect_iou(np.array([2.0, 2.0])) == pytest.approx(0.6)
    assert calibration.expect_iou(np.array([1.0, 3.0])) == pytest.approx(0.3)
