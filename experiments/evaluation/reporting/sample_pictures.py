"""Single samples as pictures: the worst, and two with little knowledge (paper, figures 7 and 13)."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from shapely.geometry import Polygon

from closedrooms.core.errors import InvalidInputError
from closedrooms.core.files.geojson import read_rooms
from closedrooms.core.grid import OccupancyGrid
from closedrooms.core.names import plot_text
from closedrooms.experiments.evaluation.reporting.figures import TITLE, same_extent, same_scale, save_figure
from closedrooms.experiments.evaluation.reporting.score_summary import MEASURES, estimates
from closedrooms.experiments.evaluation.samples.sample_path import SamplePath
from closedrooms.experiments.evaluation.samples.sample_reader import Sample, read_sample
from closedrooms.experiments.evaluation.scoring.scores import Scores, hidden_area
from closedrooms.experiments.evaluation.scoring.timed_prediction import predict_with
from closedrooms.experiments.evaluation.scoring.tours import cropped, plan_cropped_tour
from closedrooms.visualization.colours import DOOR_CLOSED, FREE, OCCUPIED, ROOM_COLOURS, UNKNOWN

HIDDEN, OUTLINE = (255, 205, 130), "#1c5fb0"
# Share of the samples that know least, among which the two extreme cases are looked for.
LEAST_KNOWN = 0.1


def draw_worst(path: Path, scores: Sequence[Scores], samples: Mapping[str, SamplePath], method: str, most: int) -> bool:
    """Draw the samples with the lowest mean IoU: map, prediction and truth in one picture each.

    Args:
        path: The PNG; the predictions are in ``<method>/<sample>/rooms.geojson`` beside it.
        scores: Of all methods.
        samples: By name.
        method: Whose worst cases.
        most: How many.

    Returns:
        Whether there was anything to draw.
    """
    scored = [score for score in scores if score["method"] == method and score["matched"]]
    scored.sort(key=lambda score: (float(np.mean(score["matched"])), score["sample"]))
    worst = scored[:most]
    if not worst:
        return False
    columns = min(4, len(worst))
    figure, axes = _figure(-(-len(worst) // columns), columns, 4.2, 4.2)
    for place, score in zip(axes.ravel(), worst, strict=False):
        try:
            sample = read_sample(samples[score["sample"]])
            rooms = read_rooms(path.parent / method / score["sample"] / "rooms.geojson")
        except InvalidInputError:
            continue
        _show_case(place, sample, rooms)
        place.set_title(f"{plot_text(score['sample'])}\n{method}: {np.mean(score['matched']):.2f}", fontsize=8, y=TITLE)
    for line in axes:
        same_scale(line)
    figure.suptitle("worst cases: true free space hidden from the map (orange), predicted rooms (blue outline)")
    save_figure(figure, path)
    return True


def extreme_cases(scores: Sequence[Scores], method: str) -> list[Scores]:
    """Choose the two kinds of case of figures 7 and 13: much is predicted from little, and well, or less well.

    Among the tenth of the samples whose maps show least of the building, the one with the lowest coverage error and,
    of another building where there is one, the one with the highest; where there are no tours, highest and lowest IoU.
    """
    own = [score for score in scores if score["method"] == method and score["matched"]]
    own = estimates(own).get(method, own)
    own = sorted(own, key=lambda score: (-score["hidden_share"], score["sample"]))
    own = own[: max(round(LEAST_KNOWN * len(own)), 2)]
    ordered = sorted(own, key=lambda score: (_badness(score), score["sample"]))
    if len(ordered) < 2:
        return ordered
    best = ordered[0]
    others = [score for score in ordered[1:] if score["world"] != best["world"]]
    return [best, (others or ordered)[-1]]


def _badness(score: Scores) -> float:
    """Rate how bad a result is: the error of the coverage cost, or the share of rooms that was not predicted."""
    if "tour" in score:
        return float(score["tour"]["error_predicted"])
    return 1.0 - float(np.mean(MEASURES["matched"](score)))


def draw_extremes(
    rooms_path: Path, tours_path: Path, cases: Sequence[Scores], samples: Mapping[str, SamplePath]
) -> int:
    """Draw the same cases twice: as M, M_pred, M_GT (figure 7), and as their graphs with tours (figure 13).

    Returns:
        How many of the two were drawn: the second only where the cases have tours.
    """
    read = []
    for score in cases:
        sample = read_sample(samples[score["sample"]])
        read.append((score, sample, predict_with(score["method"], sample)[0]))
    if not read:
        return 0
    figure, axes = _figure(len(read), 3, 5.0, 3.6)
    for line, (score, sample, prediction) in zip(axes, read, strict=True):
        titles = (
            f"{plot_text(score['sample'])}: {score['closed_doors']} doors closed, {score['hidden_share']:.0%} hidden",
            f"predicted ({score['method']}): mean IoU {np.mean(MEASURES['matched'](score)):.2f}",
            "truth",
        )
        for place, grid, title in zip(line, (sample.observed, prediction.grid, sample.truth), titles, strict=True):
            _show_grid(place, cropped(grid))
            place.set_title(title, fontsize=9, y=TITLE)
        _outline(line[1], [room.polygon for room in prediction.rooms], OUTLINE)
        _outline(line[2], [room.polygon for room in sample.rooms], OUTLINE)
        _dots(line[0], sample)
        same_extent(line)
    save_figure(figure, rooms_path)
    if not all("tour" in score for score, _, _ in read):
        return 1
    figure, axes = _figure(len(read), 3, 5.0, 3.6)
    for line, (score, sample, prediction) in zip(axes, read, strict=True):
        tour = score["tour"]
        grids = ((sample.observed, sample.doors), (prediction.grid, ()), (sample.truth, ()))
        figures = (
            f"M: error {tour['error_closed']:.1f} %, baseline {tour['error_baseline']:.1f} %",
            f"M_pred: error {tour['error_predicted']:.1f} %",
            "M_GT",
        )
        names = ("closed", "predicted", "truth")
        for place, (grid, doors), title, name in zip(line, grids, figures, names, strict=True):
            _show_grid(place, cropped(grid))
            _show_tour(place, plan_cropped_tour(grid, doors))
            place.set_title(f"{title}, tour {tour[name]['length_m']:.0f} m", fontsize=9, y=TITLE)
        _dots(line[0], sample)
        same_extent(line)
    save_figure(figure, tours_path)
    return 2


def _figure(rows: int, columns: int, width: float, height: float) -> tuple[Any, Any]:
    """Make an empty figure of panels without axes, sizes of a panel in inches."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width * columns, height * rows), layout="constrained")
    FigureCanvasAgg(figure)
    axes = np.atleast_2d(figure.subplots(rows, columns, squeeze=False))
    for place in axes.ravel():
        place.axis("off")
    return figure, axes


