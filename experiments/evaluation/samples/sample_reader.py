"""Samples on disk: a map, its closed doors and the truth, in one folder each."""

import contextlib
import os
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from closedrooms.core.door import ClosedDoor
from closedrooms.core.errors import InvalidInputError
from closedrooms.core.files.geojson import read_doors, read_rooms
from closedrooms.core.files.incoming import read_json
from closedrooms.core.files.output_folders import MANIFEST
from closedrooms.core.files.rosmap import read_map
from closedrooms.core.files.schema import check_schema
from closedrooms.core.grid import OccupancyGrid
from closedrooms.core.numbers import repr_of
from closedrooms.core.room import Room
from closedrooms.experiments.dataset.checksums import check, digest
from closedrooms.experiments.evaluation.samples.sample_path import SamplePath
from closedrooms.experiments.evaluation.samples.shard_rows import unpacked
from closedrooms.predictor.structure.known_window import MAX_CELLS

# Unknown cells kept around what is known when a sample is cropped [m].
MARGIN = 3.0
# Largest number of rooms, doors or repetitions that a manifest may name.
MAX_COUNT = 1_000_000


@dataclass(frozen=True, slots=True, eq=False)
class Sample:
    """Map, closed doors and truth of one sample; all grids on one frame, cropped to what any of them knows.

    Attributes:
        observed: The map with closed doors.
        doors: Closed doors of the map.
        truth: The true map.
        rooms: True rooms behind closed doors, empty where the sample has no such file.
        authors: Somebody's completed map (``authors.yaml``), or ``None``.
        world: Building.
        repetition: Repetition, 0 where nothing names it.
        closed: Closed doors, those that the robot did not see included; the doors of the map where nothing tells.
        rooms_seen: ``|R|`` of section 5.2, ``None`` where no run.json tells.
    """

    observed: OccupancyGrid
    doors: list[ClosedDoor]
    truth: OccupancyGrid
    rooms: list[Room]
    authors: OccupancyGrid | None
    world: str = ""
    repetition: int = 0
    closed: int = 0
    rooms_seen: int | None = None


@contextlib.contextmanager
def at_hand(sample: SamplePath) -> Iterator[SamplePath]:
    """Yield the sample with its files in a folder, unpacked where it is in a shard.

    Raises:
        InvalidInputError: The shard cannot be read; anything of the block that names the folder it was unpacked to,
            with the name of the shard in its place.
    """
    if sample.shard is None:
        yield sample
        return
    with unpacked(sample.shard) as folder:
        try:
            yield replace(sample, folder=folder, shard=None)
        except InvalidInputError as error:
            raise InvalidInputError(renamed(str(error), folder, sample)) from error


def renamed(message: str, folder: Path, sample: SamplePath) -> str:
    """Name the shard and the sample in a message about a folder that nobody knows."""
    return message.replace(str(folder), str(sample.folder))


def read_sample(sample: SamplePath) -> Sample:
    """Read a sample, check it against its checksums, and bring its grids to one frame.

    Raises:
        InvalidInputError: A missing, broken or changed file, grids that do not lie on one lattice, or so far apart
            that a frame that holds them has more than :data:`MAX_CELLS` cells.
    """
    if sample.problem:
        raise InvalidInputError(sample.problem)
    if sample.shard is not None:
        with at_hand(sample) as unpacked_sample:
            return read_sample(unpacked_sample)
    folder = sample.folder
    about = _read_about(sample)
    observed, truth = read_map(folder / "map.yaml"), read_map(folder / "truth.yaml")
    authors = read_map(folder / "authors.yaml") if os.path.lexists(folder / "authors.yaml") else None
    grids = [grid for grid in (observed, truth, authors) if grid is not None]
    windows = [grid.known_bounds() for grid in grids]
    bounds = [grid.frame.cropped(*w).bounds for grid, w in zip(grids, windows, strict=True) if w is not None]
    if len(bounds) < len(grids):
        raise InvalidInputError("a map without a known cell", expected="map and truth", where=folder)
    frame = observed.frame
    low, high = [min(b[i] for b in bounds) for i in (0, 1)], [max(b[i] for b in bounds) for i in (2, 3)]
    start = frame.to_cells(np.array(low) - MARGIN)
    end = frame.to_cells(np.array(high) + MARGIN)
    rows, cols = (int(size) for size in end - start)
    if rows * cols > MAX_CELLS:
        extent = f"{cols * frame.resolution:.6g} x {rows * frame.resolution:.6g} m in cells of {frame.resolution:g} m"
        raise InvalidInputError(f"map and truth together cover {extent}", expected=f"at most {MAX_CELLS}", where=folder)
    window_frame = frame.cropped(int(start[0]), int(start[1]), rows, cols)
    try:
        cropped = [grid.on(window_frame) for grid in grids]
    except InvalidInputError as error:
        raise InvalidInputError("map and truth on different lattices", expected="one lattice", where=folder) from error
    rooms = read_rooms(folder / "truth_rooms.geojson") if os.path.lexists(folder / "truth_rooms.geojson") else []
    doors = read_doors(folder / "doors.geojson")
    closed, seen, repetition = about.get("closed"), about.get("rooms_seen"), about.get("repetition")
    return Sample(
        cropped[0],
        doors,
        cropped[1],
        rooms,
        cropped[2] if authors is not None else None,
        sample.world or about.get("world") or sample.name.rpartition("/")[0] or sample.name,
        sample.repetition if sample.repetition >= 0 else repetition or 0,
        len(closed) if isinstance(closed, list) else len(doors),
        seen,
    )


def _read_about(sample: SamplePath) -> dict[str, Any]:
    """Read ``world``, ``closed``, ``repetition`` and ``rooms_seen`` of the sample's run.json, checksums compared."""
    path = sample.folder / MANIFEST
    if not os.path.lexists(path) and not sample.listed:
        return {}
    data = read_json(path, what="the manifest of a run")
    if not isinstance(data, dict):
        raise InvalidInputError("no JSON object", expected="the manifest of a run", where=path)
    check_schema(data, path)
    if sample.digest and digest(path) != sample.digest:
        raise InvalidInputError("changed since it was written", expected="its SHA-256 in SHA256SUMS", where=path)
    if sample.listed or "checksums" in data:
        check(sample.folder)
    metrics = data.get("metrics")
    seen = _count(metrics.get("rooms_seen") if isinstance(metrics, dict) else None, "rooms_seen", path)
    world = data.get("world")
    return {
        "world": world if isinstance(world, str) else None,
        "closed": data.get("closed"),
        "repetition": _count(data.get("repetition"), "repetition", path),
        "rooms_seen": seen,
    }


def _count(value: Any, name: str, path: Path) -> int | None:
    """Read a whole number of a manifest, ``None`` where there is none.

    Raises:
        InvalidInputError: Something else, or larger than any count.
    """
    if value is not None and (isinstance(value, bool) or not isinstance(value, int) or not 0 <= value <= MAX_COUNT):
        raise InvalidInputError(
            f"{name} {repr_of(value)}", expected=f"a whole number from 0 to {MAX_COUNT}", where=path
        )
    return value
