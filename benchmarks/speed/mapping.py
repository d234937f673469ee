"""How good and how fast the mapper is on recorded logs, beside its peers, in one run.

    python benchmarks/speed/mapping.py LOG ... [--rounds 3] [--parts]
    python benchmarks/speed/mapping.py LOG ... --faults [--quick] [--seeds 5] [--methods closedrooms yag-slam ...]
                                                [--out CSV]

Every log is mapped with one set of parameters, the defaults, and compared with raw odometry; with ``small_gicp`` (scan
to keyframe), ``kiss-icp`` (without deskewing) and ``yag-slam``, started from odometry, where they are installed; with
the mapper without loops; and, where ``gtsam`` is installed, with the mapper whose pose graph gtsam solves. Errors are
against the log's reference poses after SE(2) alignment. Speeds are scans a second of the process's own processor time,
medians of some rounds in which all take turns, reading and importing left out; the last column is processor time beside
the quickest peer. Simulated worlds: ``benchmarks/quality/loop_closure.py``. ``--quick`` takes the first scans of each
log, once.

With ``--faults`` steps of the odometry fail (``odometry_faults.py``), and the result is a CSV; ``--quick`` takes less
than a minute a log.
"""

import argparse
import contextlib
import math
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from statistics import median

import numpy as np
import scipy.sparse.linalg  # noqa: F401  (loaded here, not inside the first timing)
from odometry_faults import bench_faults, yag_slam

import closedrooms.mapping.graph.keyframe_graph as graph_module
from closedrooms.core.arrays import FloatArray
from closedrooms.core.pose import Pose2, wrap_angle
from closedrooms.mapping.beams import clean, hit_points, thin_points
from closedrooms.mapping.config import LoopConfig, MapperConfig
from closedrooms.mapping.graph.pose_graph import Edge, Solution, optimise
from closedrooms.mapping.log_odds_grid import EvidenceGrid
from closedrooms.mapping.logs import RecordedRun, read_run
from closedrooms.mapping.mapper import Mapper
from closedrooms.mapping.matching.gauss_newton_matcher import refine
from closedrooms.mapping.matching.likelihood_field import LikelihoodField
from closedrooms.mapping.motion.scan_odometry import ScanOdometry
from closedrooms.mapping.scan_preparation import prepare_scans
from closedrooms.mapping.trajectory import ate

WITHOUT_LOOPS = MapperConfig(loops=LoopConfig(enabled=False))


HEAD = (
    "log", "scans", "raw odometry", "small_gicp; scans/s", "kiss-icp; scans/s", "yag-slam; scans/s",
    "without loops; scans/s", "mapper with gtsam; scans/s", "mapper; scans/s", "mapper, at the time", "loops",
    "keyframes", "CPU: ours / best known",
)  # fmt: skip
KISS_RANGE = 25.0
"""As far as the mapper looks [m]."""
QUICK = 300
"""Scans that are enough to see that all works."""
KISS_VOXEL = 0.5
"""Voxels of its map [m]: of 0.25, 0.5 and 1 m the best over both logs of this collection."""


def map_run(run: RecordedRun, config: MapperConfig) -> tuple[Mapper, FloatArray]:
    """Map a run: the mapper, and the poses as estimated at the time, shape (scans, 3)."""
    mapper = Mapper(config)
    follower = None if run.has_odometry else ScanOdometry(config)
    online = []
    for scan, pose, ready in zip(run.scans, run.odometry, prepare_scans(run.scans, config), strict=True):
        moved = Pose2(*pose) if follower is None else follower.follow(ready.points, scan.stamp)
        online.append(mapper.process(scan, moved, prepared=ready).as_tuple())
    mapper.finish()
    mapper.grid()
    return mapper, np.array(online)


def own(run: RecordedRun) -> FloatArray:
    """Compute the final trajectory of the mapper."""
    return map_run(run, MapperConfig())[0].trajectory()[1]


def without_loops(run: RecordedRun) -> FloatArray:
    """Compute the final trajectory of the mapper that closes no loops."""
    return map_run(run, WITHOUT_LOOPS)[0].trajectory()[1]


