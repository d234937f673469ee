"""What a recording shows of a prediction."""

import numpy as np
import shapely

from closedrooms.predictor.paper.arrangement import draw_line
from closedrooms.predictor.paper.expansion import Growth
from closedrooms.predictor.paper.finished_rooms import unite
from closedrooms.predictor.paper.initial_layouts import InitialFaces
from closedrooms.predictor.prediction import Level, PredictionTrace


def level_of(k: int, growth: Growth) -> Level:
    """List the layouts as they are after step ``k``."""
    names = [entrance.door.id for entrance in growth.entrances]
    shapes = {name: unite(growth, room) for room, name in enumerate(names)}
    return Level(k, shapes, dict(zip(names, growth.scores, strict=True)))


def trace_of(start: InitialFaces, levels: list[Level]) -> PredictionTrace:
    """Collect every stage of a prediction, for recordings and pictures.

    Args:
        start: Structure, faces and entrances.
        levels: Layouts after each step, as they were reported.

    Returns:
        The stages in the map frame; the lines clipped to the box of the faces.
    """
    arrangement = start.arrangement
    box = shapely.union_all(list(arrangement.faces)).envelope
    reach = float(np.hypot(box.bounds[2] - box.bounds[0], box.bounds[3] - box.bounds[1]))
    centre = np.array(box.centroid.coords[0])
    clipped = []
    full = [line for line in arrangement.lines if line.span is None]
    for line in arrangement.lines:
        string = draw_line(line, full, centre, reach)
        clipped.append(shapely.get_coordinates(string.intersection(box.buffer(1e-6)))[[0, -1]].ravel())
    return PredictionTrace(
        segments=start.structure.segments,
        clusters=start.structure.clusters,
        lines=np.array(clipped).reshape(-1, 4),
        line_kinds=tuple(line.kind for line in arrangement.lines),
        faces=arrangement.faces,
        unknown=start.unknown,
        border=arrangement.border,
        initial={entrance.door.id: entrance.face for entrance in start.entrances},
        levels=tuple(levels),
    )
