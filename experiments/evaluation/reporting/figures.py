"""Figures 5, 9, 12 and 14 of the paper: a figure against the number of closed doors, with standard deviations."""

import io
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from closedrooms.core.files.outgoing import write_bytes
from closedrooms.experiments.tables import Row
from closedrooms.visualization.colours import ROOM_COLOURS, UNKNOWN, Colour

# One colour a method or estimate in every figure.
COLOURS: dict[str, Colour] = {
    name: ROOM_COLOURS[number]
    for number, name in enumerate(
        ("paper", "rose", "best", "line-of-sight", "geometric", "authors", "closed", "baseline", "learned")
    )
}
LABELS = {
    "paper": "paper (structure of 3.1)",
    "rose": "paper with ROSE (4.2)",
    "closed": "closed: map as it is",
    "baseline": "baseline: so much a door",
}
# Where titles stand, as shares of a panel's height. Left to itself matplotlib finds the same place, by laying out all
# labels of all ticks time and again: a third of what the figures of a report took.
TITLE = 1.0
TITLES = {"matched": "hidden rooms, matched one-to-one", "by_door": "rooms with the same door"}


def draw_iou(path: Path, rows: Sequence[Row], methods: Sequence[str], measures: Sequence[str]) -> bool:
    """Draw IoU against the number of closed doors (paper, figures 5 and 9); a panel a measure.

    Args:
        path: The PNG.
        rows: Of :func:`closedrooms.experiments.evaluation.reporting.score_summary.iou_rows`.
        methods: Which to draw.
        measures: ``matched``, ``by_door``.

    Returns:
        Whether there was anything to draw.
    """
    panels = [(TITLES[m], [(name, _series(rows, "method", name, m)) for name in methods]) for m in measures]
    return _draw(path, panels, "IoU (mean, standard deviation)", top=1.05)


def draw_errors(path: Path, rows: Sequence[Row], names: Sequence[str]) -> bool:
    """Draw the error of estimates of the coverage cost by number of closed doors (paper, figures 12 and 14).

    Args:
        path: The PNG.
        rows: Of :func:`closedrooms.experiments.evaluation.reporting.score_summary.coverage_rows`; a panel a part.
        names: Estimates to draw.

    Returns:
        Whether there was anything to draw.
    """
    titles = {"subset": "subset of section 5.3", "all": "all"}
    panels = []
    for part in dict.fromkeys(row["part"] for row in rows):
        own = [row for row in rows if row["part"] == part]
        panels.append((titles[part], [(name, _series(own, "estimate", name, "error")) for name in names]))
    return _draw(path, panels, "error of the coverage cost [%] (mean, standard deviation)", top=None)


Series = tuple[list[int], list[float], list[float]]


def _series(rows: Sequence[Row], key: str, name: str, measure: str) -> Series:
    """Compute means and standard deviations of one method by number of closed doors."""
    own = [row for row in rows if row[key] == name and row["closed_doors"] != "all"]
    own = [row for row in own if row[f"{measure}_mean"] is not None]
    own.sort(key=lambda row: row["closed_doors"])
    doors = [row["closed_doors"] for row in own]
    return doors, [row[f"{measure}_mean"] for row in own], [row[f"{measure}_sd"] for row in own]


def _draw(path: Path, panels: Sequence[tuple[str, list[tuple[str, Series]]]], label: str, *, top: float | None) -> bool:
    """Draw panels of curves against the number of closed doors; tell whether there was anything to draw."""
    panels = [panel for panel in panels if any(series[0] for _, series in panel[1])]
    if not panels:
        return False
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from matplotlib.ticker import MaxNLocator

    figure = Figure(figsize=(6.5 * len(panels), 4.3), layout="constrained")
    FigureCanvasAgg(figure)
    all_axes = np.atleast_1d(figure.subplots(1, len(panels), sharex=True, sharey=True))
    numbers = [door for _, curves in panels for _, (doors, _, _) in curves for door in doors]
    for axes, (title, curves) in zip(all_axes, panels, strict=True):
        drawn = [(name, series) for name, series in curves if series[0]]
        for number, (name, (doors, means, spread)) in enumerate(drawn):
            axes.errorbar(
                np.array(doors) + (number - (len(drawn) - 1) / 2) * 0.09, means, spread,
                label=LABELS.get(name, name), color=_colour_of(name, number),
                marker="o", markersize=3.5, elinewidth=0.8, capsize=2,
            )  # fmt: skip
        axes.set_title(title, y=TITLE)
        axes.set_xlabel("closed doors")
        axes.set_ylim(0.0, top)
        if drawn:
            axes.set_xlim(min(numbers) - 0.6, max(numbers) + 0.6)
            axes.legend(fontsize=8)
        axes.xaxis.set_major_locator(MaxNLocator(integer=True))
        axes.grid(alpha=0.3)
    all_axes[0].set_ylabel(label)
    save_figure(figure, path)
    return True


