"""What a bag may not say by itself."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class BagOptions:
    """Choice of topics and frames, and facts that a bag lacks; options of ``map``, which reads other logs too.

    Attributes:
        scan_topic: Topic of the scans, where it holds several.
        odometry_topic: Topic of the odometry, where it holds several.
        mount: ``robot_T_sensor`` of the lidar, ``(x, y, yaw)`` in metres and radians, where no transform says so.
        upside_down: Whether that lidar hangs with its z axis down.
    """

    scan_topic: str | None = None
    odometry_topic: str | None = None
    mount: tuple[float, float, float] | None = None
    upside_down: bool = False
