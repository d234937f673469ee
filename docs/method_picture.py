"""Draw the steps of ``paper`` on the map of the tutorial: ``python docs/method_picture.py`` writes ``method.png``."""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from shapely.geometry import MultiPolygon, Polygon

from closedrooms.core import OccupancyGrid, read_doors, read_map
from closedrooms.predictor import predict
from closedrooms.predictor.prediction import PredictionTrace

DOCS = Path(__file__).resolve().parent
TITLES = ("3.1 segments and lines", "3.1 unknown faces", "3.2 initial faces", "3.7 rooms")
LINES = {"wall": "tab:blue", "border": "tab:orange", "split": "tab:green"}


def main() -> None:
    """Predict with every stage kept and draw four of them side by side."""
    office = DOCS / "tutorial" / "office"
    grid, doors = read_map(office / "map.yaml"), read_doors(office / "doors.geojson")
    prediction = predict(grid, doors, "paper", trace=True)
    trace = prediction.trace
    assert isinstance(trace, PredictionTrace)
    figure, axes = plt.subplots(2, 2, figsize=(12, 9.4), layout="constrained")
    (first, second), (third, last) = axes
    for at, title in zip(axes.flat, TITLES, strict=True):
        draw_grid(at, prediction.grid if at is last else grid)
        at.set_title(title)
        at.plot(*np.array([door.midpoint for door in doors]).T, "o", color="tab:red", markersize=5)
        at.set_xticks([])
        at.set_yticks([])
    for (x0, y0, x1, y1), kind in zip(trace.lines, trace.line_kinds, strict=True):
        first.plot((x0, x1), (y0, y1), color=LINES[kind], linewidth=0.6)
    for x0, y0, x1, y1 in trace.segments:
        first.plot((x0, x1), (y0, y1), color="black", linewidth=2)
    for face, unknown in zip(trace.faces, trace.unknown, strict=True):
        fill(second, face, "tab:purple" if unknown else "none")
    for index in trace.initial.values():
        fill(third, trace.faces[index], "tab:blue")
    for room in prediction.rooms:
        fill(last, room.polygon, "tab:blue")
    low_x, low_y, high_x, high_y = first.dataLim.extents
    for at in axes.flat:
        at.set(xlim=(low_x, high_x), ylim=(low_y, high_y), aspect="equal")
    figure.savefig(DOCS / "pictures" / "method.png", dpi=80)


def draw_grid(axes: plt.Axes, grid: OccupancyGrid) -> None:
    """A map in grey: white free, black occupied."""
    low_x, low_y, high_x, high_y = grid.frame.bounds
    grey = np.where(grid.cells < 0, 0.8, 1.0 - grid.cells.clip(0, 100) / 100.0)
    axes.imshow(grey, cmap="gray", vmin=0, vmax=1, origin="lower", extent=(low_x, high_x, low_y, high_y))


def fill(axes: plt.Axes, shape: Polygon | MultiPolygon, colour: str) -> None:
    """A polygon, half transparent."""
    for part in getattr(shape, "geoms", (shape,)):
        axes.fill(*part.exterior.xy, facecolor=colour, edgecolor="black", alpha=0.4, linewidth=0.5)


if __name__ == "__main__":
    main()
