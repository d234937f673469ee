"""Tables, pictures and the page of a sweep."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from closedrooms.experiments.html_page import Section, Table, table_of, write_page
from closedrooms.experiments.robustness.config import RobustnessConfig
from closedrooms.experiments.robustness.figures import draw_curves, draw_maps
from closedrooms.experiments.robustness.levels import UNITS, cases
from closedrooms.experiments.robustness.onset import STAGES, LevelResult, Onset, level_results, onsets
from closedrooms.experiments.tables import Row, write_table

METHOD = (
    "Every level is held against the first of its factor on the same buildings and closed doors. The prediction "
    "suffers from the first level on whose mean difference of the IoU lies below zero with 97.5 % (bootstrap, "
    "buildings drawn, then sets of closed doors) and is a loss of at least 0.01; the cell is empty where no level "
    "does that. The loss of a stage is the IoU that comes back when it gets right what it hands on: mapping the poses "
    "of the scans, doors their places, structure the walls; what does not come back is the prediction's own. The "
    "first to give way is the one with the largest loss at that level. Errors of the coverage cost in percent."
)


def write_report(config: RobustnessConfig, rows: Sequence[Row], failures: Mapping[str, str]) -> list[Onset]:
    """Write trials, levels and onsets (CSV, Parquet), curves and maps (PNG) and ``report.html``.

    Args:
        config: Options.
        rows: A row a level, building and set of closed doors.
        failures: Why a world failed.

    Returns:
        Where every factor starts to hurt.
    """
    folder = config.out
    results = level_results(rows, config.resamples)
    found = onsets(results)
    write_table(folder / "trials", rows)
    write_table(folder / "levels", [_level_row(result) for result in results])
    table = [_onset_row(onset) for onset in found]
    write_table(folder / "onsets", table)
    draw_curves(folder / "curves.png", results, found)
    worlds = list(dict.fromkeys(row["world"] for row in rows))
    sections = [
        Section("Where the prediction starts to suffer", METHOD, tables=[table_of(table)], files=["onsets.csv"]),
        Section(
            "Against each level",
            "Lines: means. Bars: 95 % interval of the difference to the first level. Dotted: first to suffer.",
            folder / "curves.png",
            files=["levels.csv"],
        ),
        Section(
            "Levels", tables=[table_of([_short(result) for result in results])], files=["levels.csv", "trials.csv"]
        ),
    ]
    for world in worlds[:2]:
        picture = folder / f"maps-{world}.png"
        if draw_maps(picture, folder / "cells" / world, cases(config)):
            text = "Map, detected doors (red), true rooms (orange), predicted rooms (blue)."
            sections.append(Section(f"Maps of {world}", text, picture, files=["trials.csv"]))
    if failures:
        sections.append(Section("What failed", tables=[Table([["world", "why"], *failures.items()])]))
    title = f"closedrooms robustness: {len(worlds)} world{'s' if len(worlds) != 1 else ''}"
    write_page(Path(folder / "report.html"), title, sections)
    return found


def _level_row(result: LevelResult) -> Row:
    """List all figures of one level, with the intervals of its changes and losses."""
    row: Row = {"factor": result.factor, "number": result.number, "level": result.level, "samples": result.samples}
    row |= {f"{name}_mean": value for name, value in result.means.items()}
    for name, difference in result.differences.items():
        row |= {f"{name}_change": difference.mean, f"{name}_low": difference.low, f"{name}_high": difference.high}
    for stage, share in result.shares.items():
        row |= {f"{stage}_loss": share.mean, f"{stage}_loss_low": share.low, f"{stage}_loss_high": share.high}
    return row


def _short(result: LevelResult) -> Row:
    """List the figures of one level that the page shows."""
    names = ("ate_m", "walls_m", "doors_m", "free_iou", "iou", "iou_seen", "error_predicted")
    row: Row = {"factor": result.factor, "level": result.level} | {name: result.means.get(name) for name in names}
    change = result.differences.get("iou")
    row["change of IoU"] = None if change is None else round(change.mean, 3)
    row["low"] = None if change is None else round(change.low, 3)
    row["high"] = None if change is None else round(change.high, 3)
    for stage in STAGES:
        share = result.shares.get(stage)
        row[f"lost by {stage}"] = None if share is None else round(share.mean, 3)
    return row


def _onset_row(onset: Onset) -> Row:
    difference, share = onset.difference, onset.share
    return {
        "factor": onset.factor,
        "unit": next(unit for factor, unit in UNITS.items() if factor == onset.factor),
        "suffers_from": onset.level,
        "iou_change": None if difference is None else difference.mean,
        "iou_low": None if difference is None else difference.low,
        "iou_high": None if difference is None else difference.high,
        "first_to_give_way": onset.stage,
        "its_loss": None if share is None else share.mean,
        "loss_low": None if share is None else share.low,
        "loss_high": None if share is None else share.high,
        "coverage_suffers_from": onset.coverage_level,
    }
