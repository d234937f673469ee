"""Tables and pictures of an evaluation."""

import csv
import io
from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from closedrooms.core.arrays import FloatArray
from closedrooms.core.errors import InvalidInputError
from closedrooms.core.files import write_bytes
from closedrooms.core.random import stream
from closedrooms.pipeline.evaluation.config import EvaluateConfig
from closedrooms.pipeline.evaluation.samples import SamplePath, read_sample

Scores = dict[str, Any]
COLUMNS = ("method", "sample", "closed_doors", "measure", "room", "iou")


def write_report(
    folder: Path, scores: Sequence[Scores], samples: Sequence[SamplePath], config: EvaluateConfig
) -> list[dict[str, Any]]:
    """Write rooms.{csv,parquet}, samples.csv, summary.csv, iou.png and worst.png; returns a row a method.

    Args:
        folder: Where to write.
        scores: One entry a sample and method, sorted.
        samples: All samples, for the contact sheet.
        config: Bootstrap and size of the contact sheet.
    """
    rooms = _room_rows(scores)
    _write_csv(folder / "rooms.csv", COLUMNS, rooms)
    _write_parquet(folder / "rooms.parquet", rooms)
    columns = ("method", "sample", "doors", "area", "agreement", "seconds")
    _write_csv(folder / "samples.csv", columns, [[score.get(name) for name in columns] for score in scores])
    overall = [_summary(method, group, config) for method, group in _grouped(scores, "method").items()]
    by_doors = [
        _summary(method, group, config) | {"closed_doors": doors}
        for method, own in _grouped(scores, "method").items()
        for doors, group in _grouped(own, "doors").items()
    ]
    if overall:
        head = ("closed_doors", *overall[0])
        table = [[row.get(name, "all") for name in head] for row in [*overall, *by_doors]]
        _write_csv(folder / "summary.csv", head, table)
        _draw_curves(folder / "iou.png", by_doors)
        _draw_worst(folder / "worst.png", scores, samples, config)
    return overall


def _grouped(scores: Sequence[Scores], key: str) -> dict[Any, list[Scores]]:
    groups: defaultdict[Any, list[Scores]] = defaultdict(list)
    for score in scores:
        groups[score[key]].append(score)
    return dict(sorted(groups.items()))


def _room_rows(scores: Sequence[Scores]) -> list[list[Any]]:
    """A row a room and measure; a hidden room whose door was not seen counts 0 in a measure of its own."""
    rows: list[list[Any]] = []
    for score in scores:
        head = [score["method"], score["sample"], score["doors"]]
        rows += [[*head, "matched", f"{number:02d}", figure] for number, figure in enumerate(score["matched"])]
        rows += [[*head, "by door", door, figure] for door, figure in score["by_door"].items()]
        rows += [[*head, "not seen", door, 0.0] for door in score["not_seen"]]
    return rows


def _summary(method: str, scores: Sequence[Scores], config: EvaluateConfig) -> dict[str, Any]:
    """Means with standard deviations and 95 % bootstrap intervals over samples."""
    matched = [np.array(score["matched"], dtype=np.float64) for score in scores]
    by_door = [np.array([*score["by_door"].values()], dtype=np.float64) for score in scores]
    area = [np.array([score["area"]]) for score in scores]
    agreement = [np.array([score["agreement"]]) for score in scores if "agreement" in score]
    seconds = [score["seconds"] for score in scores if "seconds" in score]
    row: dict[str, Any] = {"method": method, "samples": len(scores), "rooms": sum(map(len, matched))}
    for name, groups in (("matched", matched), ("by_door", by_door), ("area", area), ("agreement", agreement)):
        values = np.concatenate(groups) if groups else np.zeros(0)
        low, high = bootstrap(groups, config.resamples, f"{method} {name}")
        row |= {
            f"{name}_mean": _rounded(values.mean()) if values.size else None,
            f"{name}_median": _rounded(np.median(values)) if values.size else None,
            f"{name}_sd": _rounded(values.std()) if values.size else None,
            f"{name}_low": low,
            f"{name}_high": high,
        }
    row["not_seen"] = sum(len(score["not_seen"]) for score in scores)
    row["seconds_median"] = round(float(np.median(seconds)), 3) if seconds else None
    return row


def _rounded(value: Any) -> float:
    return round(float(value), 6)


def bootstrap(groups: Sequence[FloatArray], resamples: int, name: str) -> tuple[float | None, float | None]:
    """95 % percentile interval of the mean over all values, whole groups (samples) drawn with replacement.

    Rooms of one sample are not independent of each other, so samples are what is drawn.
    """
    sums = np.array([group.sum() for group in groups if group.size])
    counts = np.array([group.size for group in groups if group.size])
    if not sums.size:
        return None, None
    draws = stream(0, "bootstrap", name).integers(0, sums.size, (resamples, sums.size))
    means = sums[draws].sum(axis=1) / counts[draws].sum(axis=1)
    low, high = np.percentile(means, [2.5, 97.5])
    return _rounded(low), _rounded(high)