def _show_case(axes: Any, sample: Sample, rooms: Sequence[Any]) -> None:
    """Show a map, its hidden area, predicted rooms and doors."""
    shown = np.full((*sample.observed.frame.shape, 3), UNKNOWN, dtype=np.uint8)
    shown[sample.observed.free] = FREE
    shown[hidden_area(sample.observed, sample.truth)] = HIDDEN
    shown[sample.observed.occupied | (sample.truth.occupied & sample.observed.unknown)] = OCCUPIED
    _image(axes, shown, sample.observed)
    _outline(axes, [room.polygon for room in rooms], OUTLINE)
    _dots(axes, sample)


def _show_grid(axes: Any, grid: OccupancyGrid) -> None:
    shown = np.full((*grid.frame.shape, 3), UNKNOWN, dtype=np.uint8)
    shown[grid.free], shown[grid.occupied] = FREE, OCCUPIED
    _image(axes, shown, grid)


def _image(axes: Any, shown: Any, grid: OccupancyGrid) -> None:
    x_min, y_min, x_max, y_max = grid.frame.bounds
    axes.imshow(shown, origin="lower", extent=(x_min, x_max, y_min, y_max), interpolation="nearest")


def _outline(axes: Any, areas: Sequence[Any], colour: str) -> None:
    for area in areas:
        for part in shapely.get_parts(area):
            if isinstance(part, Polygon):
                axes.plot(*part.exterior.xy, color=colour, linewidth=1.2)


def _dots(axes: Any, sample: Sample) -> None:
    places = np.array([door.midpoint for door in sample.doors]).reshape(-1, 2)
    axes.plot(*places.T, ".", color=[v / 255 for v in DOOR_CLOSED], markersize=5)


def _show_tour(axes: Any, tour: Any) -> None:
    """Show the graph that a tour is planned on."""
    from matplotlib.collections import LineCollection

    edges = np.asarray(tour.graph.vertices)[tour.graph.pairs]
    axes.add_collection(LineCollection(list(edges), colors=[[v / 255 for v in ROOM_COLOURS[0]]], linewidths=1.0))
    axes.plot(*np.asarray(tour.graph.vertices).T, ".", color=OUTLINE, markersize=3)
