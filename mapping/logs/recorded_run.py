"""A recorded run: scans with odometry, from whatever file holds them."""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from closedrooms.core.arrays import FloatArray, frozen
from closedrooms.core.errors import InvalidInputError
from closedrooms.core.incoming import is_file, is_folder, read_head, reading
from closedrooms.core.numbers import FARTHEST
from closedrooms.core.scan import LaserScan

GZIP, ZIP, SQLITE = b"\x1f\x8b", b"PK\x03\x04", b"SQLite format 3"
ROSBAG, MCAP = b"#ROSBAG V2.0", b"\x89MCAP0\r\n"


@dataclass(frozen=True, slots=True, eq=False)
class RecordedRun:
    """Scans of a real (or simulated) robot in the order they were taken.

    Attributes:
        scans: The sweeps, stamps never running backwards.
        odometry: ``odom_T_robot`` at each scan, shape (n, 3), metres and radians; drifts.
        reference: Better poses from elsewhere, shape (n, 3), or ``None``; never an input of the mapper.
        skipped: What was left out or mended, counted by reason.
    """

    scans: tuple[LaserScan, ...]
    odometry: FloatArray
    reference: FloatArray | None = None
    skipped: dict[str, int] = field(default_factory=dict)

    def __post_init__(self) -> None:
        object.__setattr__(self, "odometry", _poses(self.odometry, "odometry"))
        if self.reference is not None:
            object.__setattr__(self, "reference", _poses(self.reference, "reference poses"))


def _poses(poses: FloatArray, what: str) -> FloatArray:
    """Poses as they are kept, shape (n, 3), none of them where no robot is."""
    poses = frozen(poses)
    # NaN compares as false.
    if not bool((np.abs(poses) <= FARTHEST).all()):
        raise InvalidInputError(f"{what} that are not finite or too far away", expected=f"at most {FARTHEST:g} m")
    return poses


def read_run(path: Path, *, scan_topic: str | None = None, odometry_topic: str | None = None) -> RecordedRun:
    """Read a recorded run of any supported kind, told apart by its content.

    Args:
        path: A CARMEN log (plain or gzipped), a ``scans.npz``, a rosbag 1, or an MCAP file or rosbag 2 folder.
        scan_topic: Topic of the scans in a bag that holds several.
        odometry_topic: Topic of the odometry in a bag that holds several.

    Raises:
        InvalidInputError: Missing, unreadable, of no known kind, or without a single scan that can be used.
    """
    if is_folder(path):
        head = SQLITE if is_file(path / "metadata.yaml") else b""
    else:
        head = read_head(path, what="a recorded run", size=16)
    with reading(path, "a recorded run"):
        try:
            run = _read_kind(path, head, scan_topic, odometry_topic)
        except InvalidInputError as error:
            # Scans and poses check themselves, and do not know their file.
            raise error if str(path) in str(error) else InvalidInputError(str(error), where=path) from error
    if not run.scans:
        found = "".join(f", {count} {what}" for what, count in run.skipped.items())
        raise InvalidInputError(f"no scan with odometry{found}", expected="laser scans and odometry", where=path)
    return run


def _read_kind(path: Path, head: bytes, scan_topic: str | None, odometry_topic: str | None) -> RecordedRun:
    """Read a run with the reader that its first bytes name."""
    if head.startswith((ROSBAG, MCAP, SQLITE)):
        from closedrooms.mapping.logs.rosbag import read_bag

        run = read_bag(path, scan_topic=scan_topic, odometry_topic=odometry_topic)
    elif head.startswith(ZIP):
        from closedrooms.mapping.logs.npz import read_scans

        run = read_scans(path)
    elif is_folder(path):
        raise InvalidInputError("a folder", expected="a log file, or a rosbag 2 folder with metadata.yaml", where=path)
    else:
        from closedrooms.mapping.logs.carmen import read_carmen

        run = read_carmen(path, gzipped=head.startswith(GZIP))
    return run


def forward(stamps: FloatArray) -> tuple[FloatArray, int]:
    """Stamps [s] whose clock never runs backwards (a jump back counts as no time), and how often it did."""
    steps = np.diff(stamps, prepend=stamps[:1])
    back = steps < 0.0
    steps[back] = 0.0
    start = float(stamps[0]) if len(stamps) else 0.0
    return start + np.cumsum(steps), int(back.sum())
