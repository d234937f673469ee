"""Recorded runs of robots; ``reader`` tells the formats apart.

- ROS bags: ``bags/`` reads and writes them; doors that a person clicked too.
- CARMEN logs: ``carmen``, ``carmen_lines``, ``carmen_odometry``.
- NumPy archives: ``npz``.
- All of them: ``clocks``, ``recorded_odometry``, ``odometry_units``, ``stated_view``, ``recorded_run``.
"""

from typing import TYPE_CHECKING

from closedrooms.core.runtime.lazy import lazy_face

if TYPE_CHECKING:
    from closedrooms.mapping.logs.reader import read_run as read_run
    from closedrooms.mapping.logs.recorded_run import RecordedRun as RecordedRun

__getattr__, __dir__, __all__ = lazy_face(
    __name__,
    {
        "reader": ("read_run",),
        "recorded_run": ("RecordedRun",),
    },
)
