"""The method ``best``: rooms as rectangles between wall faces, by the evidence for their sides, chosen jointly.

Still purely geometric. For each door, in the frame of its wall: candidate sides from walls that are seen from their
other side, walls that continue, the middle between doors, and the sizes of observed rooms; every rectangle of such
sides is scored by its evidence; the rectangles of all doors are then chosen together.
"""

from collections.abc import Callable, Sequence

from closedrooms.core.door import ClosedDoor
from closedrooms.core.grid import OccupancyGrid
from closedrooms.predictor.best.hypotheses import Proposals, propose_rectangles
from closedrooms.predictor.best.rectangle_belief import believe
from closedrooms.predictor.best.room_shape import trace_rooms
from closedrooms.predictor.best.scene import Scene, prepare
from closedrooms.predictor.best.selection import select_jointly
from closedrooms.predictor.best.trace import trace_of
from closedrooms.predictor.config import BestConfig
from closedrooms.predictor.inpainting import complete_map
from closedrooms.predictor.prediction import Prediction
from closedrooms.predictor.structure.doorways import find_doorways


def predict_best(
    grid: OccupancyGrid,
    doors: Sequence[ClosedDoor],
    config: BestConfig,
    *,
    rate: Callable[[Scene, Proposals], Proposals] | None = None,
) -> Prediction:
    """Predict the rooms behind closed doors as well as we can.

    Args:
        grid: The map, of any resolution and size.
        doors: Closed doors in the frame of the map.
        config: Settings.
        rate: Rates the proposed rectangles anew before some are chosen (method ``learned``).

    Returns:
        The completed map on the lattice of the input, rooms in the order of the doors, failures by door id.

    Raises:
        InvalidInputError: Two doors of one id, or a known area that is too large (:func:`at_resolution`).
    """
    scene = prepare(grid, doors, config)
    hypotheses = propose_rectangles(scene)
    if rate is not None:
        hypotheses = rate(scene, hypotheses)
    chosen = select_jointly(scene, hypotheses)
    facing = [pose.facing for pose in scene.poses]
    openings = find_doorways(scene.grid, facing, width=config.door_width)
    rooms, without = trace_rooms(scene, chosen, openings)
    completed = complete_map(grid, scene.grid, rooms, facing, config)
    failures = scene.failures | without
    in_order = {door.id: failures[door.id] for door in doors if door.id in failures}
    beliefs = believe(scene, chosen, rooms, openings)
    trace = trace_of(scene, hypotheses, chosen, rooms) if config.keep_trace and scene.poses else None
    return Prediction(completed, tuple(rooms), in_order, trace, beliefs=beliefs, facing=tuple(facing))