def draw_reliability(path: Path, rows: Sequence[Row], methods: Sequence[str]) -> bool:
    """Draw the mean IoU of rooms against their confidence, a curve a method.

    Args:
        path: The PNG.
        rows: Of :func:`closedrooms.experiments.evaluation.scoring.sureness.reliability_rows`.
        methods: Which to draw.

    Returns:
        Whether there was anything to draw.
    """
    if not rows:
        return False
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(5.2, 4.8), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots()
    axes.plot([0.0, 1.0], [0.0, 1.0], color="0.6", linewidth=0.8, linestyle="--", label="as sure as right")
    for number, method in enumerate(methods):
        own = [row for row in rows if row["method"] == method]
        axes.plot(
            [row["confidence"] for row in own], [row["iou"] for row in own],
            label=LABELS.get(method, method), color=_colour_of(method, number), marker="o", markersize=3.5,
        )  # fmt: skip
    axes.set(xlabel="confidence (expected IoU)", ylabel="mean IoU", xlim=(0.0, 1.0), ylim=(0.0, 1.0))
    axes.legend(fontsize=8)
    axes.grid(alpha=0.3)
    save_figure(figure, path)
    return True


def draw_costs(path: Path, scores: Sequence[Row], methods: Sequence[str]) -> bool:
    """Draw the intervals of the cost of coverage by share of the true cost, from low to high, a panel a method.

    Args:
        path: The PNG.
        scores: One entry a sample and method.
        methods: Which to draw.

    Returns:
        Whether there was anything to draw.
    """
    if not methods:
        return False
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(4.6 * len(methods), 4.4), layout="constrained")
    FigureCanvasAgg(figure)
    panels = figure.subplots(1, len(methods), squeeze=False, sharey=True)[0]
    for axes, method in zip(panels, methods, strict=True):
        own = [s["completions"] for s in scores if s["method"] == method and s.get("completions", {}).get("truth_m")]
        own.sort(key=lambda cost: cost["mean_m"] / cost["truth_m"])
        for within, colour in ((True, ROOM_COLOURS[0]), (False, ROOM_COLOURS[4])):
            kept = [(at, cost) for at, cost in enumerate(own) if cost["true_within"] == within]
            bars = [[cost[end] / cost["truth_m"] for _, cost in kept] for end in ("low_m", "high_m", "mean_m")]
            at, shade = [number for number, _ in kept], [value / 255 for value in colour]
            said = f"{'within' if within else 'outside'}: {len(kept)}"
            axes.vlines(at, bars[0], bars[1], color=shade, linewidth=1.2, label=said)
            axes.plot(at, bars[2], color=shade, marker="o", markersize=2.0, linestyle="none")
        axes.axhline(1.0, color="0.4", linewidth=0.8, linestyle="--")
        axes.set_title(LABELS.get(method, method), y=TITLE)
        axes.set_xlabel("samples, by mean")
        axes.legend(fontsize=8)
        axes.grid(alpha=0.3)
    panels[0].set_ylabel("cost of coverage / true cost: interval and mean")
    save_figure(figure, path)
    return True


def same_extent(panels: Sequence[Any]) -> None:
    """Give the panels of one row, pictures of one building, the extent that holds them all."""
    drawn = [panel for panel in panels if panel.images]
    if drawn:
        (x0, x1), (y0, y1) = (_span([getattr(panel, get)() for panel in drawn]) for get in ("get_xlim", "get_ylim"))
        for panel in drawn:
            panel.set(xlim=(x0, x1), ylim=(y0, y1))
            _fill_with_unknown(panel)


def same_scale(panels: Sequence[Any]) -> None:
    """Give the panels of one row, pictures of different buildings, extents of one size about their middles."""
    drawn = [panel for panel in panels if panel.images]
    if not drawn:
        return
    for get, name in (("get_xlim", "xlim"), ("get_ylim", "ylim")):
        limits = [getattr(panel, get)() for panel in drawn]
        half = max(high - low for low, high in limits) / 2.0
        for panel, (low, high) in zip(drawn, limits, strict=True):
            middle = (low + high) / 2.0
            panel.set(**{name: (middle - half, middle + half)})
    for panel in drawn:
        _fill_with_unknown(panel)


def _fill_with_unknown(panel: Any) -> None:
    """Paint what a panel shows beyond its map as the map paints what it does not know."""
    panel.axis("on")
    panel.set(facecolor=str(UNKNOWN / 255), xticks=(), yticks=())
    panel.spines[:].set_visible(False)


def _span(limits: Sequence[tuple[float, float]]) -> tuple[float, float]:
    return min(low for low, _ in limits), max(high for _, high in limits)


def save_figure(figure: Any, path: Path) -> None:
    """Write a matplotlib figure as PNG, without the version of the library in it."""
    data = io.BytesIO()
    figure.savefig(data, format="png", dpi=110, metadata={"Software": None})
    write_bytes(path, data.getvalue())


def _colour_of(name: str, number: int) -> list[float]:
    """Choose the colour of a method or estimate, 0 to 1; for one without its own by its place in the figure."""
    colour = COLOURS.get(name, ROOM_COLOURS[(len(COLOURS) + number) % len(ROOM_COLOURS)])
    return [value / 255 for value in colour]
