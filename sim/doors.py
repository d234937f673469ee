"""The doors of a building: placed along their travel, or hung in PyBullet and moved by motors and by whoever pushes."""

from typing import Protocol

import shapely
from shapely.geometry import Polygon

from closedrooms.core.arrays import FloatArray
from closedrooms.sim.config import SimConfig
from closedrooms.sim.contacts import Obstacles, leaf_edges
from closedrooms.sim.door_leaves import Leaf
from closedrooms.sim.physics_world import PhysicsWorld
from closedrooms.sim.solids import MovingPart, upright
from closedrooms.worlds.extrusion import extrude
from closedrooms.worlds.plan import PlanDoor

# Usual height of a door leaf [m].
DOOR_HEIGHT = 2.1
# What a latch holds: rammed at 1 m/s a closed door moved by 0.000 degrees [Nm or N].
LATCH = 2000.0
# The motor that opens a hinged door, EN 16005's low energy: a robot stops it [Nm]; the same at half a leaf's
# width, of a sliding one [N].
HINGE_MOTOR, SLIDE_MOTOR = 20.0, 44.0
# Friction of hinges and rails: a leaf stays where it is left [Nm or N].
HINGE_FRICTION, SLIDE_FRICTION = 2.0, 5.0
# Speed that a motor may reach where doors open at once, in travels a second [1/s].
AT_ONCE = 50.0
# A leaf this near to the end of its travel has arrived, and one this near to its frame is closed [share of its travel].
ARRIVED, SHUT = 0.99, 0.02


class Door(Protocol):
    """One door of the building, and how far it is open.

    Attributes:
        plan: The door in the plan.
        leaves: What moves.
        body: Its body in PyBullet.
        opens: Whether it is opening.
    """

    plan: PlanDoor
    leaves: tuple[Leaf, ...]
    body: int
    opens: bool

    @property
    def opening(self) -> float:
        """0 closed, 1 as far open as the plan allows."""

    @property
    def closed(self) -> bool:
        """Whether it blocks the passage."""

    def corners(self) -> list[FloatArray]:
        """Compute the corners of each leaf as it stands, shape (4, 2), building frame [m]."""

    def place(self, opening: float) -> None:
        """Place it between closed, 0, and open, 1."""

    def set_out(self) -> None:
        """Begin to open."""

    def advance(self, duration: float, x: float, y: float, radius: float) -> None:
        """Open further for ``duration`` [s] beside a robot of ``radius`` [m] at ``(x, y)`` [m]."""


class PlacedDoor:
    """A door without weight: it is put where it is, opens at its pace and waits for a robot that blocks it."""

    def __init__(
        self, plan: PlanDoor, leaves: tuple[Leaf, ...], physics: PhysicsWorld, obstacles: Obstacles, config: SimConfig
    ) -> None:
        self.plan, self.leaves = plan, leaves
        self.opening = 0.0
        self.opens = False
        self._physics, self._obstacles, self._seconds = physics, obstacles, config.door_seconds
        self.body = physics.add_moving([door_part(leaf) for leaf in leaves])
        for link, leaf in enumerate(leaves):
            low, high = leaf.reach.min(axis=0), leaf.reach.max(axis=0)
            obstacles.add_leaf((plan.id, link), (*low, *high))

    @property
    def closed(self) -> bool:
        """Whether it blocks the passage."""
        return self.opening == 0.0

    def corners(self) -> list[FloatArray]:
        """Compute the corners of each leaf as it stands, shape (4, 2), building frame [m]."""
        return self._corners(self.opening)

    def _corners(self, opening: float) -> list[FloatArray]:
        return [leaf.at(opening * leaf.travel) for leaf in self.leaves]

    def place(self, opening: float) -> None:
        """Place it between closed, 0, and open, 1."""
        self.opening = opening
        for link, (leaf, corners) in enumerate(zip(self.leaves, self.corners(), strict=True)):
            self._physics.move_joint(self.body, link, opening * leaf.travel)
            self._obstacles.move_leaf((self.plan.id, link), leaf_edges(corners))

    def set_out(self) -> None:
        """Begin to open."""
        self.opens = self.opening < 1.0

    def advance(self, duration: float, x: float, y: float, radius: float) -> None:
        """Open further, unless a leaf would touch the robot."""
        share = duration / self._seconds if self._seconds > 0 else 1.0
        opening = min(self.opening + share, 1.0)
        robot = shapely.Point(x, y)
        if any(Polygon(corners).distance(robot) <= radius + 1e-3 for corners in self._corners(opening)):
            return
        self.place(opening)
        self.opens = opening < 1.0


