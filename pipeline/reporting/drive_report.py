"""What a driven tour is worth: figures for ``run.json``, features for ``tour.geojson``, a picture."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from shapely.geometry import LineString, Point

from closedrooms.core.files.geojson import GeoFeature
from closedrooms.core.pose import Pose2
from closedrooms.core.room import Room
from closedrooms.coverage.tour.coverage_tour import CoverageTour
from closedrooms.pipeline.drive import DriveResult
from closedrooms.pipeline.reporting.run_scores import area_mapped, mean, room_iou, rounded
from closedrooms.pipeline.survey import Truth
from closedrooms.worlds.plan import FloorPlan
from closedrooms.worlds.truth import reachable


def drive_metrics(
    drive: DriveResult, plan: FloorPlan, map_T_world: Pose2, truth: Truth, full_knowledge: CoverageTour | None
) -> dict[str, Any]:
    """Compute the figures of a driven tour.

    Args:
        drive: How it went.
        plan: The building.
        map_T_world: Building frame to map frame.
        truth: The true rooms behind the doors that were closed.
        full_knowledge: The tour on the true map.
    """
    log, outcome, start = drive.log, drive.outcome, map_T_world.inverse()
    cells = reachable(plan, (), drive.grid.frame, map_T_world, (start.x, start.y))
    revisions = []
    for revision in outcome.revisions:
        before, after = room_iou(revision.before, truth.rooms), room_iou(revision.after, truth.rooms)
        told = sorted({*revision.doors, *revision.changed} & before.keys())
        revisions.append(
            {
                "stamp_s": round(revision.stamp, 3),
                "doors": list(revision.doors),
                "changed": list(revision.changed),
                "replanned": revision.replanned,
                "iou_before": {door: round(before[door], 5) for door in told},
                "iou_after": {door: round(after[door], 5) for door in told},
                "iou_mean_before": rounded(mean(before)),
                "iou_mean_after": rounded(mean(after)),
            }
        )
    last = room_iou(outcome.prediction.rooms, truth.rooms)
    return {
        "status": log.status,
        **({"reason": log.reason} if log.reason else {}),
        "planned_length_m": round(drive.planned.length, 3),
        "driven_length_m": round(log.distance, 3),
        "full_knowledge_length_m": None if full_knowledge is None else round(full_knowledge.length, 3),
        "area_covered": rounded(area_mapped(drive.grid, cells)),
        "simulated_s": round(log.seconds, 3),
        "vertices_visited": outcome.visited,
        "vertices_unreachable": len(outcome.unreachable),
        "replans": outcome.replans,
        "room_iou_end": {door: round(iou, 5) for door, iou in last.items()},
        "room_iou_mean_end": rounded(mean(last)),
        "revisions": revisions,
    }


def drive_features(drive: DriveResult) -> list[GeoFeature]:
    """List the path that was driven, for ``tour.geojson``, and the vertices that could not be reached."""
    log = drive.log
    features: list[GeoFeature] = [
        (
            LineString(log.path) if len(log.path) > 1 else Point(log.path[0]),
            {"map": "driven", "type": "tour", "length": round(log.distance, 4), "status": log.status},
        )
    ]
    return features + [(Point(place), {"map": "driven", "type": "unreachable"}) for place in drive.outcome.unreachable]


def draw_drive(path: Path, drive: DriveResult, truth_rooms: Sequence[Room]) -> None:
    """Write one picture of the path that was driven over the revised map.

    Args:
        path: The PNG.
        drive: How it went.
        truth_rooms: True rooms behind the closed doors, map frame.

    Raises:
        OutputError: The folder cannot be written.
    """
    from closedrooms.core.files.outgoing import write_bytes
    from closedrooms.visualization import colours
    from closedrooms.visualization.canvas import Canvas
    from closedrooms.visualization.summary import room_opacity

    log, outcome = drive.log, drive.outcome
    grid = outcome.prediction.grid
    window = grid.known_bounds()
    bounds = grid.frame.bounds if window is None else grid.frame.cropped(*window).bounds
    canvas = Canvas(bounds, 1200 / max(bounds[2] - bounds[0], bounds[3] - bounds[1]))
    canvas.grid(grid)
    palette = colours.room_colours([door for room in truth_rooms for door in room.doors])
    for room in outcome.prediction.rooms:
        colour = palette.get(room.doors[0], colours.INK)
        for other in room.alternatives:
            canvas.dashed(other.polygon, colour)
        canvas.fill(room.polygon, colour, opacity=0.3 if room.confidence is None else room_opacity(room.confidence))
    for room in truth_rooms:
        canvas.outline(room.polygon, colours.TOURS["truth"], width=2)
    canvas.course(log.path, width=2)
    canvas.dots(log.path[:1], colours.TOURS["truth"], radius=7)
    canvas.dots(outcome.unreachable, colours.DOOR_CLOSED, radius=6)
    canvas.text(
        (bounds[0] + (bounds[2] - bounds[0]) / 2, bounds[3] - 12 / canvas.scale),
        f"driven {log.distance:.0f} m (blue to orange, from the green dot), "
        f"planned {drive.planned.length:.0f} m, {outcome.replans} new tours",
    )
    import cv2

    write_bytes(path, cv2.imencode(".png", canvas.finished()[..., ::-1])[1].tobytes())
