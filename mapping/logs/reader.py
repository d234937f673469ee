"""Read a recorded run of any supported kind, told apart by its content."""

import re
from dataclasses import fields, replace
from pathlib import Path

import numpy as np

from closedrooms.core.errors import InvalidInputError
from closedrooms.core.files.incoming import is_file, is_folder, read_head, reading
from closedrooms.core.remarks import Remark
from closedrooms.mapping.logs.bags.bag_files import METADATA, is_bag_folder
from closedrooms.mapping.logs.bags.bag_options import BagOptions
from closedrooms.mapping.logs.odometry_units import UNITS, contradicts, find_unit, unit_remark
from closedrooms.mapping.logs.recorded_odometry import bridge_jumps, jump_remarks
from closedrooms.mapping.logs.recorded_run import RecordedRun
from closedrooms.mapping.logs.stated_view import with_fitting_view

GZIP, ZIP, SQLITE, MCAP = b"\x1f\x8b", b"PK\x03\x04", b"SQLite format 3", b"\x89MCAP0\r\n"
OLD_BAG = re.compile(rb"#ROS(?:BAG|RECORD|LOG) V(\d+\.\d+)")
ROSBAG = b"2.0"
PACKED = {
    b"\x28\xb5\x2f\xfd": "zstd",
    b"BZh": "bzip2",
    b"\xfd7zXZ": "xz",
    b"7z\xbc\xaf": "7-Zip",
    b"\x04\x22\x4d\x18": "lz4",
}
"""What files begin with that other programs have packed whole; a folder of rosbag 2 says itself how its files are."""
SAME_POSE = 1e-6
"""Odometry that never leaves its first pose by more [m and rad] was not measured."""


def read_run(
    path: Path,
    *,
    scan_topic: str | None = None,
    odometry_topic: str | None = None,
    mount: tuple[float, float, float] | None = None,
    upside_down: bool = False,
) -> RecordedRun:
    """Read a recorded run of any supported kind, told apart by its content.

    Args:
        path: A CARMEN log (plain or gzipped), a ``scans.npz``, a rosbag 1, or an MCAP file or rosbag 2 folder.
        scan_topic: Topic of the scans in a bag that holds several.
        odometry_topic: Topic of the odometry in a bag that holds several, or of the transforms that hold it.
        mount: Where the lidar of a bag sits on the robot, ``(x, y, yaw)`` [m, rad], in place of its transforms.
        upside_down: Whether that lidar hangs with its z axis down.

    Raises:
        InvalidInputError: Missing, unreadable, of no known kind, or without a single scan that can be used.
    """
    options = BagOptions(scan_topic=scan_topic, odometry_topic=odometry_topic, mount=mount, upside_down=upside_down)
    with reading(path, "a recorded run"):
        try:
            run = _read(path.parent if path.name == METADATA and is_file(path) else path, options)
        except InvalidInputError as error:
            # Scans and poses check themselves, and do not know their file.
            raise error if str(path) in str(error) else InvalidInputError(str(error), where=path) from error
    if not run.scans:
        found = "".join(f"; {remark}" for remark in run.remarks)
        raise InvalidInputError(f"no scan that can be used{found}", expected="laser scans", where=path)
    return _of_one_lidar(_fitting(with_fitting_view(_without_frozen_odometry(run))))


