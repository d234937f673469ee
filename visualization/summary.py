"""``summary.png``: one look at a run, a prediction or a tour."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from closedrooms.core.arrays import FloatArray
from closedrooms.core.door import ClosedDoor
from closedrooms.core.files.outgoing import write_bytes
from closedrooms.core.grid import Bounds, OccupancyGrid
from closedrooms.core.names import shown
from closedrooms.core.room import Room
from closedrooms.visualization import colours

if TYPE_CHECKING:
    from closedrooms.coverage.tour.coverage_tour import CoverageTour
    from closedrooms.predictor.prediction import Prediction
    from closedrooms.visualization.canvas import Canvas, Pixels

# Size of one panel, of the strip with its title, and of the gap between panels [pixels].
PANEL, TITLE, GAP = 900, 40, 14
# Size of a title's letters, and from one of its lines to the next [pixels].
LETTERS, LINE = 22, 28
# A room lower than this has its name and figure on one line [pixels].
TWO_LINES = 44
# Opacity of a room that is not sure at all and of one that is sure; how sure a room counts of which nothing is known.
FAINTEST, STRONGEST, USUAL = 0.08, 0.64, 0.57
# Free space around what is known [m].
MARGIN = 1.0

Panel = tuple[str, "Pixels"]


def draw_summary(
    path: Path,
    observed: OccupancyGrid,
    prediction: "Prediction",
    doors: Sequence[ClosedDoor],
    *,
    truth: OccupancyGrid | None = None,
    truth_rooms: Sequence[Room] = (),
    room_iou: Mapping[str, float] | None = None,
    tours: Mapping[str, "CoverageTour"] | None = None,
    trajectory: FloatArray | None = None,
) -> None:
    """Write one picture: the map, the prediction, and where they are known the truth and the tour.

    Args:
        path: The PNG.
        observed: M, with the closed doors unseen behind.
        prediction: Rooms and M_pred.
        doors: Closed doors in the map.
        truth: M_GT.
        truth_rooms: True rooms behind the closed doors.
        room_iou: How well each room was predicted, by door id.
        tours: Coverage tours; that for ``predicted`` is drawn.
        trajectory: Where the robot went, shape (n, 2 or 3) [m].

    Raises:
        OutputError: The folder cannot be written.
    """
    grids = [observed, prediction.grid, *([] if truth is None else [truth])]
    bounds = _bounds(grids, [other.polygon for room in prediction.rooms for other in room.alternatives])
    palette = colours.room_colours([d.id for d in doors] + [d for room in truth_rooms for d in room.doors])
    panels = [
        _map_panel(bounds, observed, doors, trajectory),
        _prediction_panel(bounds, prediction, doors, room_iou or {}, palette),
    ]
    if truth is not None:
        panels.append(_truth_panel(bounds, truth, truth_rooms, prediction, palette))
    if tours and "predicted" in tours:
        panels.append(_tour_panel(bounds, prediction.grid, tours["predicted"], "Coverage tour on the predicted map"))
    _write(path, panels)


def draw_cover(path: Path, grid: OccupancyGrid, doors: Sequence[ClosedDoor], tour: "CoverageTour") -> None:
    """Write one picture of a map with its topological graph and the tour over it.

    Args:
        path: The PNG.
        grid: The map.
        doors: Closed doors in the map.
        tour: Graph and tour.

    Raises:
        OutputError: The folder cannot be written.
    """
    _write(path, [_tour_panel(_bounds([grid]), grid, tour, "Coverage tour", doors=doors)])


def draw_map(path: Path, grid: OccupancyGrid, doors: Sequence[ClosedDoor], trajectory: FloatArray) -> None:
    """Write one picture of a map with the path that the robot took.

    Args:
        path: The PNG.
        grid: The map.
        doors: Closed doors in the map.
        trajectory: ``(x, y, theta)``, shape (n, 3), map frame.

    Raises:
        OutputError: The folder cannot be written.
    """
    _write(path, [_map_panel(_bounds([grid]), grid, doors, trajectory)])


def _map_panel(
    bounds: Bounds, grid: OccupancyGrid, doors: Sequence[ClosedDoor], trajectory: FloatArray | None
) -> Panel:
    """Draw the map with its doors and the estimated path."""
    canvas = _canvas(bounds)
    canvas.grid(grid)
    if trajectory is not None and len(trajectory):
        path = np.asarray(trajectory)[:, :2]
        canvas.line(path, colours.ESTIMATE, width=2)
        canvas.dots(path[:1], colours.ESTIMATE, radius=6)
    _draw_doors(canvas, doors, named=True)
    plural = "" if len(doors) == 1 else "s"
    return f"Map with {len(doors)} closed door{plural}", canvas.finished()


def _prediction_panel(
    bounds: Bounds,
    prediction: "Prediction",
    doors: Sequence[ClosedDoor],
    room_iou: Mapping[str, float],
    palette: Mapping[str, colours.Colour],
) -> Panel:
    """Draw the completed map, rooms in the colours of their doors, with their IoU where it is known."""
    canvas = _canvas(bounds)
    canvas.grid(prediction.grid)
    _draw_rooms(canvas, prediction.rooms, palette, room_iou)
    _draw_doors(canvas, doors)
    title = f"Predicted: {len(prediction.rooms)} of {len(doors)} closed doors"
    if any(room.alternatives for room in prediction.rooms):
        title += " (faint: less sure, dashed: or else)"
    if room_iou:
        title += f", mean IoU {np.mean(list(room_iou.values())):.2f}"
    return title, canvas.finished()


def _truth_panel(
    bounds: Bounds,
    truth: OccupancyGrid,
    rooms: Sequence[Room],
    prediction: "Prediction",
    palette: Mapping[str, colours.Colour],
) -> Panel:
    """Draw the true map and rooms, the outlines of the predicted ones over them."""
    canvas = _canvas(bounds)
    canvas.grid(truth)
    _draw_rooms(canvas, rooms, palette, {})
    for room in prediction.rooms:
        canvas.outline(room.polygon, colours.INK, width=2)
    return "Truth (dark outline: predicted)", canvas.finished()


def _tour_panel(
    bounds: Bounds, grid: OccupancyGrid, tour: "CoverageTour", title: str, *, doors: Sequence[ClosedDoor] = ()
) -> Panel:
    """Draw a tour over the graph and the map that it was planned on."""
    canvas = _canvas(bounds)
    canvas.grid(grid)
    graph, path = tour.graph, np.asarray(tour.path, dtype=np.float64).reshape(-1, 2)
    for edge in graph.pairs:
        canvas.line(np.asarray(graph.vertices)[edge], (175, 175, 185), width=1)
    canvas.course(path, width=2)
    canvas.dots(graph.vertices, colours.INK, radius=2.5)
    canvas.dots(path[:1], colours.TOURS["truth"], radius=7)
    _draw_doors(canvas, doors, named=True)
    return f"{title}: {tour.length:.0f} m (blue to orange, from the green dot)", canvas.finished()


def _draw_doors(canvas: "Canvas", doors: Sequence[ClosedDoor], *, named: bool = False) -> None:
    for door in doors:
        if door.segment is not None:
            canvas.line(np.asarray(door.segment), colours.DOOR_CLOSED, width=4)
        canvas.dots(np.array([door.midpoint]), colours.DOOR_CLOSED, radius=4)
        if named:
            canvas.text((door.midpoint[0], door.midpoint[1] + 14 / canvas.scale), door.id, colour=colours.DOOR_CLOSED)


def room_opacity(confidence: float) -> float:
    """Choose how strongly a room of a confidence is drawn, 0..1."""
    return FAINTEST + (STRONGEST - FAINTEST) * confidence


def _draw_rooms(
    canvas: "Canvas", rooms: Sequence[Room], palette: Mapping[str, colours.Colour], figures: Mapping[str, float]
) -> None:
    for room in rooms:
        colour = palette.get(next(iter(room.doors), ""), colours.INK)
        sure = USUAL if room.confidence is None else room.confidence
        for other in room.alternatives:
            canvas.dashed(other.polygon, colour)
        canvas.fill(room.polygon, colour, opacity=room_opacity(sure))
        canvas.outline(room.polygon, colour)
        label = "+".join(room.doors)
        known = [figures[door] for door in room.doors if door in figures]
        if known:
            _, low, _, high = room.polygon.bounds
            label += ("\n" if (high - low) * canvas.scale > TWO_LINES else "  ") + f"{max(known):.2f}"
        place = shapely.get_coordinates(room.polygon.representative_point())[0]
        canvas.text(place, label)


def _bounds(grids: Sequence[OccupancyGrid], shapes: Sequence[BaseGeometry] = ()) -> Bounds:
    """Find the bounds of what is known in any of the grids, and of some shapes, with a margin [m]."""
    boxes = [shape.bounds for shape in shapes if not shape.is_empty]
    for grid in grids:
        window = grid.known_bounds()
        if window is not None:
            boxes.append(grid.frame.cropped(*window).bounds)
    if not boxes:
        return grids[0].frame.bounds
    x_min, y_min = np.min(boxes, axis=0)[:2] - MARGIN
    x_max, y_max = np.max(boxes, axis=0)[2:] + MARGIN
    return (float(x_min), float(y_min), float(x_max), float(y_max))


def _canvas(bounds: Bounds) -> "Canvas":
    """Make an empty panel that shows ``bounds`` [m]."""
    from closedrooms.visualization.canvas import Canvas

    x_min, y_min, x_max, y_max = bounds
    return Canvas(bounds, PANEL / max(x_max - x_min, y_max - y_min))


def _write(path: Path, panels: Sequence[Panel]) -> None:
    """Write panels in the grid nearest to the shape of a screen, each under its title, as PNG."""
    import cv2
    from PIL import Image, ImageDraw

    from closedrooms.visualization.canvas import font

    titles, widest = _wrapped([title for title, _ in panels], panels[0][1].shape[1])
    height, width = panels[0][1].shape[0], max(panels[0][1].shape[1], widest)
    strip = TITLE + LINE * (max(len(lines) for lines in titles) - 1)
    cols = min(
        range(1, len(panels) + 1),
        key=lambda n: abs(math.log(n * width / (math.ceil(len(panels) / n) * (height + strip)) / 1.4)),
    )
    rows = math.ceil(len(panels) / cols)
    step_x, step_y = width + GAP, height + strip + GAP
    image = Image.new("RGB", (cols * step_x + GAP, rows * step_y + GAP), "white")
    draw = ImageDraw.Draw(image)
    for number, (lines, (_, pixels)) in enumerate(zip(titles, panels, strict=True)):
        x, y = GAP + number % cols * step_x, GAP + number // cols * step_y
        for line, text in enumerate(lines):
            at = (x + 2, y + TITLE / 2 + LINE * line)
            draw.text(at, text, fill=colours.INK, font=font(LETTERS), anchor="lm")
        image.paste(Image.fromarray(pixels), (x, y + strip))
    # A third of the time that Pillow takes, for a tenth more bytes.
    settings = [cv2.IMWRITE_PNG_COMPRESSION, 3, cv2.IMWRITE_PNG_FILTER, cv2.IMWRITE_PNG_FILTER_NONE]
    write_bytes(path, cv2.imencode(".png", np.asarray(image)[..., ::-1], settings)[1].tobytes())


def _wrapped(titles: Sequence[str], width: int) -> tuple[list[list[str]], int]:
    """Break titles into lines that fit a width [pixels]; also returns the width of the widest line."""
    from closedrooms.visualization.canvas import font

    length = font(LETTERS).getlength
    wrapped = []
    for title in titles:
        lines: list[str] = []
        for word in shown(title).split() or [""]:
            longer = f"{lines[-1]} {word}" if lines else word
            lines[-1:] = [longer] if not lines or length(longer) <= width - 2 else [lines[-1], word]
        wrapped.append(lines)
    return wrapped, math.ceil(max(length(line) for lines in wrapped for line in lines)) + 2
