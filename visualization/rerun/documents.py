"""Texts of a recording: legend, configuration, rooms as a table and as lines of the log."""

import json
from collections.abc import Mapping
from typing import TYPE_CHECKING

import rerun as rr

from closedrooms.core.names import markdown_text
from closedrooms.core.room import Room

if TYPE_CHECKING:
    from closedrooms.predictor.prediction import Prediction

LEGEND = """| colour | what |
| --- | --- |
| blue | estimated robot and path |
| green | true robot and path |
| orange | odometry |
| sky blue | scan |
| red | closed doors |
| pink | frontiers |
| yellow | goal and the way there |
| violet | loops that were closed |
| ochre | people and boxes that move |
| crimson | where the robot touched something |
"""


def text_document(text: str) -> rr.TextDocument:
    """Make a document of Markdown."""
    return rr.TextDocument(text, media_type=rr.MediaType.MARKDOWN)


def configuration_text(values: Mapping[str, object]) -> str:
    """Write a configuration as Markdown."""
    return f"# Configuration\n```json\n{json.dumps(values, indent=2, default=str)}\n```"


def rooms_table(prediction: "Prediction") -> str:
    """Write the table that stands under ``result`` until the run's own comes."""
    rows = [
        [", ".join(room.doors), room.kind or "", f"{room.polygon.area:.1f} m²", "cut" if room.bounded else ""]
        for room in prediction.rooms
    ]
    rows += [[door, f"not predicted: {why}", "", ""] for door, why in prediction.failures.items()]
    rows = [[markdown_text(cell) for cell in row] for row in rows]
    head = [["doors", "room", "area", "search"], ["---"] * 4]
    return "\n".join(["# Prediction", "", *("| " + " | ".join(row) + " |" for row in [*head, *rows])])


def room_line(room: Room, iou: Mapping[str, float]) -> str:
    """Describe a predicted room in one line of the log."""
    known = [iou[door] for door in room.doors if door in iou]
    held = f", IoU with the true room {min(known):.2f}" if known else ""
    sure = "" if room.confidence is None else f", confidence {room.confidence:.2f}"
    kind = f"{room.kind} room" if room.kind else "room"
    return f"behind {', '.join(room.doors)}: {kind} of {room.polygon.area:.1f} m²{sure}{held}"
