"""Every figure of a run: ``metrics`` of ``run.json``."""

from collections.abc import Mapping, Sequence
from typing import Any

from closedrooms.core.pose import Pose2
from closedrooms.coverage.estimates import compare_tours
from closedrooms.coverage.tour.coverage_tour import CoverageTour
from closedrooms.mapping.trajectory import ate
from closedrooms.pipeline.reporting.run_scores import area_mapped, mean, room_iou, rooms_seen, rounded
from closedrooms.pipeline.survey import Survey, Truth
from closedrooms.predictor.prediction import Prediction
from closedrooms.worlds.plan import FloorPlan
from closedrooms.worlds.truth import reachable


def run_metrics(
    plan: FloorPlan,
    closed: Sequence[str],
    map_T_world: Pose2,
    survey: Survey,
    prediction: Prediction,
    truth: Truth,
    tours: Mapping[str, CoverageTour],
) -> dict[str, Any]:
    """Compare map, rooms and tours with the truth; units stand in the names or beside them.

    Args:
        plan: The building.
        closed: Doors that were closed; a room behind one that was not seen counts with an IoU of 0.
        map_T_world: Building frame to map frame.
        survey: What the robot brought home, on the frame of the truth.
        prediction: On the same frame.
        truth: Map and closed rooms.
        tours: By the map that they were planned on.
    """
    position, heading = ate(survey.estimate, survey.true_poses)
    start = map_T_world.inverse()
    cells = reachable(plan, closed, truth.grid.frame, map_T_world, (start.x, start.y))
    figures = room_iou(prediction.rooms, truth.rooms)
    seen = rooms_seen(plan, survey.grid, map_T_world)
    return {
        "area_mapped": rounded(area_mapped(survey.grid, cells)),
        "ate_m": round(position, 5),
        "ate_rad": round(heading, 6),
        "room_iou": {door: round(iou, 5) for door, iou in figures.items()},
        "room_iou_mean": rounded(mean(figures)),
        "rooms_closed": len(truth.rooms),
        "doors_closed": len(closed),
        "doors_seen": len(survey.doors),
        "rooms_seen": seen,
        "tour": _tour_metrics(tours, seen, len(survey.doors)),
        "units": {"area_mapped": "share 0..1", "room_iou": "share 0..1", "ate_m": "m", "ate_rad": "rad"},
    }


def _tour_metrics(tours: Mapping[str, CoverageTour], n_rooms: int, n_doors: int) -> dict[str, Any]:
    """List lengths of tours, and how far the estimates are off (paper, section 5.3); ``None``: not to be told."""
    metrics: dict[str, Any] = {
        name: {
            "length_m": round(tour.length, 4),
            "lower_bound_m": round(tour.lower_bound, 4),
            "vertices": len(tour.graph.vertices),
            "status": tour.status,
        }
        for name, tour in tours.items()
    }
    metrics["errors_percent"] = dict.fromkeys(("closed", "baseline", "predicted"))
    if {"closed", "predicted", "truth"} <= tours.keys():
        errors = compare_tours(tours["closed"], tours["predicted"], tours["truth"], n_rooms, n_doors)
        told = {"closed": errors.error_closed, "baseline": errors.error_baseline, "predicted": errors.error_pred}
        metrics["errors_percent"] = {name: None if error is None else round(error, 4) for name, error in told.items()}
    return metrics
