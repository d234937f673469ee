"""Maps as ROS map_server keeps them: a YAML beside a picture."""

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import shapely
from shapely.geometry.base import BaseGeometry

from closedrooms.core.arrays import CellArray, handed_over
from closedrooms.core.door import ClosedDoor
from closedrooms.core.errors import InvalidInputError
from closedrooms.core.files.map_picture import is_jpeg, picture_path, read_picture
from closedrooms.core.files.outgoing import write_bytes
from closedrooms.core.files.yaml_text import parse_yaml
from closedrooms.core.grid import FREE, OCCUPIED, UNKNOWN, GridFrame, OccupancyGrid, is_free, is_occupied
from closedrooms.core.numbers import COARSEST, FARTHEST, FINEST, bounded, repr_of
from closedrooms.core.pose import IDENTITY, Pose2, wrap_angle
from closedrooms.core.remarks import Remark
from closedrooms.core.room import Room

# 205 is p = 0.196078: a free_thresh of 0.196 keeps it unknown, 0.25 would reload it as free.
FREE_THRESH, OCCUPIED_THRESH = 0.196, 0.65
PIXEL_FREE, PIXEL_UNKNOWN, PIXEL_OCCUPIED = 254, 205, 0
# Greys so far apart, each of so large a share of a picture, mean different things to whoever drew it.
APART, MOST_RARE = 16, 0.05
# Greys of a JPEG that are as far from the usual unknown still mean it: of plans saved at quality 50 and above.
SPREAD = 24
# Half the thickness of a thick wall [m], and share of the cells of one kind further inside it from which they are none.
HALF_WALL, MOST_WIDE = 0.2, 0.1
# Less floor is no room [square metres].
SMALLEST_ROOM = 2.0
# Cells above this show no door of 0.9 m [m].
COARSE = 0.5
# No yaw in radians is larger, but one in degrees is.
LARGEST_YAW = 2.0 * math.pi + 0.1
WHAT = "a ROS map (image, resolution, origin)"
MAX_YAML = 1_000_000
"""Longest description of a map that is read [bytes]."""
SAME_YAW = 1e-9
"""A turn below this is none [rad]: 1 km away it moves a point by a micrometre."""


@dataclass(frozen=True, slots=True, eq=False)
class RosMap:
    """A map as read from a ROS map's files, whoever wrote them.

    The grid keeps the axes of its picture. Everything that the program works out lies in the frame of the grid, and is
    brought to the map frame where it is written.

    Attributes:
        grid: The cells.
        map_T_grid: Where the grid's frame lies in the map frame; the identity where the map's origin has no yaw, the
            grid's origin is then the map's.
        remarks: What was repaired or guessed.
    """

    grid: OccupancyGrid
    map_T_grid: Pose2 = IDENTITY
    remarks: tuple[Remark, ...] = ()

    @property
    def turned(self) -> bool:
        """Whether grid and map have different axes."""
        return self.map_T_grid != IDENTITY

    def doors_on_grid(self, doors: Iterable[ClosedDoor]) -> list[ClosedDoor]:
        """Move doors of the map frame to the frame of the grid."""
        grid_T_map = self.map_T_grid.inverse()
        return [door.moved(grid_T_map) for door in doors] if self.turned else list(doors)

    def rooms_on_map(self, rooms: Iterable[Room]) -> list[Room]:
        """Move rooms of the grid's frame to the map frame."""
        if not self.turned:
            return list(rooms)
        return [
            replace(
                room,
                polygon=self.on_map(room.polygon),
                alternatives=tuple(replace(o, polygon=self.on_map(o.polygon)) for o in room.alternatives),
            )
            for room in rooms
        ]

    def on_map(self, geometry: BaseGeometry) -> Any:
        """Move a geometry of the grid's frame to the map frame."""
        return shapely.transform(geometry, self.map_T_grid.transform) if self.turned else geometry


def write_map(stem: Path, grid: OccupancyGrid, *, map_T_grid: Pose2 = IDENTITY) -> None:
    """Write ``<stem>.png`` and ``<stem>.yaml``, trinary (0.65 / 0.196), each whole or not at all.

    Args:
        stem: Path without suffix, e.g. ``out/map``.
        grid: Written with row 0 at the bottom of the picture.
        map_T_grid: Where the grid's frame lies in the map frame; its angle is the yaw of the map's origin.

    Raises:
        OutputError: The folder cannot be written.
    """
    values = np.arange(256).astype(np.uint8).view(np.int8)  # every cell value, at its place as a byte without sign
    shades = np.full(256, PIXEL_UNKNOWN, dtype=np.uint8)
    shades[is_free(values)] = PIXEL_FREE
    shades[is_occupied(values)] = PIXEL_OCCUPIED
    _write(stem, grid, shades, "trinary", map_T_grid)


