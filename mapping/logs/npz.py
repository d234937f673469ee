"""Scans in NumPy archives: our own ``scans.npz``, and the MRPT export of the Malaga data set."""

import math
from pathlib import Path
from typing import Any

import numpy as np

from closedrooms.core.arrays import BoolArray, FloatArray
from closedrooms.core.errors import InvalidInputError
from closedrooms.core.files.archives import read_arrays
from closedrooms.core.files.outgoing import write_bytes
from closedrooms.core.pose import Pose2
from closedrooms.core.remarks import Remark
from closedrooms.core.scan import LaserScan
from closedrooms.mapping.logs.clocks import forward
from closedrooms.mapping.logs.recorded_run import RecordedRun

EXPECTED = "scans.npz with stamps, ranges, odometry, angle_min, angle_increment, range_max"
TICKS = 1e-7
"""Windows file-time ticks of MRPT's stamps [s]."""
MRPT_RANGE = 80.0
"""Longest range of the SICK LMS that recorded them [m]."""
NEAREST = 1e-3
"""Shorter ranges are none: 0 and below mark beams without an answer, and no lidar measures a millimetre [m]."""
FIELDS = {
    "stamps", "ranges", "odometry", "truth", "angle_min", "angle_increment", "range_max", "robot_T_sensor", "sweep",
    "odom", "ts", "sensor_xy",
}  # fmt: skip
"""Arrays that are read, ours and MRPT's."""
REAL = "biuf"
"""Kinds of arrays that hold real numbers (NumPy's letters)."""


def write_scans(path: Path, run: RecordedRun, *, estimate: FloatArray | None = None, compressed: bool = True) -> None:
    """Write a run as ``scans.npz`` (all scans of one geometry).

    Raises:
        InvalidInputError: Scans of different geometry.
        OutputError: The folder cannot be written.
    """
    import io

    first = run.scans[0]
    geometries = {(s.ranges.size, s.angle_min, s.angle_increment, s.range_max) for s in run.scans}
    if len(geometries) != 1:
        raise InvalidInputError("scans of different geometry", expected="one lidar", where=path)
    arrays: dict[str, Any] = {
        "stamps": np.array([s.stamp for s in run.scans]),
        "ranges": np.array([s.ranges for s in run.scans], dtype=np.float32),
        "odometry": run.odometry,
        "angle_min": np.float64(first.angle_min),
        "angle_increment": np.float64(first.angle_increment),
        "range_max": np.float64(first.range_max),
        "robot_T_sensor": np.array(first.robot_T_sensor),
    }
    if first.sweep:
        arrays["sweep"] = np.float64(first.sweep)
    if estimate is not None:
        arrays["estimate"] = estimate
    if run.reference is not None:
        arrays["truth"] = run.reference
    buffer = io.BytesIO()
    (np.savez_compressed if compressed else np.savez)(buffer, **arrays)
    write_bytes(path, buffer.getvalue())


def read_scans(path: Path) -> RecordedRun:
    """Read ``scans.npz`` of a run, or an MRPT export (``ranges``, ``odom`` increments, ``ts``, ``sensor_xy``).

    Raises:
        InvalidInputError: Broken, too large, with pickles, or with arrays missing or of other shapes.
    """
    arrays: dict[str, Any] = read_arrays(path, what=EXPECTED)
    for name in FIELDS & arrays.keys():
        # Cast to numbers they would be others: halves of complex ones, nanoseconds of dates, bytes of records.
        if arrays[name].dtype.kind not in REAL:
            raise InvalidInputError(f"array {name} of {arrays[name].dtype}", expected="real numbers", where=path)
    try:
        if "odometry" in arrays:
            return _ours(arrays, path)
        if {"ranges", "odom", "ts"} <= arrays.keys():
            return _mrpt(arrays, path)
    except (ValueError, TypeError, IndexError, OverflowError) as error:
        raise InvalidInputError(f"arrays that do not fit ({error})", expected=EXPECTED, where=path) from error
    raise InvalidInputError(f"arrays {', '.join(sorted(arrays))}", expected=EXPECTED, where=path)


