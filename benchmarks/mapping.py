"""How good and how fast the mapper is: on recorded logs beside its peers, and on simulated worlds.

    python benchmarks/mapping.py [LOG ...] [--worlds office-05 school-03] [--noise medium high] [--seed 0] [--close 5]

Every log and world is mapped with one set of parameters, the defaults. A log with reference poses is compared with
raw odometry, with ``small_gicp`` (scan to keyframe, started from odometry; left out where it is not installed), and
with the mapper without loop closure; where ``gtsam`` is installed, it solves the mapper's last pose graph too. Speeds
are scans a second of processor time, reading and importing left out. Worlds are explored once; the same scans are then
mapped with and without loops.
"""

import argparse
import math
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import scipy.sparse.linalg  # noqa: F401  (loaded here, not inside the first timing)

from closedrooms.core.arrays import FloatArray
from closedrooms.core.pose import Pose2, wrap_angle
from closedrooms.mapping.beams import clean, hit_points, thin
from closedrooms.mapping.config import LoopConfig, MapperConfig
from closedrooms.mapping.evidence import EvidenceGrid
from closedrooms.mapping.likelihood import LikelihoodField
from closedrooms.mapping.mapper import Mapper
from closedrooms.mapping.posegraph import optimise
from closedrooms.mapping.recorded import RecordedRun, read_run
from closedrooms.mapping.refinement import refine
from closedrooms.mapping.trajectory import ate

WITHOUT_LOOPS = MapperConfig(loops=LoopConfig(enabled=False))


def mapped(run: RecordedRun, config: MapperConfig) -> tuple[Mapper, FloatArray, float]:
    """The mapper after a run, the poses as estimated at the time, and the seconds of processor time it took."""
    mapper = Mapper(config)
    start = time.process_time()
    online = [mapper.process(s, Pose2(*o)).as_tuple() for s, o in zip(run.scans, run.odometry, strict=True)]
    mapper.finish()
    mapper.grid()
    return mapper, np.array(online), time.process_time() - start


def gicp(run: RecordedRun) -> FloatArray:
    """Scan to keyframe with small_gicp (GICP), from odometry; scans stand as walls of three layers."""
    import small_gicp

    def cloud(points: FloatArray) -> FloatArray:
        return np.vstack([np.column_stack((points, np.full(len(points), z))) for z in (0.0, 0.1, 0.2)])

    poses: list[tuple[float, float, float]] = []
    keyframe, points_of_keyframe = Pose2(), np.empty((0, 3))
    pose, before = Pose2(), Pose2(*run.odometry[0])
    for scan, odometry in zip(run.scans, run.odometry, strict=True):
        now = Pose2(*odometry)
        pose, before = pose @ (before.inverse() @ now), now
        points = cloud(hit_points(scan, max_range=25.0))
        if len(points_of_keyframe) and len(points) > 60:
            guess = np.eye(4)
            local = keyframe.inverse() @ pose
            guess[:2, :2], guess[:2, 3] = local.matrix()[:2, :2], (local.x, local.y)
            found = small_gicp.align(
                points_of_keyframe, points, guess, registration_type="GICP", downsampling_resolution=0.05,
                max_correspondence_distance=0.5,
            ).T_target_source  # fmt: skip
            pose = keyframe @ Pose2(found[0, 3], found[1, 3], math.atan2(found[1, 0], found[0, 0]))
        moved = pose.distance(keyframe) > 0.5 or abs(wrap_angle(pose.theta - keyframe.theta)) > 0.35
        if not len(points_of_keyframe) or moved:
            keyframe, points_of_keyframe = pose, points
        poses.append(pose.as_tuple())
    return np.array(poses)


def gtsam_solution(mapper: Mapper) -> tuple[FloatArray, float]:
    """Keyframe poses from the mapper's graph as gtsam's Levenberg-Marquardt solves it, and its seconds."""
    import gtsam

    graph, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
    for keyframe in mapper.keyframes:
        values.insert(keyframe.index, gtsam.Pose2(*keyframe.pose.as_tuple()))
    first = gtsam.Pose2(*mapper.keyframes[0].pose.as_tuple())
    graph.add(gtsam.PriorFactorPose2(0, first, gtsam.noiseModel.Diagonal.Sigmas(np.full(3, 1e-6))))
    for edge in mapper.edges:
        noise = gtsam.noiseModel.Gaussian.Information(edge.information + 1e-6 * np.eye(3))
        if edge.loop:
            cauchy = gtsam.noiseModel.mEstimator.Cauchy.Create(MapperConfig().loops.kernel)
            noise = gtsam.noiseModel.Robust.Create(cauchy, noise)
        graph.add(gtsam.BetweenFactorPose2(edge.source, edge.target, gtsam.Pose2(*edge.a_T_b.as_tuple()), noise))
    start = time.process_time()
    result = gtsam.LevenbergMarquardtOptimizer(graph, values).optimize()
    seconds = time.process_time() - start
    poses = [result.atPose2(k.index) for k in mapper.keyframes]
    return np.array([(p.x(), p.y(), p.theta()) for p in poses]), seconds


def optional(name: str, work: Callable[[], str]) -> None:
    try:
        print(work())
    except ImportError:
        print(f"| {name} | not installed |")


def error(estimate: FloatArray, reference: FloatArray | None) -> str:
    if reference is None:
        return "no reference"
    position, heading = ate(estimate, reference)
    return f"{position:.3f} m, {math.degrees(heading):.2f} deg"