def write_raw_map(stem: Path, grid: OccupancyGrid, *, map_T_grid: Pose2 = IDENTITY) -> None:
    """Write ``<stem>.png`` and ``<stem>.yaml`` in the mode ``raw``: values 0 to 100 as they are, 255 for -1.

    Args:
        stem: Path without suffix.
        grid: Written with row 0 at the bottom of the picture.
        map_T_grid: Where the grid's frame lies in the map frame.

    Raises:
        OutputError: The folder cannot be written.
    """
    _write(stem, grid, None, "raw", map_T_grid)


def _write(stem: Path, grid: OccupancyGrid, shades: npt.NDArray[np.uint8] | None, mode: str, map_T_grid: Pose2) -> None:
    """Write the picture, whose greys are the ``shades`` of the cells' bytes or these themselves, and the YAML."""
    import cv2

    frame, picture = grid.frame, stem.with_name(stem.name + ".png")
    pixels = grid.cells[::-1].view(np.uint8).copy()
    if shades is not None:
        cv2.LUT(pixels, shades, dst=pixels)
    # Runs of one grey are what a map is made of.
    settings = [cv2.IMWRITE_PNG_COMPRESSION, 1, cv2.IMWRITE_PNG_STRATEGY, cv2.IMWRITE_PNG_STRATEGY_RLE]
    settings += [cv2.IMWRITE_PNG_FILTER, cv2.IMWRITE_PNG_FILTER_NONE]
    write_bytes(picture, cv2.imencode(".png", pixels, settings)[1].tobytes())
    x, y, yaw = frame.origin_x, frame.origin_y, 0.0
    if map_T_grid != IDENTITY:
        x, y, yaw = (map_T_grid @ Pose2(x, y)).as_tuple()
    text = (
        f"image: {picture.name}\n"
        f"mode: {mode}\n"
        f"resolution: {round(frame.resolution, 9)!r}\n"
        f"origin: [{round(x, 9)!r}, {round(y, 9)!r}, {round(yaw, 12)!r}]\n"
        "negate: 0\n"
        f"occupied_thresh: {OCCUPIED_THRESH}\n"
        f"free_thresh: {FREE_THRESH}\n"
    )
    write_bytes(stem.with_name(stem.name + ".yaml"), text.encode())


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
            :func:`closedrooms.core.files.map_picture.picture_path`.

    Raises:
        InvalidInputError: A missing or broken file, a number out of bounds, a picture that is too large.
    """
    remarks: list[Remark] = []
    fields = _read_fields(path)
    resolution = bounded(_number(fields, "resolution"), FINEST, COARSEST, name="map resolution", unit="m", where=path)
    x, y, yaw = _origin(fields.get("origin"), path, remarks)
    mode = str(fields.get("mode") or "trinary").strip().lower()
    if mode not in {"trinary", "scale", "raw"}:
        raise InvalidInputError(f"map mode {repr_of(mode)}", expected="trinary, scale or raw", where=path)
    image, other = picture_path(str(fields["image"]), path, allow_outside=allow_outside)
    if other:
        why = f"{fields['image']} is not there or outside, the file of its name beside the YAML was read"
        remarks.append(Remark(action="guessed", what="picture", why=why, names=(image.name,)))
    lossy = mode == "trinary" and is_jpeg(image)
    if lossy:
        why = f"a JPEG spreads greys: up to {SPREAD} from {PIXEL_UNKNOWN} counts as unknown"
        remarks.append(Remark(action="guessed", what="cells", why=why, names=(image.name,)))
    table = _raw() if mode == "raw" else _meanings(fields, mode, path, spread=SPREAD if lossy else 1)
    remarks += _unsaid(fields, mode, path)
    # A turned grid keeps its own axes, with its corner as their origin.
    corner, map_T_grid = ((x, y), IDENTITY) if yaw == 0.0 else ((0.0, 0.0), Pose2(x, y, yaw))
    grid, counts = _grid(image, table, resolution, *corner)
    remarks += _odd_greys(counts, fields, mode, path)
    if resolution > COARSE:
        why = f"{resolution:g} m a cell shows no door (centimetres?); taken as metres"
        remarks.append(Remark(action="guessed", what="resolution", why=why))
    remarks += _merged_greys(counts, table)
    if 0 < counts.sum() < grid.cells.size and not grid.free.any():
        why = "no opaque pixel is free; transparent ones are unknown"
        remarks.append(Remark(action="guessed", what="cells", why=why))
    if _looks_inverted(grid):
        why = "what is free is as thin as walls, what is occupied is wide: an inverted picture (negate)?"
        remarks.append(Remark(action="guessed", what="cells", why=why))
    return RosMap(grid, map_T_grid, tuple(remarks))


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


def read_bare_picture(path: Path, *, resolution: float) -> OccupancyGrid:
    """Read the picture of a map that has no YAML, with the thresholds that :func:`write_map` uses.

    Args:
        path: The picture.
        resolution: Metres a pixel; the lower left corner lies at the origin.

    Raises:
        InvalidInputError: See :func:`closedrooms.core.files.map_picture.read_picture`.
    """
    return _grid(path, _meanings({}, "trinary", path), resolution, 0.0, 0.0)[0]


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


def _odd_greys(counts: npt.NDArray[np.int64], fields: dict[str, Any], mode: str, path: Path) -> list[Remark]:
    """Say where greys are taken for something else than other programs take them for.

    Args:
        counts: Pixels of each grey, shape (256,).
        fields: Of the YAML.
        mode: As it stands there.
        path: Of the YAML.
    """
    if mode == "raw":
        strange = int(counts[OCCUPIED + 1 : 255].sum())
        why = f"greys from {OCCUPIED + 1} to 254 mean nothing in the mode raw (trinary?); unknown"
        return [Remark(action="dropped", what="cells", why=why, count=strange, loss=True)] if strange else []
    unknown = 255 - PIXEL_UNKNOWN if _negate(fields.get("negate", "0"), path) else PIXEL_UNKNOWN
    count, free_below = int(counts[unknown]), _thresholds(fields, path)[0]
    if not count:
        return []
    if mode == "scale":
        why = f"{unknown}, unknown in the mode trinary, is nearly free in the mode scale; taken so"
        return [Remark(action="guessed", what="cells", why=why, count=count)]
    if free_below <= (255 - PIXEL_UNKNOWN) / 255:
        return []
    why = f"{unknown} means unknown, though free_thresh {free_below:g} makes it free"
    return [Remark(action="guessed", what="cells", why=why, count=count)]


def _merged_greys(counts: npt.NDArray[np.int64], table: CellArray) -> list[Remark]:
    """Say where two greys that somebody told apart are both free, or both occupied: unknown space of another program.

    Args:
        counts: Opaque pixels of each grey, shape (256,).
        table: The cell of each grey, shape (256,).
    """
    frequent = counts >= max(MOST_RARE * counts.sum(), 1)
    told = []
    for cell, name in ((FREE, "free"), (OCCUPIED, "occupied")):
        greys = np.flatnonzero(frequent & (table == cell))
        if greys.size and greys[-1] - greys[0] >= APART:
            why = f"greys {', '.join(map(str, greys))} are all {name} by the thresholds (is one of them unknown?)"
            told.append(Remark(action="guessed", what="cells", why=why, count=int(counts[greys].sum())))
    return told


def _read_fields(path: Path) -> dict[str, Any]:
    """Read every scalar as the text that stands there: map_server's reader (yaml-cpp) has other rules than PyYAML."""
    # Read by the safe loader first: what it refuses is broken, and was never a map that somebody used.
    parse_yaml(path, what=WHAT, max_bytes=MAX_YAML)
    fields = parse_yaml(path, what=WHAT, max_bytes=MAX_YAML, plain=True)
    if not isinstance(fields.get("image"), str):
        raise InvalidInputError("a YAML without 'image'", expected=WHAT, where=path)
    return fields


