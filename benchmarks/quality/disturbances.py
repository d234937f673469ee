"""Run the bundled worlds plain, with people who walk and with walls of glass: docs/results/disturbances.csv.

    python benchmarks/quality/disturbances.py --out DIR [WORLD ...] [--conditions plain people glass] [--csv CSV]

One run after the other; a run whose directory is already in DIR is not repeated, so that several processes share the
work when each takes other worlds or conditions, and a call that finds all of them there only writes the table. Nothing
is recorded. Processor time is that of the whole run, from the floor plan to the written files.

Ghosts are the occupied cells of the map further than 0.2 m from anything that stands still: walls (of glass, too),
furniture, leaves of doors as they stood.
"""

import argparse
import csv
import json
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from time import process_time
from typing import Any, TextIO

import numpy as np
import shapely

from closedrooms.core.files.rosmap import read_map
from closedrooms.pipeline.options.run import RunConfig, named_sim
from closedrooms.pipeline.run import run
from closedrooms.sim.building import building_solids
from closedrooms.sim.config import SimConfig
from closedrooms.sim.simulation import Simulation
from closedrooms.worlds.library import bundled_names, load_world

CONDITIONS: dict[str, dict[str, Any]] = {"plain": {}, "people": {"people": 4}, "glass": {"glass": 0.1}}
# Distance from all that stands still beyond which an occupied cell is a ghost [m].
GHOST = 0.2
HEAD = (
    "condition", "world", "ended", "area mapped [%]", "ATE [m]", "doors seen", "doors closed", "IoU", "ghosts [%]",
    "simulated [s]", "CPU [s]",
)  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("worlds", nargs="*", default=bundled_names())
    parser.add_argument("--out", type=Path, required=True, help="where the run directories are")
    parser.add_argument("--conditions", nargs="+", default=list(CONDITIONS), choices=list(CONDITIONS))
    parser.add_argument("--noise", default="medium", choices=("none", "low", "medium", "high"))
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--csv", type=Path, help="write the table here, not to the screen")
    options = parser.parse_args()
    rows = (
        row(condition, name, made(condition, name, options))
        for name in options.worlds
        for condition in options.conditions
    )
    if options.csv is None:
        write_table(sys.stdout, rows)
        return
    with options.csv.open("w", newline="") as file:
        by_condition = sorted(rows, key=lambda cells: (list(CONDITIONS).index(cells[0]), cells[1]))
        write_table(file, [*by_condition, *mean_rows(by_condition)])


def made(condition: str, name: str, options: argparse.Namespace) -> Path:
    """Make a run, unless it is there, and return its directory."""
    folder: Path = options.out / condition / f"{Path(name).stem}-{options.seed}"
    spent = folder.with_suffix(".cpu.json")
    if not spent.exists():
        begun = process_time()
        run(
            RunConfig(
                world=name, noise=options.noise, seed=options.seed, record=False, out=folder,
                sim=disturbed(condition, options.noise),
            )
        )  # fmt: skip
        spent.write_text(json.dumps({"cpu_s": process_time() - begun}))
    return folder


def disturbed(condition: str, noise: str) -> SimConfig:
    """Set a robot on wheels among what is there in a condition."""
    return replace(named_sim(noise, "default", "wheels"), **CONDITIONS[condition])


def row(condition: str, name: str, folder: Path) -> list[str]:
    """Read the figures of one run."""
    told = json.loads((folder / "run.json").read_text())
    metrics, spent = told["metrics"], json.loads(folder.with_suffix(".cpu.json").read_text())
    return [
        condition,
        Path(name).stem,
        told["exploration"]["status"],
        f"{100 * metrics['area_mapped']:.1f}",
        f"{metrics['ate_m']:.3f}",
        str(metrics["doors_seen"]),
        str(metrics["doors_closed"]),
        f"{metrics['room_iou_mean']:.3f}",
        f"{100 * ghosts(name, told, folder):.2f}",
        f"{told['exploration']['simulated_s']:.0f}",
        f"{spent['cpu_s']:.1f}",
    ]


def ghosts(name: str, told: dict[str, Any], folder: Path) -> float:
    """Compute the share of a map's occupied cells that are far from all that stands still [0..1]."""
    grid = read_map(folder / "map.yaml")
    points = grid.frame.to_points(np.argwhere(grid.occupied))
    plan = load_world(name)
    with Simulation(plan, told["closed"], SimConfig(), told["seed"]) as sim:
        leaves = [leaf for door in sim.door_states() for leaf in sim.door_leaves(door)]
        furniture = [thing.polygon for thing in plan.furniture]
        standing = shapely.union_all([building_solids(plan), *furniture, *leaves])
        places = shapely.points(sim.world_T_map.transform(points))
    shapely.prepare(standing)
    return float(np.mean(~shapely.dwithin(standing, places, GHOST)))


def mean_rows(rows: list[list[str]]) -> list[list[str]]:
    """Make a row a condition with the means of its figures, to as many digits as they have."""
    means = []
    for condition in dict.fromkeys(cells[0] for cells in rows):
        columns = list(zip(*(cells for cells in rows if cells[0] == condition), strict=True))[3:]
        digits = [len(column[0].partition(".")[2]) for column in columns]
        figures = [f"{np.mean([*map(float, col)]):.{count}f}" for col, count in zip(columns, digits, strict=True)]
        means.append([condition, "mean", "", *figures])
    return means


def write_table(file: TextIO, rows: Iterator[list[str]] | list[list[str]]) -> None:
    writer = csv.writer(file, lineterminator="\n")
    writer.writerow(HEAD)
    for cells in rows:
        writer.writerow(cells)
        file.flush()


if __name__ == "__main__":
    main()
