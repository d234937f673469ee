"""Options of ``closedrooms map``."""

from dataclasses import dataclass, field
from pathlib import Path

import tyro

from closedrooms.mapping.config import MapperConfig


@dataclass(frozen=True, kw_only=True)
class MapConfig:
    """Options of ``closedrooms map``."""

    log: tyro.conf.Positional[Path]
    """A recorded run: CARMEN log (also gzipped), rosbag or MCAP, or ``scans.npz`` of a run."""

    out: Path
    """Folder to write."""

    record: bool = True
    """Write the recording ``run.rrd`` for the rerun viewer."""

    scan_topic: str | None = None
    """Topic of the laser scans, where a bag holds several."""

    odometry_topic: str | None = None
    """Topic of the odometry, where a bag holds several; or of the transforms that hold it."""

    mount: tuple[float, float, float] | None = None
    """Where the lidar sits on the robot: x, y [m] and yaw [rad]; of a bag, in place of its transforms."""

    upside_down: bool = False
    """The lidar hangs with its z axis down; of a bag, in place of its transforms."""

    mapper: MapperConfig = field(default_factory=MapperConfig)
    """The mapper."""
