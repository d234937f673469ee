"""What the robot gets to know at one instant."""

from dataclasses import dataclass

from closedrooms.core.door import DoorSighting
from closedrooms.core.pose import Pose2
from closedrooms.core.scan import LaserScan


@dataclass(frozen=True, slots=True, eq=False)
class Observation:
    """One sweep, the odometry at that time and the closed doors it hit.

    Attributes:
        scan: The sweep, with the lidar's noise.
        odometry: ``odom_T_robot`` as accumulated by the odometry; the identity at the start of a run.
        sightings: Closed doors that a ray of this sweep hit, robot frame.
        map_T_robot_true: The true pose, for truth and for pictures; never for an estimate.
        stamp: Time since the start of the run [s].
    """

    scan: LaserScan
    odometry: Pose2
    sightings: tuple[DoorSighting, ...]
    map_T_robot_true: Pose2
    stamp: float