def _ours(arrays: dict[str, Any], path: Path) -> RecordedRun:
    """Read the arrays of ``scans.npz`` as this program writes them."""
    missing = {"stamps", "ranges", "angle_min", "angle_increment", "range_max"} - arrays.keys()
    if missing:
        raise InvalidInputError(f"arrays {', '.join(sorted(missing))} missing", expected=EXPECTED, where=path)
    mount = arrays.get("robot_T_sensor", np.zeros(3))
    return _run(
        np.asarray(arrays["stamps"], dtype=np.float64),
        np.asarray(arrays["ranges"], dtype=np.float64),
        np.asarray(arrays["odometry"], dtype=np.float64),
        arrays.get("truth"),
        (float(arrays["angle_min"]), float(arrays["angle_increment"]), float(arrays["range_max"])),
        (float(mount[0]), float(mount[1]), float(mount[2])),
        path,
        sweep=float(arrays.get("sweep", 0.0)),
    )


def _mrpt(arrays: dict[str, Any], path: Path) -> RecordedRun:
    """Read arrays converted from MRPT, whose odometry is a list of steps and whose stamps are ticks."""
    ranges = np.array(arrays["ranges"], dtype=np.float64)
    poses = [Pose2()]
    for x, y, theta in np.asarray(arrays["odom"], dtype=np.float64):
        poses.append(poses[-1] @ Pose2(x, y, theta))
    ticks = np.asarray(arrays["ts"], dtype=np.uint64)
    stamps = (ticks - ticks[:1]).astype(np.float64) * TICKS
    x, y = (float(v) for v in arrays.get("sensor_xy", np.zeros(2)))
    with np.errstate(invalid="ignore"):
        ranges[~((ranges > 0.0) & (ranges < MRPT_RANGE))] = np.nan
    geometry = (-math.pi / 2, math.pi / max(ranges.shape[1] - 1, 1), MRPT_RANGE)
    return _run(stamps, ranges, np.array([p.as_tuple() for p in poses]), None, geometry, (x, y, 0.0), path)


def _run(
    stamps: FloatArray,
    ranges: FloatArray,
    odometry: FloatArray,
    reference: Any,
    geometry: tuple[float, float, float],
    mount: tuple[float, float, float],
    path: Path,
    *,
    sweep: float = 0.0,
) -> RecordedRun:
    """Check shapes and values and make a run; ``geometry`` is angle_min, angle_increment [rad] and range_max [m]."""
    n = len(stamps)
    if stamps.ndim != 1 or ranges.ndim != 2 or ranges.shape[0] != n or odometry.shape != (n, 3):
        raise InvalidInputError(
            f"stamps {stamps.shape}, ranges {ranges.shape}, odometry {odometry.shape}",
            expected="shapes (n,), (n, beams), (n, 3)",
            where=path,
        )
    if reference is not None and np.shape(reference) != (n, 3):
        raise InvalidInputError(f"truth of shape {np.shape(reference)}", expected="shape (n, 3)", where=path)
    if not all(math.isfinite(v) for v in (*geometry, *mount, sweep)) or geometry[1] == 0.0:
        raise InvalidInputError("a scan geometry that is not finite", expected=EXPECTED, where=path)
    usable = np.isfinite(stamps) & np.isfinite(odometry).all(axis=1)
    if not usable.all():
        stamps, ranges, odometry = stamps[usable], ranges[usable], odometry[usable]
        reference = None if reference is None else np.asarray(reference)[usable]
    ranges = np.where(ranges >= NEAREST, ranges, np.nan)
    stamps, backwards = forward(stamps)
    scans = tuple(
        LaserScan(row, geometry[0], geometry[1], geometry[2], stamp=float(stamp), robot_T_sensor=mount, sweep=sweep)
        for row, stamp in zip(ranges, stamps, strict=True)
    )
    remarks = (*_unusable(~usable), *backwards)
    reference = None if reference is None else np.asarray(reference, dtype=np.float64)
    return RecordedRun(scans, odometry, reference, remarks)


def _unusable(dropped: BoolArray) -> list[Remark]:
    count = int(dropped.sum())
    why = "a stamp or an odometry that is not finite"
    return [Remark(action="dropped", what="scans", why=why, count=count, loss=True)] if count else []
