"""How fast the simulation senses: rays a second beside PyBullet's bare ``rayTestBatch``, from 20 m to 130 m.

    python benchmarks/speed/rays.py [WORLD ...] [--scans 300] [--repeats 5] [--quick]

Without a world it measures corridors with rooms on both sides, of growing length. Each world is crossed by a robot that
turns away from what is near; the same poses are then cast by every way in turn, and the median of some repeats counts.
The last column is "ours / best known": processor time of a noisy sweep against the quickest of PyBullet's bare
``rayTestBatch`` and the peers of ``ray_peers.py`` that are installed (Embree, IR-SIM, pyrobosim), which cast at the
same walls and whose distances have to agree with ours.
"""

import argparse
import time
from collections.abc import Callable
from statistics import median

import numpy as np
from numpy.typing import NDArray
from ray_peers import PEERS
from shapely.geometry import box

from closedrooms.core.pose import Pose2
from closedrooms.sim.building import building_solids
from closedrooms.sim.config import LidarConfig, SimConfig, noise_level
from closedrooms.sim.lidar import Lidar
from closedrooms.sim.physics_world import EVERYTHING, PhysicsWorld
from closedrooms.sim.simulation import Simulation
from closedrooms.worlds.extrusion import extrude
from closedrooms.worlds.library import load_world
from closedrooms.worlds.plan import FloorPlan, PlanDoor, PlanRoom, Wall

LENGTHS = (20, 40, 80, 130)
# Peers that take a quarter of a second a scan are asked for the first few.
SLOW, FEW = {"pyrobosim"}, 5


