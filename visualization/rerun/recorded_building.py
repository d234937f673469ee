"""The simulated building in a recording: walls, floors, and doors that move."""

from collections.abc import Collection, Mapping, Sequence

import numpy as np
import rerun as rr
import shapely
from shapely.geometry import MultiPolygon, Point, Polygon

from closedrooms.core.arrays import FloatArray, IntArray
from closedrooms.core.pose import Pose2
from closedrooms.sim.building import FURNITURE_HEIGHT
from closedrooms.sim.bystanders import BOX, PERSON_HEIGHT, PERSON_RADIUS, Mover, Person
from closedrooms.sim.config import SimConfig
from closedrooms.sim.door_leaves import Leaf, door_leaves
from closedrooms.sim.doors import DOOR_HEIGHT
from closedrooms.sim.glass import glass_area
from closedrooms.visualization import colours
from closedrooms.visualization.rerun import drawables
from closedrooms.visualization.rerun.stream import RecordingStream
from closedrooms.worlds.extrusion import WALL_HEIGHT, extrude
from closedrooms.worlds.geometry import areal, wall_area
from closedrooms.worlds.plan import FloorPlan

Area = Polygon | MultiPolygon
# One sees through glass [0..255].
GLASS_ALPHA = 90


class RecordedBuilding:
    """Plan in a recording, drawn once, its doors whenever they move."""

    def __init__(self, stream: RecordingStream, plan: FloorPlan, map_T_world: Pose2, closed: Collection[str]) -> None:
        self._stream = stream
        self._map_T_world = map_T_world
        walls = wall_area(plan)
        furniture = areal(shapely.union_all([thing.polygon for thing in plan.furniture]))
        solids, swing = areal(shapely.union_all([walls, furniture])), SimConfig().swing
        self._leaves = {door.id: door_leaves(plan, door, solids, swing) for door in plan.doors}
        self._states = {door.id: 0.0 if door.id in closed else 1.0 for door in plan.doors}
        self._closed = sorted(closed)
        self._draw_shell(plan, walls, furniture)
        self._draw_open_doors([door.id for door in plan.doors if door.id not in closed])
        for door in self._closed:
            self._draw_door(door)
            stream.log(
                f"door_states/{door}",
                rr.StateConfiguration(
                    values=["unseen", "seen", "open"],
                    labels=["closed, not seen yet", "closed, seen", "open"],
                    colors=[[170, 170, 175], [*colours.DOOR_CLOSED], [*colours.TRUTH]],
                ),
                static=True,
            )
            stream.log(f"door_states/{door}", rr.StateChange(state="unseen"))

    def seen(self, doors: Collection[str]) -> None:
        """Draw the closed doors that the robot has seen by now."""
        for door in self._closed:
            if door in doors and self._states[door] < 0.5:
                self._stream.log(f"door_states/{door}", rr.StateChange(state="seen"))

    def move(self, states: Mapping[str, float]) -> None:
        """Draw the doors that have moved: 0 is closed, 1 is open."""
        for door in self._closed:
            if door in states and abs(states[door] - self._states[door]) > 1e-6:
                opens = self._states[door] <= 0.5 < states[door]
                self._states[door] = states[door]
                self._draw_door(door)
                if opens:
                    self._stream.log(f"door_states/{door}", rr.StateChange(state="open"))

    def draw_movers(self, movers: Sequence[Mover]) -> None:
        """Draw people as upright cylinders and boxes as boxes."""
        people = [mover.outline.centroid for mover in movers if isinstance(mover, Person)]
        boxes = [mover.outline.centroid for mover in movers if not isinstance(mover, Person)]
        if people:
            centres = self._lift(people, PERSON_HEIGHT / 2)
            count = len(people)
            self._stream.log(
                "building/people",
                rr.Cylinders3D(
                    lengths=[PERSON_HEIGHT] * count,
                    radii=[PERSON_RADIUS] * count,
                    centers=centres,
                    colors=[colours.MOVER] * count,
                    fill_mode="solid",
                ),
            )
        if boxes:
            half = [[BOX / 2] * 3] * len(boxes)
            centres, turned = (
                self._lift(boxes, BOX / 2),
                rr.RotationAxisAngle([0, 0, 1], rr.Angle(rad=self._map_T_world.theta)),
            )
            self._stream.log(
                "building/boxes",
                rr.Boxes3D(
                    half_sizes=half,
                    centers=centres,
                    rotation_axis_angles=[turned] * len(boxes),
                    colors=[colours.MOVER] * len(boxes),
                    fill_mode="solid",
                ),
            )

    def _lift(self, places: Sequence[Point], z: float) -> FloatArray:
        """Convert places of the building frame to the map frame, at a height [m], shape (n, 3)."""
        flat = self._map_T_world.transform(shapely.get_coordinates(np.asarray(places, dtype=object)))
        return np.column_stack((flat, np.full(len(flat), z)))

    def _draw_shell(self, plan: FloorPlan, walls: Area, furniture: Area) -> None:
        """Draw walls, panes, floors and furniture, which never move."""
        glass = glass_area(plan, walls)
        self._draw_solid("building/walls", areal(walls.difference(glass)), WALL_HEIGHT, colours.WALL)
        if not glass.is_empty:
            self._draw_solid("building/glass", glass, WALL_HEIGHT, colours.GLASS, alpha=GLASS_ALPHA)
        floors = [Polygon(self._map_T_world.transform(np.asarray(room.polygon.exterior.coords))) for room in plan.rooms]
        self._stream.log("building/floor", drawables.filled(floors, colours.FLOOR, alpha=255, z=-0.02), static=True)
        if not furniture.is_empty:
            self._draw_solid("building/furniture", furniture, FURNITURE_HEIGHT, colours.FURNITURE)

    def _draw_solid(self, path: str, area: Area, height: float, colour: colours.Colour, *, alpha: int = 255) -> None:
        """Extrude an area, building frame [m], to a height [m] and draw it."""
        vertices, triangles = extrude(area, height=height)
        self._stream.log(path, drawables.solid(self._in_map(vertices), triangles, colour, alpha=alpha), static=True)

    def _draw_open_doors(self, doors: Collection[str]) -> None:
        """Draw doors that stay open as one mesh: a large floor has hundreds."""
        parts = [_mesh(leaf, 1.0) for door in doors for leaf in self._leaves[door]]
        if parts:
            counts = np.cumsum([0, *(len(vertices) for vertices, _ in parts)])
            vertices = np.concatenate([vertices for vertices, _ in parts])
            triangles = np.concatenate([part + count for (_, part), count in zip(parts, counts, strict=False)])
            self._stream.log(
                "building/open_doors",
                drawables.solid(self._in_map(vertices), triangles, colours.DOOR_OPEN),
                static=True,
            )

    def _draw_door(self, door: str) -> None:
        """Draw the leaves of a door as far open as it is."""
        opening = self._states[door]
        colour = colours.DOOR_CLOSED if opening < 0.5 else colours.DOOR_OPEN
        for number, leaf in enumerate(self._leaves[door]):
            vertices, triangles = _mesh(leaf, opening)
            self._stream.log(
                f"building/doors/{door}/{number}", drawables.solid(self._in_map(vertices), triangles, colour)
            )

    def _in_map(self, vertices: FloatArray) -> FloatArray:
        """Transform vertices, shape (n, 3), from the building frame to the map frame."""
        return np.column_stack((self._map_T_world.transform(vertices[:, :2]), vertices[:, 2]))


def _mesh(leaf: Leaf, opening: float) -> tuple[FloatArray, IntArray]:
    """Build vertices and triangles of a leaf when its door is open by ``opening``, 0 to 1."""
    return extrude(Polygon(leaf.at(opening * leaf.travel)), height=DOOR_HEIGHT)
