"""What is predicted while a robot explores, for the recording."""

from collections.abc import Sequence

import numpy as np
import pytest

from closedrooms.core.door import ClosedDoor
from closedrooms.core.grid import FREE, UNKNOWN, GridFrame, OccupancyGrid
from closedrooms.pipeline.reporting import live_recording
from closedrooms.pipeline.reporting.live_recording import InterimPrediction
from closedrooms.predictor.prediction import Prediction
from closedrooms.visualization.no_recording import no_recording

DOORS = [ClosedDoor("d00", (1.0, 1.0)), ClosedDoor("d01", (2.0, 1.0))]


def a_map(known: int) -> OccupancyGrid:
    cells = np.full((40, 50), UNKNOWN, dtype=np.int8)
    cells.ravel()[:known] = FREE
    return OccupancyGrid(GridFrame(0.1, 0.0, 0.0, 40, 50), cells)


@pytest.mark.parametrize("large", [False, True])
def test_a_prediction_is_made_for_each_new_door_but_of_a_large_map_only_as_it_grows(
    large: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(live_recording, "LARGE", 1_999 if large else 2_000)
    made = []

    def predict(grid: OccupancyGrid, doors: Sequence[ClosedDoor]) -> Prediction:
        made.append(len(doors))
        return Prediction(grid, ())

    interim = InterimPrediction(no_recording(), predict, [])
    assert interim(a_map(100), [], 0.0) is None
    assert interim(a_map(100), DOORS[:1], 1.0) is not None
    assert interim(a_map(150), DOORS[:1], 2.0) is None
    interim(a_map(150), DOORS, 3.0)
    assert made == ([1] if large else [1, 2])
    interim(a_map(301), DOORS, 4.0)
    assert made == ([1, 2] if large else [1, 2, 2])
