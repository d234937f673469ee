"""What the page of ``closedrooms edit`` makes of a map: rooms, a tour, the folder of a prediction."""

import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from closedrooms.core.door import ClosedDoor
from closedrooms.core.errors import ClosedroomsError, reason
from closedrooms.core.files.geojson import write_features
from closedrooms.core.files.rosmap import RosMap
from closedrooms.core.report import Report
from closedrooms.core.room import Room
from closedrooms.coverage.config import CoverageConfig
from closedrooms.coverage.tour.coverage_tour import CoverageTour
from closedrooms.coverage.tour.tour_features import make_tour_features
from closedrooms.coverage.tour.tour_planner import plan_coverage
from closedrooms.pipeline.options.predict import PredictConfig
from closedrooms.pipeline.predict import predict_map
from closedrooms.predictor.methods import METHODS, predict
from closedrooms.predictor.prediction import Prediction


@dataclass(frozen=True, slots=True, eq=False)
class EditedPrediction:
    """Outcome of one prediction of the page.

    Attributes:
        prediction: In the frame of the grid; ``None`` where the whole failed.
        failures: Why there is no room, by door.
        trouble: Why the whole failed; empty where it did not.
        seconds: How long it took.
    """

    prediction: Prediction | None
    failures: dict[str, str] = field(default_factory=dict)
    trouble: str = ""
    seconds: float = 0.0

    @property
    def rooms(self) -> tuple[Room, ...]:
        """Predicted rooms, frame of the grid [m]."""
        return () if self.prediction is None else self.prediction.rooms


def predict_rooms(read: RosMap, doors: Sequence[ClosedDoor], method: str, settings: Any) -> EditedPrediction:
    """Predict for people who watch: whatever goes wrong is said and stops nothing.

    Args:
        read: The map.
        doors: In the map frame.
        method: Its name.
        settings: Of its own class.
    """
    began = time.perf_counter()
    try:
        prediction = predict(read.grid, read.doors_on_grid(doors), method, settings)
    except Exception as error:  # a method may be anybody's
        return EditedPrediction(None, trouble=reason(error))
    return EditedPrediction(prediction, dict(prediction.failures), seconds=time.perf_counter() - began)


def plan_edited_tour(prediction: Prediction, method: str, coverage: CoverageConfig) -> CoverageTour | str:
    """Plan the tour over a map that the page completed, or say in one line why there is none."""
    if not METHODS[method].disjoint:
        return f"no tour: the rooms of the method {method} overlap"
    try:
        return plan_coverage(prediction.grid, (), coverage, map_name="predicted")
    except ClosedroomsError as error:
        return f"no tour: {error}"
    except ModuleNotFoundError as error:
        return f"no tour: {error.name} is not installed here"


def save_rooms(config: PredictConfig, doors: Sequence[ClosedDoor], coverage: CoverageConfig) -> Report:
    """Write the folder that ``closedrooms predict`` writes, with ``tour.geojson`` beside.

    Args:
        config: Options of the prediction; its doors are the file that is going to be in the folder.
        doors: Closed doors, map frame.
        coverage: Options of the tour.

    Raises:
        InvalidInputError: The map cannot be read any more.
        OutputError: The folder cannot be written, or holds something that is not ours.
    """

    def write_tour(folder: Path, read: RosMap, prediction: Prediction) -> dict[str, Any]:
        tour = plan_edited_tour(prediction, config.method, coverage)
        if isinstance(tour, str):
            return {"notes": [tour]}
        features = [(read.on_map(shape), about) for shape, about in make_tour_features(tour, "predicted")]
        write_features(folder / "tour.geojson", features)
        return {"notes": list(tour.notes), "metrics": {"tour": {"predicted": {"length_m": round(tour.length, 4)}}}}

    return predict_map(config, given=doors, beside=write_tour)
