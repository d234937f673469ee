"""CARMEN logs of real robots (FLASER, ROBOTLASER1, ODOM), plain or gzipped."""

import math
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from closedrooms.core.archives import TruncatedError, log_lines
from closedrooms.core.arrays import FloatArray
from closedrooms.core.errors import InvalidInputError
from closedrooms.core.pose import Pose2
from closedrooms.core.scan import LaserScan
from closedrooms.mapping.logs.recorded_run import RecordedRun, forward

MAX_BEAMS = 20_000
MAX_LINE = 1_000_000
"""Bytes; a scan of MAX_BEAMS fits."""
DEFAULT_RANGE = 80.0
"""Longest range of the SICK LMS that most of these logs come from [m]."""
NO_RETURN_COUNT = 10
"""A largest range that repeats this often is the sensor's mark for "nothing", not a wall."""
NO_RETURN_FROM = 7.5
"""No sensor of these logs saturates below this [m]."""
SAME_ROBOT = 1.5
"""Offset [m] up to which the two poses of a scan are laser and robot; beyond it one of them is corrected."""
STRAY = 1.0
"""Distance [m] from the ODOM lines beyond which a scan's own odometry is not theirs."""


@dataclass(frozen=True, slots=True, eq=False)
class _Scan:
    """One scan line; ``since`` counts the odometry lines before it."""

    ranges: FloatArray
    angle_min: float
    increment: float
    range_max: float | None
    laser: Pose2
    robot: Pose2
    stamp: float
    since: int


@dataclass(frozen=True, slots=True)
class _Odometry:
    """One ODOM line; ``clock`` is its own timestamp, zero in lines that a mapping program put in."""

    pose: Pose2
    clock: float


def read_carmen(path: Path, *, gzipped: bool) -> RecordedRun:
    """Read the scans of a CARMEN log in file order, with the raw odometry at each.

    What counts as odometry depends on the log. As recorded, a scan carries its own. In logs that a mapping program
    corrected, the poses in the scan lines are its result: they become ``reference``, and odometry is what the ODOM
    lines report. Some of those programs write each corrected pose as one more ODOM line (clock 0) and continue from
    there; those jumps are taken out again, or the correction would leak into the odometry.

    Args:
        path: The log.
        gzipped: Whether to unpack it; a truncated archive is read as far as it goes.

    Raises:
        InvalidInputError: Unreadable, not text, or unpacking to too much (:mod:`closedrooms.core.archives`).
    """
    skipped: Counter[str] = Counter()
    scans: list[_Scan] = []
    moves: list[_Odometry] = []
    settings: dict[str, float] = {}
    for line in _lines(path, gzipped, skipped):
        words = line.split()
        try:
            match words[:1]:
                case ["FLASER"]:
                    scans.append(_flaser(words, len(moves)))
                case ["ROBOTLASER1"]:
                    scans.append(_robotlaser(words, len(moves)))
                case ["ODOM"]:
                    moves.append(_Odometry(_pose(words[1:4]), float(words[7])))
                case ["PARAM"]:
                    settings[words[1]] = float(words[2])
        except (ValueError, IndexError, InvalidInputError):
            if words[0] != "PARAM":
                skipped["malformed lines"] += 1
    return _resolved(scans, moves, settings, skipped)


def _lines(path: Path, gzipped: bool, skipped: Counter[str]) -> Iterator[str]:
    try:
        for line in log_lines(path, gzipped=gzipped, what="a CARMEN log", longest=MAX_LINE):
            yield line.decode("ascii", errors="replace")
    except TruncatedError:
        skipped["truncated archives"] += 1


def _pose(words: list[str]) -> Pose2:
    x, y, theta = map(float, words)
    return Pose2(x, y, theta)


def _ranges(words: list[str], count: int) -> FloatArray:
    if len(words) != count:
        raise ValueError("a line that ends early")
    return np.array([float(word) for word in words])


def _count(word: str) -> int:
    count = int(word)
    if not 1 <= count <= MAX_BEAMS:
        raise ValueError("a scan of no or too many beams")
    return count


def _flaser(words: list[str], since: int) -> _Scan:
    """``FLASER n r1..rn x y theta odom_x odom_y odom_theta clock host logger_clock``, half a turn of view."""
    n = _count(words[1])
    # 181 and 361 beams include both ends of the half turn, 180 and 360 leave the last one out.
    increment = math.pi / (n - 1 if n % 2 and n > 1 else n)
    ranges = _ranges(words[2 : 2 + n], n)
    tail = words[2 + n :]
    return _Scan(
        ranges, -math.pi / 2, increment, None, _pose(tail[0:3]), _pose(tail[3:6]), _stamp(tail[6], tail[-1]), since
    )