def gicp(run: RecordedRun) -> FloatArray:
    """Match scan to keyframe with small_gicp (GICP), from odometry; scans stand as walls of three layers."""
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


def kiss(run: RecordedRun) -> FloatArray:
    """Run KISS-ICP on the scans as flat clouds, each started from odometry."""
    from kiss_icp.config import KISSConfig
    from kiss_icp.kiss_icp import KissICP

    config = KISSConfig()
    config.data.max_range, config.data.deskew = KISS_RANGE, False
    config.mapping.voxel_size = KISS_VOXEL
    config.registration.max_num_threads = 1
    odometer = KissICP(config)
    poses: list[tuple[float, float, float]] = []
    before, measured = Pose2(*run.odometry[0]), bool(np.ptp(run.odometry, axis=0).any())
    for scan, odometry in zip(run.scans, run.odometry, strict=True):
        now = Pose2(*odometry)
        step, before = before.inverse() @ now, now
        if measured:  # else its own model of constant velocity
            odometer.last_delta = np.eye(4)
            odometer.last_delta[:2, :2], odometer.last_delta[:2, 3] = step.matrix()[:2, :2], (step.x, step.y)
        points = hit_points(scan, max_range=KISS_RANGE)
        if len(points) > 20:
            odometer.register_frame(np.column_stack((points, np.zeros(len(points)))), np.zeros(len(points)))
        else:
            odometer.last_pose = odometer.last_pose @ odometer.last_delta
        world_T_robot = odometer.last_pose
        turn = math.atan2(world_T_robot[1, 0], world_T_robot[0, 0])
        poses.append((float(world_T_robot[0, 3]), float(world_T_robot[1, 3]), turn))
    return np.array(poses)


def gtsam_optimise(poses: FloatArray, edges: list[Edge], *, kernel: float, iterations: int = 20) -> Solution:
    """Optimise what :func:`closedrooms.mapping.graph.pose_graph.optimise` does, by gtsam's Levenberg-Marquardt."""
    import gtsam

    graph, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
    for i, pose in enumerate(poses):
        values.insert(i, gtsam.Pose2(*pose))
    graph.add(gtsam.PriorFactorPose2(0, gtsam.Pose2(*poses[0]), gtsam.noiseModel.Diagonal.Sigmas(np.full(3, 1e-6))))
    for edge in edges:
        noise = gtsam.noiseModel.Gaussian.Information(edge.information + 1e-6 * np.eye(3))
        if edge.loop:
            noise = gtsam.noiseModel.Robust.Create(gtsam.noiseModel.mEstimator.Cauchy.Create(kernel), noise)
        graph.add(gtsam.BetweenFactorPose2(edge.source, edge.target, gtsam.Pose2(*edge.a_T_b.as_tuple()), noise))
    settings = gtsam.LevenbergMarquardtParams()
    settings.setMaxIterations(iterations)
    result = gtsam.LevenbergMarquardtOptimizer(graph, values, settings).optimize()
    found = [result.atPose2(i) for i in range(len(poses))]
    solved = np.array([(p.x(), p.y(), p.theta()) for p in found])
    return Solution(solved, optimise(solved, edges, kernel=kernel, iterations=0).errors)


def with_gtsam(run: RecordedRun) -> FloatArray:
    """Compute the final trajectory of the mapper whose pose graph gtsam solves."""
    import gtsam  # noqa: F401  (a missing one shows here, not in the middle of a run)

    optimiser = graph_module.optimise
    graph_module.optimise = gtsam_optimise
    try:
        return own(run)
    finally:
        graph_module.optimise = optimiser


def error(estimate: FloatArray, reference: FloatArray | None) -> str:
    if reference is None:
        return "no reference"
    position, heading = ate(estimate, reference)
    return f"{position:.3f} m, {math.degrees(heading):.2f} deg"


def first_scans(run: RecordedRun, most: int | None) -> RecordedRun:
    """Take the first scans of a run, all of them for ``None``."""
    reference = None if run.reference is None else run.reference[:most]
    return replace(run, scans=run.scans[:most], odometry=run.odometry[:most], reference=reference)


