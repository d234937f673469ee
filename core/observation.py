"""What a robot gets to know at one instant: nothing else may decide what it does."""

from dataclasses import dataclass

from closedrooms.core.door import DoorSighting
from closedrooms.core.pose import Pose2
from closedrooms.core.scan import LaserScan


@dataclass(frozen=True, slots=True, eq=False)
class Observation:
    """One sweep, the odometry at that time and the closed doors it hit.

    The true pose is not part of it: a simulation tells it to whoever keeps the truth, beside the observation.

    Attributes:
        scan: The sweep as measured; its stamp is the observation's.
        odometry: ``odom_T_robot`` as accumulated by the odometry; the identity at the start of a run.
        sightings: Closed doors that a ray of this sweep hit, robot frame.
        bumps: Directions from which something pressed against the robot since the last observation, robot frame [rad].
    """

    scan: LaserScan
    odometry: Pose2
    sightings: tuple[DoorSighting, ...] = ()
    bumps: tuple[float, ...] = ()

    @property
    def stamp(self) -> float:
        """Time since the start of the run [s]."""
        return self.scan.stamp
