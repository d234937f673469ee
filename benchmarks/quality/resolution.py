"""The same map in cells of another size, and turned: how far the predicted rooms agree with those of the map as it is.

    python benchmarks/quality/resolution.py ../shared/data/authors/*/0[15] [--methods paper best] [--cells 0.1]
                                                [--turn 30]

A sample is a folder with ``map.yaml`` and ``doors.geojson``. Three ways to write a cell from those it covers: ``most``,
what most of its area is; ``any``, occupied where anything is; ``third``, occupied where 0.3 of it is.
"""

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import shapely
import tyro
from rich.console import Console
from rich.table import Table
from shapely import affinity

from closedrooms.core.arrays import BoolArray, CellArray, FloatArray
from closedrooms.core.door import ClosedDoor, Point
from closedrooms.core.files.geojson import read_doors
from closedrooms.core.files.rosmap import read_map
from closedrooms.core.grid import FREE, OCCUPIED, UNKNOWN, GridFrame, OccupancyGrid
from closedrooms.core.shapes import Shape
from closedrooms.predictor.methods import predict
from closedrooms.predictor.structure.known_window import known_window

METHODS = ("paper", "rose", "best")
# Points a turned cell is sampled at along each axis.
SAMPLES = 4
RULES: dict[str, Callable[[FloatArray, FloatArray], BoolArray]] = {
    "most": lambda occupied, free: (occupied > 0) & (occupied >= free) & (occupied >= 1.0 - occupied - free),
    "any": lambda occupied, _free: occupied > 1e-6,
    "third": lambda occupied, _free: occupied >= 0.3 - 1e-9,
}


@dataclass(frozen=True, kw_only=True)
class Options:
    """Options of a comparison."""

    samples: tyro.conf.Positional[tuple[Path, ...]]
    """Folders with a map and its doors."""
    methods: tuple[str, ...] = ("paper", "rose", "best")
    """paper, rose, best."""
    cells: tuple[float, ...] = (0.025, 0.03, 0.04, 0.08, 0.1)
    """Cell sizes [m]."""
    rules: tuple[str, ...] = ("most", "any", "third")
    """most, any, third."""
    turn: tuple[float, ...] = (30.0, -17.0)
    """Angles that the map is turned by about the origin [degrees], in cells of its own size and by ``third``."""


def redrawn(grid: OccupancyGrid, resolution: float, rule: str) -> OccupancyGrid:
    """Redraw the map in cells of ``resolution`` [m], from the share of each that is occupied and free."""
    frame = grid.frame
    size = resolution / frame.resolution
    rows, cols = (math.ceil(count / size - 1e-9) for count in frame.shape)
    down, across = _overlaps(frame.rows, rows, size), _overlaps(frame.cols, cols, size)
    occupied, free = (down @ mask.astype(np.float64) @ across.T for mask in (grid.occupied, grid.free))
    target = GridFrame(resolution, frame.origin_x, frame.origin_y, rows, cols)
    return OccupancyGrid(target, _cells(occupied, free, rule))


def _overlaps(count: int, wanted: int, size: float) -> FloatArray:
    """Compute the share of each new cell, ``size`` old ones long, in each old one, shape (wanted, count)."""
    starts, cells = np.arange(wanted)[:, None] * size, np.arange(count)[None, :]
    return np.maximum(np.minimum(starts + size, cells + 1) - np.maximum(starts, cells), 0.0) / size


