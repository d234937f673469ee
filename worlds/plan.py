"""The floor-plan model: rooms, walls, doors and openings."""

from dataclasses import dataclass, field
from typing import Literal

from shapely.geometry import Polygon

from closedrooms.core.door import Point, Segment
from closedrooms.core.remarks import Remark

DoorKind = Literal["hinged", "double", "sliding"]
Material = Literal["solid", "glass"]


@dataclass(frozen=True, slots=True)
class PlanRoom:
    """One room of a plan.

    Attributes:
        id: Unique in the plan.
        label: What it is, e.g. ``office``, ``corridor``, ``toilet``.
        polygon: Outline on the walls' centre lines, building frame [m]. The free interior is this minus the walls.
    """

    id: str
    label: str
    polygon: Polygon


@dataclass(frozen=True, slots=True)
class Wall:
    """A straight wall along its centre line, building frame [m]; doors and openings are cut out of it."""

    id: str
    segment: Segment
    thickness: float
    material: Material = "solid"


@dataclass(frozen=True, slots=True)
class PlanDoor:
    """A door in a wall.

    Attributes:
        id: Unique in the plan (``d00``, ``d01``, ...).
        segment: The two jambs on the wall's centre line, building frame [m].
        rooms: Ids of the rooms on both sides; ``None`` is outside.
        kind: How it moves.
        hinge: Which end of ``segment`` the leaf hangs on (0 or 1).
        opens_into: Id of the room into which it swings; ``None`` is outside.
        material: Of the leaf.
    """

    id: str
    segment: Segment
    rooms: tuple[str | None, str | None]
    kind: DoorKind = "hinged"
    hinge: Literal[0, 1] = 0
    opens_into: str | None = None
    material: Material = "solid"

    @property
    def width(self) -> float:
        """Clear width between the jambs [m]."""
        (x0, y0), (x1, y1) = self.segment
        return float(((x1 - x0) ** 2 + (y1 - y0) ** 2) ** 0.5)

    @property
    def midpoint(self) -> Point:
        """Middle of the two jambs, building frame [m]."""
        (x0, y0), (x1, y1) = self.segment
        return ((x0 + x1) / 2, (y0 + y1) / 2)


@dataclass(frozen=True, slots=True)
class Opening:
    """A passage without a door; ``segment`` on the wall's centre line, building frame [m]."""

    id: str
    segment: Segment
    rooms: tuple[str | None, str | None]


@dataclass(frozen=True, slots=True)
class Furniture:
    """A thing on the floor that blocks robot and rays; never part of the truth."""

    id: str
    polygon: Polygon


@dataclass(frozen=True, slots=True)
class FloorPlan:
    """One floor of a building, in the building frame: metres, x right, y up.

    Attributes:
        name: Name of the world.
        rooms: Every room, corridors included.
        walls: Every wall.
        doors: Every door.
        openings: Every passage without a door.
        start: Where the robot starts ``(x, y, heading)`` [m, rad], or ``None`` where an importer knows none.
        furniture: Optional clutter.
        meta: Where the plan came from: generator version and seed, source file.
        remarks: What was dropped, repaired or guessed on reading; neither compared nor written.
    """

    name: str
    rooms: tuple[PlanRoom, ...]
    walls: tuple[Wall, ...]
    doors: tuple[PlanDoor, ...]
    openings: tuple[Opening, ...] = ()
    start: tuple[float, float, float] | None = None
    furniture: tuple[Furniture, ...] = ()
    meta: dict[str, object] = field(default_factory=dict)
    remarks: tuple[Remark, ...] = field(default=(), compare=False)

    def __hash__(self) -> int:
        """Hash a few figures: what is computed once for each plan is kept by it, and some hold 60,000 walls."""
        return hash((self.name, len(self.rooms), len(self.walls), len(self.doors), len(self.openings)))

    @property
    def passages(self) -> tuple[PlanDoor | Opening, ...]:
        """Doors and openings."""
        return (*self.doors, *self.openings)
