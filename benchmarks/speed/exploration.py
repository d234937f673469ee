"""Exploration side by side: known area, simulated time and the share of each step, on any worlds.

    python benchmarks/speed/exploration.py [WORLD ...] [--noise medium] [--close 5] [--seed 0] [--rounds 3]
        [--quick]

The worlds take turns, and medians of the rounds count. One row a world: status, simulated seconds, travelled distance,
plans, share of the reachable free cells that is known at the end, trajectory error, doors seen, and milliseconds a scan
for sensing, mapping and navigating. The last figure is "ours / best known": processor time of the exploration beside
that of PyBullet's rays alone, cast from every tenth of the same poses and counted tenfold.
"""

import argparse
from statistics import median
from time import process_time

from closedrooms.core.pose import Pose2
from closedrooms.core.random import stream
from closedrooms.mapping.config import MapperConfig
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
from closedrooms.worlds.library import load_world
from closedrooms.worlds.truth import reachable, truth_bounds

SKIPPED = 10


def measure(world: str, *, noise: str, close: int, seed: int) -> tuple[str, tuple[float, ...]]:
    """Explore a world once: what is the same each time, and milliseconds a scan by step, CPU time [s] and its ratio."""
    plan = load_world(world)
    closed = draw_closed(plan, min(close, len(closable_rooms(plan))), stream(seed, "closed doors"))
    begin = process_time()
    with Simulation(plan, closed, SimConfig(noise=noise_level(noise)), seed) as sim:
        log, mapper = RunLog(sim, Silent(), keep_scans=False), Mapper(MapperConfig())
        survey = survey_building(log, mapper, NavigationConfig())
        result = survey.exploration
        start = sim.world_T_map
        taken, poses = process_time() - begin, [start @ Pose2(*pose) for pose in log.true_poses[::SKIPPED].tolist()]
        begin = process_time()
        for pose in poses:
            sim.true_ranges(pose)
        rays = SKIPPED * (process_time() - begin)
    map_T_world = start.inverse()
    x_min, y_min, x_max, y_max = truth_bounds(plan, map_T_world)
    grid = mapper.grid()
    grid = grid.on(grid.frame.covering(x_min, y_min, x_max, y_max))
    cells = reachable(plan, closed, grid.frame, map_T_world, (start.x, start.y))
    error, _ = ate(mapper.trajectory()[1], log.true_poses)
    each = (1e3 * result.wall_seconds[step] / result.scans for step in ("sense", "map", "navigate"))
    told = (
        f"{plan.name[:24]:<24} {x_max - x_min:4.0f} x {y_max - y_min:3.0f} m  {result.status:<9}"
        f"{result.seconds:6.0f} s {result.distance:6.0f} m {survey.searches:5d} searches  "
        f"known {100 * area_mapped(grid, cells):6.2f} %  ate {error:.3f} m  doors {len(mapper.doors())}/{len(closed)}  "
    )
    return told, (*each, taken, taken / rays)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("worlds", nargs="*", default=["office-01", "office-07"])
    parser.add_argument("--quick", action="store_true", help="the first world only, once")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--noise", default="medium")
    parser.add_argument("--close", type=int, default=5)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    if options.quick:
        options.worlds, options.rounds = options.worlds[:1], 1
    rows: dict[str, list[tuple[str, tuple[float, ...]]]] = {world: [] for world in options.worlds}
    for _ in range(options.rounds):
        for world, found in rows.items():
            found.append(measure(world, noise=options.noise, close=options.close, seed=options.seed))
    for found in rows.values():
        sense, mapped, navigate, cpu, ratio = (median(column) for column in zip(*(t for _, t in found), strict=True))
        print(
            f"{found[0][0]}sense {sense:.2f}  map {mapped:.2f}  navigate {navigate:.2f} ms/scan  "
            f"CPU {cpu:.1f} s  ours / best known {ratio:.2f}"
        )


if __name__ == "__main__":
    main()
