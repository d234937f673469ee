"""Reads ROS maps, whoever wrote them; what is repaired or guessed becomes a remark."""

from pathlib import Path

import numpy as np
import numpy.typing as npt

from closedrooms.core.arrays import CellArray, handed_over
from closedrooms.core.errors import InvalidInputError
from closedrooms.core.files.rosmap.greys import (
    JPEG_SPREAD,
    PIXEL_UNKNOWN,
    GreyMeaning,
    read_meaning,
    remark_merged,
)
from closedrooms.core.files.rosmap.map_description import number, read_fields, read_origin
from closedrooms.core.files.rosmap.map_picture import is_jpeg, picture_path, read_picture
from closedrooms.core.files.rosmap.ros_map import RosMap
from closedrooms.core.grid import UNKNOWN, GridFrame, OccupancyGrid
from closedrooms.core.numbers import COARSEST, FINEST, bounded, repr_of
from closedrooms.core.pose import IDENTITY, Pose2
from closedrooms.core.remarks import Remark

# A picture is taken for inverted where less than this share of what is free, and more than half of what is occupied,
# is left when half the thickness of a thick wall [m] is taken off all around.
HALF_WALL, MOST_WIDE = 0.2, 0.1
# Less floor is no room [square metres].
SMALLEST_ROOM = 2.0
# Cells above this show no door of 0.9 m [m].
COARSE = 0.5


def read_map(path: Path, *, allow_outside: bool = False) -> OccupancyGrid:
    """Read a ROS map whose axes are those of the map frame: every map that this program writes of a building.

    Args:
        path: The YAML file.
        allow_outside: See :func:`read_ros_map`.

    Returns:
        The grid in the map frame.

    Raises:
        InvalidInputError: See :func:`read_ros_map`; a map with a yaw.
    """
    read = read_ros_map(path, allow_outside=allow_outside)
    if read.turned:
        raise InvalidInputError(f"map origin with yaw {read.map_T_grid.theta:.6g}", expected="yaw 0 here", where=path)
    return read.grid


def read_ros_map(path: Path, *, allow_outside: bool = False) -> RosMap:
    """Read a ROS map (map_server of ROS 1 and 2): PGM or PNG; trinary, scale or raw; with any yaw.

    In trinary maps, a grey value one off the usual unknown (205, of a negated map 50) still counts as unknown, whatever
    the thresholds are.

    Args:
        path: The YAML file.
        allow_outside: Open ``image:`` outside the YAML's folder too; see
            :func:`closedrooms.core.files.rosmap.map_picture.picture_path`.

    Raises:
        InvalidInputError: A missing or broken file, a number out of bounds, a picture that is too large.
    """
    remarks: list[Remark] = []
    fields = read_fields(path)
    resolution = bounded(number(fields, "resolution"), FINEST, COARSEST, name="map resolution", unit="m", where=path)
    x, y, yaw = read_origin(fields.get("origin"), path, remarks)
    mode = str(fields.get("mode") or "trinary").strip().lower()
    if mode not in {"trinary", "scale", "raw"}:
        raise InvalidInputError(f"map mode {repr_of(mode)}", expected="trinary, scale or raw", where=path)
    image, other = picture_path(str(fields["image"]), path, allow_outside=allow_outside)
    if other:
        why = f"{fields['image']} is not there or outside, the file of its name beside the YAML was read"
        remarks.append(Remark(action="guessed", what="picture", why=why, names=(image.name,)))
    lossy = mode == "trinary" and is_jpeg(image)
    if lossy:
        why = f"a JPEG spreads greys: up to {JPEG_SPREAD} from {PIXEL_UNKNOWN} counts as unknown"
        remarks.append(Remark(action="guessed", what="cells", why=why, names=(image.name,)))
    meaning = read_meaning(fields, mode, path)
    remarks += meaning.remark_assumed()
    # A turned grid keeps its own axes, with its corner as their origin.
    corner, map_T_grid = ((x, y), IDENTITY) if yaw == 0.0 else ((0.0, 0.0), Pose2(x, y, yaw))
    table = meaning.cells(spread=JPEG_SPREAD if lossy else 1)
    grid, counts = _grid(image, table, resolution, *corner)
    remarks += meaning.remark_odd(counts)
    if resolution > COARSE:
        why = f"{resolution:g} m a cell shows no door (centimetres?); taken as metres"
        remarks.append(Remark(action="guessed", what="resolution", why=why))
    remarks += remark_merged(counts, table)
    if 0 < counts.sum() < grid.cells.size and not grid.free.any():
        why = "no opaque pixel is free; transparent ones are unknown"
        remarks.append(Remark(action="guessed", what="cells", why=why))
    if _looks_inverted(grid):
        why = "what is free is as thin as walls, what is occupied is wide: an inverted picture (negate)?"
        remarks.append(Remark(action="guessed", what="cells", why=why))
    return RosMap(grid, map_T_grid, tuple(remarks))


def read_bare_picture(path: Path, *, resolution: float) -> OccupancyGrid:
    """Read the picture of a map that has no YAML, with the thresholds that ``write_map`` uses.

    Args:
        path: The picture.
        resolution: Metres a pixel; the lower left corner lies at the origin.

    Raises:
        InvalidInputError: See :func:`closedrooms.core.files.rosmap.map_picture.read_picture`.
    """
    return _grid(path, GreyMeaning().cells(), resolution, 0.0, 0.0)[0]


def _grid(
    picture: Path, table: CellArray, resolution: float, x: float, y: float
) -> tuple[OccupancyGrid, npt.NDArray[np.int64]]:
    """Make the grid that a picture holds when ``table`` gives the cell of each grey value, and count the greys.

    Returns:
        The grid, and how many opaque pixels have each grey, shape (256,).
    """
    import cv2

    pixels, opaque = read_picture(picture)
    mask = None if opaque is None else opaque.astype(np.uint8)
    counts = cv2.calcHist([pixels], [0], mask, [256], [0.0, 256.0]).ravel().astype(np.int64)
    # Ten times as quick as indexing the table, and in place where nobody else holds the picture.
    upwards = np.ascontiguousarray(pixels[::-1])
    own = upwards if upwards.flags.writeable else None
    cells: CellArray = cv2.LUT(upwards, table.view(np.uint8), dst=own).view(np.int8)
    if opaque is not None:
        cells[~opaque[::-1]] = UNKNOWN
    return OccupancyGrid(GridFrame(resolution, x, y, *pixels.shape), handed_over(cells)), counts


def _looks_inverted(grid: OccupancyGrid) -> bool:
    """Check whether a map shows free walls around occupied rooms."""
    import cv2

    if np.count_nonzero(grid.occupied) <= np.count_nonzero(grid.free):
        return False
    around = 2 * max(round(HALF_WALL / grid.frame.resolution), 1) + 1
    inside = np.ones((around, around), dtype=np.uint8)
    free, occupied = (int(cv2.erode(cells.astype(np.uint8), inside).sum()) for cells in (grid.free, grid.occupied))
    rooms = occupied * grid.frame.resolution**2 >= SMALLEST_ROOM and occupied > 0.5 * grid.occupied.sum()
    return bool(rooms and grid.free.any() and free < MOST_WIDE * grid.free.sum())