def comb(length: float) -> FloorPlan:
    """Build a corridor of ``length`` [m], 2.4 m wide, with rooms of 4 x 6 m on both sides and a door to each."""
    count = int(length // 4)
    rooms = [PlanRoom("corridor", "corridor", box(0, 6, length, 8.4))]
    lines = [(0, 6, length, 6), (0, 8.4, length, 8.4), (0, 0, length, 0), (0, 14.4, length, 14.4)]
    lines += [(0, 0, 0, 14.4), (length, 0, length, 14.4)]
    doors = []
    for i in range(count):
        x = 4.0 * i
        for low, high, wall in ((0.0, 6.0, 6.0), (8.4, 14.4, 8.4)):
            room = PlanRoom(f"r{len(rooms):03}", "office", box(x, low, min(x + 4, length), high))
            segment = ((x + 0.6, wall), (x + 1.5, wall))
            doors.append(PlanDoor(f"d{len(doors):03}", segment, ("corridor", room.id), opens_into=room.id))
            rooms.append(room)
            lines += [(x, low, x, high)] if i else []
    walls = tuple(
        Wall(f"w{i}", ((float(a), float(b)), (float(c), float(d))), 0.15) for i, (a, b, c, d) in enumerate(lines)
    )
    return FloorPlan(f"comb of {length:g} m", tuple(rooms), walls, tuple(doors), start=(2.0, 7.2, 0.0))


def wander(sim: Simulation, count: int) -> list[Pose2]:
    """Simulate a robot that goes ahead and turns away from what is near: its poses, one every 0.1 s."""
    ahead = np.abs(sim.observe().scan.angles) < 0.5
    rng = np.random.default_rng(0)
    poses: list[Pose2] = []
    turn = 0.0
    while len(poses) < count:
        pose = sim.world_T_robot
        poses.append(pose)
        free = sim.true_ranges(pose)[ahead].min()
        if free < 0.7 and turn == 0.0:
            turn = rng.choice([-1.2, 1.2])
        elif free > rng.uniform(0.8, 3.0):
            turn = 0.0
        sim.step(0.0 if turn else 0.8, turn or rng.normal(0.0, 0.3), 0.1)
    return poses


def medians(ways: dict[str, Callable[[], object]], repeats: int) -> dict[str, float]:
    """Measure the median processor time of each method [s]; they take turns, so a busy machine is fair to all."""
    times: dict[str, list[float]] = {name: [] for name in ways}
    for _ in range(repeats):
        for name, run in ways.items():
            start = time.process_time()
            run()
            times[name].append(time.process_time() - start)
    return {name: median(taken) for name, taken in times.items()}


def bare_batches(physics: PhysicsWorld, poses: list[Pose2], lidar: LidarConfig) -> Callable[[], object]:
    """Prepare calls of ``rayTestBatch`` on ready lists, results thrown away: what PyBullet itself takes."""
    bullet, client = physics._bullet, physics._client
    angles = lidar.angle_min + lidar.angle_increment * np.arange(lidar.beams)
    batches = []
    for pose in poses:
        start = [pose.x, pose.y, lidar.height]
        ends = np.full((lidar.beams, 3), lidar.height)
        directions = np.column_stack((np.cos(angles + pose.theta), np.sin(angles + pose.theta)))
        ends[:, :2] = np.array(start[:2]) + lidar.range_max * directions
        batches.append(([start] * lidar.beams, ends.tolist()))

    def run() -> None:
        for starts, ends in batches:
            bullet.rayTestBatch(starts, ends, collisionFilterMask=EVERYTHING, physicsClientId=client)

    return run


def check_agreement(ranges: NDArray[np.float64], bare: NDArray[np.float64], name: str) -> None:
    """Raise ``SystemExit`` where a peer casts other rays: more than one in a hundred differs by over 1 cm."""
    share = float((np.abs(ranges - bare[: len(ranges)]) > 0.01).mean())
    if share > 0.01:
        raise SystemExit(f"{name} and PyBullet differ by more than 1 cm on {share:.0%} of the rays")


def measure(plan: FloorPlan, scans: int, repeats: int) -> str:
    """Measure one line of the table."""
    config = SimConfig(noise=noise_level("medium"))
    closed = [door.id for door in plan.doors if None not in door.rooms][::6][:5]
    solids = building_solids(plan)
    started = time.perf_counter()
    with Simulation(plan, closed, config, 0) as sim:
        built = time.perf_counter() - started
        poses = wander(sim, scans)
        physics, lidar = sim.physics, config.lidar
        scanner = Lidar(lidar, config.noise, physics, 0)
        with PhysicsWorld() as simple:
            simple.add_static(*extrude(solids))
            true = Lidar(lidar, config.noise, simple, 0)
            ranges = np.minimum([true.track(pose)[0] for pose in poses], lidar.range_max)
            ways: dict[str, Callable[[], object]] = {}
            for name, peer in PEERS.items():
                few = poses[: FEW if name in SLOW else None]
                if cast := peer(solids, few, lidar):
                    check_agreement(np.minimum(cast(), lidar.range_max), ranges, name)
                    ways[name] = cast
            ways |= {
                "bare": bare_batches(simple, poses, lidar),
                "ours": bare_batches(physics, poses, lidar),
                "cast": lambda: [scanner.track(pose) for pose in poses],
                "sweep": lambda: [scanner.sweep(pose, 0.0) for pose in poses],
                "step": lambda: [sim.step(0.5, 0.5, 0.1) for _ in poses],
            }
            seconds = medians(ways, repeats)
    for name in SLOW & seconds.keys():
        seconds[name] *= scans / min(FEW, scans)
    rate = {name: f"{scans * lidar.beams / 1000 / taken:.0f}" for name, taken in seconds.items()}
    best = min(seconds[name] for name in (*PEERS, "bare") if name in seconds)
    x0, y0, x1, y1 = solids.bounds
    columns = (*PEERS, "bare", "ours", "cast", "sweep")
    return (
        f"{plan.name[:20]:20} {max(x1 - x0, y1 - y0):6.1f} {len(plan.doors):5d} {built:6.2f} "
        + " ".join(f"{rate.get(name, '-'):>9}" for name in columns)
        + f" {seconds['step'] / scans * 1e6:8.0f}"
        f" {0.1 * scans / (seconds['sweep'] + seconds['step']):7.0f} {seconds['sweep'] / best:10.2f}"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("worlds", nargs="*", help="names of bundled worlds, or files")
    parser.add_argument("--scans", type=int, default=300)
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--quick", action="store_true", help="the smallest corridor, 50 scans, three repeats")
    arguments = parser.parse_args()
    if arguments.quick:
        arguments.scans, arguments.repeats = 50, 3
    print(f"{LidarConfig().beams} beams of {LidarConfig().range_max:g} m; median of {arguments.repeats} repeats of")
    print(f"{arguments.scans} scans; thousands of rays a second.\n")
    print("bare: rayTestBatch on the walls as extruded, without doors; bare+: on the simulation's own bodies, doors")
    print("included; true: Lidar.track; noisy: Lidar.sweep at medium noise; step: 0.1 s of driving; x real: both.\n")
    heads = " ".join(f"{head:>9}" for head in (*PEERS, "bare", "bare+", "true", "noisy"))
    print(
        f"{'world':20} {'size/m':>6} {'doors':>5} {'build':>6} {heads} {'step/us':>8} {'x real':>7} {'ours/best':>10}"
    )
    plans = [load_world(name) for name in arguments.worlds] or [
        comb(length) for length in LENGTHS[: 1 if arguments.quick else None]
    ]
    for plan in plans:
        print(measure(plan, arguments.scans, arguments.repeats), flush=True)


if __name__ == "__main__":
    main()
