import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import rankdata
from shapely.geometry import box

from closedrooms.core.door import ClosedDoor
from closedrooms.core.grid import FREE, UNKNOWN, GridFrame, OccupancyGrid
from closedrooms.core.room import Alternative, Room
from closedrooms.experiments.evaluation.scoring.sureness import (
    auroc,
    calibration_error,
    cells_asked,
    ranked,
    reliability_rows,
    score_sureness,
    spearman,
    sureness_rows,
)
from closedrooms.predictor.prediction import Prediction

FRAME = GridFrame(0.1, 0.0, 0.0, 100, 100)
DOOR = ClosedDoor("d", (5.0, 5.0))


def grid_of(value: int) -> OccupancyGrid:
    return OccupancyGrid(FRAME, np.full(FRAME.shape, value, dtype=np.int8))


def scored(percent: int, *, confidence: float = 0.5) -> dict[str, object]:
    """Half of the building is hidden floor, and a method gives every cell the same probability."""
    truth = np.full(FRAME.shape, UNKNOWN, dtype=np.int8)
    truth[50:] = FREE
    room = Room(box(0, 5, 10, 7.5), ("d",), "border", 1.0, confidence=confidence,
                alternatives=(Alternative(box(0, 0, 1, 1), 0.1), Alternative(box(0, 5, 10, 10), 0.2)))  # fmt: skip
    completed = np.full(FRAME.shape, UNKNOWN, dtype=np.int8)
    completed[50:75] = FREE
    prediction = Prediction(OccupancyGrid(FRAME, completed), (room,), probability=grid_of(percent))
    true_rooms = [Room(box(0, 5, 10, 10), ("d",))]
    return score_sureness(prediction, grid_of(UNKNOWN), [DOOR], OccupancyGrid(FRAME, truth), true_rooms)


def test_brier_and_log_score_of_a_coin() -> None:
    (row,) = sureness_rows([{"method": "m", "sure": scored(50)}])
    assert row["brier"] == pytest.approx(0.25)
    assert row["log"] == pytest.approx(np.log(2.0))
    assert row["brier_guess"] == pytest.approx(0.25, abs=0.01)
    assert row["log_guess"] > row["log"]


def test_the_best_of_several_guesses() -> None:
    (row,) = sureness_rows([{"method": "m", "sure": scored(50)}])
    assert row["iou_mean"] == pytest.approx(0.5)
    assert (row["best_of_2"], row["best_of_3"], row["best_of_4"]) == pytest.approx((0.5, 1.0, 1.0))
    assert row["calibration_error"] == pytest.approx(0.0)


def test_only_unknown_cells_near_a_door_are_asked_about() -> None:
    frame = GridFrame(0.1, 0.0, 0.0, 300, 300)
    cells = np.full(frame.shape, UNKNOWN, dtype=np.int8)
    cells[:100] = FREE
    asked = cells_asked(OccupancyGrid(frame, cells), [DOOR])
    assert not asked[:100].any()
    assert asked[120, 50]
    assert not asked[140, 50]


def test_calibration_error_is_the_distance_from_the_diagonal() -> None:
    confidence = np.linspace(0.2, 0.8, 200)
    assert calibration_error(confidence, confidence) == pytest.approx(0.0)
    assert calibration_error(confidence, confidence - 0.1) == pytest.approx(0.1)


def test_rooms_of_one_confidence_count_the_same_in_any_order() -> None:
    rng = np.random.default_rng(0)
    confidence, iou = np.repeat([0.3, 0.6, 0.9], [7, 20, 14]), rng.random(41)
    found = set()
    for _ in range(5):
        order = rng.permutation(41)
        found.add(round(calibration_error(confidence[order], iou[order]), 12))
    assert len(found) == 1
    # Groups that hold one confidence each are off by the distance of its mean.
    assert calibration_error(np.repeat([0.2, 0.8], 50), np.tile([0.0, 1.0], 50)) == pytest.approx(0.3)


def test_ranks_tell_found_rooms_from_others() -> None:
    iou = np.array([0.1, 0.2, 0.6, 0.9])
    assert auroc(np.array([0.1, 0.2, 0.3, 0.4]), iou > 0.5) == 1.0
    assert auroc(np.array([0.4, 0.3, 0.2, 0.1]), iou > 0.5) == 0.0
    assert auroc(np.full(4, 0.5), iou > 0.5) == 0.5
    assert auroc(iou, iou > 2.0) is None
    assert spearman(iou**3, iou) == pytest.approx(1.0)
    assert spearman(np.full(4, 0.5), iou) is None


def test_a_sample_without_rooms_says_nothing() -> None:
    nothing = {"method": "m", "sure": {"rooms": [], "cells": 0}}
    assert sureness_rows([nothing, {"method": "authors"}]) == []
    assert reliability_rows([nothing]) == []


@given(st.lists(st.integers(0, 9)))
def test_ranks_are_scipys(values: list[int]) -> None:
    assert np.array_equal(ranked(np.array(values, dtype=float)), rankdata(values))
