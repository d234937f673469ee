"""Samples on disk: a map, its closed doors and the truth, in one folder each."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from closedrooms.core.door import ClosedDoor
from closedrooms.core.errors import InvalidInputError
from closedrooms.core.geojson import read_doors, read_rooms
from closedrooms.core.grid import OccupancyGrid
from closedrooms.core.room import Room
from closedrooms.core.rosmap import read_map

FILES = ("map.yaml", "doors.geojson", "truth.yaml")
# Unknown cells kept around what is known when a sample is cropped [m].
MARGIN = 3.0


@dataclass(frozen=True, slots=True, order=True)
class SamplePath:
    """Where a sample is; ``name`` is its path relative to the dataset."""

    name: str
    folder: Path


@dataclass(frozen=True, slots=True, eq=False)
class Sample:
    """One sample; all grids on one frame, cropped to what any of them knows.

    Attributes:
        observed: The map with closed doors.
        doors: Closed doors of the map.
        truth: The true map.
        rooms: True rooms behind closed doors, empty where the sample has no such file.
        authors: Somebody's completed map (``authors.yaml``), or ``None``.
    """

    observed: OccupancyGrid
    doors: list[ClosedDoor]
    truth: OccupancyGrid
    rooms: list[Room]
    authors: OccupancyGrid | None


def find_samples(datasets: Sequence[Path]) -> list[SamplePath]:
    """Every sample below the datasets, by name.

    Raises:
        InvalidInputError: A dataset that is no folder or holds no sample; two samples of one name.
    """
    found: dict[str, Path] = {}
    for dataset in datasets:
        if not dataset.is_dir():
            raise InvalidInputError("no such folder", expected="a dataset", where=dataset)
        folders = sorted(path.parent for path in dataset.rglob(FILES[0]))
        folders = [folder for folder in folders if all((folder / name).is_file() for name in FILES)]
        if not folders:
            raise InvalidInputError("no sample", expected=f"folders with {', '.join(FILES)}", where=dataset)
        for folder in folders:
            name = folder.relative_to(dataset).as_posix()
            name = dataset.resolve().name if name == "." else name
            if name in found:
                raise InvalidInputError(f"two samples named {name!r}", expected="one folder a name", where=folder)
            found[name] = folder
    return [SamplePath(name, folder) for name, folder in sorted(found.items())]


def read_sample(folder: Path) -> Sample:
    """Read a sample and bring its grids to one frame.

    Raises:
        InvalidInputError: A broken file, or grids that do not lie on one lattice.
    """
    observed, truth = read_map(folder / "map.yaml"), read_map(folder / "truth.yaml")
    authors = read_map(folder / "authors.yaml") if (folder / "authors.yaml").is_file() else None
    grids = [grid for grid in (observed, truth, authors) if grid is not None]
    frame = observed.frame
    for grid in grids:
        window = grid.known_bounds()
        if window is None:
            raise InvalidInputError("a map without a known cell", expected="map and truth", where=folder)
    bounds = [grid.frame.cropped(*(grid.known_bounds() or (0, 0, 1, 1))).bounds for grid in grids]
    low, high = [min(b[i] for b in bounds) for i in (0, 1)], [max(b[i] for b in bounds) for i in (2, 3)]
    start = frame.to_cells(np.array(low) - MARGIN)
    end = frame.to_cells(np.array(high) + MARGIN)
    window_frame = frame.cropped(int(start[0]), int(start[1]), int(end[0] - start[0]), int(end[1] - start[1]))
    try:
        cropped = [grid.on(window_frame) for grid in grids]
    except InvalidInputError as error:
        raise InvalidInputError("map and truth on different lattices", expected="one lattice", where=folder) from error
    rooms = read_rooms(folder / "truth_rooms.geojson") if (folder / "truth_rooms.geojson").is_file() else []
    doors = read_doors(folder / "doors.geojson")
    return Sample(cropped[0], doors, cropped[1], rooms, cropped[2] if authors is not None else None)
