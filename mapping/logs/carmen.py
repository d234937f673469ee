"""CARMEN logs of real robots (FLASER, ROBOTLASER, RAWLASER, ODOM), plain or gzipped."""

import codecs
import math
from dataclasses import replace
from pathlib import Path

import numpy as np

from closedrooms.core.arrays import FloatArray
from closedrooms.core.errors import InvalidInputError
from closedrooms.core.files.archives import TruncatedError, log_lines
from closedrooms.core.pose import Pose2
from closedrooms.core.remarks import Remark
from closedrooms.core.scan import LaserScan
from closedrooms.mapping.logs.carmen_lines import (
    LARGEST_ANGLE,
    WITH_POSES,
    CarmenLog,
    FieldOfView,
    ScanLine,
    flaser_field_of_view,
)
from closedrooms.mapping.logs.carmen_odometry import LocatedScans, motion_of
from closedrooms.mapping.logs.clocks import forward
from closedrooms.mapping.logs.odometry_units import UNITS, contradicts, find_unit, unit_remark
from closedrooms.mapping.logs.recorded_run import RecordedRun

MAX_LINE = 1_000_000
"""Bytes; a scan of MAX_BEAMS fits."""
IMPOSSIBLE_RANGE, MOST_IMPOSSIBLE = 100.0, 0.25
"""Range [m] that no lidar of these logs has, and share of the ranges beyond it from which they are in another unit."""
FULL_TURN = (0.05, 0.8, 20)
"""Scans whose first and last ranges differ by at most this share, in at least this share of at least so many scans,
go all around, where others differ: the two ends of a narrower view look apart."""
STATED_VIEW = {"laser_front_laser_fov", "laser_front_laser_resolution"}
DEFAULT_RANGE = 80.0
"""Longest range of the SICK LMS that most of these logs come from [m]."""
NO_RETURN_COUNT = 10
"""A largest range that repeats this often is the sensor's mark for "nothing", not a wall."""
NO_RETURN_FROM = 7.5
"""No sensor of these logs saturates below this [m]."""


def read_carmen(path: Path, *, gzipped: bool) -> RecordedRun:
    """Read the scans of a CARMEN log in file order, with the raw odometry at each.

    Scans of one laser are taken, of those that carry poses if there are any. What counts as their odometry,
    :func:`motion_of` says. Where it contradicts the scans and is written in centimetres, millimetres or degrees, it is
    read once more in these units.

    Args:
        path: The log.
        gzipped: Whether to unpack it; a truncated archive is read as far as it goes.

    Raises:
        InvalidInputError: Unreadable, not text, or unpacking to too much (``core.archives``).
    """
    log = _lines(path, gzipped, CarmenLog())
    run = _mapped(log)
    if not run.has_odometry or not contradicts(run.scans, run.odometry):
        return run
    # No heading in radians is as large as those of writers who put degrees.
    for angle in (1.0, math.radians(1.0)) if log.widest > LARGEST_ANGLE else (1.0,):
        turned = run if angle == 1.0 else _mapped(_lines(path, gzipped, CarmenLog(angle=angle)))
        length = find_unit(turned.scans, turned.odometry)
        if length is not None and (length, angle) != (1.0, 1.0):
            again = _mapped(_lines(path, gzipped, CarmenLog(length=length, angle=angle)))
            units = ([UNITS[length]] if length != 1.0 else []) + (["degrees"] if angle != 1.0 else [])
            return replace(again, remarks=(*again.remarks, unit_remark(" and ".join(units))))
    return run


def _lines(path: Path, gzipped: bool, log: CarmenLog) -> CarmenLog:
    """Take in the lines of a log; an archive that ends early ends them and is noted."""
    try:
        for line in log_lines(path, gzipped=gzipped, what="a CARMEN log", longest=MAX_LINE):
            log.take(line.removeprefix(codecs.BOM_UTF8).decode("ascii", errors="replace"))
    except TruncatedError:
        log.truncated = True
    return log


def _mapped(log: CarmenLog) -> RecordedRun:
    """Make a run of the laser that is mapped."""
    remarks = _reading_remarks(log)
    kind = _kind(log)
    if kind is None:
        why = "they say neither where the laser sits nor where it looks"
        unsaid = [Remark(action="dropped", what=f"{k} scans", why=why, count=len(s)) for k, s in log.scans.items()]
        return RecordedRun((), np.empty((0, 3)), None, (*remarks, *unsaid))
    remarks += [
        Remark(action="dropped", what=f"{other} scans", why=f"{kind} is mapped", count=len(scans))
        for other, scans in log.scans.items()
        if other != kind
    ]
    scans, guesses = _with_sector(log.scans[kind], log.settings)
    motion = motion_of(scans, log.moves, log.settings, rear=kind == "RAWLASER2")
    return _run(motion, log.settings, [*remarks, *guesses])


def _kind(log: CarmenLog) -> str | None:
    """Choose the laser that is mapped: the one with most scans, of those with poses first."""
    kinds = [kind for kind in log.scans if kind in WITH_POSES]
    # Rear lasers of old logs (RLASER) say neither where they sit nor where they look.
    kinds = kinds or sorted(kind for kind in log.scans if kind != "RLASER")
    return max(kinds, key=lambda kind: len(log.scans[kind]), default=None)


