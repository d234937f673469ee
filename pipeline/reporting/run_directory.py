"""What a run found, as its directory holds it: the figures of ``run.json``, every data file, the pictures."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from closedrooms.core.files.geojson import write_doors, write_features, write_rooms
from closedrooms.core.files.rosmap import write_map, write_raw_map
from closedrooms.core.files.tum import write_trajectory
from closedrooms.core.pose import Pose2
from closedrooms.coverage.cost_spread import CostSpread
from closedrooms.coverage.tour.coverage_tour import CoverageTour
from closedrooms.coverage.tour.tour_features import make_tour_features
from closedrooms.pipeline.drive import DriveResult
from closedrooms.pipeline.reporting.drive_report import draw_drive, drive_features, drive_metrics
from closedrooms.pipeline.reporting.run_metrics import run_metrics
from closedrooms.pipeline.survey import Survey, Truth
from closedrooms.predictor.prediction import Prediction, free_probability
from closedrooms.worlds.plan import FloorPlan


@dataclass(frozen=True, slots=True, eq=False)
class Finding:
    """Findings of a run; maps on one frame.

    Attributes:
        survey: What the robot brought home.
        prediction: The rooms behind the closed doors.
        truth: What is really there.
        tours: By the map that they were planned on: ``closed``, ``predicted``, ``truth``.
        missing: Why there is no tour, by the same names.
        notes: What their planning says.
        spread: What covering the building may cost, on demand.
        driven: How the predicted tour was driven, on demand.
    """

    survey: Survey
    prediction: Prediction
    truth: Truth
    tours: dict[str, CoverageTour]
    missing: dict[str, str]
    notes: list[str]
    spread: CostSpread | None = None
    driven: DriveResult | None = None


def run_figures(plan: FloorPlan, closed: Sequence[str], map_T_world: Pose2, found: Finding) -> dict[str, Any]:
    """List what ``run.json`` says of a finding."""
    survey, log, prediction = found.survey, found.survey.exploration, found.prediction
    metrics = run_metrics(plan, closed, map_T_world, survey, prediction, found.truth, found.tours)
    if found.spread is not None:
        truth = found.tours.get("truth")
        metrics["completions"] = found.spread.figures(None if truth is None else truth.length)
    if found.driven is not None:
        metrics["drive"] = drive_metrics(found.driven, plan, map_T_world, found.truth, found.tours.get("truth"))
    seen = [door.id for door in survey.doors]
    return {
        "exploration": {
            "status": log.status,
            "simulated_s": round(log.seconds, 3),
            "scans": log.scans,
            "distance_m": round(log.distance, 3),
            "plans": survey.searches,
            **({"reason": log.reason} if log.reason else {}),
        },
        "metrics": metrics,
        "doors": {"seen": seen, "not_seen": sorted(set(closed) - set(seen)), "failures": prediction.failures},
        "notes": [*found.missing.values(), *found.notes],
    }


def stopped_stages(found: Finding) -> dict[str, str]:
    """Say which stage ended before it was done, and why."""
    logs = {"exploration": found.survey.exploration} | ({} if found.driven is None else {"drive": found.driven.log})
    stopped = {stage: f"{log.status}, {log.reason}" for stage, log in logs.items() if log.status != "complete"}
    return stopped | ({"cover": "; ".join(found.missing.values())} if found.missing else {})


def write_run_files(folder: Path, found: Finding, metrics: Mapping[str, Any]) -> None:
    """Write every data file of the run directory, then the pictures."""
    from closedrooms.visualization.summary import draw_summary

    survey, prediction, truth, driven = found.survey, found.prediction, found.truth, found.driven
    write_map(folder / "map", survey.grid)
    write_map(folder / "predicted", prediction.grid)
    write_map(folder / "truth", truth.grid)
    write_doors(folder / "doors.geojson", survey.doors)
    write_rooms(folder / "rooms.geojson", prediction.rooms)
    write_raw_map(folder / "probability", free_probability(prediction, survey.grid))
    write_rooms(folder / "truth_rooms.geojson", truth.rooms)
    write_trajectory(folder / "trajectory.tum", survey.stamps, survey.estimate)
    write_trajectory(folder / "trajectory_truth.tum", survey.stamps, survey.true_poses)
    features = [f for name, tour in found.tours.items() for f in make_tour_features(tour, name)]
    write_features(folder / "tour.geojson", features + ([] if driven is None else drive_features(driven)))
    if driven is not None:
        draw_drive(folder / "drive.png", driven, truth.rooms)
    draw_summary(
        folder / "summary.png",
        survey.grid,
        prediction,
        survey.doors,
        truth=truth.grid,
        truth_rooms=truth.rooms,
        room_iou=metrics["room_iou"],
        tours=found.tours,
        trajectory=survey.estimate,
    )
