"""What a driven tour is worth: figures for ``run.json``, a feature for ``tour.geojson``, a picture."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from shapely.geometry import LineString, Point

from closedrooms.core.arrays import BoolArray
from closedrooms.core.geojson import Feature
from closedrooms.core.grid import OccupancyGrid
from closedrooms.core.room import Room
from closedrooms.coverage.tour import CoverageTour
from closedrooms.navigation.drive import DriveResult
from closedrooms.pipeline.scores import area_mapped, mean, room_iou


def drive_metrics(
    drive: DriveResult,
    truth_rooms: Sequence[Room],
    grid: OccupancyGrid,
    reachable: BoolArray,
    full_knowledge: CoverageTour | None,
) -> dict[str, Any]:
    """Figures of a driven tour.

    Args:
        drive: How it went.
        truth_rooms: True rooms behind the closed doors, map frame.
        grid: The map after the drive.
        reachable: True free cells connected to the start with every door open, shape of ``grid``.
        full_knowledge: The tour on the true map.
    """
    revisions = []
    for revision in drive.revisions:
        before, after = room_iou(revision.before, truth_rooms), room_iou(revision.after, truth_rooms)
        told = sorted({*revision.doors, *revision.changed} & before.keys())
        revisions.append(
            {
                "stamp_s": round(revision.stamp, 3),
                "doors": list(revision.doors),
                "changed": list(revision.changed),
                "replanned": revision.replanned,
                "iou_before": {door: round(before[door], 5) for door in told},
                "iou_after": {door: round(after[door], 5) for door in told},
                "iou_mean_before": _rounded(mean(before)),
                "iou_mean_after": _rounded(mean(after)),
            }
        )
    last = room_iou(drive.prediction.rooms, truth_rooms)
    return {
        "status": drive.status,
        "planned_length_m": round(drive.planned_length, 3),
        "driven_length_m": round(drive.driven_length, 3),
        "full_knowledge_length_m": None if full_knowledge is None else round(full_knowledge.length, 3),
        "area_covered": round(area_mapped(grid, reachable), 5),
        "simulated_s": round(drive.seconds, 3),
        "vertices_visited": drive.visited,
        "vertices_unreachable": len(drive.unreachable),
        "replans": drive.replans,
        "room_iou_end": {door: round(iou, 5) for door, iou in last.items()},
        "room_iou_mean_end": _rounded(mean(last)),
        "revisions": revisions,
    }


def drive_features(drive: DriveResult) -> list[Feature]:
    """The way that was driven, for ``tour.geojson``, and the vertices that could not be reached."""
    features: list[Feature] = [
        (
            LineString(drive.path) if len(drive.path) > 1 else Point(drive.path[0]),
            {"map": "driven", "type": "tour", "length": round(drive.driven_length, 4), "status": drive.status},
        )
    ]
    return features + [(Point(place), {"map": "driven", "type": "unreachable"}) for place in drive.unreachable]


def draw_drive(path: Path, drive: DriveResult, truth_rooms: Sequence[Room]) -> None:
    """Write one picture of the way that was driven over the revised map.

    Args:
        path: The PNG.
        drive: How it went.
        truth_rooms: True rooms behind the closed doors, map frame.

    Raises:
        OutputError: The folder cannot be written.
    """
    from closedrooms.core.files import write_bytes
    from closedrooms.visualization import colours
    from closedrooms.visualization.canvas import Canvas

    grid = drive.prediction.grid
    window = grid.known_bounds()
    bounds = grid.frame.bounds if window is None else grid.frame.cropped(*window).bounds
    canvas = Canvas(bounds, 1200 / max(bounds[2] - bounds[0], bounds[3] - bounds[1]))
    canvas.grid(grid)
    palette = colours.room_colours([door for room in truth_rooms for door in room.doors])
    for room in drive.prediction.rooms:
        canvas.fill(room.polygon, palette.get(room.doors[0], colours.INK), opacity=0.3)
    for room in truth_rooms:
        canvas.outline(room.polygon, colours.TOURS["truth"], width=2)
    canvas.course(drive.path, width=2)
    canvas.dots(drive.path[:1], colours.TOURS["truth"], radius=7)
    canvas.dots(drive.unreachable, colours.DOOR_CLOSED, radius=6)
    canvas.text(
        (bounds[0] + (bounds[2] - bounds[0]) / 2, bounds[3] - 12 / canvas.scale),
        f"driven {drive.driven_length:.0f} m (blue to orange, from the green dot), "
        f"planned {drive.planned_length:.0f} m, {drive.replans} new tours",
    )
    import cv2

    write_bytes(path, cv2.imencode(".png", canvas.finished()[..., ::-1])[1].tobytes())


def _rounded(value: float | None) -> float | None:
    return None if value is None else round(value, 5)
