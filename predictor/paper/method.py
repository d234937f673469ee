"""The method of the paper: from a map and its closed doors to rooms and the completed map (section 3)."""

from collections.abc import Sequence

from closedrooms.core.door import ClosedDoor
from closedrooms.core.grid import OccupancyGrid
from closedrooms.predictor.config import PaperConfig
from closedrooms.predictor.inpainting import complete_map
from closedrooms.predictor.paper.expansion import Growth, expand
from closedrooms.predictor.paper.face_swaps import swap_faces
from closedrooms.predictor.paper.finished_rooms import finish_rooms
from closedrooms.predictor.paper.initial_layouts import FacesFound, find_initial_faces
from closedrooms.predictor.paper.trace import level_of, trace_of
from closedrooms.predictor.prediction import Level, Prediction


def predict_paper(
    grid: OccupancyGrid, doors: Sequence[ClosedDoor], config: PaperConfig, *, started: FacesFound | None = None
) -> Prediction:
    """Predict the rooms behind closed doors as the authors describe and ran it.

    With :class:`~closedrooms.predictor.config.RoseConfig` walls and directions come from ROSE (section 4.2).

    Trouble with one door is its own: it is named in ``failures`` and the other doors are predicted. On a map without
    any wall line (all unknown, all free, noise), every door fails with the reason and the map stays as it is.

    Args:
        grid: The map, of any resolution and size.
        doors: Closed doors in the frame of the map.
        config: Settings.
        started: What ``find_initial_faces`` gave for this map, these doors and these settings, where it is at hand.

    Returns:
        The completed map on the lattice of the input, the rooms in the order of the doors, failures by door id.

    Raises:
        InvalidInputError: Two doors of one id; a known area that is too large for the cells that walls are looked for
            in; a completed map of too many cells, where those of the input are tiny.
    """
    # 3.1, 3.2: lines, faces, and the face behind each door.
    start, reasons = started or find_initial_faces(grid, doors, config)
    failures = dict(reasons)
    if start is None:
        return Prediction(grid, (), failures)
    levels: list[Level] = []

    def report(k: int) -> None:
        if config.keep_trace:
            levels.append(level_of(k, growth))

    # 3.3, 3.4: all rooms grow jointly, scored by the evaluation functions.
    growth = Growth(start.arrangement, start.unknown, start.entrances)
    expand(growth, config, report)
    # 3.5: adjacent rooms swap faces.
    if config.joint_layout:
        swap_faces(growth, config)
        report(config.max_level + 1)
    # 3.6, 3.7: rooms on the border, free interiors, and all of it drawn into the map.
    rooms, without = finish_rooms(start, growth, config)
    facing = tuple(entrance.facing for entrance in start.entrances)
    completed = complete_map(grid, start.grid, rooms, facing, config)
    trace = trace_of(start, levels) if config.keep_trace else None
    return Prediction(completed, tuple(rooms), failures | without, trace, facing=facing)