def _with_sector(scans: list[ScanLine], settings: dict[str, float]) -> tuple[list[ScanLine], list[Remark]]:
    """Give scans that do not say their field of view the one of the log's parameters or of a SICK LMS."""
    resolved, guessed, turned = [], 0, 0
    around = not settings.keys() & STATED_VIEW and _goes_around(scans)
    for scan in scans:
        if scan.angle_min is not None:
            resolved.append(scan)
            continue
        fov, guess = flaser_field_of_view(scan.ranges.size, settings)
        if around:
            increment = 2.0 * math.pi / scan.ranges.size
            fov, guess, turned = FieldOfView(-math.pi, increment), False, turned + 1
        guessed += guess
        resolved.append(replace(scan, angle_min=fov.angle_min, increment=fov.increment))
    why = "the log has no laser_front_laser_fov; taken to be"
    shares = ((guessed, "half a turn"), (turned, "a whole turn, as their first and last beams meet"))
    return resolved, [
        Remark(action="guessed", what="fields of view", why=f"{why} {share}", count=count)
        for count, share in shares
        if count
    ]


def _goes_around(scans: list[ScanLine]) -> bool:
    """Check whether the first and the last beam of scans see the same surface, as neighbours do."""
    near, share, least = FULL_TURN
    ends = np.array([scan.ranges[[0, -1, scan.ranges.size // 2]] for scan in scans])
    ends = ends[(ends > 0.0).all(axis=1) & (ends < DEFAULT_RANGE).all(axis=1)]
    if len(ends) < least:
        return False
    last, middle = ((np.abs(ends[:, 0] - ends[:, i]) <= near * ends[:, 0]).mean() for i in (1, 2))
    return bool(last >= share and middle <= 0.5)


def _reading_remarks(log: CarmenLog) -> list[Remark]:
    """Say which lines were dropped, repaired or missing."""
    remarks = [
        Remark(action="dropped", what=f"{kind} lines", why="malformed", count=count, loss=True)
        for kind, count in log.malformed.items()
    ]
    remarks += [
        Remark(action="repaired", what="headers of scans", why=how, count=count) for how, count in log.repaired.items()
    ]
    if log.truncated:
        why = "the archive ends early; read as far as it goes"
        remarks.append(Remark(action="dropped", what="end of the log", why=why, loss=True))
    return remarks


def _run(motion: LocatedScans, settings: dict[str, float], remarks: list[Remark]) -> RecordedRun:
    """Make a run of the scans with their odometry."""
    scans = motion.scans
    remarks = [*remarks, *motion.remarks]
    if not scans:
        return RecordedRun((), np.empty((0, 3)), None, tuple(remarks))
    ranges = np.concatenate([scan.ranges for scan in scans])
    if (ranges > IMPOSSIBLE_RANGE).mean() > MOST_IMPOSSIBLE:
        middle = f"half of the ranges are above {np.median(ranges):.0f}"
        raise InvalidInputError(f"{middle} (centimetres?)", expected=f"metres, up to {IMPOSSIBLE_RANGE:g}")
    stamps, backwards = forward(np.array([scan.stamp for scan in scans]))
    limit = _range_max(scans, settings)
    sweeps = tuple(_sweep(scan, float(stamp), limit, motion.mount) for scan, stamp in zip(scans, stamps, strict=True))
    return RecordedRun(sweeps, motion.odometry, motion.reference, (*remarks, *backwards), motion.has_odometry)


def _sweep(scan: ScanLine, stamp: float, limit: float, mount: Pose2) -> LaserScan:
    """Make a scan of a line; ranges from ``limit`` [m] on mean that nothing was measured."""
    range_max = min(limit, scan.range_max or limit)
    ranges = _measured(scan.ranges, range_max)
    return LaserScan(
        ranges, scan.angle_min or 0.0, scan.increment, range_max, stamp=stamp, robot_T_sensor=mount.as_tuple()
    )


def _range_max(scans: list[ScanLine], settings: dict[str, float]) -> float:
    """Find the range from which the sensor means "nothing" [m]."""
    ranges = np.concatenate([s.ranges for s in scans])
    ranges = ranges[np.isfinite(ranges)]
    top = float(ranges.max(initial=0.0))
    stated = settings.get("robot_front_laser_max", DEFAULT_RANGE)
    limit = stated if math.isfinite(stated) and stated > 0.0 else DEFAULT_RANGE
    if top >= NO_RETURN_FROM and int((ranges >= top).sum()) >= NO_RETURN_COUNT:
        limit = min(limit, top)
    return limit


def _measured(ranges: FloatArray, range_max: float) -> FloatArray:
    """Replace ranges that were not measured by NaN.

    These sensors report errors (dazzle, glass, black walls) and emptiness with the same largest value: it clears
    nothing.
    """
    with np.errstate(invalid="ignore"):
        return np.where((ranges > 0.0) & (ranges < range_max), ranges, np.nan)
