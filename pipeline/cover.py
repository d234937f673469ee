"""``closedrooms cover``: a coverage tour on anybody's map."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from closedrooms.core.door import ClosedDoor, Point
from closedrooms.core.errors import InvalidInputError
from closedrooms.core.files.geojson import write_doors, write_features
from closedrooms.core.files.output_folders import check_output_folder, output_folder
from closedrooms.core.files.rosmap import RosMap, read_ros_map, write_map
from closedrooms.core.grid import OccupancyGrid
from closedrooms.core.report import Report
from closedrooms.coverage.cost_spread import CostSpread, spread_cost
from closedrooms.coverage.tour.coverage_tour import CoverageTour
from closedrooms.coverage.tour.drivable_path import find_drivable_paths
from closedrooms.coverage.tour.ros_tour import write_path_message, write_waypoints
from closedrooms.coverage.tour.tour_features import make_tour_features
from closedrooms.coverage.tour.tour_planner import plan_coverage
from closedrooms.pipeline.given_doors import given_doors, misplaced_doors
from closedrooms.pipeline.options.cover import CoverConfig
from closedrooms.pipeline.reporting.manifest import input_path, resolved, versions
from closedrooms.pipeline.reporting.progress import Progress, Silent
from closedrooms.pipeline.reporting.report import spread_rows
from closedrooms.pipeline.reporting.stopwatch import Stopwatch
from closedrooms.predictor.methods import predict


def cover_map(config: CoverConfig, *, progress: Progress | None = None) -> Report:
    """Read a map, plan a tour that covers it, write the folder.

    Args:
        config: Options.
        progress: Told what is done.

    Raises:
        InvalidInputError: The map or the doors cannot be read, or the map has no free space.
        OutputError: The folder cannot be written, or holds something that is not ours.
    """
    progress, watch = progress or Silent(), Stopwatch()
    check_output_folder(config.out, "cover", sources=[config.map, config.doors])
    with watch.stage("read"):
        progress.stage("read")
        read = read_ros_map(config.map, allow_outside=config.allow_outside)
        remarks = list(read.remarks)
        given = given_doors(config.doors, remarks) if config.doors else []
        grid, doors = read.grid, read.doors_on_grid(given)
        remarks += misplaced_doors(read, doors)
        start = None if config.start is None else _on_grid(read, config.start)
    manifest: dict[str, Any] = {
        "command": "cover",
        "configuration": resolved(config, leave_out=("map", "doors", "out")),
        "paths": {"map": input_path(config.map), "doors": input_path(config.doors) if config.doors else None},
        "versions": versions(),
    }
    with watch.stage("cover"):
        progress.stage("cover")
        try:
            tour = plan_coverage(grid, doors, config.coverage, start=start, map_name="closed")
        except InvalidInputError as error:
            raise InvalidInputError(str(error), where=config.map) from error
        spread = _spread(grid, doors, config, start) if config.completions else None
    missed = {door.id: "no free space to reach it from" for door in doors if door.id not in tour.graph.door_vertices}
    missed |= dict.fromkeys(tour.unreached_doors, "no free space to reach it from")
    with output_folder(config.out, manifest) as folder:
        progress.stage("write")
        write_map(folder / "map", grid, map_T_grid=read.map_T_grid)
        if config.doors:
            write_doors(folder / "doors.geojson", given)
        features = [(read.on_map(geometry), properties) for geometry, properties in make_tour_features(tour, "closed")]
        write_features(folder / "tour.geojson", features)
        if config.to is not None:
            _write_for_ros(folder, read, tour, config)
        from closedrooms.visualization.summary import draw_cover

        draw_cover(folder / "summary.png", grid, doors, tour)
        manifest["metrics"] = {
            "tour": {
                "length_m": round(tour.length, 4),
                "lower_bound_m": round(tour.lower_bound, 4),
                "vertices": len(tour.graph.vertices),
                "status": tour.status,
                "not_visited": missed,
            }
        }
        if spread is not None:
            manifest["metrics"]["completions"] = spread.figures()
        manifest["notes"] = list(tour.notes)
        manifest["remarks"] = [remark.as_json() for remark in remarks]
        manifest["durations"] = watch.seconds()
    return Report(
        folder=config.out,
        title=f"{config.map.name}: coverage tour",
        rows=_rows(tour, missed, manifest["metrics"], manifest["durations"]["cover"]),
        failures=missed,
        remarks=remarks,
        figures=manifest["metrics"],
    )


def _spread(grid: OccupancyGrid, doors: Sequence[ClosedDoor], config: CoverConfig, start: Point | None) -> CostSpread:
    """Compute what covering the map with the rooms behind its doors may cost."""
    try:
        prediction = predict(grid, doors, config.method)
        tour = plan_coverage(prediction.grid, (), config.coverage, start=start, map_name="predicted")
    except InvalidInputError as error:
        raise InvalidInputError(str(error), where=config.map) from error
    return spread_cost(
        tour.length,
        grid.frame,
        doors,
        prediction.rooms,
        prediction.probability,
        config.coverage,
        count=config.completions,
        seed=config.seed,
    )


def _rows(
    tour: CoverageTour, missed: dict[str, str], metrics: Mapping[str, Any], seconds: float
) -> list[tuple[str, str]]:
    """Build the table for people."""
    return [
        ("figure", "value"),
        ("vertices", f"{len(tour.graph.vertices)}"),
        ("length", f"{tour.length:.1f} m"),
        ("lower bound", f"{tour.lower_bound:.1f} m (gap {100 * tour.gap:.1f} %)"),
        ("status", tour.status),
        *spread_rows(metrics.get("completions")),
        *(("note", note) for note in tour.notes),
        *((f"not visited: {door}", reason) for door, reason in missed.items()),
        ("time", f"{seconds:.2f} s"),
    ]


def _on_grid(read: RosMap, point: tuple[float, float]) -> tuple[float, float]:
    """Convert a point of the map frame to the frame of the grid [m]."""
    x, y = read.map_T_grid.inverse().transform(np.array(point)).tolist() if read.turned else point
    return x, y


def _write_for_ros(folder: Path, read: RosMap, tour: CoverageTour, config: CoverConfig) -> None:
    """Write ``path.yaml`` and, for nav2, ``waypoints.yaml``; of unconnected parts a pair each, with its number."""
    paths = find_drivable_paths(read.grid, tour, config.coverage.graph.robot_radius)
    for number, path in enumerate(paths):
        poses = np.column_stack(
            (read.map_T_grid.transform(path.poses[:, :2]), path.poses[:, 2] + read.map_T_grid.theta)
        )
        ending = f"-{number}" if len(paths) > 1 else ""
        write_path_message(folder / f"path{ending}.yaml", poses)
        if config.to == "nav2":
            write_waypoints(folder / f"waypoints{ending}.yaml", poses[list(path.stops)])