def bench_log(path: Path) -> None:
    run = read_run(path)
    n = len(run.scans)
    print(f"\n### {path.name}: {n} scans{''.join(f', {c} {w}' for w, c in run.skipped.items())}")
    print("| method | ATE RMSE | note |\n| --- | --- | --- |")
    print(f"| raw odometry | {error(run.odometry, run.reference)} | |")

    def peer() -> str:
        start = time.process_time()
        poses = gicp(run)
        return f"| small_gicp | {error(poses, run.reference)} | {n / (time.process_time() - start):.0f} scans/s |"

    optional("small_gicp", peer)
    _, poses, seconds = mapped(run, WITHOUT_LOOPS)
    print(f"| mapper without loops | {error(poses, run.reference)} | {n / seconds:.0f} scans/s |")
    mapper, online, seconds = mapped(run, MapperConfig())
    print(f"| mapper, at the time | {error(online, run.reference)} | |")
    note = f"{n / seconds:.0f} scans/s, {len(mapper.loops)} loops, {len(mapper.keyframes)} keyframes"
    print(f"| mapper | {error(mapper.trajectory()[1], run.reference)} | {note} |")

    def solver() -> str:
        theirs, seconds = gtsam_solution(mapper)
        before = np.array([k.pose.as_tuple() for k in mapper.keyframes])
        start = time.process_time()
        ours = optimise(before, list(mapper.edges), kernel=MapperConfig().loops.kernel).poses
        mine = time.process_time() - start
        apart = float(np.hypot(*(theirs - ours)[:, :2].T).max())
        return f"| gtsam on the same graph | at most {apart:.4f} m from ours | {seconds:.3f} s, ours {mine:.3f} s |"

    if len(mapper.edges):
        optional("gtsam", solver)


def bench_world(name: str, noise: str, seed: int, close: int) -> None:
    from closedrooms.core.random import stream
    from closedrooms.mapping.navigation_config import NavigationConfig
    from closedrooms.pipeline.explore import explore
    from closedrooms.sim.config import SimConfig, noise_level
    from closedrooms.sim.observation import Observation
    from closedrooms.sim.simulation import Simulation
    from closedrooms.worlds.closing import draw_closed
    from closedrooms.worlds.library import load_world
    from closedrooms.worlds.truth import reachable, truth_bounds

    class Recorder:
        def __init__(self, sim: Simulation) -> None:
            self.sim = sim
            self.seen: list[Observation] = []

        def observe(self) -> Observation:
            self.seen.append(self.sim.observe())
            return self.seen[-1]

        def step(self, v: float, w: float, duration: float) -> None:
            self.sim.step(v, w, duration)

    plan = load_world(name)
    closed = draw_closed(plan, close, stream(seed, "doors"))
    with Simulation(plan, closed, replace(SimConfig(), noise=noise_level(noise)), seed) as sim:
        recorder = Recorder(sim)
        result = explore(recorder, Mapper(), NavigationConfig())
        world_T_map = sim.world_T_map
    run = RecordedRun(
        tuple(o.scan for o in recorder.seen),
        np.array([o.odometry.as_tuple() for o in recorder.seen]),
        np.array([o.map_T_robot_true.as_tuple() for o in recorder.seen]),
    )
    n = len(run.scans)
    plain, online, _ = mapped(run, WITHOUT_LOOPS)
    mapper, _, seconds = mapped(run, MapperConfig())

    def known(some: Mapper) -> float:
        map_T_world = world_T_map.inverse()
        frame = some.grid().frame.covering(*truth_bounds(plan, map_T_world))
        grid = some.grid().on(frame)
        free = reachable(plan, closed, frame, map_T_world, (world_T_map.x, world_T_map.y))
        return float((grid.known & free).sum() / free.sum())

    print(
        f"| {name} | {noise} | {result.status} | {n} | {error(run.odometry, run.reference)} "
        f"| {error(online, run.reference)} | {error(mapper.trajectory()[1], run.reference)} | {len(mapper.loops)} "
        f"| {100 * known(plain):.1f} % | {100 * known(mapper):.1f} % | {n / seconds:.0f} |",
        flush=True,
    )


def bench_parts(run: RecordedRun) -> None:
    """Refinements, insertions and stampings a second on the scans of one run."""
    config = MapperConfig()
    scans = run.scans[: min(400, len(run.scans))]
    field = LikelihoodField(config.resolution, config.matcher)
    field.add(hit_points(scans[0], max_range=config.max_range))
    points = [thin(hit_points(s, max_range=config.max_range), 0.1, config.matcher.max_points) for s in scans]
    evidence = EvidenceGrid(config)
    jobs: dict[str, Callable[[int], object]] = {
        "refinements": lambda i: refine(field, points[0], Pose2(0.02, -0.02, 0.01 * (i % 3))),
        "insertions into the grid": lambda i: evidence.add(clean(scans[i], max_range=config.max_range), Pose2()),
        "stampings of the field": lambda i: field.add(hit_points(scans[i], max_range=config.max_range)),
    }
    for name, job in jobs.items():
        start = time.process_time()
        for i in range(len(scans)):
            job(i)
        print(f"- {name}: {len(scans) / (time.process_time() - start):.0f} a second")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("logs", nargs="*", type=Path)
    parser.add_argument("--worlds", nargs="*", default=[])
    parser.add_argument("--noise", nargs="*", default=["medium", "high"])
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--close", type=int, default=5)
    options = parser.parse_args()
    for path in options.logs:
        bench_log(path)
    if options.logs:
        print(f"\n### Parts, on {options.logs[0].name}")
        bench_parts(read_run(options.logs[0]))
    if options.worlds:
        print("\n| world | noise | status | scans | odometry | no loops | loops | closed | known | with | scans/s |")
        print("| --- " * 11 + "|")
    for noise in options.noise:
        for world in options.worlds:
            bench_world(world, noise, options.seed, options.close)


if __name__ == "__main__":
    main()
