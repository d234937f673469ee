"""What the command line's ``closedrooms worlds`` does, as plain functions."""

from collections.abc import Callable
from pathlib import Path

from closedrooms.core.errors import InvalidInputError
from closedrooms.core.files import new_files
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


def show_world(world: str, out_png: str | Path, *, level: str | None = None, force: bool = False) -> FloorPlan:
    """Write a picture of a world; returns its plan, with what was dropped, repaired or guessed in ``remarks``.

    Raises:
        InvalidInputError: See :func:`closedrooms.worlds.library.load_world`.
        OutputError: The picture cannot be written, or is there already and ``force`` is not set.
    """
    from closedrooms.visualization.floor_plan import draw_plan

    with new_files([Path(out_png)], force=force, sources=[Path(world)]):
        plan = load_world(world, level=level)
        try:
            draw_plan(plan, Path(out_png))
        except InvalidInputError as error:
            raise InvalidInputError(str(error), where=world) from error
    return plan


def generate_world(
    kind: str, seed: int, out_json: str | Path, *, furniture: bool = False, force: bool = False
) -> FloorPlan:
    """Write a generated world as JSON; returns its plan.

    Raises:
        InvalidInputError: An unknown kind, a negative seed.
        OutputError: The file cannot be written, or is there already and ``force`` is not set.
    """
    from closedrooms.worlds.formats.native import write_plan
    from closedrooms.worlds.generation.generator import generate

    with new_files([Path(out_json)], force=force):
        plan = generate(kind, seed, furniture=furniture)
        write_plan(Path(out_json), plan)
    return plan


def convert_world(src: str, dst: str | Path, to: str, *, level: str | None = None, force: bool = False) -> FloorPlan:
    """Write a world of any known format in the format ``to``; returns its plan, with ``remarks``.

    Raises:
        InvalidInputError: See :func:`closedrooms.worlds.library.load_world`; an unknown format.
        OutputError: A file cannot be written, is the source, or is there already and ``force`` is not set.
    """
    formats = exporters()
    if to not in formats:
        raise InvalidInputError(f"unknown format {to!r}", expected=f"one of {', '.join(formats)}")
    with new_files([Path(dst), *beside(Path(dst), to)], force=force, sources=[Path(src)]):
        plan = read_world(src, level=level)
        formats[to](Path(dst), plan)
    return plan


def beside(path: Path, to: str) -> list[Path]:
    """The files that a format of several files writes; :data:`exporters` are given the first one's name."""
    match to:
        case "rosmap":
            stem = map_stem(path)
            return [stem.with_name(stem.name + ending) for ending in (".yaml", ".png", ".doors.geojson")]
        case "stage":
            return [path.with_suffix(ending) for ending in (".world", ".png")]
    return []


def map_stem(path: Path) -> Path:
    """The name that the files of a ROS map share."""
    return path.with_suffix("") if path.suffix in {".yaml", ".yml", ".png", ".pgm"} else path


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
    stem = map_stem(path)
    write_map(stem, rasterise(plan, frame, Pose2()))
    doors = [ClosedDoor(door.id, door.midpoint, door.segment, door.width) for door in plan.doors]
    write_doors(stem.with_name(f"{stem.name}.doors.geojson"), doors)
