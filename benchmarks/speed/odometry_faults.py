"""Mapping with odometry that fails, beside the peers: the part of ``benchmarks/speed/mapping.py`` behind ``--faults``.

Faults hit a share of the steps from scan to scan, drawn by the seed: ``dropped`` steps are lost for good, ``doubled``
ones count twice, ``frozen`` ones repeat the reading before, which the next step makes up for. ``none`` is a run without
odometry: scan matching alone.
"""

import contextlib
import csv
import dataclasses
import datetime
import io
import math
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TextIO

import numpy as np

from closedrooms.core.arrays import FloatArray
from closedrooms.core.pose import Pose2, wrap_angle
from closedrooms.mapping.logs import RecordedRun, read_run
from closedrooms.mapping.trajectory import ate

Method = Callable[[RecordedRun], FloatArray]
CASES = (
    ("good", 0.0), ("frozen", 0.01), ("frozen", 0.05), ("doubled", 0.01), ("doubled", 0.05), ("dropped", 0.01),
    ("dropped", 0.05), ("none", 1.0),
)  # fmt: skip
QUICK = (("good", 0.0), ("frozen", 0.05), ("doubled", 0.05), ("dropped", 0.05))
COLUMNS = ("log", "fault", "share", "method", "seeds", "ate_mean_m", "ate_worst_m", "scans_per_cpu_second")
TRAVEL, TURN = 0.05, math.radians(3.0)
"""Motion after which Karto takes a scan: [m], [rad]. Its defaults of 0.2 m and 10 degrees lose aces (1.61 m)."""
YAG_SMEAR = 0.03
"""Standard deviation of what a point adds to its map [m]: of 0.02, 0.03, 0.05 and 0.1, on the first 300 scans of
freiburg-079, errors of 0.033, 0.031, 0.254 and 0.284 m. Wider searches (0.8 and 1.2 m, its default is 0.5) give the
same there, at two and four times the cost, and 0.26 m on the whole log, where 0.5 gives 0.30 m."""
YAG_RANGE = 20.0
"""Longest range that it looks at [m], its default."""


def with_faults(odometry: FloatArray, kind: str, share: float, seed: int) -> FloatArray:
    """Make odometry, shape (n, 3), some steps of which fail."""
    if kind == "good":
        return odometry
    if kind == "none":
        return np.zeros_like(odometry)
    poses = [Pose2(*pose) for pose in odometry]
    hit = np.random.default_rng(seed).random(len(poses)) < share
    if kind == "frozen":
        rows = [poses[0]]
        for pose, failed in zip(poses[1:], hit[1:], strict=True):
            rows.append(rows[-1] if failed else pose)
    else:
        rows = [poses[0]]
        for before, pose, failed in zip(poses, poses[1:], hit[1:], strict=False):
            step = before.inverse() @ pose
            rows.append(rows[-1] @ (step if not failed else step @ step if kind == "doubled" else Pose2()))
    return np.array([pose.as_tuple() for pose in rows])


def yag_slam(run: RecordedRun) -> FloatArray:
    """Run Karto's matcher and loop closure (``yag-slam``): 20 scans to match against, a map of ``YAG_SMEAR``.

    It looks at the response of a loop's fine match only where it is told to print what it does, and takes every loop
    else: so it is told to, and not listened to.
    """
    # numba, which it imports, takes a module called coverage for the tool of that name; one lies beside this file.
    sys.path[:] = [folder for folder in sys.path if Path(folder).resolve() != Path(__file__).resolve().parent]
    np.float = float  # type: ignore[attr-defined]  # noqa: NPY001  (it still uses the alias that NumPy dropped)
    from yag_slam.graph_slam import GraphSlam
    from yag_slam.models import LocalizedRangeScan
    from yag_slam.scan_matching import Scan2DMatcherCpp

    blind = not np.ptp(run.odometry, axis=0).any()
    sequence, loop = Scan2DMatcherCpp({"smear_deviation": YAG_SMEAR}), Scan2DMatcherCpp({}, loop=True)
    slam = GraphSlam(sequence, loop, scan_buffer_len=20, verbose=True)
    nodes, references = [], []
    taken = Pose2()
    for scan, row in zip(run.scans, run.odometry, strict=True):
        pose, mount = Pose2(*row), Pose2(*scan.robot_T_sensor)
        step = taken.inverse() @ pose
        if not nodes or blind or math.hypot(step.x, step.y) >= TRAVEL or abs(wrap_angle(step.theta)) >= TURN:
            at, count = pose @ mount, scan.ranges.size
            ranges = np.nan_to_num(scan.ranges, nan=1e3, posinf=1e3).tolist()
            last = scan.angle_min + (count - 1) * scan.angle_increment
            node = LocalizedRangeScan(
                ranges,
                scan.angle_min,
                last,
                scan.angle_increment,
                scan.range_min,
                scan.range_max,
                YAG_RANGE,
                *at.as_tuple(),
            )
            with contextlib.redirect_stdout(io.StringIO()):
                slam.process_scan(node)
            nodes.append(node)
            taken = pose
        references.append((len(nodes) - 1, taken.inverse() @ pose, mount))
    with contextlib.redirect_stdout(io.StringIO()):
        slam.run_opt()
    found = []
    for number, offset, mount in references:
        at = nodes[number].corrected_pose
        found.append((Pose2(at.x, at.y, at.euler[-1]) @ mount.inverse() @ offset).as_tuple())
    return np.array(found)


def rows_of(
    path: Path, methods: dict[str, Method], seeds: int, cases: tuple[tuple[str, float], ...]
) -> Iterator[list[str]]:
    """Measure one row a method and fault; a peer that is not installed is skipped with a line."""
    run = read_run(path)
    if run.reference is None:
        print(f"{path.name}: no reference poses to compare with: skipped", file=sys.stderr)
        return
    name = path.name.split(".")[0].removesuffix("-corrected")
    for title, method in methods.items():
        for kind, share in cases:
            errors, seconds = [], 0.0
            drawn = 1 if kind in ("good", "none") else seeds
            for seed in range(drawn):
                odometry = with_faults(run.odometry, kind, share, seed)
                failing = dataclasses.replace(run, odometry=odometry, has_odometry=kind != "none")
                start = time.process_time()
                try:
                    poses = method(failing)
                except ImportError as missing:
                    print(f"{title}: not installed ({missing.name}): skipped", file=sys.stderr)
                    break
                seconds += time.process_time() - start
                errors.append(ate(poses, run.reference)[0])
            if not errors:
                break
            speed = len(run.scans) * drawn / seconds
            figures = f"{np.mean(errors):.3f}", f"{max(errors):.3f}", f"{speed:.0f}"
            yield [name, kind, f"{share:g}", title, f"{drawn}", *figures]


def bench_faults(logs: list[Path], methods: dict[str, Method], *, seeds: int, quick: bool, out: TextIO) -> None:
    """Print the table as CSV, with the command, the date and the commit ahead of it."""
    folder = Path(__file__).parent
    commit = subprocess.run(
        ["git", "rev-parse", "--short", "HEAD"], capture_output=True, text=True, cwd=folder, check=False
    ).stdout.strip()
    words = [Path(word).name if "/" in word else word for word in sys.argv[1:]]
    print(f"# python benchmarks/speed/mapping.py {' '.join(words)}", file=out)
    print(f"# {datetime.date.today().isoformat()}, commit {commit or 'unknown'}", file=out)
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(COLUMNS)
    for title, method in methods.items():
        for path in logs:
            for row in rows_of(path, {title: method}, 1 if quick else seeds, QUICK if quick else CASES):
                writer.writerow(row)
                out.flush()
