"""What the command line's ``closedrooms worlds`` does, as plain functions."""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from closedrooms.core.errors import InvalidInputError
from closedrooms.core.files.outgoing import new_files
from closedrooms.core.names import shown
from closedrooms.worlds.library import DEFAULT_WORLD, PLANS, bundled_names, load_world, read_world

if TYPE_CHECKING:
    from closedrooms.worlds.plan import FloorPlan

BUNDLED_LIST = "bundled.txt"
# Resolution of maps written by ``convert`` [m].
MAP_RESOLUTION = 0.05


def list_worlds(*, verbose: bool = False) -> list[str]:
    """List the bundled worlds, a line each; the name comes first; with ``verbose`` more lines on each.

    The lines stand in a file beside the plans, which a test compares with :func:`describe_bundled`: to read and check
    twenty plans takes longer than most commands.
    """
    from closedrooms.core.files.incoming import read_text

    lines = read_text(PLANS.parent / BUNDLED_LIST, what="the list of bundled worlds").splitlines()
    if not verbose:
        return lines
    from closedrooms.worlds.formats.native import read_plan

    plans = [read_plan(PLANS / f"{name}.json") for name in bundled_names()]
    return [text for line, plan in zip(lines, plans, strict=True) for text in (line, *_details(plan))]


def describe_bundled() -> list[str]:
    """Work out the lines of :func:`list_worlds` from the plans."""
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


def _details(plan: "FloorPlan") -> list[str]:
    """Describe what a plan holds beside its figures."""
    from collections import Counter

    from closedrooms.worlds.closing import closable_rooms

    kinds = ", ".join(f"{count} {kind}" for kind, count in Counter(room.label for room in plan.rooms).most_common())
    doors = sorted(door for doors in closable_rooms(plan).values() for door in doors)
    area = sum(room.polygon.area for room in plan.rooms)
    furniture = f", {len(plan.furniture)} pieces of furniture" if plan.furniture else ""
    return [f"    {area:.0f} m2 of floor{furniture}: {kinds}", f"    can be closed: {', '.join(doors) or 'none'}"]


def describe_world(plan: "FloorPlan") -> list[str]:
    """Describe a plan in words: its rooms with area and doors, its doors with place, width and rooms."""
    from closedrooms.worlds.closing import closable_rooms

    closable = closable_rooms(plan)
    marked = {door for doors in closable.values() for door in doors}
    by_room: dict[str, list[str]] = {}
    for door in plan.doors:
        for room in door.rooms:
            by_room.setdefault(str(room), []).append(door.id)
    wide = max((len(shown(place.label)) for place in plan.rooms), default=0) + 1
    lines = [shown(plan.name), *_details(plan), "", f"{'room':<16} {'kind':<{wide}} {'area':>9}  doors"]
    for place in plan.rooms:
        can = "  (closable)" if place.id in closable else ""
        doors = ", ".join(map(shown, by_room.get(place.id, []))) or "none"
        lines.append(f"{shown(place.id):<16} {shown(place.label):<{wide}} {place.polygon.area:6.1f} m2  {doors}{can}")
    lines += ["", f"{'door':<16} {'x [m]':>8} {'y [m]':>8} {'width':>7}  between"]
    for door in plan.doors:
        x, y = door.midpoint
        rooms = " and ".join("outside" if room is None else shown(room) for room in door.rooms)
        can = "  (closable)" if door.id in marked else ""
        lines.append(f"{shown(door.id):<16} {x:8.2f} {y:8.2f} {door.width:5.2f} m  {rooms}{can}")
    return lines


def show_world(world: str, out_png: str | Path, *, level: str | None = None, force: bool = False) -> "FloorPlan":
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
    kind: str, seed: int, out_json: str | Path, *, furniture: bool = False, glass: float = 0.0, force: bool = False
) -> "FloorPlan":
    """Write a generated world as JSON; returns its plan.

    Raises:
        InvalidInputError: An unknown kind, a negative seed, a share of glass that is none.
        OutputError: The file cannot be written, or is there already and ``force`` is not set.
    """
    from closedrooms.worlds.formats.native import write_plan
    from closedrooms.worlds.generation.generator import generate
    from closedrooms.worlds.glazing import glazed

    if not 0.0 <= glass <= 1.0:
        raise InvalidInputError(f"--glass {glass:g}", expected="a share from 0 to 1")
    with new_files([Path(out_json)], force=force):
        plan = glazed(generate(kind, seed, furniture=furniture), glass, seed)
        write_plan(Path(out_json), plan)
    return plan


def convert_world(src: str, dst: str | Path, to: str, *, level: str | None = None, force: bool = False) -> "FloorPlan":
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
        try:
            formats[to](Path(dst), plan)
        except InvalidInputError as error:
            raise InvalidInputError(str(error), where=src) from error
    return plan


def beside(path: Path, to: str) -> list[Path]:
    """List the files that a format of several files writes; :data:`exporters` are given the first one's name."""
    match to:
        case "rosmap":
            stem = map_stem(path)
            return [stem.with_name(stem.name + ending) for ending in (".yaml", ".png", ".doors.geojson")]
        case "urdf":
            return [path, path.with_suffix(".obj")]
        case "stage":
            return [path.with_suffix(ending) for ending in (".world", ".png")]
    return []


def map_stem(path: Path) -> Path:
    """Strip the ending from the path of a ROS map: its two files share the rest."""
    return path.with_suffix("") if path.suffix in {".yaml", ".yml", ".png", ".pgm"} else path


def exporters() -> dict[str, Callable[[Path, "FloorPlan"], None]]:
    """List the writers of floor plans by the name of their format."""
    from closedrooms.worlds.formats.exports.mesh import write_obj, write_urdf
    from closedrooms.worlds.formats.exports.sdf import write_sdf
    from closedrooms.worlds.formats.exports.stage import write_stage
    from closedrooms.worlds.formats.native import write_plan

    return {
        "json": write_plan,
        "obj": write_obj,
        "rosmap": write_ros_map,
        "sdf": write_sdf,
        "stage": write_stage,
        "urdf": write_urdf,
    }


def write_ros_map(path: Path, plan: "FloorPlan") -> None:
    """Write the true map of a plan in the building frame at 0.05 m, and its doors beside it.

    ``<stem>.yaml`` and ``<stem>.png`` show all doors open; ``<stem>.doors.geojson`` lists them, so that the map can be
    read as a plan again.
    """
    import math

    from closedrooms.core.door import ClosedDoor
    from closedrooms.core.files.geojson import write_doors
    from closedrooms.core.files.rosmap import write_map
    from closedrooms.core.grid import GridFrame
    from closedrooms.core.pose import Pose2
    from closedrooms.worlds.truth import rasterise, truth_bounds

    x_min, y_min, x_max, y_max = truth_bounds(plan, Pose2())
    col, row = math.floor(x_min / MAP_RESOLUTION) - 10, math.floor(y_min / MAP_RESOLUTION) - 10
    cols, rows = math.ceil(x_max / MAP_RESOLUTION) + 10 - col, math.ceil(y_max / MAP_RESOLUTION) + 10 - row
    frame = GridFrame(MAP_RESOLUTION, round(col * MAP_RESOLUTION, 9), round(row * MAP_RESOLUTION, 9), rows, cols)
    stem = map_stem(path)
    write_map(stem, rasterise(plan, frame, Pose2()))
    doors = [ClosedDoor(door.id, door.midpoint, door.segment, door.width) for door in plan.doors]
    write_doors(stem.with_name(f"{stem.name}.doors.geojson"), doors)
