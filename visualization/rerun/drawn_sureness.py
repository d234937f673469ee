"""How sure a prediction is, in a recording: the probability of every cell, and a table of rooms."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
import rerun as rr

from closedrooms.core.grid import OccupancyGrid
from closedrooms.core.names import markdown_text
from closedrooms.core.room import Room
from closedrooms.visualization import colours
from closedrooms.visualization.rerun import drawables
from closedrooms.visualization.rerun.documents import text_document
from closedrooms.visualization.rerun.stream import RecordingStream

if TYPE_CHECKING:
    from closedrooms.predictor.prediction import Prediction

# A cell that is free for certain, and one that is not at all: where the map does not know.
SURE, NOT_AT_ALL = np.array(colours.ESTIMATE), np.full(3, colours.UNKNOWN)
NOTHING_YET = "Nothing is predicted yet."


def draw_sureness(
    stream: RecordingStream, observed: OccupancyGrid, prediction: "Prediction", iou: Mapping[str, float]
) -> None:
    """Draw the probability of each cell that the map does not know, and write the table of rooms.

    Args:
        stream: Where to.
        observed: The map.
        prediction: With the confidence of its rooms.
        iou: How well each room is predicted, by door, where the truth is known.
    """
    if prediction.probability is not None:
        stream.log("sureness/grid", probability_map(observed, prediction))
    stream.log("sureness/table", text_document(_table(prediction, iou)))


def draw_nothing_yet(stream: RecordingStream, observed: OccupancyGrid) -> None:
    """Draw what stands there before the first prediction."""
    stream.log("sureness/grid", drawables.grid_map(observed))
    stream.log("sureness/table", text_document(NOTHING_YET))


def probability_map(observed: OccupancyGrid, prediction: "Prediction") -> rr.GridMap:
    """Paint the map with the probability to be free floor: from grey, not at all, to blue, for certain."""
    from closedrooms.predictor.prediction import free_probability

    percent = free_probability(prediction, observed)
    known = observed.on(percent.frame)
    rows, cols = (np.flatnonzero((known.known | (percent.cells > 0)).any(axis=axis)) for axis in (1, 0))
    frame = percent.frame
    if rows.size:
        height, width = int(rows[-1] - rows[0]) + 1, int(cols[-1] - cols[0]) + 1
        frame = frame.cropped(int(rows[0]), int(cols[0]), height, width)
    chance = np.arange(101)[:, None] / 100.0
    shades = np.rint((1.0 - chance) * NOT_AT_ALL + chance * SURE).astype(np.uint8)
    pixels = shades[np.maximum(percent.on(frame).cells, 0)]
    cells = known.on(frame)
    pixels[cells.free] = colours.FREE
    pixels[cells.occupied] = colours.OCCUPIED
    return drawables.picture(pixels, frame)


def _table(prediction: "Prediction", iou: Mapping[str, float]) -> str:
    """Write a table of rooms, the least sure one first."""
    head = ["doors", "confidence", "IoU with the true room", "area [m²]", "or else, with its probability"]
    rooms = sorted(prediction.rooms, key=lambda room: (room.confidence or 0.0, room.doors))
    rows = [_row(room, iou) for room in rooms] or [["none", "", "", "", ""]]
    lines = [f"| {' | '.join(row)} |" for row in [head, ["---", "---:", "---:", "---:", "---"], *rows]]
    note = (
        "Confidence: the IoU that the room is expected to have with the true one. Rooms are fainter where less sure; "
        "dashed: what else they may be. Cells: from grey (no floor) to blue (floor for certain)."
    )
    return "\n".join(["# How sure", "", *lines, "", note])


def _row(room: Room, iou: Mapping[str, float]) -> list[str]:
    """Make the row of a room."""
    known = [iou[door] for door in room.doors if door in iou]
    others = "; ".join(f"{other.polygon.area:.1f} m², {100 * other.probability:.0f} %" for other in room.alternatives)
    return [
        markdown_text(", ".join(room.doors)),
        "seen" if room.confidence is None else f"{room.confidence:.2f}",
        f"{min(known):.2f}" if known else "",
        f"{room.polygon.area:.1f}",
        others or "nothing else",
    ]