def _as_number(text: object) -> float | None:
    """Parse a number as yaml-cpp does (``5e-2``, ``-5e-05``, ``.5``, ``.nan``, quoted or not), ``None`` for none."""
    if not isinstance(text, str) or "_" in text:
        return None
    word = text.strip().lower()
    try:
        return float(word.replace(".", "") if word.lstrip("+-") in {".nan", ".inf"} else word)
    except ValueError:
        return None


def _number(fields: dict[str, Any], key: str, default: float | None = None) -> Any:
    """Parse the number that a field holds, else keep what stands there, for the message."""
    if key not in fields:
        return default
    value = _as_number(fields[key])
    return fields[key] if value is None else value


def _origin(value: Any, path: Path, remarks: list[Remark]) -> tuple[float, float, float]:
    """Read ``x, y`` [m] and yaw [rad] of the map's lower left corner; a whole turn, and no number, are no yaw."""
    numbers = [_as_number(v) for v in value] if isinstance(value, list) else []
    if len(numbers) not in {2, 3} or None in numbers:
        raise InvalidInputError(
            f"map origin {repr_of(value)}", expected="[x, y, yaw] in metres and radians", where=path
        )
    x, y, yaw = (float(v) for v in (*numbers, 0.0)[:3] if v is not None)
    for name, coordinate in (("x", x), ("y", y)):
        bounded(coordinate, -FARTHEST, FARTHEST, name=f"map origin {name}", unit="m", where=path)
    if len(numbers) == 2 or math.isnan(yaw):
        remarks.append(Remark(action="guessed", what="yaw of the map", why="no number in the file, 0 was taken"))
        return x, y, 0.0
    turned = wrap_angle(bounded(yaw, -1e6, 1e6, name="map origin yaw", unit="rad", where=path))
    turned = turned if abs(turned) > SAME_YAW else 0.0
    if abs(yaw) > LARGEST_YAW and turned:
        why = f"{yaw:g} is more than a turn (degrees?); read as radians, as map_server does"
        remarks.append(Remark(action="guessed", what="yaw of the map", why=why))
    return x, y, turned