def take_turns(run: RecordedRun, rounds: int) -> dict[str, tuple[FloatArray, float]]:
    """Run every installed method ``rounds`` times, in turn: its trajectory, and its median processor time [s]."""
    times: dict[str, list[float]] = {}
    found: dict[str, FloatArray] = {}
    for _ in range(rounds):
        for name, method in (METHODS | VARIANTS).items():
            start = time.process_time()
            with contextlib.suppress(ImportError):
                found[name] = method(run)
                times.setdefault(name, []).append(time.process_time() - start)
    return {name: (poses, median(times[name])) for name, poses in found.items()}


def bench_log(path: Path, most: int | None, rounds: int) -> list[str]:
    """Measure one row of the table, on the first ``most`` scans."""
    run = first_scans(read_run(path), most)
    mapper, online = map_run(run, MapperConfig())
    found = take_turns(run, rounds)

    def told(name: str) -> str:
        if name not in found:
            return "not installed"
        poses, seconds = found[name]
        return f"{error(poses, run.reference)}; {len(run.scans) / seconds:.0f}"

    peers = [seconds for name, (_, seconds) in found.items() if name in METHODS and name != "closedrooms"]
    return [
        path.name.split(".")[0].removesuffix("-corrected"),
        f"{len(run.scans)}",
        error(run.odometry, run.reference),
        *(told(name) for name in ("small_gicp", "kiss-icp", "yag-slam", *VARIANTS)),
        f"**{told('closedrooms')}**",
        error(online, run.reference),
        f"{len(mapper.loops)}",
        f"{len(mapper.keyframes)}",
        f"{found['closedrooms'][1] / min(peers):.2f}" if peers else "",
    ]


def bench_parts(run: RecordedRun) -> None:
    """Measure refinements, insertions and stampings a second on the scans of one run."""
    config = MapperConfig()
    scans = run.scans[: min(400, len(run.scans))]
    field = LikelihoodField(config.resolution, config.matcher)
    field.add(hit_points(scans[0], max_range=config.max_range))
    points = [thin_points(hit_points(s, max_range=config.max_range), 0.1, config.matcher.max_points) for s in scans]
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


METHODS: dict[str, Callable[[RecordedRun], FloatArray]] = {
    "closedrooms": own,
    "yag-slam": yag_slam,
    "small_gicp": gicp,
    "kiss-icp": kiss,
}
VARIANTS = {"without loops": without_loops, "with gtsam": with_gtsam}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("logs", nargs="+", type=Path)
    parser.add_argument("--parts", action="store_true", help="also measure single steps, on the first log")
    parser.add_argument("--faults", action="store_true", help="with odometry that fails, as CSV")
    parser.add_argument(
        "--quick", action="store_true", help=f"{QUICK} scans, once; with --faults: one seed, the worst faults"
    )
    parser.add_argument("--rounds", type=int, default=3, help="turns of every method, of which the median counts")
    parser.add_argument("--seeds", type=int, default=5, help="with --faults: runs of each kind")
    parser.add_argument("--methods", nargs="+", choices=METHODS, default=list(METHODS), help="with --faults: whose")
    parser.add_argument("--out", type=Path, help="with --faults: the file, else printed")
    options = parser.parse_args()
    if options.faults:
        methods = {name: METHODS[name] for name in options.methods}
        with options.out.open("w") if options.out else contextlib.nullcontext(sys.stdout) as out:
            bench_faults(options.logs, methods, seeds=options.seeds, quick=options.quick, out=out)
        return
    print(f"| {' | '.join(HEAD)} |\n| --- |{' ---: |' * (len(HEAD) - 1)}", flush=True)
    for path in options.logs:
        print(
            f"| {' | '.join(bench_log(path, *((QUICK, 1) if options.quick else (None, options.rounds))))} |", flush=True
        )
    if options.parts:
        print(f"\nParts, on {options.logs[0].name}")
        bench_parts(read_run(options.logs[0]))


if __name__ == "__main__":
    main()
