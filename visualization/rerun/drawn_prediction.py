"""A prediction in a recording, stage by stage, and the tours on the maps."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
import rerun as rr
import shapely
from shapely.geometry.base import BaseGeometry

from closedrooms.core.door import ClosedDoor
from closedrooms.core.grid import OccupancyGrid
from closedrooms.core.room import Room
from closedrooms.visualization import colours
from closedrooms.visualization.colours import Colour
from closedrooms.visualization.rerun import drawables
from closedrooms.visualization.rerun.documents import text_document
from closedrooms.visualization.rerun.stream import RecordingStream, Stage

if TYPE_CHECKING:
    from closedrooms.predictor.prediction import PredictionTrace

# Opacity of a room of which nothing tells how sure it is, of one that is not sure at all, and of one that is sure.
USUAL, FAINTEST, STRONGEST = 110, 25, 190
LINE_COLOURS: dict[str, Colour] = {"wall": (0, 114, 178), "border": (110, 110, 120), "split": (213, 94, 0)}


def draw_doors(stream: RecordingStream, root: str, doors: Sequence[ClosedDoor]) -> None:
    """Draw closed doors with their ids: a bar from jamb to jamb where known, a dot in the middle."""
    places = np.array([door.midpoint for door in doors], dtype=np.float64).reshape(-1, 2)
    bars = [np.asarray(door.segment) for door in doors if door.segment is not None]
    labels = [door.id for door in doors]
    stream.log(f"{root}/bars", drawables.strips(bars, colours.DOOR_CLOSED, radius=drawables.THICK, z=drawables.Z_PATH))
    stream.log(f"{root}/ids", drawables.points(places, colours.PAPER, radius=drawables.THIN, labels=labels))


def draw_input(stream: RecordingStream, grid: OccupancyGrid, doors: Sequence[ClosedDoor]) -> None:
    """Draw what a prediction starts from."""
    stream.log("prediction/input", drawables.grid_map(grid))
    draw_doors(stream, "prediction/doors", doors)


def draw_trace(
    stream: RecordingStream, trace: "PredictionTrace", palette: Mapping[str, Colour], *, staged: bool
) -> None:
    """Draw segments, lines, faces, initial faces and the expansion level by level, a stage each if ``staged``."""
    _draw_segments(stream, trace, staged=staged)
    _draw_lines(stream, trace, staged=staged)
    _draw_faces(stream, trace, staged=staged)
    if staged:
        stream.at(stage=Stage.INITIAL)
        stream.say("Initial faces", f"{len(trace.initial)} doors, each with the unknown face behind it (section 3.3)")
    stream.clear("prediction/initial")
    for door, face in sorted(trace.initial.items()):
        stream.log(f"prediction/initial/{door}", drawables.filled([trace.faces[face]], palette[door], alpha=170))
    stream.clear("prediction/layouts")
    for level in trace.levels if staged else trace.levels[-1:]:
        if staged:
            stream.at(stage=min(Stage.EXPANSION + level.k, Stage.ROOMS - 1))
            best = ", ".join(f"{door} {score:.1f}" for door, score in sorted(level.scores.items()))
            stream.say(f"Expansion, level {level.k}", f"score by door: {best or 'none'} (section 3.4)")
        for door, shape in sorted(level.layouts.items()):
            _draw_room(stream, f"prediction/layouts/{door}", shape, palette[door])
            if staged and door in level.scores:
                stream.log(f"metrics/score/{door}", rr.Scalars(level.scores[door]))
    if staged:
        _draw_scores(stream, trace, palette)


def draw_rooms(
    stream: RecordingStream,
    root: str,
    grid: OccupancyGrid,
    rooms: Sequence[Room],
    palette: Mapping[str, Colour],
    *,
    iou: Mapping[str, float] | None = None,
    static: bool = False,
) -> None:
    """Draw a whole map with the rooms in their doors' colours, fainter where less sure, dashed what else they may be.

    They are labelled with IoU where known, else area, and with their confidence.
    """
    stream.log(f"{root}/grid", drawables.grid_map(grid), static=static)
    if not static:
        stream.clear(f"{root}/rooms")
        stream.clear(f"{root}/alternatives")
    names = ["+".join(room.doors) or f"room-{number}" for number, room in enumerate(rooms)]
    for name, room in zip(names, rooms, strict=True):
        colour = palette.get(next(iter(room.doors), ""), colours.INK)
        _draw_room(stream, f"{root}/rooms/{name}", room.polygon, colour, static=static, alpha=_alpha(room))
        if room.alternatives:
            others = drawables.dashed([other.polygon for other in room.alternatives], colour)
            stream.log(f"{root}/alternatives/{name}", others, static=static)
    places = np.array([shapely.get_coordinates(r.polygon.representative_point())[0] for r in rooms]).reshape(-1, 2)
    stream.log(
        f"{root}/labels",
        drawables.points(places, colours.PAPER, radius=drawables.THIN, labels=[_label(r, iou or {}) for r in rooms]),
        static=static,
    )


def _draw_segments(stream: RecordingStream, trace: "PredictionTrace", *, staged: bool) -> None:
    """Draw segments coloured by the line that they belong to; those of none in grey."""
    if staged:
        stream.at(stage=Stage.SEGMENTS)
    segments = np.asarray(trace.segments).reshape(-1, 2, 2)
    clusters = np.asarray(trace.clusters)
    chosen = [
        colours.ROOM_COLOURS[cluster % len(colours.ROOM_COLOURS)] if cluster >= 0 else (130, 130, 130)
        for cluster in clusters.tolist()
    ]
    if staged:
        stream.say("Wall segments", f"{len(segments)} segments on {clusters.max(initial=-1) + 1} lines (section 3.1)")
    stream.log("prediction/segments", drawables.strips(list(segments), *chosen, radius=drawables.THICK))


def _draw_lines(stream: RecordingStream, trace: "PredictionTrace", *, staged: bool) -> None:
    """Draw lines coloured by their kind: along a wall, the border, or a split."""
    if staged:
        stream.at(stage=Stage.LINES)
    lines = np.asarray(trace.lines).reshape(-1, 2, 2)
    kinds = np.asarray(trace.line_kinds)
    counts = ", ".join(f"{int((kinds == kind).sum())} {kind}" for kind in dict.fromkeys(trace.line_kinds))
    if staged:
        stream.say("Lines", f"{counts} (section 3.1)")
    for kind in dict.fromkeys(trace.line_kinds):
        stream.log(
            f"prediction/lines/{kind}",
            drawables.strips(list(lines[kinds == kind]), LINE_COLOURS.get(kind, colours.INK)),
        )


def _draw_faces(stream: RecordingStream, trace: "PredictionTrace", *, staged: bool) -> None:
    """Draw unknown faces filled, those at the border paler; the edges of all."""
    if staged:
        stream.at(stage=Stage.FACES)
    unknown, border = np.asarray(trace.unknown, dtype=bool), np.asarray(trace.border, dtype=bool)
    if staged:
        stream.say("Faces", f"{len(trace.faces)} faces, {int(unknown.sum())} of them unknown (section 3.2)")
    stream.log("prediction/faces/edges", drawables.outlines(trace.faces, (120, 120, 130), radius=drawables.THIN))
    for name, chosen, colour in (
        ("unknown", unknown & ~border, (86, 180, 233)),
        ("border", unknown & border, (160, 160, 200)),
        ("known", ~unknown, (240, 228, 66)),
    ):
        stream.log(
            f"prediction/faces/{name}",
            drawables.filled([face for face, take in zip(trace.faces, chosen, strict=True) if take], colour, alpha=90),
        )


def _draw_scores(stream: RecordingStream, trace: "PredictionTrace", palette: Mapping[str, Colour]) -> None:
    """Write the scores as a table, a row a level and a column a door; say how their curves look."""
    doors = sorted({door for level in trace.levels for door in level.scores})
    rows = [
        [str(level.k), *(f"{level.scores[door]:.2f}" if door in level.scores else "" for door in doors)]
        for level in trace.levels
    ]
    lines = ["| " + " | ".join(row) + " |" for row in [["level", *doors], ["---:"] * (len(doors) + 1), *rows]]
    stream.log("prediction/scores", text_document("\n".join(lines)), static=True)
    for door in doors:
        stream.log(
            f"metrics/score/{door}",
            rr.SeriesLines(colors=[palette[door]], names=[door], widths=[2.0]),
            rr.SeriesPoints(colors=[palette[door]], marker_sizes=[4.0]),
            static=True,
        )


def _draw_room(
    stream: RecordingStream,
    root: str,
    shape: BaseGeometry,
    colour: Colour,
    *,
    static: bool = False,
    alpha: int = USUAL,
) -> None:
    """Draw a room filled, and its outline."""
    stream.log(root, drawables.filled([shape], colour, alpha=alpha), static=static)
    stream.log(f"{root}/outline", drawables.outlines([shape], colour), static=static)


def _label(room: Room, iou: Mapping[str, float]) -> str:
    """Write a room's doors with the IoU of the worst of them, or its area, and how sure it is."""
    known = [iou[door] for door in room.doors if door in iou]
    figure = f"IoU {min(known):.2f}" if known else f"{room.polygon.area:.1f} m²"
    sure = "" if room.confidence is None else f", confidence {room.confidence:.2f}"
    return f"{'+'.join(room.doors)}  {figure}{sure}"


def _alpha(room: Room) -> int:
    """Compute how strongly a room is filled, 0 to 255."""
    return USUAL if room.confidence is None else round(FAINTEST + (STRONGEST - FAINTEST) * room.confidence)