def _read(path: Path, options: BagOptions) -> RecordedRun:
    """Read a log by the reader that its first bytes ask for."""
    head = _head(path)
    version = OLD_BAG.match(head)
    if version and version[1] != ROSBAG:
        raise InvalidInputError(f"a ROS bag {version[1].decode()}", expected="ROS bag 2.0", where=path)
    if version or head.startswith((MCAP, SQLITE)):
        from closedrooms.mapping.logs.bags.rosbag import read_bag

        return read_bag(path, options)
    packer = next((name for magic, name in PACKED.items() if head.startswith(magic)), None)
    if packer:
        what = "the file unpacked, or the folder with its metadata.yaml"
        raise InvalidInputError(f"a file packed by {packer}", expected=what, where=path)
    _refuse_options(options, path)
    if head.startswith(ZIP):
        from closedrooms.mapping.logs.npz import read_scans

        return _bridged(read_scans(path))
    if is_folder(path):
        raise InvalidInputError("a folder", expected="a log file, or a rosbag 2 folder with metadata.yaml", where=path)
    from closedrooms.mapping.logs.carmen import read_carmen

    return _bridged(read_carmen(path, gzipped=head.startswith(GZIP)))


def _refuse_options(options: BagOptions, path: Path) -> None:
    """Refuse options that only a bag reads."""
    given = [f.name.replace("_", "-") for f in fields(options) if getattr(options, f.name) not in {None, False}]
    if given:
        raise InvalidInputError(f"--{', --'.join(given)} for a log that is no bag", expected="a rosbag", where=path)


def _head(path: Path) -> bytes:
    """Read what tells the kind of file."""
    if is_folder(path):
        return SQLITE if is_bag_folder(path) else b""
    return read_head(path, what="a recorded run", size=24)


def _bridged(run: RecordedRun) -> RecordedRun:
    """Bridge the jumps of a run's odometry."""
    odometry, jumps = bridge_jumps(np.array([scan.stamp for scan in run.scans]), run.odometry)
    if not jumps:
        return run
    return replace(run, odometry=odometry, remarks=(*run.remarks, *jump_remarks(jumps)))


def _without_frozen_odometry(run: RecordedRun) -> RecordedRun:
    """Take away an odometry that never moves: a robot that does would be taken to stand."""
    if not run.has_odometry or len(run.scans) < 2:
        return run
    if float(np.abs(run.odometry - run.odometry[0]).max()) > SAME_POSE:
        return run
    remark = Remark(action="guessed", what="motion", why="the odometry never changes; found from the scans alone")
    return _by_scans_alone(run, remark)


def _fitting(run: RecordedRun) -> RecordedRun:
    """Read an odometry that contradicts the scans in the unit that fits them; take it away where none does."""
    if not run.has_odometry or not contradicts(run.scans, run.odometry):
        return run
    unit = find_unit(run.scans, run.odometry)
    scaled = run.odometry * np.array([unit or 1.0, unit or 1.0, 1.0])
    if unit is None or contradicts(run.scans, scaled):
        why = "the odometry contradicts the scans (a wrong mounting or field of view?); found from the scans alone"
        return _by_scans_alone(run, Remark(action="guessed", what="motion", why=why, loss=True))
    return replace(run, odometry=scaled, remarks=(*run.remarks, unit_remark(UNITS[unit])))


def _of_one_lidar(run: RecordedRun) -> RecordedRun:
    """Keep the scans of the lidar that most are of, where there is no odometry: two that look elsewhere fit nowhere."""
    mounts = [scan.robot_T_sensor for scan in run.scans]
    usual = max(dict.fromkeys(mounts), key=mounts.count)
    kept = np.array([mount == usual for mount in mounts])
    if run.has_odometry or kept.all():
        return run
    why = "of another lidar on the same topic, which cannot be matched without odometry"
    remark = Remark(action="dropped", what="scans", why=why, count=int((~kept).sum()), loss=True)
    reference = None if run.reference is None else run.reference[kept]
    scans = tuple(scan for scan, keep in zip(run.scans, kept, strict=True) if keep)
    return replace(run, scans=scans, odometry=run.odometry[kept], reference=reference, remarks=(*run.remarks, remark))


def _by_scans_alone(run: RecordedRun, remark: Remark) -> RecordedRun:
    """Take the odometry away."""
    return replace(run, odometry=np.zeros((len(run.scans), 3)), has_odometry=False, remarks=(*run.remarks, remark))
