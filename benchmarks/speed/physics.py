"""What bodies cost: processor time a simulated second, kinematic beside wheels beside bare ``stepSimulation``.

    python benchmarks/speed/physics.py [WORLD ...] [--seconds S] [--rounds N] [--quick] [--sweeps] [--csv CSV]

The robot drives the same commands in every row. Bare steps are those of the world with wheels, without commands,
encoders or contacts being read. Rays are one sweep of 720 beams a tenth of a second. The bodies take turns, figures are
medians over the rounds; the last column is what moving takes beside bare steps. With ``--sweeps`` it drives at 1 m/s
and turns at 2 rad/s instead, and says how far the mapper is off with instant and rolling sweeps, straightened and not.
"""

import argparse
import csv
import math
import sys
from collections.abc import Callable, Iterator
from itertools import pairwise
from pathlib import Path
from statistics import median
from time import process_time
from typing import TextIO

import numpy as np

from closedrooms.core.pose import Pose2
from closedrooms.core.robot import RobotConfig
from closedrooms.mapping.config import MapperConfig
from closedrooms.mapping.mapper import Mapper
from closedrooms.mapping.trajectory import ate
from closedrooms.sim.config import STEPS, LidarConfig, SimConfig
from closedrooms.sim.simulation import Simulation
from closedrooms.worlds.closing import closable_rooms, draw_closed
from closedrooms.worlds.library import load_world
from closedrooms.worlds.plan import FloorPlan

WORLDS = ("office-01", "office-07", "school-09")
CLOSED = 5
COST_HEAD = ("world", "doors", "body", "move [ms/s]", "rays [ms/s]", "us a step", "ours / best known")
SWEEP_HEAD = ("world", "sweep", "straightened", "way [m]", "ATE [m]", "ATE [deg]")
Row = tuple[str, ...]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("worlds", nargs="*", default=WORLDS)
    parser.add_argument("--seconds", type=float, default=20.0, help="simulated [s]")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--quick", action="store_true", help="one world, 5 s, one round")
    parser.add_argument("--sweeps", action="store_true", help="errors of rolling sweeps instead of costs")
    parser.add_argument("--csv", type=Path, help="write the table here, not to the screen")
    options = parser.parse_args()
    if options.quick:
        options.worlds, options.seconds, options.rounds = options.worlds[:1], 5.0, 1
    plans = ((name, load_world(name)) for name in options.worlds)
    if options.sweeps:
        head, rows = SWEEP_HEAD, (row for plan in plans for row in compare_sweeps(*plan, options.seconds))
    else:
        head, rows = (
            COST_HEAD,
            (row for plan in plans for row in compare_bodies(*plan, options.seconds, options.rounds)),
        )
    if options.csv is None:
        write_rows(sys.stdout, head, rows)
        return
    with options.csv.open("w", newline="") as file:
        write_rows(file, head, rows)


def write_rows(file: TextIO, head: Row, rows: Iterator[Row]) -> None:
    """Write a table, each row as soon as it is measured."""
    writer = csv.writer(file, lineterminator="\n")
    writer.writerow(head)
    for row in rows:
        writer.writerow(row)
        file.flush()


def compare_bodies(name: str, plan: FloorPlan, seconds: float, rounds: int) -> Iterator[Row]:
    """Measure one row a body, and one for the steps alone."""
    closed = draw_closed(plan, min(CLOSED, len(closable_rooms(plan))), np.random.default_rng(0))
    taken: dict[str, list[tuple[float, float]]] = {"kinematic": [], "wheels": [], "bare steps": []}
    for _ in range(rounds):
        for body in ("kinematic", "wheels"):
            config = SimConfig(body="wheels") if body == "wheels" else SimConfig(body="kinematic")
            with Simulation(plan, closed, config, 0) as sim:
                moved, rays = 0.0, 0.0
                for number in range(round(seconds / 0.1)):
                    moved += cost(lambda n=number: sim.step(0.3, 0.8 * math.sin(n / 9), 0.1))
                    rays += cost(sim.observe)
                taken[body].append((moved / seconds, rays / seconds))
                if body == "wheels":
                    bare = sum(cost(sim.physics.step) for _ in range(round(seconds * STEPS)))
                    taken["bare steps"].append((bare / seconds, 0.0))
    limit = median(moved for moved, _ in taken["bare steps"])
    for body, times in taken.items():
        moved, rays = (median(column) for column in zip(*times, strict=True))
        step = f"{moved / STEPS * 1e6:.1f}" if body != "kinematic" else ""
        beside = f"{moved / limit:.2f}"
        yield (name, str(len(plan.doors)), body, f"{1e3 * moved:.2f}", f"{1e3 * rays:.2f}", step, beside)


def cost(work: Callable[[], object]) -> float:
    """Measure processor time [s]."""
    begun = process_time()
    work()
    return process_time() - begun


def compare_sweeps(name: str, plan: FloorPlan, seconds: float) -> Iterator[Row]:
    """Compare trajectory errors on one drive back and forth with turns on the spot, at 10 Hz."""
    for sweep, undistort in (("instant", True), ("rolling", False), ("rolling", True)):
        lidar = LidarConfig(sweep="rolling") if sweep == "rolling" else LidarConfig()
        robot = RobotConfig(max_speed=1.0, max_turn_rate=2.0)
        with Simulation(plan, (), SimConfig(lidar=lidar, robot=robot), 0) as sim:
            mapper, truth = Mapper(MapperConfig(undistort=undistort)), []
            for number in range(round(seconds / 0.1)):
                seen = sim.observe()
                mapper.process(seen.scan, seen.odometry)
                truth.append(sim.map_T_robot.as_tuple())
                sim.step(*command(number, seen.scan.ranges), 0.1)
            mapper.finish()
            position, heading = ate(mapper.trajectory()[1], np.array(truth))
            way = sum(Pose2(*a).distance(Pose2(*b)) for a, b in pairwise(truth))
            how = "" if sweep == "instant" else "yes" if undistort else "no"
            yield (name, sweep, how, f"{way:.1f}", f"{position:.4f}", f"{math.degrees(heading):.3f}")


def command(number: int, ranges: np.ndarray) -> tuple[float, float]:
    """Choose speeds: 1 m/s ahead where 1.5 m are free, else 2 rad/s on the spot; a whole turn every 6 s."""
    middle = len(ranges) // 2
    ahead = np.nanmin(ranges[middle - 40 : middle + 40])
    if number % 60 < 32 and number % 60 >= 0 and number >= 60:
        return (0.0, 2.0)
    return (1.0, 0.0) if ahead > 1.5 else (0.0, 2.0)


if __name__ == "__main__":
    main()
