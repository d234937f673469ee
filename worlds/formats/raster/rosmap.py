"""A ROS map, or the picture of one, as a plan: walls around its free space, doors from a GeoJSON list."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from closedrooms.core.errors import InvalidInputError
from closedrooms.core.files.geojson import read_doors
from closedrooms.core.files.incoming import is_file
from closedrooms.core.files.rosmap import RosMap, read_bare_picture, read_ros_map
from closedrooms.core.grid import UNKNOWN, GridFrame, OccupancyGrid
from closedrooms.core.pose import Pose2
from closedrooms.core.remarks import Remark
from closedrooms.worlds.door_hinges import hung
from closedrooms.worlds.formats.import_checks import Source, settle
from closedrooms.worlds.formats.raster.raster_rooms import find_rooms_and_doors, mark_gaps
from closedrooms.worlds.formats.raster.raster_walls import check_pieces, trace_walls
from closedrooms.worlds.geometry import wall_axes
from closedrooms.worlds.plan import FloorPlan, Wall
from closedrooms.worlds.truth import rasterise

# A picture without a YAML beside it has this resolution [m].
RESOLUTION = 0.05
# Cells smaller than this make no wall that a plan can hold [m].
FINEST = 0.01
# Maps with more cells make no plan of usable size.
MAX_CELLS = 60_000_000


def read_raster(path: str | Path, doors_path: Path | None = None) -> FloorPlan:
    """Read a map as a plan in the map's own frame; what was guessed stands in its ``remarks``.

    Rooms are the connected free areas once all doors are shut, cell by cell. Every occupied cell is wall, however
    thin; so is every other cell that touches free space, since a robot must not leave what is known.
    Of a map with a yaw, the plan keeps the picture's axes.

    Args:
        path: The YAML of a ROS map, or a picture: with a YAML of its name beside it, else at 0.05 m a pixel.
        doors_path: GeoJSON of doors in the map frame; ``None`` looks for ``<name>.doors.geojson``, then
            ``doors.geojson``, beside the map.

    Raises:
        InvalidInputError: A broken map or list, cells too small or too many, no free area.
    """
    path = Path(path)
    read = _map(path)
    remarks = list(read.remarks)
    grid = _bordered(_checked(read.grid, path))
    listed = _doors_beside(path) if doors_path is None else doors_path
    given = read.doors_on_grid(read_doors(listed, remarks=remarks)) if listed is not None else []
    if listed is None:
        why = "no list of doors beside the map: a plan without doors"
        remarks.append(Remark(action="guessed", what="doors", why=why))
    if read.turned:
        why = "the plan keeps the axes of the picture, the map's origin has a yaw"
        remarks.append(Remark(action="repaired", what="axes", why=why))
    check_pieces(grid, path)
    rooms, doors, frames, beside_doors = find_rooms_and_doors(grid, given, remarks)
    if not rooms:
        raise InvalidInputError("a plan without rooms", expected="free areas in the map", where=path)
    walls = [*trace_walls(grid, beside_doors, path, remarks), *frames]
    plan = FloorPlan(
        path.stem,
        tuple(rooms),
        tuple(Wall(f"w{number:04d}", segment, thickness) for number, (segment, thickness) in enumerate(walls)),
        hung(doors, (), rooms),
        meta={"source": path.name, "format": "rosmap"},
    )
    plan = settle(plan, remarks, Source(doors=len(given), door_widths=[door.width for door in doors]), path)
    return replace(plan, remarks=(*plan.remarks, *_differences(plan, grid)))


def _checked(grid: OccupancyGrid, path: Path) -> OccupancyGrid:
    """Refuse a map that is too large or too fine to become a plan."""
    frame = grid.frame
    if frame.rows * frame.cols > MAX_CELLS:
        raise InvalidInputError(
            f"a map of {frame.rows} x {frame.cols} cells", expected=f"at most {MAX_CELLS}", where=path
        )
    if frame.resolution < FINEST:
        raise InvalidInputError(
            f"a map with cells of {frame.resolution:g} m", expected=f"at least {FINEST} m for a world", where=path
        )
    return grid


def _bordered(grid: OccupancyGrid) -> OccupancyGrid:
    """Put a ring of unknown cells around the map: free space at its edge ends there."""
    frame = grid.frame
    around = GridFrame(
        frame.resolution,
        frame.origin_x - frame.resolution,
        frame.origin_y - frame.resolution,
        frame.rows + 2,
        frame.cols + 2,
    )
    return OccupancyGrid(around, np.pad(grid.cells, 1, constant_values=UNKNOWN))


def _map(path: Path) -> RosMap:
    """Read a map by its YAML, or a picture: with the YAML of its name beside it, else alone."""
    if path.suffix.lower() in {".yaml", ".yml"}:
        return read_ros_map(path)
    for suffix in (".yaml", ".yml"):
        beside = path.with_suffix(suffix)
        if is_file(beside):
            return read_ros_map(beside)
    why = f"no YAML of a map beside the picture: {RESOLUTION} m a pixel"
    remark = Remark(action="guessed", what="resolution", why=why)
    return RosMap(read_bare_picture(path, resolution=RESOLUTION), remarks=(remark,))


def _doors_beside(path: Path) -> Path | None:
    """Find the file of doors beside a map: of its own name, or ``doors.geojson``."""
    options = (path.with_name(f"{path.stem}.doors.geojson"), path.with_name("doors.geojson"))
    return next((option for option in options if is_file(option)), None)


def _differences(plan: FloorPlan, grid: OccupancyGrid) -> list[Remark]:
    """Count cells of the map that the plan's true map shows otherwise, but in doorways."""
    true = rasterise(plan, grid.frame, Pose2())
    found = []
    lines = wall_axes(plan)
    passed = mark_gaps([(door.segment, lines.thickness(door.segment) or 0.0) for door in plan.doors], grid.frame)
    for what, mask in (
        ("occupied cells", grid.occupied & ~true.occupied & ~passed),
        ("free cells", grid.free & true.occupied),
    ):
        if mask.any():
            why = "free in the plan" if what == "occupied cells" else "wall in the plan, beside the jambs of doors"
            loss = what == "occupied cells"
            found.append(Remark(action="repaired", what=what, why=why, count=int(mask.sum()), loss=loss))
    return found
