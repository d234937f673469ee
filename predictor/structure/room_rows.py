"""Whether a wall is the back of a row of rooms: what stands back from such a wall is seldom a door.

A row of rooms has its doors to the corridor. The walls at its other end lie in one line, of the building's outline or
of the next row of rooms, and there windows stand back as closed doors do. Of 54 places that looked like closed doors in
walls at which at least three rooms end (80 explored maps of ten floor plans of the use ``fit``), 3 were.
"""

import numpy as np

from closedrooms.core.arrays import BoolArray
from closedrooms.core.grid import OccupancyGrid, is_free, is_occupied
from closedrooms.predictor.structure.window_rows import WIDEST_CORRIDOR, Niche

# So many rooms make a row.
LEAST_IN_ROW = 3
# A wall is followed so far to either side [m], and the rooms of a row end this near to one line [m].
REACH, SHIFTED = 25.0, 0.5
# Free space of a room is looked for between these distances before the line [m], and so much of it is free at least.
BEFORE, FREE_SHARE = (0.6, 1.2), 0.6
# What parts two rooms is thinner than this along the wall [m], and closed so far into the room [m], in such a share.
THICKEST, DEEP, CLOSED_SHARE = 1.6, 1.4, 0.8
# What lies behind is asked for this far behind the line [m], and is unknown in such a share.
BEHIND, UNKNOWN_SHARE = (0.6, 1.4), 0.7
# A room of a row is so wide [m], its wall is seen over such a share of that, and over such a share nothing is known
# behind. What is wider, or less deep than a corridor is wide over more than such a share, is a corridor.
ROOM_WIDTH, SEEN_WALL, SEEN_HIDDEN, SHALLOW = (1.2, 15.0), 0.6, 0.5, 0.75


def count_rooms_in_row(grid: OccupancyGrid, niche: Niche) -> int:
    """Count the known rooms that end side by side at the line of the wall that a niche is in.

    Args:
        grid: The map.
        niche: In the wall; the room that it looks into is one of them.

    Returns:
        0 where it does not look into a room but into a corridor.
    """
    resolution = grid.frame.resolution
    along = np.array([niche.outward[1], -niche.outward[0]])
    s = np.arange(-round(REACH / resolution), round(REACH / resolution) + 1) * resolution
    t = np.arange(-BEHIND[1], WIDEST_CORRIDOR + resolution, resolution)
    cells = grid.frame.to_cells(niche.middle + s[:, None, None] * along + t[:, None] * niche.outward)
    inside = grid.frame.contains(cells)
    free, occupied = np.zeros((2, *inside.shape), dtype=np.bool_)
    values = grid.cells[cells[inside][:, 0], cells[inside][:, 1]]
    free[inside], occupied[inside] = is_free(values), is_occupied(values)

    def share(mask: BoolArray, low: float, high: float) -> BoolArray:
        return np.asarray(mask[:, (t >= low) & (t < high)].mean(axis=1))

    open_ = share(free, *BEFORE) >= FREE_SHARE
    parting = share(~free, BEFORE[0], DEEP) >= CLOSED_SHARE
    deep = free[:, (t >= BEFORE[0]) & (t < WIDEST_CORRIDOR)].all(axis=1)
    wall = share(occupied, -SHIFTED, SHIFTED) > 0.0
    hidden = share(~(free | occupied), -BEHIND[1], -BEHIND[0]) >= UNKNOWN_SHARE

    rooms = _rooms(open_, parting, resolution)
    middle = s.size // 2
    own = next((number for number, (low, high) in enumerate(rooms) if low <= middle < high), None)

    def ends_here(number: int) -> bool:
        low, high = rooms[number]
        width = (high - low) * resolution
        if not ROOM_WIDTH[0] <= width <= ROOM_WIDTH[1]:
            return False
        return number == own or (wall[low:high].mean() >= SEEN_WALL and hidden[low:high].mean() >= SEEN_HIDDEN)

    if own is None or not ends_here(own) or deep[slice(*rooms[own])].mean() < 1.0 - SHALLOW:
        return 0
    count = 1
    for step, last in ((-1, -1), (1, len(rooms))):
        for number in range(own + step, last, step):
            low, high = sorted((number, number - step))
            near = (rooms[high][0] - rooms[low][1]) * resolution <= THICKEST
            if not (near and ends_here(number)):
                break
            count += 1
    return count


def _rooms(open_: BoolArray, parting: BoolArray, resolution: float) -> list[tuple[int, int]]:
    """Find the stretches of open columns; columns that are closed, but part nothing, belong to them."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], open_, [False])).astype(np.int8)))
    rooms: list[tuple[int, int]] = []
    for low, high in edges.reshape(-1, 2).tolist():
        if rooms and (low - rooms[-1][1]) * resolution <= THICKEST and not parting[rooms[-1][1] : low].any():
            rooms[-1] = (rooms[-1][0], high)
        else:
            rooms.append((low, high))
    return rooms
