"""Maps as large as one likes, tiled from mapped buildings: processor time and memory of whole processes.

    python benchmarks/speed/large_maps.py RUN... [--cells 4000 8000] [--methods paper best] [--rounds 3] [--quick]

A run is a folder with ``map.yaml`` and ``doors.geojson``. Every method reads the map, predicts and, where it is one of
``closedrooms predict``, writes its folder, in a process of its own, in turn; the medians of some rounds count. Beside
the methods, ``doors`` and ``cover`` are the commands of that name, with how many doors are proposed and how many
vertices the tours of all buildings have. The last column is "ours / best known": processor time of the last of the
methods that are ours (``best``, ``learned``) beside the quickest of the others.
"""

import itertools
import json
import resource
import subprocess
import sys
import tempfile
from dataclasses import dataclass, replace
from pathlib import Path
from statistics import median

import numpy as np
import tyro
from rich.console import Console
from rich.table import Table

from closedrooms.core.door import ClosedDoor
from closedrooms.core.files.geojson import read_doors, write_doors
from closedrooms.core.files.rosmap import read_map, write_map
from closedrooms.core.grid import UNKNOWN, GridFrame, OccupancyGrid
from closedrooms.predictor.structure.known_window import known_window

RESOLUTION = 0.05
OURS, NO_METHODS = ("best", "learned"), ("doors", "cover")


@dataclass(frozen=True, kw_only=True)
class Options:
    """Options of a measurement."""

    runs: tyro.conf.Positional[tuple[Path, ...]]
    """Folders with a map and its doors."""
    cells: tuple[int, ...] = (4000, 8000)
    """Cells along each side of the tiled maps."""
    doors: int = 20
    """How many of the doors are closed, drawn with a fixed seed."""
    methods: tuple[str, ...] = ("paper", "rose", "best", "line-of-sight", "geometric")
    """paper, rose, best, line-of-sight, geometric; doors and cover are commands."""
    rounds: int = 3
    """Each method is called once a round, in turn; medians count."""
    quick: bool = False
    """Two methods on a map of 1500 x 1500 cells with five closed doors."""


def tile(runs: tuple[Path, ...], cells: int, doors: int, folder: Path) -> None:
    """Write a map of buildings side by side, without space between them, and doors spread over it."""
    windows = []
    for run in runs:
        window = known_window(read_map(run / "map.yaml"), margin=0)
        assert window is not None, f"{run}: nothing is known"
        windows.append((window, read_doors(run / "doors.geojson")))
    drawn, places, row = np.full((cells, cells), UNKNOWN, dtype=np.int8), [], 0
    endless = itertools.cycle(windows)
    while row < cells:
        col, height = 0, cells
        while col < cells:
            window, closed = next(endless)
            part = window.cells[: cells - row, : cells - col]
            drawn[row : row + part.shape[0], col : col + part.shape[1]] = part
            for door in closed:
                x, y = np.subtract(door.midpoint, (window.frame.origin_x, window.frame.origin_y)).tolist()
                if x < part.shape[1] * RESOLUTION - 1.0 and y < part.shape[0] * RESOLUTION - 1.0:
                    places.append((x + col * RESOLUTION, y + row * RESOLUTION))
            height, col = min(height, part.shape[0]), col + part.shape[1]
        row += height
    chosen = np.random.default_rng(0).permutation(len(places))[:doors]
    write_map(folder / "map", OccupancyGrid(GridFrame(RESOLUTION, 0.0, 0.0, cells, cells), drawn))
    write_doors(folder / "doors.geojson", [ClosedDoor(f"d{n:02d}", places[at]) for n, at in enumerate(chosen)])


def measure(method: str, folder: Path) -> tuple[float, float, int]:
    """Measure processor seconds, megabytes at the peak and what was found by one method in a process of its own."""
    here = Path(__file__).resolve()
    words = [sys.executable, str(here), "--only", method, str(folder)]
    text = subprocess.run(words, check=True, capture_output=True, text=True).stdout
    seconds, memory, rooms = json.loads(text.splitlines()[-1])
    return seconds, memory, rooms


def middle(calls: tuple[tuple[float, float, int], ...]) -> tuple[float, float, int]:
    """Take the medians of processor seconds and megabytes of some calls, which find the same rooms."""
    return median(seconds for seconds, _, _ in calls), median(memory for _, memory, _ in calls), calls[-1][2]


def only(method: str, folder: Path) -> None:
    """Predict by one method, or run a command, and say what it took."""
    found = found_by(method, folder / "map.yaml", folder / "doors.geojson", folder / method)
    used = resource.getrusage(resource.RUSAGE_SELF)
    print(json.dumps((used.ru_utime + used.ru_stime, used.ru_maxrss / 1024, found)))


def found_by(method: str, grid: Path, doors: Path, out: Path) -> int:
    """Count the rooms that a method predicts, the doors that are proposed, or the vertices of tours."""
    if method == "doors":
        from closedrooms.pipeline.options.doors import DoorsConfig
        from closedrooms.pipeline.propose_doors import doors_map

        return len(doors_map(DoorsConfig(map=grid, out=out.with_suffix(".out.geojson"))).figures["doors"])
    if method == "cover":
        from closedrooms.coverage.config import CoverageConfig
        from closedrooms.pipeline.cover import cover_map
        from closedrooms.pipeline.options.cover import CoverConfig

        figures = cover_map(CoverConfig(map=grid, doors=doors, out=out, coverage=CoverageConfig(parts="all"))).figures
        return int(figures["tour"]["vertices"])
    from closedrooms.pipeline.options.predict import PredictConfig
    from closedrooms.pipeline.predict import predict_map

    return len(predict_map(PredictConfig(map=grid, doors=doors, out=out, method=method)).figures["rooms"])


def main() -> None:
    options = tyro.cli(Options, description=__doc__)
    if options.quick:
        options = replace(options, cells=(1500,), doors=5, methods=("line-of-sight", "best"))
    table = Table("cells", *(f"{method}: s, MB, found" for method in options.methods), "ours / best known")
    for cells in options.cells:
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            tile(options.runs, cells, options.doors, folder)
            rounds = [[measure(method, folder) for method in options.methods] for _ in range(options.rounds)]
            measured = [middle(calls) for calls in zip(*rounds, strict=True)]
        ours = [row[0] for method, row in zip(options.methods, measured, strict=True) if method in OURS]
        others = [row[0] for m, row in zip(options.methods, measured, strict=True) if m not in OURS + NO_METHODS]
        share = f"{ours[-1] / min(others):.2f}" if ours and others else ""
        figures = (f"{seconds:.1f}, {memory:.0f}, {n}" for seconds, memory, n in measured)
        table.add_row(f"{cells} x {cells}", *figures, share)
    Console(width=200).print(table)


if __name__ == "__main__":
    if sys.argv[1:2] == ["--only"]:
        only(sys.argv[2], Path(sys.argv[3]))
    else:
        main()
