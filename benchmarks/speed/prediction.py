"""Speed, memory and agreement of the predictor, side by side with the authors' own completed maps.

    python benchmarks/speed/prediction.py ../shared/data/authors [--method best] [--quick]

A sample is any folder with ``map.yaml`` and ``doors.geojson``; with ``authors.yaml`` the area that the prediction adds
(cells free in it and unknown in the map) is compared with the area that the authors' program added, with
``truth.yaml`` with the area that is really there. Seconds are processor time in a running process; the last column is
the median of "ours / best known", against the paper's simplest baseline, ``line-of-sight``: medians of three calls
each, in turn, on the same map.
"""

import resource
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import tyro
from rich.console import Console
from rich.table import Table

from closedrooms.core.door import ClosedDoor
from closedrooms.core.files.geojson import read_doors
from closedrooms.core.files.rosmap import read_map
from closedrooms.core.grid import OccupancyGrid
from closedrooms.predictor.methods import predict

ROUNDS = 3


@dataclass(frozen=True, kw_only=True)
class Options:
    """Options of a measurement."""

    folder: tyro.conf.Positional[Path]
    """Where the samples are, at any depth."""
    method: str = "paper"
    """Name of a method."""
    each: bool = False
    """Print a row a map."""
    quick: bool = False
    """Take every tenth sample."""


def added_iou(predicted: OccupancyGrid, other: OccupancyGrid, map_grid: OccupancyGrid) -> float:
    """Measure the IoU of the cells that two completed maps add to a map."""
    frame = predicted.frame.covering(*other.frame.bounds)
    unknown = map_grid.on(frame).unknown
    a, b = predicted.on(frame).free & unknown, other.on(frame).free & unknown
    return float((a & b).sum() / max((a | b).sum(), 1))


def measure(folder: Path, options: Options) -> dict[str, float]:
    grid = read_map(folder / "map.yaml")
    doors: list[ClosedDoor] = read_doors(folder / "doors.geojson")
    ours: list[float] = []
    simplest: list[float] = []
    for _ in range(ROUNDS):  # in turn, so that a busy machine is fair to both
        start = time.process_time()
        prediction = predict(grid, doors, options.method)
        ours.append(time.process_time() - start)
        start = time.process_time()
        predict(grid, doors, "line-of-sight")
        simplest.append(time.process_time() - start)
    seconds = float(np.median(ours))
    row = {"doors": len(doors), "failures": len(prediction.failures), "seconds": seconds}
    row["ratio"] = seconds / float(np.median(simplest))
    for name in ("authors", "truth"):
        if (folder / f"{name}.yaml").exists():
            row[name] = added_iou(prediction.grid, read_map(folder / f"{name}.yaml"), grid)
    return row


def main() -> None:
    options = tyro.cli(Options, description=__doc__)
    folders = sorted(path.parent for path in options.folder.rglob("map.yaml"))[:: 10 if options.quick else 1]
    for method in (options.method, "line-of-sight"):  # what they import is paid once, and is no prediction
        predict(read_map(folders[0] / "map.yaml"), read_doors(folders[0] / "doors.geojson"), method)
    rows = {str(f.relative_to(options.folder)): measure(f, options) for f in folders}
    table = Table(
        "maps",
        "doors",
        "failures",
        "median CPU s",
        "max CPU s",
        "agreement",
        "IoU with truth",
        "peak MB",
        "ours / best known",
    )
    console = Console()
    if options.each:
        for name, row in sorted(rows.items(), key=lambda item: item[1].get("authors", 0.0)):
            console.print(name, {key: round(value, 3) for key, value in row.items()})

    def column(key: str) -> np.ndarray:
        return np.array([row[key] for row in rows.values() if key in row] or [np.nan])

    seconds = column("seconds")
    table.add_row(
        str(len(rows)),
        f"{column('doors').sum():.0f}",
        f"{column('failures').sum():.0f}",
        f"{np.median(seconds):.2f}",
        f"{seconds.max():.2f}",
        f"{column('authors').mean():.3f}",
        f"{column('truth').mean():.3f}",
        f"{resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024:.0f}",
        f"{np.median(column('ratio')):.2f}",
    )
    console.print(table)


if __name__ == "__main__":
    main()
