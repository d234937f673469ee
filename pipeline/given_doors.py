"""The closed doors that a person gives: GeoJSON, or points clicked in RViz."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import shapely

from closedrooms.core.door import ClosedDoor
from closedrooms.core.files.geojson import read_doors
from closedrooms.core.files.rosmap import RosMap
from closedrooms.core.grid import is_free
from closedrooms.core.remarks import Remark

# A closed door parts free space from walls or unknown space: its middle is nearer to these than this [m].
OFF_WALL = 0.5


def given_doors(path: Path, remarks: list[Remark]) -> list[ClosedDoor]:
    """Read closed doors from GeoJSON or from a bag of geometry_msgs/PointStamped, in the map frame.

    Args:
        path: The file, or the folder of a rosbag 2.
        remarks: Told what was left out or named here.

    Raises:
        InvalidInputError: See :func:`closedrooms.core.files.geojson.read_doors`,
            :func:`closedrooms.mapping.logs.bags.clicked_points.read_clicked_points`.
    """
    from closedrooms.mapping.logs.bags.clicked_points import is_bag, read_clicked_points

    return read_clicked_points(path, remarks=remarks) if is_bag(path) else read_doors(path, remarks=remarks)


def misplaced_doors(read: RosMap, doors: Sequence[ClosedDoor]) -> list[Remark]:
    """Say which doors lie beside the map, or in the middle of free space: pixels, degrees, swapped axes.

    Args:
        read: The map.
        doors: In the frame of its grid.
    """
    outside, off = [], {}
    for door in doors:
        distance = _distance_to_edge(read, door)
        if distance is None:
            outside.append(door.id)
        elif distance > OFF_WALL:
            off[door.id] = distance
    told = []
    if outside:
        frame = read.grid.frame
        width, height = frame.cols * frame.resolution, frame.rows * frame.resolution
        area = shapely.box(frame.origin_x, frame.origin_y, frame.origin_x + width, frame.origin_y + height)
        x0, y0, x1, y1 = read.on_map(area).bounds
        why = f"outside the map, whose x is {x0:.6g} to {x1:.6g} m and y {y0:.6g} to {y1:.6g} m (pixels? degrees?)"
        told.append(Remark(action="guessed", what="places of doors", why=why, names=tuple(outside), count=len(outside)))
    if off:
        why = f"up to {max(off.values()):.1f} m from any wall or unknown space; taken to be in what is nearest"
        told.append(Remark(action="guessed", what="places of doors", why=why, names=tuple(off), count=len(off)))
    return told


def _distance_to_edge(read: RosMap, door: ClosedDoor) -> float | None:
    """Measure how far the middle of a door is from any cell that is not free [m]; ``None`` outside the grid."""
    grid = read.grid
    middle = np.array(door.midpoint)
    row, col = (int(v) for v in grid.frame.to_cells(middle))
    if not grid.frame.contains(np.array([row, col])):
        return None
    # Twice as far is as good as any farther.
    reach = int(np.ceil(4 * OFF_WALL / grid.frame.resolution))
    low = max(row - reach, 0), max(col - reach, 0)
    near = grid.cells[low[0] : row + reach + 1, low[1] : col + reach + 1]
    cells = np.argwhere(~is_free(near)) + low
    if not len(cells):
        return 4 * OFF_WALL
    return float(np.hypot(*(grid.frame.to_points(cells) - middle).T).min())
