"""Pictures of a sweep: curves by level, and maps."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from shapely.geometry import Polygon

from closedrooms.core.errors import InvalidInputError
from closedrooms.core.files.geojson import read_doors, read_rooms
from closedrooms.core.files.rosmap import read_map
from closedrooms.experiments.evaluation.reporting.figures import TITLE, same_extent, save_figure
from closedrooms.experiments.robustness.config import Factor
from closedrooms.experiments.robustness.levels import UNITS, Case
from closedrooms.experiments.robustness.onset import LevelResult, Onset
from closedrooms.visualization.colours import DOOR_CLOSED, FREE, OCCUPIED, ROOM_COLOURS, UNKNOWN

# Column of the figure: measures, their names, and the label of the axis.
COLUMNS: tuple[tuple[str, dict[str, str]], ...] = (
    ("mapping error [m]", {"ate_m": "trajectory", "walls_m": "walls", "doors_m": "doors"}),
    (
        "IoU of hidden rooms",
        {
            "iou": "as it is",
            "iou_true_poses": "+ true poses",
            "iou_true_doors": "+ true doors",
            "iou_true_walls": "+ true walls",
        },
    ),
    (
        "error of the coverage cost [%]",
        {"error_predicted": "predicted", "error_closed": "closed", "error_baseline": "baseline"},
    ),
)


def draw_curves(path: Path, results: Sequence[LevelResult], found: Sequence[Onset]) -> None:
    """Draw a row a factor: mapping error, IoU with more and more stages repaired, coverage error, against the levels.

    What was not measured, as the coverage error without tours, has no column.

    Args:
        path: The PNG.
        results: Of every level.
        found: Where the prediction starts to suffer: a dotted line.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    factors = list(dict.fromkeys(result.factor for result in results))
    measured = {name for result in results for name, mean in result.means.items() if mean is not None}
    columns = [(label, measures) for label, measures in COLUMNS if measured & measures.keys()]
    figure = Figure(figsize=(5 * len(columns), 3.1 * len(factors)), layout="constrained")
    FigureCanvasAgg(figure)
    grid = figure.subplots(len(factors), len(columns), squeeze=False)
    onset = {entry.factor: entry.level for entry in found}
    for line, factor in zip(grid, factors, strict=True):
        own = sorted((result for result in results if result.factor == factor), key=lambda result: result.level)
        for axes, (label, measures) in zip(line, columns, strict=True):
            for number, (name, title) in enumerate(measures.items()):
                _curve(axes, own, name, title, ROOM_COLOURS[number])
            if onset.get(factor) is not None:
                axes.axvline(onset[factor], color="#999999", linestyle=":")
            axes.set(xlabel=UNITS[_factor(factor)], ylabel=label)
            axes.set_ylim(bottom=0.0)
            axes.grid(alpha=0.3)
            if axes.get_legend_handles_labels()[0]:
                axes.legend(fontsize=7)
    save_figure(figure, path)


def _factor(name: str) -> Factor:
    return next(factor for factor in UNITS if factor == name)


def _curve(axes: Any, results: Sequence[LevelResult], name: str, title: str, colour: tuple[int, int, int]) -> None:
    """Draw means, and around them the interval of the difference to the first level."""
    points = [(result, result.means.get(name)) for result in results]
    points = [(result, mean) for result, mean in points if mean is not None]
    if not points:
        return
    colours = [v / 255 for v in colour]
    axes.plot(
        [r.level for r, _ in points], [mean for _, mean in points], "o-", markersize=3, color=colours, label=title
    )
    for result, mean in points:
        difference = result.differences.get(name)
        if difference is not None and mean is not None:
            spread = (mean + difference.low - difference.mean, mean + difference.high - difference.mean)
            axes.plot([result.level] * 2, spread, color=colours, linewidth=0.8)


def draw_maps(path: Path, folder: Path, wanted: Sequence[Case]) -> bool:
    """Draw a row a factor, a column a level: map, detected doors, true rooms (orange) and predicted ones (blue).

    Args:
        path: The PNG.
        folder: Of one world, with a folder a level.
        wanted: Levels to draw.

    Returns:
        Whether there was anything to draw.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    factors = list(dict.fromkeys(case.factor for case in wanted))
    columns = max(case.number for case in wanted) + 1
    figure = Figure(figsize=(3.2 * columns, 2.4 * len(factors)), layout="constrained")
    FigureCanvasAgg(figure)
    grid = figure.subplots(len(factors), columns, squeeze=False)
    for axes in grid.ravel():
        axes.axis("off")
    drawn = False
    for case in wanted:
        axes = grid[factors.index(case.factor), case.number]
        try:
            _map(axes, folder / case.name)
        except InvalidInputError:
            continue
        axes.set_title(f"{case.factor} {case.level:g}", fontsize=9, y=TITLE)
        drawn = True
    for line in grid:
        same_extent(line)
    if drawn:
        save_figure(figure, path)
    return drawn


def _map(axes: Any, folder: Path) -> None:
    """Show a kept map with true and predicted rooms."""
    grid = read_map(folder / "map.yaml")
    shown = np.full(grid.frame.shape, UNKNOWN, dtype=np.uint8)
    shown[grid.free], shown[grid.occupied] = FREE, OCCUPIED
    x_min, y_min, x_max, y_max = grid.frame.bounds
    axes.imshow(shown, cmap="gray", vmin=0, vmax=255, origin="lower", extent=(x_min, x_max, y_min, y_max),
                interpolation="nearest")  # fmt: skip
    for name, colour in (("truth_rooms", ROOM_COLOURS[1]), ("rooms", ROOM_COLOURS[0])):
        for room in read_rooms(folder / f"{name}.geojson"):
            for part in shapely.get_parts(room.polygon):
                if isinstance(part, Polygon):
                    axes.plot(*part.exterior.xy, color=[v / 255 for v in colour], linewidth=1.2)
    places = np.array([door.midpoint for door in read_doors(folder / "doors.geojson")]).reshape(-1, 2)
    axes.plot(*places.T, ".", color=[v / 255 for v in DOOR_CLOSED], markersize=5)
