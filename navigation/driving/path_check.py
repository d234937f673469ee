"""Whether a path that was planned a while ago can still be driven on the map as it is now."""

import numpy as np

from closedrooms.core.arrays import FloatArray
from closedrooms.core.grid import OccupancyGrid
from closedrooms.navigation.config import RobotNavigation
from closedrooms.navigation.driving.costmap import clearance_field


def fits_along(grid: OccupancyGrid, points: FloatArray, config: RobotNavigation) -> bool:
    """Check whether the robot still fits at all points of a path.

    Args:
        grid: The map as known now; what is unknown counts as free.
        points: The path ahead, from the robot on, shape (n, 2) [m].
        config: The robot.
    """
    if len(points) < 2:
        return True
    margin = config.required_clearance + 2.0 * grid.frame.resolution
    cells = grid.frame.to_cells(np.vstack((points.min(axis=0) - margin, points.max(axis=0) + margin)))
    (r0, c0), (r1, c1) = cells
    window = grid.on(grid.frame.cropped(int(r0), int(c0), int(r1 - r0 + 1), int(c1 - c0 + 1)))
    blocked = window.occupied.astype(np.uint8)
    field = clearance_field(np.ones_like(blocked), blocked, grid.frame.resolution)
    at = window.frame.to_cells(points)
    # Half a cell of tolerance: walls thicken a little as they are seen again.
    needed = config.robot.radius - 0.5 * grid.frame.resolution
    # The robot's own place is not judged: it is there.
    away = np.hypot(*(points - points[0]).T) > config.required_clearance
    return bool((field[at[:, 0], at[:, 1]] >= needed)[away].all())