def _robotlaser(words: list[str], since: int) -> _Scan:
    """``ROBOTLASER1 type start fov step max accuracy mode n r1..rn m e1..em laser robot ... clock host clock``."""
    start, step, longest = (float(words[i]) for i in (2, 4, 5))
    n = _count(words[8])
    ranges = _ranges(words[9 : 9 + n], n)
    tail = words[10 + n + int(words[9 + n]) :]
    if not (step > 0.0 and longest > 0.0 and math.isfinite(start)):
        raise ValueError("a laser without a step")
    return _Scan(ranges, start, step, longest, _pose(tail[0:3]), _pose(tail[3:6]), _stamp(tail[-3], tail[-1]), since)


def _stamp(clock: str, logger_clock: str) -> float:
    value = float(clock) or float(logger_clock)
    if not math.isfinite(value):
        raise ValueError("a time that is no number")
    return value


def _resolved(
    scans: list[_Scan], moves: list[_Odometry], settings: dict[str, float], skipped: Counter[str]
) -> RecordedRun:
    if not scans:
        return RecordedRun((), np.empty((0, 3)), None, dict(skipped))
    echoes = _echoes(scans, moves)
    corrected_scans = max(s.laser.distance(s.robot) for s in scans) > SAME_ROBOT
    last_moves = [(s, moves[s.since - 1].pose) for s in scans if s.since > 0]
    strays = bool(last_moves) and max(s.robot.distance(pose) for s, pose in last_moves) > STRAY
    reference: FloatArray | None = None
    mount = Pose2()
    if echoes or (strays and not corrected_scans):
        raw = _raw_odometry(moves, echoes)
        skipped["scans without odometry"] += sum(s.since == 0 for s in scans)
        scans = [s for s in scans if s.since > 0]
        odometry = [raw[s.since - 1] for s in scans]
        reference = np.array([s.robot.as_tuple() for s in scans]).reshape(-1, 3)
    else:
        odometry = [s.robot for s in scans]
        if corrected_scans:
            reference = np.array([s.laser.as_tuple() for s in scans])
        else:
            mount = scans[0].robot.inverse() @ scans[0].laser
    stamps, backwards = forward(np.array([s.stamp for s in scans]))
    if backwards:
        skipped["stamps running backwards"] += backwards
    range_max = _range_max(scans, settings)
    sweeps = tuple(
        LaserScan(
            _measured(s.ranges, min(range_max, s.range_max or range_max)),
            s.angle_min,
            s.increment,
            min(range_max, s.range_max or range_max),
            stamp=float(stamp),
            robot_T_sensor=mount.as_tuple(),
        )
        for s, stamp in zip(scans, stamps, strict=True)
    )
    poses = np.array([pose.as_tuple() for pose in odometry]).reshape(-1, 3)
    return RecordedRun(sweeps, poses, reference, {what: count for what, count in skipped.items() if count})


def _echoes(scans: list[_Scan], moves: list[_Odometry]) -> set[int]:
    """ODOM lines right after a scan that only repeat its corrected pose."""
    return {
        s.since
        for s in scans
        if s.since < len(moves) and moves[s.since].clock == 0.0 and moves[s.since].pose == s.robot
    }


def _raw_odometry(moves: list[_Odometry], echoes: set[int]) -> list[Pose2]:
    """Odometry accumulated over the ODOM lines without the jumps to corrected poses."""
    pose, raw = Pose2(), []
    for i, move in enumerate(moves):
        if i > 0 and i not in echoes:
            pose = pose @ (moves[i - 1].pose.inverse() @ move.pose)
        raw.append(pose)
    return raw


def _range_max(scans: list[_Scan], settings: dict[str, float]) -> float:
    """Range from which the sensor means "nothing" [m]."""
    ranges = np.concatenate([s.ranges for s in scans])
    ranges = ranges[np.isfinite(ranges)]
    top = float(ranges.max(initial=0.0))
    stated = settings.get("robot_front_laser_max", DEFAULT_RANGE)
    limit = stated if math.isfinite(stated) and stated > 0.0 else DEFAULT_RANGE
    if top >= NO_RETURN_FROM and int((ranges >= top).sum()) >= NO_RETURN_COUNT:
        limit = min(limit, top)
    return limit


def _measured(ranges: FloatArray, range_max: float) -> FloatArray:
    """Ranges with NaN for what was not measured.

    These sensors report errors (dazzle, glass, black walls) and emptiness with the same largest value: it clears
    nothing.
    """
    with np.errstate(invalid="ignore"):
        return np.where((ranges > 0.0) & (ranges < range_max), ranges, np.nan)
