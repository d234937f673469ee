"""The simulated building in a recording: walls, floors, and doors that move."""

import math
from collections.abc import Collection, Mapping

import numpy as np
import rerun as rr
import shapely
from shapely.geometry import Polygon

from closedrooms.core.arrays import FloatArray, IntArray
from closedrooms.core.pose import Pose2
from closedrooms.pipeline import colours, drawables
from closedrooms.pipeline.recording_stream import RecordingStream
from closedrooms.worlds.extrude import extrude
from closedrooms.worlds.geometry import areal, door_leaf, wall_area
from closedrooms.worlds.plan import FloorPlan, PlanDoor

# A usual door leaf is 2.0 m high; furniture is drawn as high as a table [m].
LEAF_HEIGHT, FURNITURE_HEIGHT = 2.0, 0.75
# An open door is swung aside by as much [rad].
OPEN_ANGLE = math.radians(95.0)


class RecordedBuilding:
    """Draws a plan once and its doors whenever they move."""

    def __init__(self, stream: RecordingStream, plan: FloorPlan, map_T_world: Pose2, closed: Collection[str]) -> None:
        self._stream = stream
        self._map_T_world = map_T_world
        self._leaves = {door.id: _leaves(plan, door) for door in plan.doors}
        self._states = {door.id: 0.0 if door.id in closed else 1.0 for door in plan.doors}
        self._closed = sorted(closed)
        self._draw_shell(plan)
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
        """The robot has seen these closed doors by now."""
        for door in self._closed:
            if door in doors and self._states[door] < 0.5:
                self._stream.log(f"door_states/{door}", rr.StateChange(state="seen"))

    def move(self, states: Mapping[str, float]) -> None:
        """Draw the doors that have moved: 0 is closed, 1 is open."""
        for door in self._closed:
            if door in states and abs(states[door] - self._states[door]) > 1e-6:
                self._states[door] = states[door]
                self._draw_door(door)
                if states[door] > 0.5:
                    self._stream.log(f"door_states/{door}", rr.StateChange(state="open"))

    def _draw_shell(self, plan: FloorPlan) -> None:
        walls, triangles = extrude(wall_area(plan))
        self._stream.log("building/walls", drawables.solid(self._in_map(walls), triangles, colours.WALL), static=True)
        floors = [Polygon(self._map_T_world.transform(np.asarray(room.polygon.exterior.coords))) for room in plan.rooms]
        self._stream.log("building/floor", drawables.fill(floors, colours.FLOOR, alpha=255, z=-0.02), static=True)
        if plan.furniture:
            area = areal(shapely.union_all([thing.polygon for thing in plan.furniture]))
            vertices, triangles = extrude(area, height=FURNITURE_HEIGHT)
            self._stream.log(
                "building/furniture", drawables.solid(self._in_map(vertices), triangles, colours.DOOR_OPEN), static=True
            )

    def _draw_open_doors(self, doors: Collection[str]) -> None:
        """Doors that stay open are one mesh: a large floor has hundreds."""
        parts = [leaf.mesh(1.0) for door in doors for leaf in self._leaves[door]]
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
        opening = self._states[door]
        colour = colours.DOOR_CLOSED if opening < 0.5 else colours.DOOR_OPEN
        for number, leaf in enumerate(self._leaves[door]):
            vertices, triangles = leaf.mesh(opening)
            self._stream.log(
                f"building/doors/{door}/{number}", drawables.solid(self._in_map(vertices), triangles, colour)
            )

    def _in_map(self, vertices: FloatArray) -> FloatArray:
        return np.column_stack((self._map_T_world.transform(vertices[:, :2]), vertices[:, 2]))


class _Leaf:
    """One leaf of a door, building frame [m]."""

    def __init__(self, shape: Polygon, hinge: FloatArray, swing: float, slide: FloatArray) -> None:
        self._shape, self._hinge, self._swing, self._slide = shape, hinge, swing, slide

    def mesh(self, opening: float) -> tuple[FloatArray, IntArray]:
        """Vertices and triangles when the door is open by ``opening``, 0 to 1."""
        angle = self._swing * opening
        c, s = math.cos(angle), math.sin(angle)
        corners = np.asarray(self._shape.exterior.coords) - self._hinge
        moved = corners @ np.array([[c, s], [-s, c]]) + self._hinge + opening * self._slide
        return extrude(Polygon(moved), height=LEAF_HEIGHT)


def _leaves(plan: FloorPlan, door: PlanDoor) -> list[_Leaf]:
    leaf = door_leaf(plan, door)
    ends = np.asarray(door.segment, dtype=np.float64)
    still = np.zeros(2)
    if door.kind == "sliding":
        # The leaf hides beside the gap, on the side of its hinge.
        return [_Leaf(leaf, still, 0.0, ends[door.hinge] - ends[1 - door.hinge])]
    if door.kind == "double":
        middle = ends.mean(axis=0)
        halves = [_half(leaf, end, middle) for end in ends]
        return [_Leaf(half, end, _swing(plan, door, end), still) for half, end in zip(halves, ends, strict=True)]
    return [_Leaf(leaf, ends[door.hinge], _swing(plan, door, ends[door.hinge]), still)]


def _half(leaf: Polygon, end: FloatArray, middle: FloatArray) -> Polygon:
    side = shapely.LineString([end, middle]).buffer(leaf.length, cap_style="flat")
    return Polygon(shapely.get_coordinates(leaf.intersection(side).convex_hull))


def _swing(plan: FloorPlan, door: PlanDoor, hinge: FloatArray) -> float:
    """Angle of an open leaf that hangs on ``hinge`` [rad]: it swings into the room that the door opens into."""
    along = np.asarray(door.midpoint) - hinge
    left = np.array([-along[1], along[0]]) / max(float(np.hypot(*along)), 1e-9)
    room = next((room for room in plan.rooms if room.id == door.opens_into), None)
    other = next((room for room in plan.rooms if room.id in door.rooms and room.id != door.opens_into), None)
    probe = shapely.Point(np.asarray(door.midpoint) + 0.4 * left)
    into_left = room.polygon.contains(probe) if room else not (other and other.polygon.contains(probe))
    return OPEN_ANGLE if into_left else -OPEN_ANGLE
