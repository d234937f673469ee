"""Pictures of floor plans."""

import io
import math
from collections.abc import Collection
from pathlib import Path
from typing import Any

import shapely
from shapely.geometry import MultiPolygon, Polygon
from shapely.geometry.polygon import orient

from closedrooms.core.files.outgoing import write_bytes
from closedrooms.core.names import plot_text
from closedrooms.worlds.closing import closable_rooms
from closedrooms.worlds.geometry import door_leaf, wall_area
from closedrooms.worlds.plan import FloorPlan, PlanDoor
from closedrooms.worlds.start_pose import start_pose

# Fill by what the room's label says.
COLOURS = {
    "corridor": "#f4efe2", "hallway": "#f4efe2", "passage": "#f4efe2", "lobby": "#f7e7c6", "entrance": "#f7e7c6",
    "hall": "#f3dfb8", "office": "#d9e6f4", "classroom": "#dcecd6", "toilet": "#d6eef0", "washroom": "#d6eef0",
    "bathroom": "#d6eef0", "store": "#e6e0ea", "closet": "#e6e0ea", "stairs": "#e3e3e3", "elevator": "#e3e3e3",
}  # fmt: skip
OTHER, WALL, OPEN, CLOSED, START = "#ece9f3", "#3b3f46", "#9a6b3f", "#c0392b", "#1f77b4"
CLOSABLE = "#1b4f9c"
# Room for numbers along the axes [inches].
MARGIN = 0.42
DOTS_PER_INCH = 110
# Characters of 10 points in an inch of title, and how many of a name are shown at least.
CHARACTERS_PER_INCH, SHORTEST_NAME = 11.0, 12


def draw_plan(plan: FloorPlan, path_png: str | Path, *, closed: Collection[str] = ()) -> None:
    """Write a picture of a plan: rooms by label, walls, doors by name, furniture, the start; axes in metres.

    Doors of rooms that ``closedrooms run`` may close have their names in bold blue, the others in brown.

    Args:
        plan: The building.
        path_png: Where to.
        closed: Ids of doors drawn closed and named.

    Raises:
        OutputError: The folder cannot be written.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    walls = wall_area(plan)
    x_min, y_min, x_max, y_max = shapely.total_bounds([walls, *(room.polygon for room in plan.rooms)])
    width, height = x_max - x_min + 2.0, y_max - y_min + 2.0
    inches = 11.0 / max(width, height)
    figure = Figure(figsize=(max(width * inches, 4.0), max(height * inches, 2.5)), dpi=DOTS_PER_INCH)
    FigureCanvasAgg(figure)
    left, low = MARGIN / figure.get_figwidth(), MARGIN / figure.get_figheight()
    axes = figure.add_axes((left, low, 1.0 - 1.2 * left, 0.95 - low))
    axes.set_aspect("equal")
    axes.tick_params(labelsize=6, length=2)
    axes.set_xlabel("x [m]", fontsize=7, labelpad=1)
    axes.set_ylabel("y [m]", fontsize=7, labelpad=1)
    axes.set_xlim(x_min - 1.0, x_max + 1.0)
    axes.set_ylim(y_min - 1.0, y_max + 1.0)
    for room in plan.rooms:
        _fill(axes, room.polygon, _colour(room.label))
    for thing in plan.furniture:
        _fill(axes, thing.polygon, "#b9a58c", edgecolor="#8a7559")
    _fill(axes, walls, WALL)
    closable = {door for doors in closable_rooms(plan).values() for door in doors}
    for door in plan.doors:
        _draw_door(axes, plan, door, closed=door.id in closed)
        _name_door(axes, door, CLOSED if door.id in closed else CLOSABLE if door.id in closable else OPEN)
    _draw_scale(axes, x_max - x_min)
    _write_labels(axes, plan)
    pose = start_pose(plan)
    axes.plot(pose.x, pose.y, marker=(3, 0, pose.theta * 57.29578 - 90.0), color=START, markersize=9)
    _write_title(figure, plan.name, f"{x_max - x_min:.0f} x {y_max - y_min:.0f} m   {len(plan.rooms)} rooms, "
                 f"{len(plan.doors)} doors")  # fmt: skip
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", metadata={"Software": None})
    write_bytes(Path(path_png), buffer.getvalue())


def _write_title(figure: Any, name: str, rest: str) -> None:
    """Write the name and figures of a plan, the name shortened until the line fits into the picture."""
    room = int(figure.get_figwidth() * CHARACTERS_PER_INCH) - len(rest) - 3
    size = 10.0
    if room < SHORTEST_NAME:
        size *= (len(rest) + 3 + room) / (len(rest) + 3 + SHORTEST_NAME)
        room = SHORTEST_NAME
    shown = plot_text(name)
    shown = shown if len(shown) <= room else f"{shown[: room - 3]}..."
    figure.text(0.01, 0.965, f"{shown}   {rest}", fontsize=size, parse_math=False)


def _colour(label: str) -> str:
    """Choose a room's colour by a word in its label."""
    label = label.lower()
    return next((colour for word, colour in COLOURS.items() if word in label), OTHER)


