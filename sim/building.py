"""A floor plan as bodies: walls, furniture and doors, in PyBullet and as edges for the robot's contacts."""

import math
from collections.abc import Collection

import shapely
from shapely.geometry import Polygon

from closedrooms.core.arrays import FloatArray
from closedrooms.core.errors import InvalidInputError
from closedrooms.sim.config import SimConfig
from closedrooms.sim.contacts import Obstacles, edges_of, leaf_edges
from closedrooms.sim.differential_drive import Drive
from closedrooms.sim.door_leaves import Leaf, door_leaves
from closedrooms.sim.physics_world import MovingPart, PhysicsWorld, upright
from closedrooms.worlds.extrusion import extrude
from closedrooms.worlds.geometry import areal, door_gap, wall_area
from closedrooms.worlds.plan import FloorPlan, Opening, PlanDoor

# Usual height of a door leaf and of furniture that blocks a robot [m].
DOOR_HEIGHT = 2.1
FURNITURE_HEIGHT = 0.75


class Door:
    """One door of the building, and how far it is open.

    Attributes:
        plan: The door in the plan.
        leaves: What moves.
        body: Its body in PyBullet.
        opening: 0 closed, 1 as far open as the plan allows.
        opens: Whether it is on its way to open.
    """

    def __init__(self, plan: PlanDoor, leaves: tuple[Leaf, ...], body: int) -> None:
        self.plan = plan
        self.leaves = leaves
        self.body = body
        self.opening = 0.0
        self.opens = False

    @property
    def closed(self) -> bool:
        """Whether it blocks the passage."""
        return self.opening == 0.0

    def corners(self, opening: float) -> list[FloatArray]:
        """Corners of each leaf, shape (4, 2), building frame [m]."""
        return [leaf.at(opening * leaf.travel) for leaf in self.leaves]


class Building:
    """The plan's solids in one physics world.

    Doors and openings to the outside are shut for good: the robot stays in the building, and what shuts it is a wall
    to it, never a closed door.
    """

    def __init__(self, plan: FloorPlan, closed: Collection[str], config: SimConfig, physics: PhysicsWorld) -> None:
        self.plan = plan
        self._physics = physics
        self._seconds = config.door_seconds
        inner = [door for door in plan.doors if None not in door.rooms]
        _check_doors(plan, closed, [door.id for door in inner])
        walls = building_solids(plan)
        furniture = areal(shapely.union_all([thing.polygon for thing in plan.furniture]))
        solids = areal(shapely.union_all([walls, furniture]))
        self._add_static(walls, None)
        if not furniture.is_empty:
            self._add_static(furniture, FURNITURE_HEIGHT)
        self.obstacles = Obstacles(edges_of(solids), Drive.reach(config.robot))
        self.solids = solids
        self.doors: dict[str, Door] = {}
        self._opening = 0
        for plan_door in inner:
            leaves = door_leaves(plan, plan_door, solids, config.swing)
            body = physics.add_moving([_part(leaf) for leaf in leaves])
            door = self.doors[plan_door.id] = Door(plan_door, leaves, body)
            for link, leaf in enumerate(leaves):
                low, high = leaf.reach.min(axis=0), leaf.reach.max(axis=0)
                self.obstacles.add_leaf((plan_door.id, link), (*low, *high))
            self._put(door, 0.0 if plan_door.id in closed else 1.0)
        self.door_of_body = {door.body: door for door in self.doors.values()}

    def open_door(self, door_id: str) -> None:
        """Let a door open from now on; it takes its time, and waits for a robot in its way.

        Raises:
            InvalidInputError: No such door.
        """
        _check_doors(self.plan, [door_id], list(self.doors))
        door = self.doors[door_id]
        self._set_out(door, door.opening < 1.0)

    @property
    def moving(self) -> bool:
        """Whether a door is on its way."""
        return self._opening > 0

    def advance(self, duration: float, x: float, y: float, radius: float) -> None:
        """Move the doors that open.

        Args:
            duration: Time [s].
            x: Centre of the robot [m].
            y: Centre of the robot [m].
            radius: Of the robot [m]; a leaf that would touch it waits.
        """
        for door in self.doors.values():
            if not door.opens:
                continue
            share = duration / self._seconds if self._seconds > 0 else 1.0
            opening = min(door.opening + share, 1.0)
            robot = shapely.Point(x, y)
            if any(Polygon(corners).distance(robot) <= radius + 1e-3 for corners in door.corners(opening)):
                continue
            self._put(door, opening)
            self._set_out(door, opening < 1.0)

    def _set_out(self, door: Door, opens: bool) -> None:
        self._opening += int(opens) - int(door.opens)
        door.opens = opens

    def _put(self, door: Door, opening: float) -> None:
        door.opening = opening
        for link, (leaf, corners) in enumerate(zip(door.leaves, door.corners(opening), strict=True)):
            self._physics.move_joint(door.body, link, opening * leaf.travel)
            self.obstacles.move_leaf((door.plan.id, link), leaf_edges(corners))

    def _add_static(self, area: Polygon | shapely.MultiPolygon, height: float | None) -> None:
        vertices, triangles = extrude(area) if height is None else extrude(area, height=height)
        self._physics.add_static(vertices, upright(vertices, triangles))


def building_solids(plan: FloorPlan) -> Polygon | shapely.MultiPolygon:
    """Walls, and what shuts the doors and openings to the outside, building frame [m]."""
    passages: tuple[PlanDoor | Opening, ...] = (*plan.doors, *plan.openings)
    outer = [door_gap(plan, passage) for passage in passages if None in passage.rooms]
    walls = wall_area(plan)
    return areal(shapely.union_all([walls, *outer])) if outer else walls


def _part(leaf: Leaf) -> MovingPart:
    vertices, triangles = extrude(Polygon(leaf.corners), height=DOOR_HEIGHT)
    axis = (*leaf.direction.tolist(), 0.0) if leaf.slides else (0.0, 0.0, float(leaf.sense))
    x, y = leaf.pivot.tolist()
    return MovingPart(vertices, upright(vertices, triangles), leaf.slides, (x, y, 0.0), axis)


def _check_doors(plan: FloorPlan, wanted: Collection[str], inner: Collection[str]) -> None:
    for name in wanted:
        if name not in inner:
            known = f"one of {', '.join(inner)}" if inner else "none: this plan has no doors between rooms"
            raise InvalidInputError(f"door {name!r} is not between two rooms of the plan", expected=known,
                                    where=plan.name)  # fmt: skip


def gap_from(solids: Polygon | shapely.MultiPolygon, x: float, y: float) -> float:
    """Distance of a place from the solids [m], 0 inside them."""
    distance = solids.distance(shapely.Point(x, y))
    return math.inf if solids.is_empty else float(distance)
