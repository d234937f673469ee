"""What a run found, as a table for people."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from closedrooms.core.remarks import Remark
from closedrooms.core.report import Report

Rows = list[tuple[str, str]]

# Stands for a figure that cannot be computed.
NOT_AVAILABLE = "n/a"


def run_report(
    folder: Path,
    title: str,
    manifest: Mapping[str, Any],
    *,
    stopped: Mapping[str, str] | None = None,
    remarks: Sequence[Remark] = (),
) -> Report:
    """Report on a finished run.

    Args:
        folder: The run directory.
        title: Head of the table.
        manifest: What ``run.json`` holds: ``metrics``, ``closed``, ``doors``, ``exploration``, ``durations``.
        stopped: Why a stage ended before it was done, by stage: ``exploration``, ``cover``, ``drive``.
        remarks: What was dropped, repaired or guessed.
    """
    metrics, unpredicted, stopped = manifest["metrics"], manifest["doors"]["failures"], stopped or {}
    durations: Mapping[str, float] = manifest["durations"]
    rows: Rows = [
        ("figure", "value"),
        *((f"{stage} ended early", why) for stage, why in stopped.items()),
        *_map_rows(manifest),
        *_room_rows(manifest),
        *tour_rows(metrics["tour"]),
        *spread_rows(metrics.get("completions")),
        *drive_rows(metrics.get("drive")),
        *((f"time: {stage}", f"{seconds:.2f} s") for stage, seconds in durations.items()),
    ]
    figures = {name: manifest[name] for name in ("closed", "doors", "exploration", "metrics", "durations")}
    failures = {**unpredicted, **stopped}
    return Report(folder=folder, title=title, rows=rows, failures=failures, remarks=remarks, figures=figures)


def _map_rows(manifest: Mapping[str, Any]) -> Rows:
    """List the rows on doors, map and trajectory."""
    metrics, closed, seen = manifest["metrics"], manifest["closed"], manifest["doors"]["seen"]
    missed = [door for door in closed if door not in seen]
    return [
        ("doors closed", f"{len(closed)}" + (f": {', '.join(closed)}" if closed else "")),
        ("doors seen", f"{len(seen)}" + (f"; never seen: {', '.join(missed)}" if missed else "")),
        ("area mapped", figure(metrics["area_mapped"], "{:.1f} %", scale=100.0)),
        ("trajectory error (ATE RMSE)", f"{metrics['ate_m']:.3f} m"),
    ]


def _room_rows(manifest: Mapping[str, Any]) -> Rows:
    if not manifest["closed"]:
        return [("closed rooms", "none: no door was closed")]
    metrics, doors = manifest["metrics"], manifest["doors"]
    rows = [
        (f"IoU behind {door}", f"{iou:.3f}" + ("" if door in doors["seen"] else ", never seen"))
        for door, iou in metrics["room_iou"].items()
    ]
    if metrics["room_iou_mean"] is not None:
        rows.append(("IoU mean", f"{metrics['room_iou_mean']:.3f} of {_count(metrics)}"))
    return rows + [(f"not predicted: {door}", why) for door, why in doors["failures"].items()]


def _count(metrics: Mapping[str, Any]) -> str:
    """Say how many rooms the mean is of; where a room has several doors, how many doors too."""
    rooms, doors = metrics["rooms_closed"], len(metrics["room_iou"])
    text = f"{rooms} room" + ("" if rooms == 1 else "s")
    return text if rooms == doors else f"{text} by {doors} doors"


def figure(value: float | None, form: str, *, scale: float = 1.0) -> str:
    """Write a figure in words: ``n/a`` where it could not be computed."""
    return NOT_AVAILABLE if value is None else form.format(value * scale)


def tour_rows(tour: Mapping[str, Any]) -> Rows:
    """List lengths of the tours and errors of the estimates (paper, section 5.3)."""
    names = {"closed": "map with closed doors", "predicted": "predicted map", "truth": "true map"}
    lengths = {name: tour[name]["length_m"] if name in tour else None for name in names}
    rows = [(f"tour on the {text}", figure(lengths[name], "{:.1f} m")) for name, text in names.items()]
    errors = tour["errors_percent"]
    return rows + [(f"tour error, {name}", figure(error, "{:.1f} %")) for name, error in errors.items()]


def spread_rows(spread: Mapping[str, Any] | None) -> Rows:
    """Tell what covering the building may cost, as it is drawn from what the rooms may be."""
    if spread is None:
        return []
    share, low, high = 100 * spread["interval"], spread["low_m"], spread["high_m"]
    interval = f" ({share:.0f} %: {low:.1f} to {high:.1f} m)" if share else ""
    plural = "" if spread["count"] == 1 else "s"
    rows = [(f"tour, {spread['count']} completion{plural}", f"{spread['mean_m']:.1f} m{interval}")]
    if "doors_without_room" in spread:
        rows.append(("no room to draw behind", ", ".join(spread["doors_without_room"])))
    if "true_within" in spread:
        rows.append(("true tour within", "yes" if spread["true_within"] else "no"))
    return rows


def drive_rows(drive: Mapping[str, Any] | None) -> Rows:
    """List how the driven tour went."""
    if drive is None:
        return []
    rows: Rows = [
        ("drive", f"{drive['status']}, {drive['replans']} new tours, {drive['vertices_unreachable']} places given up"),
        ("drive: planned length", f"{drive['planned_length_m']:.1f} m"),
        ("drive: driven length", f"{drive['driven_length_m']:.1f} m"),
        ("drive: free area seen at the end", figure(drive["area_covered"], "{:.1f} %", scale=100.0)),
    ]
    for revision in drive["revisions"]:
        for door, before in revision["iou_before"].items():
            rows.append((f"IoU behind {door} as more was seen", f"{before:.3f} to {revision['iou_after'][door]:.3f}"))
    if drive["room_iou_mean_end"] is not None:
        rows.append(("IoU mean after the drive", f"{drive['room_iou_mean_end']:.3f}"))
    return rows


def markdown(report: Report) -> str:
    """Write the table of results for a recording, without times: recordings of equal runs must not differ."""
    head, *rows = report.table()
    lines = [f"| {' | '.join(row)} |" for row in rows if not row[0].startswith("time")]
    return "\n".join([f"# {report.title}", "", f"| {' | '.join(head)} |", "| --- | ---: |", *lines])
