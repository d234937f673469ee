"""``closedrooms map``: the map of a recorded run."""

import contextlib
import math
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from closedrooms.core.errors import blaming
from closedrooms.core.files.geojson import write_doors
from closedrooms.core.files.output_folders import check_output_folder, output_folder
from closedrooms.core.files.rosmap import write_map
from closedrooms.core.files.tum import write_trajectory
from closedrooms.core.pose import Pose2
from closedrooms.core.report import Report
from closedrooms.mapping.logs import RecordedRun, read_run
from closedrooms.mapping.logs.clocks import find_gaps
from closedrooms.mapping.map_builder import BuiltMap, build_map
from closedrooms.mapping.mapper import Mapper
from closedrooms.mapping.trajectory import align
from closedrooms.pipeline.options.map import MapConfig
from closedrooms.pipeline.reporting.log_observer import TRACKS, LogWatch
from closedrooms.pipeline.reporting.manifest import input_path, resolved, versions
from closedrooms.pipeline.reporting.progress import Progress, Silent
from closedrooms.pipeline.reporting.stopwatch import Stopwatch
from closedrooms.visualization.no_recording import no_recording

if TYPE_CHECKING:
    from closedrooms.visualization.rerun.recorder import Recorder


def map_log(config: MapConfig, *, progress: Progress | None = None) -> Report:
    """Read a recorded run, map it scan after scan, write the folder.

    Args:
        config: Options.
        progress: Told how far it is.

    Raises:
        InvalidInputError: The log cannot be read or holds no scan with odometry.
        OutputError: The folder cannot be written, or holds something that is not ours.
    """
    progress, watch = progress or Silent(), Stopwatch()
    check_output_folder(config.out, "map", sources=[config.log])
    with watch.stage("read"):
        progress.stage("read")
        run = read_run(
            config.log,
            scan_topic=config.scan_topic,
            odometry_topic=config.odometry_topic,
            mount=config.mount,
            upside_down=config.upside_down,
        )
    manifest: dict[str, Any] = {
        "command": "map",
        "configuration": resolved(config, leave_out=("log", "out")),
        "paths": {"log": input_path(config.log)},
        "versions": versions(),
    }
    with (
        output_folder(config.out, manifest) as folder,
        _recording(config, folder / "run.rrd") as observer,
    ):
        observer.configuration(manifest["configuration"])
        log_watch = LogWatch(observer, run)
        log_watch.begin()
        progress.stage("map", len(run.scans))

        def step(number: int, map_T_robot: Pose2, mapper: Mapper) -> None:
            progress.advance(number + 1, f"{number + 1} of {len(run.scans)} scans")
            log_watch(number, map_T_robot, mapper)

        with watch.stage("map"), blaming(config.log):
            built = build_map(run, config.mapper, watch=step)
        log_watch.finish(built)
        with watch.stage("write"):
            progress.stage("write")
            _write(folder, run, built)
        remarks = (*run.remarks, *built.remarks)
        manifest["metrics"] = _metrics(built)
        manifest["remarks"] = [remark.as_json() for remark in remarks]
        manifest["durations"] = watch.seconds() | {"mapping alone": round(built.seconds, 3)}
    return Report(
        folder=config.out,
        title=f"{config.log.name}: {len(built.stamps)} scans",
        rows=_rows(built),
        remarks=remarks,
        figures=manifest["metrics"],
    )


def _rows(built: BuiltMap) -> list[tuple[str, str]]:
    """List the rows of the table for people."""
    errors = {
        text: f"{built.errors[name][0]:.3f} m, {math.degrees(built.errors[name][1]):.2f} deg"
        for name, text in TRACKS.items()
        if name in built.errors
    }
    gaps = find_gaps(built.stamps)
    return [
        ("figure", "value"),
        ("scans", f"{len(built.stamps)}"),
        ("keyframes", f"{built.keyframes}"),
        ("loops closed", f"{len(built.loops)}"),
        ("scans a second", f"{len(built.stamps) / max(built.seconds, 1e-9):.0f}"),
        *((f"error to the reference, {text}", error) for text, error in errors.items()),
        *([("gaps between scans", f"{len(gaps)}, up to {gaps[:, 1].max():.1f} s")] if len(gaps) else []),
    ]


def _metrics(built: BuiltMap) -> dict[str, Any]:
    """List the figures of ``run.json``."""
    errors = {name: {"ate_m": round(m, 5), "ate_rad": round(rad, 6)} for name, (m, rad) in built.errors.items()}
    return {
        "scans": len(built.stamps),
        "keyframes": built.keyframes,
        "loops": len(built.loops),
        "errors": errors,
        "gaps": [{"stamp": round(at, 3), "seconds": round(length, 3)} for at, length in find_gaps(built.stamps)],
    }


def _write(folder: Path, run: RecordedRun, built: BuiltMap) -> None:
    """Write map, trajectories, doors and picture; the reference is aligned with the trajectory first."""
    from closedrooms.visualization.summary import draw_map

    write_map(folder / "map", built.grid)
    write_trajectory(folder / "trajectory.tum", built.stamps, built.trajectory)
    if run.reference is not None:
        write_trajectory(folder / "trajectory_truth.tum", built.stamps, align(run.reference, built.trajectory))
    if built.doors:
        write_doors(folder / "doors.geojson", built.doors)
    draw_map(folder / "summary.png", built.grid, built.doors, built.trajectory)


@contextlib.contextmanager
def _recording(config: MapConfig, path: Path) -> Iterator["Recorder"]:
    """Open a recording named after the log, or none."""
    if not config.record:
        yield no_recording()
        return
    from closedrooms.visualization.rerun.recorder import Recorder

    with Recorder(path, name=config.log.name.split(".")[0]) as recorder:
        yield recorder
