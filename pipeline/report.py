"""What a run found, as a table for people."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from closedrooms.core.remarks import Remark, remark_rows

Rows = list[tuple[str, str]]

# Stands for a figure that cannot be computed.
NOT_AVAILABLE = "n/a"


@dataclass(frozen=True, slots=True, eq=False)
class RunResult:
    """One finished run.

    Attributes:
        folder: The run directory.
        title: Head of the table of results.
        metrics: ``metrics`` of ``run.json``.
        closed: Doors that were closed.
        seen: Closed doors that the robot saw.
        unpredicted: Why a seen door could not be predicted, by door id.
        stopped: Why a stage ended before it was done, by stage: ``exploration``, ``cover``, ``drive``.
        remarks: What was dropped, repaired or guessed.
        durations: Seconds by stage.
        exploration: ``exploration`` of ``run.json``: status, simulated seconds, scans, travelled distance.
    """

    folder: Path
    title: str
    metrics: dict[str, Any]
    closed: tuple[str, ...]
    seen: tuple[str, ...]
    unpredicted: dict[str, str] = field(default_factory=dict)
    stopped: dict[str, str] = field(default_factory=dict)
    remarks: tuple[Remark, ...] = ()
    durations: dict[str, float] = field(default_factory=dict)
    exploration: dict[str, Any] = field(default_factory=dict)

    @property
    def failures(self) -> dict[str, str]:
        """What is missing from the result and why; with any, the command ends with exit status 3."""
        lost = {remark.what: str(remark) for remark in self.remarks if remark.loss}
        return {**self.unpredicted, **self.stopped, **lost}

    def table(self) -> Rows:
        """Rows for people; the first is the head."""
        return [
            ("figure", "value"),
            *((f"{stage} ended early", reason) for stage, reason in self.stopped.items()),
            *remark_rows(self.remarks),
            *self._map_rows(),
            *self._room_rows(),
            *tour_rows(self.metrics["tour"]),
            *drive_rows(self.metrics.get("drive")),
            *((f"time: {stage}", f"{seconds:.2f} s") for stage, seconds in self.durations.items()),
        ]

    def _map_rows(self) -> Rows:
        missed = [door for door in self.closed if door not in self.seen]
        return [
            ("doors closed", f"{len(self.closed)}" + (f": {', '.join(self.closed)}" if self.closed else "")),
            ("doors seen", f"{len(self.seen)}" + (f"; never seen: {', '.join(missed)}" if missed else "")),
            ("area mapped", figure(self.metrics["area_mapped"], "{:.1f} %", scale=100.0)),
            ("trajectory error (ATE RMSE)", f"{self.metrics['ate_m']:.3f} m"),
        ]

    def _room_rows(self) -> Rows:
        if not self.closed:
            return [("closed rooms", "none: no door was closed")]
        metrics = self.metrics
        rows = [
            (f"IoU behind {door}", f"{iou:.3f}" + ("" if door in self.seen else ", never seen"))
            for door, iou in metrics["room_iou"].items()
        ]
        if metrics["room_iou_mean"] is not None:
            rows.append(("IoU mean", f"{metrics['room_iou_mean']:.3f} of {_count(metrics)}"))
        return rows + [(f"not predicted: {door}", reason) for door, reason in self.unpredicted.items()]


def _count(metrics: Mapping[str, Any]) -> str:
    """How many rooms the mean is of; where a room has several doors, how many doors too."""
    rooms, doors = metrics["rooms_closed"], len(metrics["room_iou"])
    text = f"{rooms} room" + ("" if rooms == 1 else "s")
    return text if rooms == doors else f"{text} by {doors} doors"


def figure(value: float | None, form: str, *, scale: float = 1.0) -> str:
    """A figure in words: ``n/a`` where it could not be computed."""
    return NOT_AVAILABLE if value is None else form.format(value * scale)


def tour_rows(tour: Mapping[str, Any]) -> Rows:
    """Lengths of the tours and the errors of the estimates (paper, section 5.3)."""
    names = {"closed": "map with closed doors", "predicted": "predicted map", "truth": "true map"}
    lengths = {name: tour[name]["length_m"] if name in tour else None for name in names}
    rows = [(f"tour on the {text}", figure(lengths[name], "{:.1f} m")) for name, text in names.items()]
    errors = tour["errors_percent"]
    return rows + [(f"tour error, {name}", figure(error, "{:.1f} %")) for name, error in errors.items()]


def drive_rows(drive: Mapping[str, Any] | None) -> Rows:
    """How the driven tour went."""
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


def markdown(result: RunResult) -> str:
    """The table of results for a recording; times differ from run to run, recordings of equal runs must not."""
    head, *rows = result.table()
    lines = [f"| {' | '.join(row)} |" for row in rows if not row[0].startswith("time")]
    return "\n".join([f"# {result.title}", "", f"| {' | '.join(head)} |", "| --- | ---: |", *lines])
