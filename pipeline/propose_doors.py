"""``closedrooms doors``: proposes closed doors on anybody's map, from the map alone."""

from dataclasses import replace
from typing import Any

import numpy as np

from closedrooms.core.door import ClosedDoor
from closedrooms.core.errors import InvalidInputError
from closedrooms.core.files.geojson import GeoFeature, write_features
from closedrooms.core.files.outgoing import new_files
from closedrooms.core.files.rosmap import RosMap, read_ros_map
from closedrooms.core.report import Report
from closedrooms.pipeline.options.doors import DoorsConfig
from closedrooms.pipeline.reporting.progress import Progress, Silent
from closedrooms.pipeline.reporting.stopwatch import Stopwatch
from closedrooms.predictor.structure.door_proposals import DoorProposal, propose_doors


def doors_map(config: DoorsConfig, *, progress: Progress | None = None) -> Report:
    """Read a map, propose closed doors, write them.

    Args:
        config: Options.
        progress: Told what is done.

    Raises:
        InvalidInputError: The map cannot be read, or is smaller than 2 x 2 cells.
        OutputError: A file cannot be written, is the map, or is there already and ``force`` is not set.
    """
    progress, watch = progress or Silent(), Stopwatch()
    outputs = [config.out] if config.picture is None else [config.out, config.picture]
    with new_files(outputs, force=config.force, sources=[config.map]):
        return _doors_map(config, progress, watch)


def _doors_map(config: DoorsConfig, progress: Progress, watch: Stopwatch) -> Report:
    """Read the map, propose doors, write them and, on demand, their picture."""
    with watch.stage("read"):
        progress.stage("read")
        read = read_ros_map(config.map, allow_outside=config.allow_outside)
    if min(read.grid.frame.shape) < 2:
        rows, cols = read.grid.frame.shape
        raise InvalidInputError(f"a map of {cols} x {rows} cells", expected="at least 2 x 2", where=config.map)
    with watch.stage("propose"):
        progress.stage("propose")
        found = propose_doors(read.grid, config.proposals)
    names = [f"d{number:02d}" for number in range(len(found))]
    proposals = {name: _on_map(read, proposal) for name, proposal in zip(names, found, strict=True)}
    progress.stage("write")
    if config.picture is not None:
        from closedrooms.visualization.summary import draw_map

        doors = [ClosedDoor(n, p.midpoint, p.segment, p.width) for n, p in zip(names, found, strict=True)]
        draw_map(config.picture, read.grid, doors, np.zeros((0, 3)))
    write_features(config.out, [_feature(name, door) for name, door in proposals.items()])
    plural = "" if len(found) == 1 else "s"
    return Report(
        folder=config.out,
        title=f"{config.map.name}: {len(found)} closed door{plural} proposed",
        rows=_rows(proposals, watch.seconds()["propose"]),
        remarks=read.remarks,
        figures={"doors": {name: _properties(name, door) for name, door in proposals.items()}},
    )


def _rows(proposals: dict[str, DoorProposal], seconds: float) -> list[tuple[str, ...]]:
    """List the rows of the table for people, the best proposal first."""
    rows: list[tuple[str, ...]] = [("door", "score", "width", "set back", "middle")]
    for name, door in proposals.items():
        x, y = door.midpoint
        rows.append((name, f"{door.score:.2f}", f"{door.width:.2f} m", f"{door.recess:.2f} m", f"({x:.2f}, {y:.2f}) m"))
    return [*rows, ("time", f"{seconds:.2f} s", "", "", "")]


def _on_map(read: RosMap, door: DoorProposal) -> DoorProposal:
    """Transform a proposal of the grid's frame to the map frame."""
    if not read.turned:
        return door
    (x0, y0), (x1, y1) = read.map_T_grid.transform(np.array(door.segment)).tolist()
    return replace(door, segment=((x0, y0), (x1, y1)))


def _feature(name: str, door: DoorProposal) -> GeoFeature:
    from shapely.geometry import LineString

    return LineString(door.segment), _properties(name, door)


def _properties(name: str, door: DoorProposal) -> dict[str, Any]:
    """List what the file says of a proposal beside its segment."""
    properties = {"id": name, "state": "closed", "width": round(door.width, 4), "score": round(door.score, 4)}
    return {**properties, "recess": round(door.recess, 4)}