def _fill(axes: Any, area: Polygon | MultiPolygon, colour: str, *, edgecolor: str = "none") -> None:
    from matplotlib.patches import PathPatch
    from matplotlib.path import Path as Outline

    for polygon in area.geoms if isinstance(area, MultiPolygon) else [area]:
        if not polygon.is_empty:
            turned = orient(polygon)
            rings = [Outline(ring.coords, closed=True) for ring in (turned.exterior, *turned.interiors)]
            axes.add_patch(PathPatch(Outline.make_compound_path(*rings), facecolor=colour, edgecolor=edgecolor, lw=0.5))


def _draw_door(axes: Any, plan: FloorPlan, door: PlanDoor, *, closed: bool) -> None:
    if closed:
        _fill(axes, door_leaf(plan, door).buffer(0.06), CLOSED)
    elif door.kind == "hinged":
        _draw_swing(axes, plan, door)
    else:
        xs, ys = zip(*door.segment, strict=True)
        axes.plot(xs, ys, color=OPEN, lw=1.2, ls="-" if door.kind == "double" else ":")


def _name_door(axes: Any, door: PlanDoor, colour: str) -> None:
    weight = "normal" if colour == OPEN else "bold"
    axes.annotate(plot_text(door.id), door.midpoint, xytext=(3, 3), textcoords="offset points", fontsize=5.5,
                  color=colour, weight=weight, parse_math=False)  # fmt: skip


def _draw_scale(axes: Any, width: float) -> None:
    """Draw a bar of 1, 2 or 5 times a power of ten metres, at most a fifth of the building, lower right."""
    power = 10.0 ** math.floor(math.log10(width / 5.0))
    length = max(step * power for step in (1.0, 2.0, 5.0) if step * power <= width / 5.0)
    (_, right), (low, high) = axes.get_xlim(), axes.get_ylim()
    y = low + 0.015 * (high - low)
    axes.plot([right - 0.3 - length, right - 0.3], [y, y], color=WALL, lw=3, solid_capstyle="butt")
    axes.text(right - 0.3 - length / 2, y, f"{length:g} m", fontsize=6, ha="center", va="bottom", color=WALL)


def _draw_swing(axes: Any, plan: FloorPlan, door: PlanDoor) -> None:
    """Draw the leaf at 90 degrees in the room that it opens into, and the arc of its edge."""
    import numpy as np

    hinge = np.array(door.segment[door.hinge])
    along = np.array(door.segment[1 - door.hinge]) - hinge
    normal = np.array([-along[1], along[0]])
    room = next((r.polygon for r in plan.rooms if r.id == door.opens_into), None)
    probe = shapely.Point(np.array(door.midpoint) + 0.5 * normal)
    if (
        room is not None
        and not room.covers(probe)
        and room.covers(shapely.Point(np.array(door.midpoint) - 0.5 * normal))
    ):
        normal = -normal
    turn = np.linspace(0.0, np.pi / 2, 12)[:, None]
    arc = hinge + np.cos(turn) * along + np.sin(turn) * normal
    axes.plot(*arc.T, color=OPEN, lw=0.4)
    axes.plot(*np.array([hinge, hinge + normal]).T, color=OPEN, lw=1.1)


def _write_labels(axes: Any, plan: FloorPlan) -> None:
    for room in plan.rooms:
        if room.polygon.area > 4.0:
            point = room.polygon.representative_point()
            axes.text(point.x, point.y, f"{plot_text(room.id)}\n{plot_text(room.label)}", fontsize=4.5, ha="center",
                      va="center", color="#555555", parse_math=False)  # fmt: skip
