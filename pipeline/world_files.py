"""What the command line's ``closedrooms worlds`` does, as plain functions."""

from collections.abc import Callable
from pathlib import Path

from closedrooms.core.errors import InvalidInputError, OutputError
from closedrooms.worlds.library import DEFAULT_WORLD, PLANS, bundled_names, load_world, read_world
from closedrooms.worlds.plan import FloorPlan

# Resolution of maps written by ``convert`` [m].
MAP_RESOLUTION = 0.05


def list_worlds() -> list[str]:
    """One line a bundled world, its name first."""
    import shapely

    from closedrooms.worlds.closing import closable_rooms
    from closedrooms.worlds.formats.native import read_plan
    from closedrooms.worlds.geometry import wall_area

    lines = []
    for name in bundled_names():
        plan = read_plan(PLANS / f"{name}.json")
        x_min, y_min, x_max, y_max = shapely.bounds(wall_area(plan))
        size = f"{x_max - x_min:.0f} x {y_max - y_min:.0f} m"
        default = "  (default)" if name == DEFAULT_WORLD else ""
        lines.append(
            f"{name:<10} {size:>11}  {len(plan.rooms):3d} rooms  {len(plan.doors):3d} doors  "
            f"{len(closable_rooms(plan)):2d} closable  {plan.meta.get('shape', ''):<6}{default}".rstrip()
        )
    return lines


def show_world(world: str, out_png: str | Path, *, level: str | None = None) -> FloorPlan:
    """Write a picture of a world; returns its plan, with what was dropped, repaired or guessed in ``remarks``.

    Raises:
        InvalidInputError: See :func:`closedrooms.worlds.library.load_world`.
        OutputError: The picture cannot be written.
    """
    from closedrooms.visualization.floor_plan import draw_plan

    plan = load_world(world, level=level)
    draw_plan(plan, _file(out_png))
    return plan


def generate_world(kind: str, seed: int, out_json: str | Path, *, furniture: bool = False) -> FloorPlan:
    """Write a generated world as JSON; returns its plan.

    Raises:
        InvalidInputError: An unknown kind, a negative seed.
        OutputError: The file cannot be written.
    """
    from closedrooms.worlds.formats.native import write_plan
    from closedrooms.worlds.generation.generator import generate

    plan = generate(kind, seed, furniture=furniture)
    write_plan(_file(out_json), plan)
    return plan


def convert_world(src: str, dst: str | Path, to: str, *, level: str | None = None) -> FloorPlan:
    """Write a world of any known format in the format ``to``; returns its plan, with ``remarks``.

    Raises:
        InvalidInputError: See :func:`closedrooms.worlds.library.load_world`; an unknown format.
        OutputError: The file cannot be written.
    """
    formats = exporters()
    if to not in formats:
        raise InvalidInputError(f"unknown format {to!r}", expected=f"one of {', '.join(formats)}")
    plan = read_world(src, level=level)
    formats[to](_file(dst), plan)
    return plan


def _file(path: str | Path) -> Path:
    """A path that may become a file.

    Raises:
        OutputError: It is a folder.
    """
    if Path(path).is_dir():
        raise OutputError(f"the output is a folder; expected a file: {path}")
    return Path(path)


def exporters() -> dict[str, Callable[[Path, FloorPlan], None]]:
    """Writers of floor plans by the name of their format."""
    from closedrooms.worlds.formats.native import write_plan
    from closedrooms.worlds.formats.sdf import write_sdf
    from closedrooms.worlds.formats.stage import write_stage

    return {"json": write_plan, "rosmap": write_ros_map, "sdf": write_sdf, "stage": write_stage}


def write_ros_map(path: Path, plan: FloorPlan) -> None:
    """Write the true map of a plan in the building frame at 0.05 m, and its doors beside it.

    ``<stem>.yaml`` and ``<stem>.png`` show all doors open; ``<stem>.doors.geojson`` lists them, so that the map can be
    read as a plan again.
    """
    import math

    from closedrooms.core.door import ClosedDoor
    from closedrooms.core.geojson import write_doors
    from closedrooms.core.grid import GridFrame
    from closedrooms.core.pose import Pose2
    from closedrooms.core.rosmap import write_map
    from closedrooms.worlds.truth import rasterise, truth_bounds

    x_min, y_min, x_max, y_max = truth_bounds(plan, Pose2())
    col, row = math.floor(x_min / MAP_RESOLUTION) - 10, math.floor(y_min / MAP_RESOLUTION) - 10
    cols, rows = math.ceil(x_max / MAP_RESOLUTION) + 10 - col, math.ceil(y_max / MAP_RESOLUTION) + 10 - row
    frame = GridFrame(MAP_RESOLUTION, round(col * MAP_RESOLUTION, 9), round(row * MAP_RESOLUTION, 9), rows, cols)
    stem = path.with_suffix("") if path.suffix in {".yaml", ".yml", ".png", ".pgm"} else path
    write_map(stem, rasterise(plan, frame, Pose2()))
    doors = [ClosedDoor(door.id, door.midpoint, door.segment, door.width) for door in plan.doors]
    write_doors(stem.with_name(f"{stem.name}.doors.geojson"), doors)
