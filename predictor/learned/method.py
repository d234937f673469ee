"""The method ``learned``: the rectangles of ``best``, chosen by their evidence and by what a trained network says.

The network looks at the map around each door (``patches``) and says which cells the room fills (``seen_room``); the
rectangles that ``best`` proposes are rated by that as well (``ratings``), and those of all doors are chosen together as
``best`` does, so that the rooms are disjoint and lie in unknown space.
"""

from collections.abc import Sequence
from dataclasses import replace

from closedrooms.core.door import ClosedDoor
from closedrooms.core.grid import OccupancyGrid
from closedrooms.predictor.best.method import predict_best
from closedrooms.predictor.config import LearnedConfig
from closedrooms.predictor.learned.mask_belief import believe_cells
from closedrooms.predictor.learned.model import load_model
from closedrooms.predictor.learned.ratings import Rater
from closedrooms.predictor.prediction import Prediction, WeighedTrace


def predict_learned(grid: OccupancyGrid, doors: Sequence[ClosedDoor], config: LearnedConfig) -> Prediction:
    """Predict the rooms behind closed doors with a trained network.

    Args:
        grid: The map, of any resolution and size.
        doors: Closed doors in the frame of the map.
        config: Settings.

    Returns:
        The completed map on the lattice of the input, rooms in the order of the doors, failures by door id.

    Raises:
        InvalidInputError: Two doors of one id, a known area that is too large (:func:`at_resolution`), a file that is
            no model.
    """
    rater = Rater(load_model(config.model), keep=config.shortlist)
    prediction = predict_best(grid, doors, replace(config, shortlist=max(config.rated, config.shortlist)), rate=rater)
    beliefs = tuple(
        believe_cells(belief, room.polygon, [rater.heard[door] for door in room.doors])
        for belief, room in zip(prediction.beliefs, prediction.rooms, strict=True)
    )
    trace = prediction.trace
    if isinstance(trace, WeighedTrace):
        trace = replace(trace, rooms=tuple(rater.explain(room) for room in trace.rooms))
    return replace(prediction, beliefs=beliefs, trace=trace)