class HungDoor:
    """A door with weight, friction and a latch; what blocks it stops its motor."""

    def __init__(
        self, plan: PlanDoor, leaves: tuple[Leaf, ...], physics: PhysicsWorld, obstacles: Obstacles, config: SimConfig
    ) -> None:
        self.plan, self.leaves = plan, leaves
        self.opens = False
        self.latched = False
        self._physics, self._obstacles = physics, obstacles
        self._latches = config.doors == "latched"
        self._rate = 1.0 / config.door_seconds if config.door_seconds > 0 else AT_ONCE
        limits = [max(leaf.travel, 1e-3) for leaf in leaves]
        self.body = physics.add_hung([door_part(leaf) for leaf in leaves], limits)
        for link, leaf in enumerate(leaves):
            low, high = leaf.reach.min(axis=0), leaf.reach.max(axis=0)
            obstacles.add_leaf((plan.id, link), (*low, *high))

    def _positions(self) -> list[float]:
        return [self._physics.joint_position(self.body, link) for link in range(len(self.leaves))]

    @property
    def opening(self) -> float:
        """0 closed, 1 as far open as the plan allows; the mean of its leaves."""
        if self.latched:
            return 0.0
        shares = [p / max(leaf.travel, 1e-3) for p, leaf in zip(self._positions(), self.leaves, strict=True)]
        return min(max(sum(shares) / len(shares), 0.0), 1.0) if shares else 1.0

    @property
    def closed(self) -> bool:
        """Whether it blocks the passage."""
        return self.latched or self.opening < SHUT

    def corners(self) -> list[FloatArray]:
        """Compute the corners of each leaf as it stands, shape (4, 2), building frame [m]."""
        return [leaf.at(position) for leaf, position in zip(self.leaves, self._positions(), strict=True)]

    def place(self, opening: float) -> None:
        """Place it between closed, 0, and open, 1; closed, it latches."""
        self.latched = self._latches and opening == 0.0
        for link, leaf in enumerate(self.leaves):
            self._physics.move_joint(self.body, link, opening * leaf.travel)
            self._obstacles.move_leaf((self.plan.id, link), leaf_edges(leaf.at(opening * leaf.travel)))
            if self.latched:
                self._physics.drive_joint(self.body, link, 0.0, force=LATCH, speed=1.0)
            else:
                self._let_go(link)

    def set_out(self) -> None:
        """Begin to open."""
        if self.opening >= ARRIVED:
            return
        self.opens, self.latched = True, False
        for link, leaf in enumerate(self.leaves):
            force = SLIDE_MOTOR if leaf.slides else HINGE_MOTOR
            speed = max(leaf.travel, 1e-3) * self._rate
            self._physics.drive_joint(self.body, link, leaf.travel, force=force, speed=speed)

    def advance(self, duration: float, x: float, y: float, radius: float) -> None:  # noqa: ARG002
        """Let go of a door that has arrived: the physics move it."""
        if self.opening >= ARRIVED:
            self.opens = False
            for link in range(len(self.leaves)):
                self._let_go(link)

    def _let_go(self, link: int) -> None:
        """Leave a leaf to push and friction, no motor."""
        friction = SLIDE_FRICTION if self.leaves[link].slides else HINGE_FRICTION
        self._physics.brake_joint(self.body, link, friction)


def door_part(leaf: Leaf) -> MovingPart:
    """Extrude a leaf into the solid that PyBullet takes."""
    vertices, triangles = extrude(Polygon(leaf.corners), height=DOOR_HEIGHT)
    axis = (*leaf.direction.tolist(), 0.0) if leaf.slides else (0.0, 0.0, float(leaf.sense))
    x, y = leaf.pivot.tolist()
    return MovingPart(vertices, upright(vertices, triangles), leaf.slides, (x, y, 0.0), axis)
