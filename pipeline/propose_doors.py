"""``closedrooms doors``: proposes closed doors on anybody's map, from the map alone."""

import json
import tempfile
from pathlib import Path
from typing import Any

from closedrooms.core.door import ClosedDoor
from closedrooms.core.errors import ClosedroomsError, OutputError
from closedrooms.core.files import read_json
from closedrooms.core.geojson import Feature, write_features
from closedrooms.core.report import Report
from closedrooms.core.rosmap import read_map
from closedrooms.pipeline.progress import Progress, Silent
from closedrooms.pipeline.propose_doors_config import DoorsConfig
from closedrooms.pipeline.stopwatch import Stopwatch
from closedrooms.predictor.structure.door_proposals import DoorProposal, propose_doors


def doors_map(config: DoorsConfig, *, progress: Progress | None = None) -> Report:
    """Read a map, propose closed doors, write them.

    Args:
        config: Options.
        progress: Told what is done.

    Raises:
        InvalidInputError: The map cannot be read.
        OutputError: The file cannot be written, or holds something else than proposals.
    """
    progress, watch = progress or Silent(), Stopwatch()
    check_replaceable(config.out)
    with watch.stage("read"):
        progress.stage("read")
        grid = read_map(config.map)
    with watch.stage("propose"):
        progress.stage("propose")
        found = propose_doors(grid, config.proposals)
    proposals = {f"d{number:02d}": proposal for number, proposal in enumerate(found)}
    progress.stage("write")
    if config.picture is not None:
        import numpy as np

        from closedrooms.visualization.summary import draw_map

        doors = [ClosedDoor(name, door.midpoint, door.segment, door.width) for name, door in proposals.items()]
        draw_map(config.picture, grid, doors, np.zeros((0, 3)))
    write_features(config.out, [_feature(name, proposal) for name, proposal in proposals.items()])
    plural = "" if len(found) == 1 else "s"
    return Report(
        folder=config.out,
        title=f"{config.map.name}: {len(found)} closed door{plural} proposed",
        rows=_rows(proposals, watch.seconds()["propose"]),
        figures={"doors": {name: _properties(name, door) for name, door in proposals.items()}},
    )


def _rows(proposals: dict[str, DoorProposal], seconds: float) -> list[tuple[str, ...]]:
    """The table for people, the best proposal first."""
    rows: list[tuple[str, ...]] = [("door", "score", "width", "set back", "middle")]
    for name, door in proposals.items():
        x, y = door.midpoint
        rows.append((name, f"{door.score:.2f}", f"{door.width:.2f} m", f"{door.recess:.2f} m", f"({x:.2f}, {y:.2f}) m"))
    return [*rows, ("time", f"{seconds:.2f} s", "", "", "")]


def _feature(name: str, door: DoorProposal) -> Feature:
    from shapely.geometry import LineString

    return LineString(door.segment), _properties(name, door)


def _properties(name: str, door: DoorProposal) -> dict[str, Any]:
    """What the file says of a proposal beside its segment."""
    properties = {"id": name, "state": "closed", "width": round(door.width, 4), "score": round(door.score, 4)}
    return {**properties, "recess": round(door.recess, 4)}


def check_replaceable(path: Path) -> None:
    """Fail early when the file could not be written at the end, or holds anything but proposals.

    Proposals are told by their ``score``: a list of doors that somebody made, or that a run saw, has none and is kept.

    Raises:
        OutputError: A folder, a file that is not ours, or a folder that is missing or cannot be written.
    """
    try:
        if path.is_dir():
            raise OutputError(f"the output is a folder; expected a file: {path}")
        if path.exists() and not _proposals(path):
            raise OutputError(
                f"the output holds something that closedrooms doors did not write; expected a new file: {path}"
            )
        with tempfile.TemporaryFile(dir=path.parent):
            pass
    except OSError as error:
        raise OutputError(f"cannot write ({error.strerror}): {path}") from error


def _proposals(path: Path) -> bool:
    """Whether a file is a FeatureCollection of doors that all have a score."""
    try:
        data = read_json(path, what="doors")
        return data["type"] == "FeatureCollection" and all(
            feature["geometry"]["type"] == "LineString" and {"id", "state", "score"} <= feature["properties"].keys()
            for feature in data["features"]
        )
    except (ClosedroomsError, json.JSONDecodeError, KeyError, TypeError, AttributeError):
        return False
