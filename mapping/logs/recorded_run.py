"""A recorded run: scans with odometry, from whatever file holds them."""

from dataclasses import dataclass

import numpy as np

from closedrooms.core.arrays import FloatArray, frozen
from closedrooms.core.errors import InvalidInputError
from closedrooms.core.numbers import FARTHEST
from closedrooms.core.remarks import Remark
from closedrooms.core.scan import LaserScan


@dataclass(frozen=True, slots=True, eq=False)
class RecordedRun:
    """Scans of a real (or simulated) robot in the order they were taken.

    Attributes:
        scans: The sweeps, stamps never running backwards.
        odometry: ``odom_T_robot`` at each scan, shape (n, 3), metres and radians; drifts. Zeros without odometry.
        reference: Better poses from elsewhere, shape (n, 3), or ``None``; never an input of the mapper.
        remarks: What was dropped, repaired or guessed on reading.
        has_odometry: Whether the motion was measured; else it has to be found from the scans alone.
    """

    scans: tuple[LaserScan, ...]
    odometry: FloatArray
    reference: FloatArray | None = None
    remarks: tuple[Remark, ...] = ()
    has_odometry: bool = True

    def __post_init__(self) -> None:
        object.__setattr__(self, "odometry", _poses(self.odometry, "odometry"))
        if self.reference is not None:
            object.__setattr__(self, "reference", _poses(self.reference, "reference poses"))


def _poses(poses: FloatArray, what: str) -> FloatArray:
    """Check poses as they are kept, shape (n, 3), none of them where no robot is."""
    poses = frozen(poses)
    # NaN compares as false.
    if not bool((np.abs(poses) <= FARTHEST).all()):
        raise InvalidInputError(f"{what} that are not finite or too far away", expected=f"at most {FARTHEST:g} m")
    return poses
