"""``closedrooms predict``: the predictor on anybody's map."""

import contextlib
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from closedrooms.core.door import ClosedDoor
from closedrooms.core.errors import InvalidInputError
from closedrooms.core.files.geojson import write_doors, write_rooms
from closedrooms.core.files.output_folders import check_output_folder, output_folder
from closedrooms.core.files.rosmap import RosMap, read_ros_map, write_map, write_raw_map
from closedrooms.core.grid import OccupancyGrid
from closedrooms.core.report import Report
from closedrooms.core.room import Room
from closedrooms.pipeline.given_doors import given_doors, misplaced_doors
from closedrooms.pipeline.options.predict import PredictConfig
from closedrooms.pipeline.reporting.manifest import input_path, resolved, versions
from closedrooms.pipeline.reporting.progress import Progress, Silent
from closedrooms.pipeline.reporting.stopwatch import Stopwatch
from closedrooms.predictor.inpainting import withdraw_unsure
from closedrooms.predictor.methods import predict
from closedrooms.predictor.prediction import Prediction, free_probability
from closedrooms.visualization.no_recording import no_recording

if TYPE_CHECKING:
    from closedrooms.visualization.rerun.recorder import Recorder

Beside = Callable[[Path, RosMap, Prediction], dict[str, Any]]
"""Writes more files into the folder of a prediction; what it returns joins the manifest."""
# That a door may lead outside is said from this probability on: so say one door of a room in 200, and one exit in four.
DOUBTFUL = 0.4


def predict_map(
    config: PredictConfig,
    *,
    progress: Progress | None = None,
    given: Sequence[ClosedDoor] | None = None,
    beside: Beside | None = None,
) -> Report:
    """Read a map and its closed doors, predict the rooms behind them, write the folder.

    Args:
        config: Options.
        progress: Told what is done.
        given: Doors in the map frame, in place of those in the file ``config.doors``.
        beside: Writes more into the folder.

    Returns:
        The rooms by door and what failed; all of it is written to ``config.out``.

    Raises:
        InvalidInputError: The map or the doors cannot be read.
        OutputError: The folder cannot be written, or holds something that is not ours.
    """
    progress, watch = progress or Silent(), Stopwatch()
    check_output_folder(config.out, "predict", sources=[config.map, *([config.doors] if given is None else [])])
    with watch.stage("read"):
        progress.stage("read")
        read = read_ros_map(config.map, allow_outside=config.allow_outside)
        remarks = list(read.remarks)
        given = given_doors(config.doors, remarks) if given is None else given
        grid, doors = read.grid, read.doors_on_grid(given)
        remarks += misplaced_doors(read, doors)
    manifest: dict[str, Any] = {
        "command": "predict",
        "configuration": resolved(config, leave_out=("map", "doors", "out")),
        "paths": {"map": input_path(config.map), "doors": input_path(config.doors)},
        "versions": versions(),
    }
    with output_folder(config.out, manifest) as folder:
        with watch.stage("predict"):
            progress.stage("predict")
            try:
                prediction = predict(grid, doors, config.method, config.predictor, trace=config.record)
            except InvalidInputError as error:
                raise InvalidInputError(str(error), where=config.map) from error
            prediction = withdraw_unsure(prediction, grid, doors, config.min_confidence)
        with watch.stage("record"), _recording(config, grid, folder / "run.rrd") as observer:
            observer.configuration(manifest["configuration"])
            observer.prediction(grid, doors, prediction)
        with watch.stage("write"):
            progress.stage("write")
            rooms = tuple(read.rooms_on_map(prediction.rooms))
            write_doors(folder / "doors.geojson", given)
            write_rooms(folder / "rooms.geojson", rooms)
            _write_maps(folder, read, prediction, doors)
            manifest |= beside(folder, read, prediction) if beside is not None else {}
        manifest["doors"] = {"given": [door.id for door in doors], "failures": prediction.failures}
        manifest["remarks"] = [remark.as_json() for remark in remarks]
        manifest["durations"] = watch.seconds()
    return Report(
        folder=config.out,
        title=f"{config.map.name}: {len(prediction.rooms)} of {len(doors)} doors predicted",
        rows=_rows(prediction, config.min_confidence, manifest["durations"]["predict"]),
        failures=prediction.failures,
        remarks=remarks,
        figures={"rooms": [_figures(room) for room in rooms]},
    )


def _write_maps(folder: Path, read: RosMap, prediction: Prediction, doors: Sequence[ClosedDoor]) -> None:
    """Write map, completed map and probability on one frame, and the picture of them; ``doors`` are in the grid's."""
    from closedrooms.visualization.summary import draw_summary

    observed = read.grid.on(prediction.grid.frame)
    write_map(folder / "map", observed, map_T_grid=read.map_T_grid)
    write_map(folder / "predicted", prediction.grid, map_T_grid=read.map_T_grid)
    write_raw_map(folder / "probability", free_probability(prediction, read.grid), map_T_grid=read.map_T_grid)
    draw_summary(folder / "summary.png", observed, prediction, doors)


def _rows(prediction: Prediction, least: float, seconds: float) -> list[tuple[str, str, str]]:
    """List the rows of the table for people."""

    def describe(room: Room) -> str:
        sure = 0.0 if room.confidence is None else room.confidence
        told = [room.kind or "room", f"confidence {sure:.2f}" + (", not drawn" if sure < least else "")]
        if room.outside is not None and room.outside >= DOUBTFUL:
            told.append(f"or the door leads outside ({room.outside:.2f})")
        return ", ".join([*told, *(["search was cut"] if room.bounded else [])])

    return [
        ("doors", "room", "area"),
        *((", ".join(room.doors), describe(room), f"{room.polygon.area:.1f} m2") for room in prediction.rooms),
        *((door, f"not predicted: {reason}", "") for door, reason in prediction.failures.items()),
        ("time", "prediction", f"{seconds:.2f} s"),
    ]


def _figures(room: Room) -> dict[str, Any]:
    """List what programs want to know of one room."""
    area = round(room.polygon.area, 4)
    head = {"doors": list(room.doors), "kind": room.kind, "area_m2": area, "bounded": room.bounded}
    return head | {"confidence": room.confidence, "alternatives": len(room.alternatives)}


@contextlib.contextmanager
def _recording(config: PredictConfig, grid: OccupancyGrid, path: Path) -> Iterator["Recorder"]:
    """Open a recording that shows what is known of the map, or none."""
    if not config.record:
        yield no_recording()
        return
    from closedrooms.visualization.rerun.recorder import Recorder

    row, col, rows, cols = grid.known_bounds() or (0, 0, *grid.frame.shape)
    bounds = grid.frame.cropped(row, col, rows, cols).bounds
    with Recorder(path, name=config.map.stem, bounds=bounds) as recorder:
        yield recorder
