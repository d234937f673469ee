"""``closedrooms doors``: proposes closed doors on anybody's map, from the map alone."""

import json
import tempfile
from dataclasses import dataclass, field
from pathlib import Path

from closedrooms.core.door import ClosedDoor
from closedrooms.core.errors import ClosedroomsError, OutputError
from closedrooms.core.files import read_json
from closedrooms.core.geojson import Feature, write_features
from closedrooms.core.rosmap import read_map
from closedrooms.pipeline.progress import Progress, Silent
from closedrooms.pipeline.propose_doors_config import DoorsConfig
from closedrooms.pipeline.stopwatch import Stopwatch
from closedrooms.predictor.structure.door_proposals import DoorProposal, propose_doors


@dataclass(frozen=True, slots=True, eq=False)
class DoorsResult:
    """Proposed doors of one map.

    Attributes:
        folder: The file that was written.
        title: Head of the table.
        proposals: The doors, by id, the best first.
        failures: Nothing: a map without a door is a result.
        durations: Seconds by stage.
    """

    folder: Path
    title: str
    proposals: dict[str, DoorProposal]
    failures: dict[str, str] = field(default_factory=dict)
    durations: dict[str, float] = field(default_factory=dict)

    def table(self) -> list[tuple[str, ...]]:
        """Rows for people; the first is the head."""
        rows: list[tuple[str, ...]] = [("door", "score", "width", "set back", "middle")]
        for name, door in self.proposals.items():
            x, y = door.midpoint
            rows.append(
                (name, f"{door.score:.2f}", f"{door.width:.2f} m", f"{door.recess:.2f} m", f"({x:.2f}, {y:.2f}) m")
            )
        rows.append(("time", f"{self.durations['propose']:.2f} s", "", "", ""))
        return rows


def doors_map(config: DoorsConfig, *, progress: Progress | None = None) -> DoorsResult:
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
    title = f"{config.map.name}: {len(found)} closed door{plural} proposed"
    return DoorsResult(config.out, title, proposals, durations=watch.seconds())


def _feature(name: str, door: DoorProposal) -> Feature:
    from shapely.geometry import LineString

    properties = {"id": name, "state": "closed", "width": round(door.width, 4), "score": round(door.score, 4)}
    return LineString(door.segment), {**properties, "recess": round(door.recess, 4)}


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
