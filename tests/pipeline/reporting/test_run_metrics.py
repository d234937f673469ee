"""Figures of a run: what was missed counts, what cannot be computed is no number."""

import json
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from closedrooms.core.door import ClosedDoor
from closedrooms.core.grid import UNKNOWN, GridFrame, OccupancyGrid
from closedrooms.coverage.tour.coverage_tour import CoverageTour
from closedrooms.coverage.tour.tour_planner import plan_coverage
from closedrooms.navigation.control_loop import LoopLog
from closedrooms.pipeline.reporting.run_metrics import run_metrics
from closedrooms.pipeline.survey import Survey, Truth, true_building
from closedrooms.predictor.prediction import Prediction
from closedrooms.sim.config import SimConfig
from closedrooms.sim.simulation import Simulation
from closedrooms.worlds.plan import FloorPlan

CLOSED = ("d0", "d1")


def survey_of(grid: OccupancyGrid, *seen: str) -> Survey:
    poses, stamps = np.zeros((2, 3)), np.array([0.0, 0.1])
    doors = [ClosedDoor(name, (0.0, 0.0)) for name in seen]
    return Survey(grid, doors, LoopLog("complete", "", stamps, poses[:, :2], 0.0), 1, stamps, poses, poses)


def metrics(
    plan: FloorPlan, *, seen: tuple[str, ...] = CLOSED, known: bool = True, tours: dict[str, CoverageTour] | None = None
) -> dict[str, Any]:
    """The true map as what was mapped, and the true rooms behind the doors that were seen as what was predicted."""
    map_T_world = Simulation(plan, CLOSED, SimConfig(), 0).world_T_map.inverse()
    truth: Truth = true_building(plan, CLOSED, GridFrame(0.05, -4.0, -2.0, 10, 10), map_T_world)
    rooms = tuple(room for room in truth.rooms if set(room.doors) & set(seen))
    frame = truth.grid.frame
    grid = truth.grid if known else OccupancyGrid(frame, np.full(frame.shape, UNKNOWN, dtype=np.int8))
    return run_metrics(plan, CLOSED, map_T_world, survey_of(grid, *seen), Prediction(grid, rooms), truth, tours or {})


def test_a_closed_door_that_was_not_seen_counts_0_in_the_mean(flat: FloorPlan) -> None:
    # d2 and o0 still lead to r2 through r3, so that d0 alone closes a room.
    only = replace(flat, doors=flat.doors[:2])
    assert metrics(only)["room_iou"] == {"d0": 1.0, "d1": 1.0}
    figures = metrics(only, seen=("d1",))
    assert figures["room_iou"] == {"d0": 0.0, "d1": 1.0}
    assert figures["room_iou_mean"] == pytest.approx(0.5)
    assert figures["rooms_closed"] == 2
    assert (figures["doors_closed"], figures["doors_seen"]) == (2, 1)


def test_errors_of_a_tour_of_length_0_are_none_and_the_rest_is_there(flat: FloorPlan) -> None:
    cells = np.full((40, 40), 100, dtype=np.int8)
    cells[5:35, 5:35] = 0
    tour = plan_coverage(OccupancyGrid(GridFrame(0.05, 0.0, 0.0, 40, 40), cells))
    assert tour.length == 0.0
    figures = metrics(flat, tours=dict.fromkeys(("closed", "predicted", "truth"), tour))
    assert figures["tour"]["errors_percent"] == {"closed": None, "baseline": None, "predicted": None}
    assert figures["tour"]["truth"]["length_m"] == 0.0
    json.dumps(figures, allow_nan=False)


def test_without_tours_there_are_no_errors(flat: FloorPlan) -> None:
    assert set(metrics(flat)["tour"]["errors_percent"].values()) == {None}


def test_nothing_mapped_is_0_and_nothing_to_map_is_none(flat: FloorPlan) -> None:
    assert metrics(flat)["area_mapped"] == pytest.approx(1.0)
    assert metrics(flat, known=False)["area_mapped"] == 0.0
