"""What a method that weighs whole rooms saw and weighed, in a recording."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
import rerun as rr
import shapely

from closedrooms.core.arrays import FloatArray
from closedrooms.core.names import markdown_text
from closedrooms.visualization import colours
from closedrooms.visualization.colours import Colour
from closedrooms.visualization.rerun import drawables
from closedrooms.visualization.rerun.documents import text_document
from closedrooms.visualization.rerun.stream import RecordingStream, Stage

if TYPE_CHECKING:
    from closedrooms.predictor.prediction import WeighedRoom, WeighedTrace

# Candidates that are drawn and listed beside the chosen one: the best by their joint score.
DRAWN, LISTED = 12, 4
# Bars of a chart: the terms in which the chosen candidate and the runner-up differ most.
BARS = 12
CHOSEN, RUNNER_UP = "chosen", "runner_up"
BAR_COLOURS: dict[str, Colour] = {CHOSEN: colours.ESTIMATE, RUNNER_UP: colours.LOOP}


def room_name(room: "WeighedRoom") -> str:
    """Name a room for entity paths."""
    return rr.escape_entity_path_part("+".join(room.doors))


def draw_weighed(
    stream: RecordingStream, trace: "WeighedTrace", palette: Mapping[str, Colour], *, staged: bool
) -> None:
    """Draw wall faces, candidates and choice, each a stage of its own where ``staged``."""
    _draw_faces(stream, trace, staged=staged)
    if staged:
        stream.at(stage=Stage.INITIAL)
        count = sum(len(room.scores) for room in trace.rooms)
        stream.say("Candidates", f"{count} rectangles between plausible walls, for {len(trace.rooms)} rooms")
    stream.clear("prediction/candidates")
    for room in trace.rooms:
        _draw_candidates(stream, room, palette)
    stream.clear("prediction/layouts")
    for level in trace.levels if staged else trace.levels[-1:]:
        if staged:
            stream.at(stage=Stage.EXPANSION + level.k)
            stream.say(*LEVELS[min(level.k, 1)])
        for door, shape in sorted(level.layouts.items()):
            path = f"prediction/layouts/{rr.escape_entity_path_part(door)}"
            stream.log(path, drawables.filled([shape], palette[door]))
            stream.log(f"{path}/outline", drawables.outlines([shape], palette[door]))
    if staged:
        for room in trace.rooms:
            _draw_bars(stream, room)
        stream.log("weighing/candidates", text_document(_candidates_table(trace.rooms)), static=True)


LEVELS = (
    ("Each room by itself", "the rectangle of every door with the best evidence of its own"),
    ("Rooms together", "rectangles that do not overlap, share walls, and end in one line with their neighbours"),
)


def _draw_faces(stream: RecordingStream, trace: "WeighedTrace", *, staged: bool) -> None:
    """Draw wall faces, a colour for each direction that they face."""
    faces = np.asarray(trace.faces).reshape(-1, 2, 2)
    ways = np.round(np.degrees(trace.directions)).astype(int) % 360
    distinct = sorted(set(ways.tolist()))
    if staged:
        stream.at(stage=Stage.SEGMENTS)
        stream.say("Wall faces", f"{len(faces)} stretches that face {len(distinct)} ways")
    chosen = [colours.ROOM_COLOURS[distinct.index(way) % len(colours.ROOM_COLOURS)] for way in ways.tolist()]
    stream.log("prediction/wall_faces", drawables.strips(list(faces), *chosen, radius=drawables.THICK))


def _draw_candidates(stream: RecordingStream, room: "WeighedRoom", palette: Mapping[str, Colour]) -> None:
    """Draw the best candidates as thin outlines with joint scores, the chosen one filled, the runner-up in violet."""
    root = f"prediction/candidates/{room_name(room)}"
    colour = palette[room.doors[0]]
    shapes = np.asarray(shapely.polygons(room.corners))
    best = np.argsort(-room.joint, kind="stable")[:DRAWN]
    stream.log(f"{root}/others", drawables.outlines(list(shapes[best]), colour, radius=drawables.THIN))
    stream.log(f"{root}/{CHOSEN}", drawables.filled([shapes[room.chosen]], colour))
    stream.log(f"{root}/{CHOSEN}/outline", drawables.outlines([shapes[room.chosen]], colour, radius=drawables.THICK))
    places, labels = [_corner(room.corners[room.chosen], 0)], [f"{'+'.join(room.doors)} {room.joint[room.chosen]:.1f}"]
    if room.runner_up is not None:
        outline = drawables.outlines([shapes[room.runner_up]], BAR_COLOURS[RUNNER_UP], z=drawables.Z_PATH)
        stream.log(f"{root}/{RUNNER_UP}", outline)
        places.append(_corner(room.corners[room.runner_up], 2))
        labels.append(f"{room.joint[room.runner_up]:.1f}")
    stream.log(
        f"{root}/scores", drawables.points(np.array(places), colours.PAPER, radius=drawables.THIN, labels=labels)
    )


def _corner(corners: FloatArray, number: int) -> FloatArray:
    """Find a place a little inside one corner of a rectangle."""
    return np.asarray(0.8 * corners[number] + 0.2 * corners.mean(axis=0))


def _draw_bars(stream: RecordingStream, room: "WeighedRoom") -> None:
    """Draw a pair of bars a term, those first in which the chosen candidate and the runner-up differ most."""
    terms = sorted(room.terms.items(), key=lambda item: (-abs(item[1][0] - item[1][1]), item[0]))[:BARS]
    at = np.arange(1.0, len(terms) + 1)
    pairs = np.array([pair for _, pair in terms]).reshape(-1, 2)
    for column, (name, colour) in enumerate(BAR_COLOURS.items()):
        shift = 0.2 if column else -0.2
        widths = np.full(len(terms), 0.38)
        bars = rr.BarChart(pairs[:, column], color=[*colour, 255], abscissa=at + shift, widths=widths)
        stream.log(f"weighing/{room_name(room)}/{name}", bars, static=True)
    head = ["| bar | evidence | chosen (blue) | runner-up (violet) |", "| ---: | --- | ---: | ---: |"]
    rows = [f"| {number} | {name} | {a:+.2f} | {b:+.2f} |" for number, (name, (a, b)) in enumerate(terms, 1)]
    second = 0.0 if room.runner_up is None else room.joint[room.runner_up]
    rest = room.joint[room.chosen] - pairs[:, 0].sum(), second - pairs[:, 1].sum()
    rows += [
        f"| | all other terms | {rest[0]:+.2f} | {rest[1]:+.2f} |",
        f"| | **score** | **{room.joint[room.chosen]:.2f}** | **{second:.2f}** |",
    ]
    title = markdown_text(", ".join(room.doors))
    none = "" if room.runner_up is not None else "\n\nAll candidates are much the same room: there is no runner-up."
    table = "\n".join([f"## {title}", "", *head, *rows]) + none
    stream.log(f"weighing/{room_name(room)}/terms", text_document(table), static=True)


def _candidates_table(rooms: Sequence["WeighedRoom"]) -> str:
    """Write a table of the chosen candidate and the best others of each room."""
    lines = ["| doors | candidate | size [m] | score by itself | beside its neighbours |"]
    lines.append("| --- | --- | ---: | ---: | ---: |")
    for room in rooms:
        best = [int(i) for i in np.argsort(-room.joint, kind="stable")[:LISTED] if i != room.chosen]
        listed = [room.chosen, *best]
        if room.runner_up is not None and room.runner_up not in listed:
            listed.append(room.runner_up)
        for at in listed:
            what = "**chosen**" if at == room.chosen else "runner-up" if at == room.runner_up else "other"
            sides = np.linalg.norm(np.diff(room.corners[at][:3], axis=0), axis=1)
            doors = markdown_text(", ".join(room.doors))
            scores = f"{room.scores[at]:.2f} | {room.joint[at]:.2f}"
            lines.append(f"| {doors} | {what} | {sides[0]:.2f} x {sides[1]:.2f} | {scores} |")
    note = "The chosen one agrees best with all candidates, weighed by their scores: it need not have the highest."
    return "\n".join(["# Candidates", "", *lines, "", note])
