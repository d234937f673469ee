"""Rooms of ``paper`` that no building has: narrower than a door, endless strips, larger than all that the map shows."""

from collections.abc import Sequence

import numpy as np
import shapely

from closedrooms.core.grid import OccupancyGrid
from closedrooms.core.room import Room
from closedrooms.core.shapes import Shape

# A door's leaf passes no narrower place [m].
NARROWEST = 0.6
# No room is longer than this (as of ``best``) [m] and so many times as long as wide: of 3,154 true rooms of ``fit`` and
# ``choose`` none. Shorter strips are found in buildings.
LONGEST, STRIP = 24.0, 4.0
# A hall may be larger than all that was explored so far, up to this [m2].
HALL = 100.0


def leave_absurd(rooms: Sequence[Room], grid: OccupancyGrid) -> tuple[list[Room], dict[str, str]]:
    """Leave out rooms that are none.

    Args:
        rooms: As predicted.
        grid: What is known of the map.

    Returns:
        The others in their order, and what is wrong with the room behind each door that has none now, by its id.
    """
    floor = float(grid.free.sum()) * grid.frame.resolution**2
    flaws = [_find_flaw(room.polygon, floor) for room in rooms]
    kept = [room for room, flaw in zip(rooms, flaws, strict=True) if flaw is None]
    return kept, {
        door: flaw for room, flaw in zip(rooms, flaws, strict=True) if flaw is not None for door in room.doors
    }


def _find_flaw(shape: Shape, floor: float) -> str | None:
    """Say why a shape is no room where the map shows so much floor [m2]; ``None`` for a room."""
    if shape.buffer(-NARROWEST / 2).is_empty:
        return f"its room would be less than {NARROWEST:g} m wide"
    corners = shapely.get_coordinates(shapely.minimum_rotated_rectangle(shape))
    width, length = sorted(float(np.hypot(*side)) for side in np.diff(corners[:3], axis=0))
    if length > LONGEST and length > STRIP * width:
        return f"its room would be a strip of {length:.0f} x {width:.1f} m"
    if shape.area > max(floor, HALL):
        return f"its room of {shape.area:.0f} m2 would be larger than all floor of the map"
    return None