def _raw() -> CellArray:
    """Map grey values to cells in the mode ``raw``: the occupancy in percent, unknown above 100."""
    levels = np.arange(256)
    return np.where(levels <= OCCUPIED, levels, UNKNOWN).astype(np.int8)


def _meanings(fields: dict[str, Any], mode: str, path: Path, spread: int = 1) -> CellArray:
    """Find the cell that each grey value stands for, shape (256,); so near to the usual unknown it stays unknown."""
    negate = _negate(fields.get("negate", "0"), path)
    free_below, occupied_above = _thresholds(fields, path)
    levels = np.arange(256)
    p = (levels if negate else 255 - levels) / 255.0
    table = np.full(256, UNKNOWN, dtype=np.int8)
    if mode == "scale":
        between = (p - free_below) / max(occupied_above - free_below, 1e-9) * 98.0 + 1.0
        table = np.clip(np.rint(between), 1, 99).astype(np.int8)
    table[p > occupied_above] = OCCUPIED
    table[p < free_below] = FREE
    if mode == "trinary":
        # Others write 204 or 206 for unknown, or a free_thresh (0.25) that turns 205 into free.
        unknown = 255 - PIXEL_UNKNOWN if negate else PIXEL_UNKNOWN
        table[unknown - spread : unknown + spread + 1] = UNKNOWN
    return table


def _negate(value: Any, path: Path) -> bool:
    """Read ``negate``, as a number or a word."""
    words = {"0": False, "1": True, "false": False, "true": True, "no": False, "yes": True}
    negate = words.get(value.strip().lower()) if isinstance(value, str) else None
    if negate is None:
        raise InvalidInputError(f"map negate {repr_of(value)}", expected="0 or 1", where=path)
    return negate


def _unsaid(fields: dict[str, Any], mode: str, path: Path) -> list[Remark]:
    """Say which meanings of greys a file leaves open, and what was taken."""
    if mode == "raw":
        return []
    free_below, occupied_above = _thresholds(fields, path)
    taken = {"negate": "0", "free_thresh": f"{free_below:g}", "occupied_thresh": f"{occupied_above:g}"}
    missing = {name: value for name, value in taken.items() if name not in fields}
    if not missing:
        return []
    why = f"not in the file; taken: {', '.join(f'{name} {value}' for name, value in missing.items())}"
    return [Remark(action="guessed", what="meaning of greys", why=why)]


def _thresholds(fields: dict[str, Any], path: Path) -> tuple[float, float]:
    """Read the thresholds: free below the first, occupied above the second; a missing one stays clear of the other."""
    given = {
        key: bounded(_number(fields, key), 0.0, 1.0, name=f"map {key}", where=path)
        for key in ("free_thresh", "occupied_thresh")
        if key in fields
    }
    occupied_above = given.get("occupied_thresh", max(OCCUPIED_THRESH, given.get("free_thresh", 0.0)))
    free_below = given.get("free_thresh", min(FREE_THRESH, occupied_above))
    if free_below > occupied_above:
        raise InvalidInputError(
            f"map thresholds free {free_below}, occupied {occupied_above}",
            expected="0 <= free <= occupied <= 1",
            where=path,
        )
    return free_below, occupied_above
