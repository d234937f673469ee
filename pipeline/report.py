"""Tables of results for people."""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from closedrooms.pipeline.run import RunResult

Rows = list[tuple[str, str]]


def run_rows(result: "RunResult") -> Rows:
    """The table at the end of ``closedrooms run``; the first row is the head."""
    metrics = result.metrics
    missed = [door for door in result.closed if door not in result.seen]
    rows: Rows = [
        ("figure", "value"),
        ("doors closed", f"{len(result.closed)}" + (f": {', '.join(result.closed)}" if result.closed else "")),
        ("doors seen", f"{len(result.seen)}" + (f"; never seen: {', '.join(missed)}" if missed else "")),
        ("area mapped", f"{100 * metrics['area_mapped']:.1f} %"),
        ("trajectory error (ATE RMSE)", f"{metrics['ate_m']:.3f} m"),
    ]
    if not result.closed:
        rows.append(("closed rooms", "none: no door was closed"))
    rows += [(f"IoU behind {door}", f"{iou:.3f}") for door, iou in metrics["room_iou"].items()]
    if metrics["room_iou_mean"] is not None:
        rows.append(("IoU mean", f"{metrics['room_iou_mean']:.3f}"))
    rows += [(f"not predicted: {door}", reason) for door, reason in result.failures.items()]
    rows += tour_rows(metrics["tour"])
    rows += drive_rows(metrics.get("drive"))
    rows += [(f"time: {stage}", f"{seconds:.2f} s") for stage, seconds in result.durations.items()]
    return rows


def tour_rows(tour: dict[str, Any]) -> Rows:
    """Lengths of the tours and the errors of the estimates (paper, section 5.3)."""
    names = {"closed": "map with closed doors", "predicted": "predicted map", "truth": "true map"}
    rows = [(f"tour on the {text}", f"{tour[name]['length_m']:.1f} m") for name, text in names.items() if name in tour]
    errors = tour.get("errors_percent", {})
    return rows + [
        (f"tour error, {name}", "n/a" if error is None else f"{error:.1f} %") for name, error in errors.items()
    ]


def drive_rows(drive: dict[str, Any] | None) -> Rows:
    """How the driven tour went."""
    if drive is None:
        return []
    rows: Rows = [
        ("drive", f"{drive['status']}, {drive['replans']} new tours, {drive['vertices_unreachable']} places given up"),
        ("drive: planned length", f"{drive['planned_length_m']:.1f} m"),
        ("drive: driven length", f"{drive['driven_length_m']:.1f} m"),
        ("drive: free area seen at the end", f"{100 * drive['area_covered']:.1f} %"),
    ]
    for revision in drive["revisions"]:
        for door, before in revision["iou_before"].items():
            rows.append((f"IoU behind {door} as more was seen", f"{before:.3f} to {revision['iou_after'][door]:.3f}"))
    if drive["room_iou_mean_end"] is not None:
        rows.append(("IoU mean after the drive", f"{drive['room_iou_mean_end']:.3f}"))
    return rows
