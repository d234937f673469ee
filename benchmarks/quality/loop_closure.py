"""Trajectory error and mapped area on simulated worlds, with and without loop closure.

    python benchmarks/quality/loop_closure.py --out DIR [WORLD ...] [--noise medium high] [--seed 0] [--close 5]

Each world (all bundled ones when none is named) is explored once at each level of noise by the mapper as it is, and its
scans are kept in ``DIR/<world>-<noise>.npz``. Where that mapper closed a loop, the same scans are mapped again with
loops turned off; where it closed none, the two are the same. Rows are appended to ``DIR/loop_closure.csv`` as they are
done, and what is there already is not done again, so that the script can be stopped and started. At the end it prints
the table.
"""

import argparse
import csv
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from closedrooms.core.pose import Pose2
from closedrooms.core.random import stream
from closedrooms.mapping.config import LoopConfig, MapperConfig
from closedrooms.mapping.logs import RecordedRun, read_run
from closedrooms.mapping.logs.npz import write_scans
from closedrooms.mapping.mapper import Mapper
from closedrooms.mapping.trajectory import ate
from closedrooms.navigation.config import NavigationConfig
from closedrooms.pipeline.reporting.progress import Silent
from closedrooms.pipeline.reporting.run_log import RunLog
from closedrooms.pipeline.reporting.run_scores import area_mapped
from closedrooms.pipeline.survey import survey_building
from closedrooms.sim.config import SimConfig, noise_level
from closedrooms.sim.simulation import Simulation
from closedrooms.worlds.closing import closable_rooms, draw_closed
from closedrooms.worlds.library import bundled_names, load_world
from closedrooms.worlds.truth import reachable, truth_bounds

COLUMNS = (
    "world", "noise", "seed", "closed", "status", "scans", "keyframes", "loops", "odometry_m", "ate_without_m",
    "ate_with_m", "area_without", "area_with", "seconds",
)  # fmt: skip


def map_run(run: RecordedRun, config: MapperConfig) -> Mapper:
    """Map all scans of a run."""
    mapper = Mapper(config)
    for scan, odometry in zip(run.scans, run.odometry, strict=True):
        mapper.process(scan, Pose2(*odometry))
    mapper.finish()
    return mapper


def measure(world: str, noise: str, options: argparse.Namespace) -> dict[str, object]:
    """Explore a world, keep its scans, and compare."""
    begun = time.perf_counter()
    plan = load_world(world)
    closed = draw_closed(plan, min(options.close, len(closable_rooms(plan))), stream(options.seed, "closed doors"))
    with Simulation(plan, closed, replace(SimConfig(), noise=noise_level(noise)), options.seed) as sim:
        log, mapper = RunLog(sim, Silent(), keep_scans=True), Mapper(MapperConfig())
        result = survey_building(log, mapper, NavigationConfig()).exploration
        start = sim.world_T_map
    run = log.recorded()
    truth = np.asarray(run.reference)
    path = options.out / f"{world}-{noise}.npz"
    write_scans(path, run, estimate=mapper.trajectory()[1], compressed=False)
    without = mapper
    if len(mapper.loops):
        without = map_run(read_run(path), MapperConfig(loops=LoopConfig(enabled=False)))

    def known(some: Mapper) -> float:
        map_T_world = start.inverse()
        grid = some.grid()
        grid = grid.on(grid.frame.covering(*truth_bounds(plan, map_T_world)))
        return area_mapped(grid, reachable(plan, closed, grid.frame, map_T_world, (start.x, start.y)))

    figures = (
        world, noise, options.seed, len(closed), result.status,
        len(run.scans), len(mapper.keyframes), len(mapper.loops),
        round(ate(run.odometry, truth)[0], 3), round(ate(without.trajectory()[1], truth)[0], 4),
        round(ate(mapper.trajectory()[1], truth)[0], 4), round(known(without), 5), round(known(mapper), 5),
        round(time.perf_counter() - begun, 1),
    )  # fmt: skip
    return dict(zip(COLUMNS, figures, strict=True))


def read_csv_rows(path: Path) -> list[dict[str, str]]:
    if not path.exists():
        return []
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def table(rows: list[dict[str, str]], worlds: list[str], levels: list[str]) -> str:
    """Build one row a world, the levels of noise side by side."""
    found = {(row["world"], row["noise"]): row for row in rows}
    head = [f"{noise}: odometry | ATE without / with loops [m] | loops | area without / with" for noise in levels]
    lines = [f"| world | {' | '.join(head)} |", "| --- |" + " ---: |" * (4 * len(levels))]
    for world in worlds:
        cells = [world]
        for noise in levels:
            row = found.get((world, noise))
            if row is None:
                cells += ["not run", "", "", ""]
                continue
            cells += [
                f"{float(row['odometry_m']):.2f} m",
                f"{float(row['ate_without_m']):.3f} / {float(row['ate_with_m']):.3f}",
                row["loops"],
                f"{100 * float(row['area_without']):.1f} / {100 * float(row['area_with']):.1f} %",
            ]
        lines.append(f"| {' | '.join(cells)} |")
    for noise in levels:
        own = [row for row in rows if row["noise"] == noise and row["world"] in worlds]
        if own:
            errors = [float(row["ate_with_m"]) for row in own]
            areas = [float(row["area_with"]) for row in own]
            lines.append(
                f"\n`{noise}`, {len(own)} worlds: ATE mean {np.mean(errors):.3f} m, largest {max(errors):.3f} m; "
                f"area mapped mean {100 * np.mean(areas):.1f} %, least {100 * min(areas):.1f} %; "
                f"status {', '.join(sorted({row['status'] for row in own}))}"
            )
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("worlds", nargs="*")
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--noise", nargs="*", default=["medium", "high"])
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--close", type=int, default=5)
    parser.add_argument("--table", action="store_true", help="only print what is there")
    options = parser.parse_args()
    worlds = options.worlds or bundled_names()
    options.out.mkdir(parents=True, exist_ok=True)
    path = options.out / "loop_closure.csv"
    done = {(row["world"], row["noise"]) for row in read_csv_rows(path)}
    for noise in reversed(options.noise):
        for world in worlds:
            if options.table or (world, noise) in done:
                continue
            row = measure(world, noise, options)
            new = not path.exists()
            with path.open("a", newline="") as file:
                writer = csv.DictWriter(file, COLUMNS)
                if new:
                    writer.writeheader()
                writer.writerow(row)
            print(", ".join(f"{name} {value}" for name, value in row.items()), flush=True)
    print(table(read_csv_rows(path), worlds, options.noise))


if __name__ == "__main__":
    main()