def turned(grid: OccupancyGrid, angle: float) -> OccupancyGrid:
    """Turn the map about the origin by ``angle`` [rad], in cells of its own size and by ``third``."""
    c, s = math.cos(angle), math.sin(angle)
    turn = np.array([[c, s], [-s, c]])
    x0, y0, x1, y1 = grid.frame.bounds
    corners = np.array([(x0, y0), (x1, y0), (x0, y1), (x1, y1)]) @ turn
    low, resolution = corners.min(axis=0), grid.frame.resolution
    cols, rows = np.ceil((corners.max(axis=0) - low) / resolution).astype(int)
    frame = GridFrame(resolution, float(low[0]), float(low[1]), int(rows), int(cols))
    points = frame.to_points(np.stack(np.indices(frame.shape), axis=-1))
    occupied, free = np.zeros(frame.shape), np.zeros(frame.shape)
    places = ((np.arange(SAMPLES) + 0.5) / SAMPLES - 0.5) * resolution
    for dx, dy in itertools.product(places, places):
        cells = grid.frame.to_cells((points + np.array([dx, dy])) @ turn.T)
        inside = grid.frame.contains(cells)
        row, col = np.where(inside, cells[..., 0], 0), np.where(inside, cells[..., 1], 0)
        occupied += inside & grid.occupied[row, col]
        free += inside & grid.free[row, col]
    return OccupancyGrid(frame, _cells(occupied / SAMPLES**2, free / SAMPLES**2, "third"))


def _cells(occupied: FloatArray, free: FloatArray, rule: str) -> CellArray:
    values = np.where(free >= 0.5, FREE, UNKNOWN).astype(np.int8)
    values[RULES[rule](occupied, free)] = OCCUPIED
    return values


def turned_door(door: ClosedDoor, angle: float) -> ClosedDoor:
    c, s = math.cos(angle), math.sin(angle)

    def turn(point: Point) -> Point:
        return c * point[0] - s * point[1], s * point[0] + c * point[1]

    ends = None if door.segment is None else (turn(door.segment[0]), turn(door.segment[1]))
    return ClosedDoor(door.id, turn(door.midpoint), ends, door.width)


def rooms(grid: OccupancyGrid, doors: Sequence[ClosedDoor], method: str, angle: float = 0.0) -> dict[str, Shape]:
    """Predict rooms by door, turned back by ``angle`` [rad]."""
    found = predict(grid, doors, method).rooms
    back = -math.degrees(angle)
    return {door: affinity.rotate(room.polygon, back, origin=(0, 0)) for room in found for door in room.doors}


def agreement(one: dict[str, Shape], other: dict[str, Shape]) -> tuple[float, float]:
    """Measure IoU of the whole area, and the mean over rooms."""
    a, b = (shapely.union_all(list(found.values())) for found in (one, other))
    each = [one[d].intersection(other[d]).area / one[d].union(other[d]).area if d in other else 0.0 for d in one]
    return float(a.intersection(b).area / max(a.union(b).area, 1e-9)), float(np.mean(each or [1.0]))


def measure(folder: Path, options: Options) -> dict[tuple[str, str], tuple[float, float]]:
    """Measure agreement by change and method."""
    window = known_window(read_map(folder / "map.yaml"))
    assert window is not None, f"{folder}: nothing is known"
    doors, found = read_doors(folder / "doors.geojson"), {}
    usual = {method: rooms(window, doors, method) for method in options.methods}
    for size in options.cells:
        for rule in options.rules:
            other = redrawn(window, size, rule)
            for method in options.methods:
                found[f"{size:g} m, {rule}", method] = agreement(usual[method], rooms(other, doors, method))
    for degrees in options.turn:
        angle = math.radians(degrees)
        other = turned(window, angle)
        moved = [turned_door(door, angle) for door in doors]
        for method in options.methods:
            found[f"turned {degrees:g}", method] = agreement(usual[method], rooms(other, moved, method, angle))
    return found


def main() -> None:
    options = tyro.cli(Options, description=__doc__)
    measured = [measure(folder, options) for folder in options.samples]
    table = Table("change", *(f"{method}: area mean, median, lowest; rooms mean" for method in options.methods))
    for change in dict.fromkeys(change for change, _ in measured[0]):
        cells = []
        for method in options.methods:
            area, room = np.array([found[change, method] for found in measured]).T
            cells.append(f"{area.mean():.3f}, {np.median(area):.3f}, {area.min():.3f}; {room.mean():.3f}")
        table.add_row(change, *cells)
    Console(width=200).print(table)


if __name__ == "__main__":
    main()
