"""``closedrooms cover``: a coverage tour on anybody's map."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from closedrooms.core.door import ClosedDoor
from closedrooms.core.errors import InvalidInputError
from closedrooms.core.files import check_output_folder, output_folder
from closedrooms.core.geojson import read_doors, write_doors, write_features
from closedrooms.core.grid import OccupancyGrid
from closedrooms.core.rosmap import read_map, write_map
from closedrooms.coverage.drivable_path import find_drivable_paths
from closedrooms.coverage.ros_tour import write_path_message, write_waypoints
from closedrooms.coverage.tour import CoverageTour
from closedrooms.coverage.tour_features import make_tour_features
from closedrooms.coverage.tour_planner import plan_coverage
from closedrooms.pipeline.config import CoverConfig
from closedrooms.pipeline.manifest import resolved, versions
from closedrooms.pipeline.progress import Progress, Silent
from closedrooms.pipeline.stopwatch import Stopwatch


@dataclass(frozen=True, slots=True, eq=False)
class CoverResult:
    """One finished tour.

    Attributes:
        folder: What was written.
        title: Head of the table.
        tour: The tour.
        failures: Why a door could not be visited, by door id.
        durations: Seconds by stage.
    """

    folder: Path
    title: str
    tour: CoverageTour
    failures: dict[str, str] = field(default_factory=dict)
    durations: dict[str, float] = field(default_factory=dict)

    def table(self) -> list[tuple[str, str]]:
        """Rows for people; the first is the head."""
        tour = self.tour
        return [
            ("figure", "value"),
            ("vertices", f"{len(tour.graph.vertices)}"),
            ("length", f"{tour.length:.1f} m"),
            ("lower bound", f"{tour.lower_bound:.1f} m (gap {100 * tour.gap:.1f} %)"),
            ("status", tour.status),
            *[("note", note) for note in tour.notes],
            *[(f"not visited: {door}", reason) for door, reason in self.failures.items()],
            ("time", f"{self.durations['cover']:.2f} s"),
        ]


def cover_map(config: CoverConfig, *, progress: Progress | None = None) -> CoverResult:
    """Read a map, plan a tour that covers it, write the folder.

    Args:
        config: Options.
        progress: Told what is done.

    Raises:
        InvalidInputError: The map or the doors cannot be read, or the map has no free space.
        OutputError: The folder cannot be written, or holds something that is not ours.
    """
    progress, watch = progress or Silent(), Stopwatch()
    check_output_folder(config.out)
    with watch.stage("read"):
        progress.stage("read")
        grid = read_map(config.map)
        doors: list[ClosedDoor] = read_doors(config.doors) if config.doors else []
    manifest: dict[str, Any] = {
        "configuration": resolved(config, leave_out=("map", "doors", "out")),
        "paths": {"map": str(config.map), "doors": str(config.doors) if config.doors else None},
        "versions": versions(),
    }
    with watch.stage("cover"):
        progress.stage("cover")
        try:
            tour = plan_coverage(grid, doors, config.coverage, start=config.start, map_name="closed")
        except InvalidInputError as error:
            raise InvalidInputError(str(error), where=config.map) from error
    missed = {door.id: "no free space to reach it from" for door in doors if door.id not in tour.graph.door_vertices}
    missed |= dict.fromkeys(tour.unreached_doors, "no free space to reach it from")
    with output_folder(config.out, manifest) as folder:
        progress.stage("write")
        write_map(folder / "map", grid)
        if config.doors:
            write_doors(folder / "doors.geojson", doors)
        write_features(folder / "tour.geojson", make_tour_features(tour, "closed"))
        if config.to is not None:
            _write_for_ros(folder, grid, tour, config)
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
        manifest["notes"] = list(tour.notes)
        manifest["durations"] = watch.seconds()
    return CoverResult(config.out, f"{config.map.name}: coverage tour", tour, missed, manifest["durations"])


def _write_for_ros(folder: Path, grid: OccupancyGrid, tour: CoverageTour, config: CoverConfig) -> None:
    """``path.yaml`` and, for nav2, ``waypoints.yaml``; of unconnected parts a pair each, with its number."""
    paths = find_drivable_paths(grid, tour, config.coverage.graph.robot_radius)
    for number, path in enumerate(paths):
        ending = f"-{number}" if len(paths) > 1 else ""
        write_path_message(folder / f"path{ending}.yaml", path.poses)
        if config.to == "nav2":
            write_waypoints(folder / f"waypoints{ending}.yaml", path.poses[list(path.stops)])
