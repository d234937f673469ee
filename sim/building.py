"""A floor plan as bodies: walls, furniture and doors, in PyBullet and as edges for the robot's contacts."""

import math
from collections.abc import Collection

import shapely
from shapely.geometry import Polygon

from closedrooms.core.errors import InvalidInputError
from closedrooms.sim.config import SimConfig
from closedrooms.sim.contacts import Obstacles, edges_of
from closedrooms.sim.door_leaves import door_leaves
from closedrooms.sim.doors import Door, HungDoor, PlacedDoor
from closedrooms.sim.glass import glass_area
from closedrooms.sim.physics_world import PhysicsWorld
from closedrooms.sim.robot.differential_drive import Drive
from closedrooms.sim.solids import FURNITURE, PANE, RGBA, WALLS, upright
from closedrooms.worlds.extrusion import extrude
from closedrooms.worlds.geometry import areal, door_gap, wall_area
from closedrooms.worlds.plan import FloorPlan, Opening, PlanDoor

# Usual height of furniture that blocks a robot [m].
FURNITURE_HEIGHT = 0.75


class Building:
    """The plan's solids in one physics world.

    Doors and openings to the outside are shut for good: the robot stays in the building, and what shuts it is a wall
    to it, never a closed door.
    """

    def __init__(self, plan: FloorPlan, closed: Collection[str], config: SimConfig, physics: PhysicsWorld) -> None:
        self.plan = plan
        self._physics = physics
        inner = [door for door in plan.doors if None not in door.rooms]
        _check_doors(plan, closed, [door.id for door in inner])
        walls = building_solids(plan)
        furniture = areal(shapely.union_all([thing.polygon for thing in plan.furniture]))
        solids = areal(shapely.union_all([walls, furniture]))
        panes = glass_area(plan, walls)
        self._add_static(areal(walls.difference(panes)) if not panes.is_empty else walls, None, WALLS)
        if not panes.is_empty:
            for body in self._add_static(panes, None, PANE):
                physics.make_glass(body)
        if not furniture.is_empty:
            self._add_static(furniture, FURNITURE_HEIGHT, FURNITURE)
        self.obstacles = Obstacles(edges_of(solids), Drive.reach(config.robot))
        self.solids = solids
        self.doors: dict[str, Door] = {}
        hang = HungDoor if physics.stepped else PlacedDoor
        for plan_door in inner:
            leaves = door_leaves(plan, plan_door, solids, config.swing)
            door = self.doors[plan_door.id] = hang(plan_door, leaves, physics, self.obstacles, config)
            if plan_door.material == "glass":
                physics.make_glass(door.body, len(leaves))
            door.place(0.0 if plan_door.id in closed else 1.0)
        self._opening: list[Door] = []
        self.door_of_body = {door.body: door for door in self.doors.values()}

    def open_door(self, door_id: str) -> None:
        """Let a door open from now on; it takes its time, and waits for a robot that blocks it.

        Raises:
            InvalidInputError: No such door.
        """
        _check_doors(self.plan, [door_id], list(self.doors))
        door = self.doors[door_id]
        door.set_out()
        if door.opens and door not in self._opening:
            self._opening.append(door)

    @property
    def moving(self) -> bool:
        """Whether a door is opening."""
        return bool(self._opening)

    def advance(self, duration: float, x: float, y: float, radius: float) -> None:
        """Move the doors that open.

        Args:
            duration: Time [s].
            x: Centre of the robot [m].
            y: Centre of the robot [m].
            radius: Of the robot [m]; a leaf that would touch it waits.
        """
        for door in self._opening:
            door.advance(duration, x, y, radius)
        self._opening = [door for door in self._opening if door.opens]

    def _add_static(self, area: Polygon | shapely.MultiPolygon, height: float | None, colour: RGBA) -> list[int]:
        """Extrude an area, building frame [m], to a height [m] or that of the walls; returns its bodies."""
        vertices, triangles = extrude(area) if height is None else extrude(area, height=height)
        return self._physics.add_static(vertices, upright(vertices, triangles), colour)


def building_solids(plan: FloorPlan) -> Polygon | shapely.MultiPolygon:
    """Unite the walls with what shuts the doors and openings to the outside, building frame [m]."""
    passages: tuple[PlanDoor | Opening, ...] = (*plan.doors, *plan.openings)
    outer = [door_gap(plan, passage) for passage in passages if None in passage.rooms]
    walls = wall_area(plan)
    return areal(shapely.union_all([walls, *outer])) if outer else walls


def _check_doors(plan: FloorPlan, wanted: Collection[str], inner: Collection[str]) -> None:
    """Check that doors to close or open lie between two rooms.

    Raises:
        InvalidInputError: One does not; the message lists those that do.
    """
    for name in wanted:
        if name not in inner:
            known = f"one of {', '.join(inner)}" if inner else "none: this plan has no doors between rooms"
            raise InvalidInputError(f"door {name!r} is not between two rooms of the plan", expected=known,
                                    where=plan.name)  # fmt: skip


def gap_from(solids: Polygon | shapely.MultiPolygon, x: float, y: float) -> float:
    """Compute the distance of a place from the solids [m], 0 inside them."""
    distance = solids.distance(shapely.Point(x, y))
    return math.inf if solids.is_empty else float(distance)