def _write_csv(path: Path, head: Sequence[str], rows: Sequence[Sequence[Any]]) -> None:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(head)
    writer.writerows(["" if value is None else value for value in row] for row in rows)
    write_bytes(path, text.getvalue().encode())


def _write_parquet(path: Path, rows: Sequence[Sequence[Any]]) -> None:
    import pyarrow as pa
    import pyarrow.parquet as pq

    columns: list[list[Any]] = [[row[i] for row in rows] for i in range(len(COLUMNS))]
    types = (pa.string(), pa.string(), pa.int64(), pa.string(), pa.string(), pa.float64())
    arrays = [pa.array(values, kind) for values, kind in zip(columns, types, strict=True)]
    data = io.BytesIO()
    pq.write_table(pa.table(arrays, names=COLUMNS), data)
    write_bytes(path, data.getvalue())


def _draw_curves(path: Path, by_doors: Sequence[dict[str, Any]]) -> None:
    """IoU against the number of closed doors, with standard deviations, by method (paper, figure 5)."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11, 4.5), layout="constrained")
    FigureCanvasAgg(figure)
    for axes, (measure, title) in zip(
        figure.subplots(1, 2, sharey=True),
        (("matched", "hidden rooms, matched one-to-one"), ("by_door", "rooms with the same door")),
        strict=True,
    ):
        methods = sorted({row["method"] for row in by_doors})
        for number, method in enumerate(methods):
            rows = [row for row in by_doors if row["method"] == method and row[f"{measure}_mean"] is not None]
            if not rows:
                continue
            doors = np.array([row["closed_doors"] for row in rows]) + (number - len(methods) / 2) * 0.06
            means, spread = [np.array([row[f"{measure}_{name}"] for row in rows]) for name in ("mean", "sd")]
            axes.errorbar(doors, means, spread, label=method, marker="o", markersize=3, elinewidth=0.7, capsize=2)
        axes.set(title=title, xlabel="closed doors", ylim=(0, 1.05))
        axes.grid(alpha=0.3)
        if axes.get_legend_handles_labels()[0]:
            axes.legend(fontsize=8)
    figure.axes[0].set_ylabel("IoU (mean, standard deviation)")
    _save(figure, path)


def _draw_worst(path: Path, scores: Sequence[Scores], samples: Sequence[SamplePath], config: EvaluateConfig) -> None:
    """The samples with the lowest mean IoU of the first method asked for: map, prediction and truth in one picture."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    method = "best" if "best" in config.methods else config.methods[0]
    scored = [score for score in scores if score["method"] == method and score["matched"]]
    scored.sort(key=lambda score: (float(np.mean(score["matched"])), score["sample"]))
    folders = {sample.name: sample.folder for sample in samples}
    worst = scored[: config.worst]
    if not worst:
        return
    columns = min(4, len(worst))
    rows = -(-len(worst) // columns)
    figure = Figure(figsize=(4.2 * columns, 4.2 * rows), layout="constrained")
    FigureCanvasAgg(figure)
    grid = np.atleast_1d(figure.subplots(rows, columns)).ravel()
    for axes in grid:
        axes.axis("off")
    for axes, score in zip(grid, worst, strict=False):
        _draw_case(axes, path.parent / method / score["sample"] / "rooms.geojson", folders[score["sample"]])
        axes.set_title(f"{score['sample']}\n{method}: {np.mean(score['matched']):.2f}", fontsize=8)
    figure.suptitle("worst cases: true free space hidden from the map (orange), predicted rooms (blue outline)")
    _save(figure, path)


def _draw_case(axes: Any, rooms_path: Path, folder: Path) -> None:
    import shapely
    from shapely.geometry import Polygon

    from closedrooms.core.geojson import read_rooms
    from closedrooms.pipeline.evaluation.scores import hidden_area

    try:
        sample, rooms = read_sample(folder), read_rooms(rooms_path)
    except InvalidInputError:
        return
    shown = np.full((*sample.observed.frame.shape, 3), 215, dtype=np.uint8)
    shown[sample.observed.free] = 255
    shown[hidden_area(sample.observed, sample.truth)] = (255, 205, 130)
    shown[sample.observed.occupied | (sample.truth.occupied & sample.observed.unknown)] = 40
    x_min, y_min, x_max, y_max = sample.observed.frame.bounds
    axes.imshow(shown, origin="lower", extent=(x_min, x_max, y_min, y_max), interpolation="nearest")
    for room in rooms:
        for part in shapely.get_parts(room.polygon):
            if isinstance(part, Polygon):
                axes.plot(*part.exterior.xy, color="#1c5fb0", linewidth=1.2)
    axes.plot(*np.array([door.midpoint for door in sample.doors]).reshape(-1, 2).T, "r.", markersize=4)


def _save(figure: Any, path: Path) -> None:
    data = io.BytesIO()
    figure.savefig(data, format="png", dpi=110, metadata={"Software": None})
    write_bytes(path, data.getvalue())
