"""What a person changes on the page: closed doors, the method and its settings, with undo and redo."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from closedrooms.core.door import ClosedDoor, Point, Segment
from closedrooms.core.errors import InvalidInputError
from closedrooms.core.names import is_name, shown
from closedrooms.core.numbers import FARTHEST, WIDEST
from closedrooms.predictor.methods import find_method

# A door that nothing tells the width of [m]: what the methods draw where they do not know (section 3.7).
USUAL_WIDTH = 0.80
# Narrowest door that can be drawn [m]: less is a slip of the pointer.
NARROWEST = 0.20
# More doors than this take a browser half a minute to draw.
MOST_DOORS = 300
# Steps that can be undone.
MOST_STEPS = 1000


@dataclass(frozen=True, slots=True)
class Document:
    """Decisions of a person on the page, immutable: every change gives a new document.

    Attributes:
        method: How rooms are predicted.
        settings: Settings of that method, of its own class.
        doors: Closed doors in the map frame, rounded as ``doors.geojson`` holds them: what is predicted here is what
            ``closedrooms predict`` makes of the file.
        dismissed: Mid-points of proposals that are no doors, map frame [m].
    """

    method: str
    settings: Any
    doors: tuple[ClosedDoor, ...] = ()
    dismissed: frozenset[Point] = frozenset()

    def __post_init__(self) -> None:
        if len(self.doors) > MOST_DOORS:
            expected = f"at most {MOST_DOORS} on the page (closedrooms predict takes more)"
            raise InvalidInputError(f"{len(self.doors)} doors", expected=expected)

    def door(self, name: str) -> ClosedDoor:
        """Find a door by its id.

        Raises:
            InvalidInputError: There is none.
        """
        for door in self.doors:
            if door.id == name:
                return door
        raise InvalidInputError(f"no door {name!r}", expected=", ".join(d.id for d in self.doors) or "a door first")

    def free_name(self) -> str:
        """Choose the first of ``d00``, ``d01``, ... that no door has."""
        taken = {door.id for door in self.doors}
        return next(name for name in map("d{:02d}".format, range(len(taken) + 1)) if name not in taken)

    def with_door(self, segment: Segment, *, name: str = "", width: float | None = None) -> "Document":
        """Add a door.

        Raises:
            InvalidInputError: Too many doors, or a place, a width or a name that no door can have.
        """
        name = name or self.free_name()
        self._check_name(name)
        return replace(self, doors=(*self.doors, _drawn(name, segment, width)))

    def without_door(self, name: str) -> "Document":
        """Delete a door.

        Raises:
            InvalidInputError: No such door.
        """
        self.door(name)
        return replace(self, doors=tuple(door for door in self.doors if door.id != name))

    def renamed(self, name: str, new: str) -> "Document":
        """Give a door another id.

        Raises:
            InvalidInputError: No door ``name``, or ``new`` is another door's or no name at all.
        """
        new = new.strip()
        if new == name:
            return self
        self._check_name(new)
        return self._changed(name, lambda door: replace(door, id=new))

    def placed(self, name: str, segment: Segment) -> "Document":
        """Draw a door from jamb to jamb at another place.

        Raises:
            InvalidInputError: No such door, or a place or a width that no door can have.
        """
        return self._changed(name, lambda door: replace(_drawn(name, segment, None), state=door.state))

    def shifted(self, name: str, by: Point) -> "Document":
        """Move a door by metres along x and y.

        Raises:
            InvalidInputError: No such door, or a place that no door can have.
        """
        return self._changed(name, lambda door: _moved(door, by))

    def turned(self, name: str, angle: float) -> "Document":
        """Turn a door about its middle [rad], counter-clockwise; one that is a bare point becomes a line first.

        Raises:
            InvalidInputError: No such door, or one that is too narrow or too wide to be drawn.
        """
        (x0, y0), (x1, y1) = as_segment(self.door(name))
        return self.aimed(name, math.atan2(y1 - y0, x1 - x0) + angle)

    def aimed(self, name: str, angle: float) -> "Document":
        """Turn a door about its mid-point until it lies along a direction of the map frame [rad].

        Raises:
            InvalidInputError: No such door, or one that is too narrow or too wide to be drawn.
        """
        door = self.door(name)
        return self.placed(name, _around(door.midpoint, angle, _length(as_segment(door))))

    def widened(self, name: str, width: float) -> "Document":
        """Give a door another width [m], its middle stays.

        Raises:
            InvalidInputError: No such door, or a width that no door can have.
        """
        door = self.door(name)
        if not width > 0.0:
            raise InvalidInputError(f"a door of {width:g} m", expected=f"{NARROWEST:g} to {WIDEST:g} m")
        (x0, y0), (x1, y1) = as_segment(door)
        return self.placed(name, _around(door.midpoint, math.atan2(y1 - y0, x1 - x0), width))

    def with_method(self, method: str) -> "Document":
        """Choose a method, with its defaults.

        Raises:
            InvalidInputError: There is no such method.
        """
        return self if method == self.method else replace(self, method=method, settings=find_method(method).config())

    def without_proposal(self, place: Point) -> "Document":
        """Dismiss the proposal with this mid-point."""
        return replace(self, dismissed=self.dismissed | {place})

    def _changed(self, name: str, change: Callable[[ClosedDoor], ClosedDoor]) -> "Document":
        self.door(name)
        return replace(self, doors=tuple(change(door) if door.id == name else door for door in self.doors))

    def _check_name(self, name: str) -> None:
        if not is_name(name):
            raise InvalidInputError(f"{name!r} is no name of a door", expected="a short text")
        if any(door.id == name for door in self.doors):
            raise InvalidInputError(f"a door {name!r} is there already", expected="one door a name")


@dataclass(slots=True)
class History:
    """A document with what came before it and what was undone.

    Attributes:
        present: What stands now.
        past: Earlier ones, the oldest first.
        future: Undone ones, the last undone last.
    """

    present: Document
    past: list[Document] = field(default_factory=list)
    future: list[Document] = field(default_factory=list)

    def do(self, document: Document) -> bool:
        """Go on to a document; ``False`` where it is the present one."""
        if document == self.present:
            return False
        self.past = [*self.past[1 - MOST_STEPS :], self.present]
        self.present, self.future = document, []
        return True

    def undo(self) -> bool:
        """Go back one step; ``False`` where there is none."""
        if not self.past:
            return False
        self.future.append(self.present)
        self.present = self.past.pop()
        return True

    def redo(self) -> bool:
        """Do again what was undone; ``False`` where there is nothing."""
        if not self.future:
            return False
        self.past.append(self.present)
        self.present = self.future.pop()
        return True


def as_saved(doors: Sequence[ClosedDoor]) -> tuple[ClosedDoor, ...]:
    """Round doors as ``write_doors`` does and complete them as ``read_doors`` does: written and read, they stay."""
    return tuple(map(_rounded, doors))


def as_segment(door: ClosedDoor) -> Segment:
    """Compute the jambs of a door; of a bare point, a line of its width along x."""
    return door.segment or _around(door.midpoint, 0.0, door.width or USUAL_WIDTH)


def _rounded(door: ClosedDoor) -> ClosedDoor:
    """Round a door to 0.1 mm, so that a file written and read again is the same."""

    def place(point: Point) -> Point:
        return (round(point[0], 4) + 0.0, round(point[1], 4) + 0.0)

    width = None if door.width is None else round(door.width, 4) or None
    if door.segment is not None:
        a, b = place(door.segment[0]), place(door.segment[1])
        if a != b:
            middle = (a[0] / 2 + b[0] / 2, a[1] / 2 + b[1] / 2)
            return ClosedDoor(door.id, middle, (a, b), width or round(_length((a, b)), 4), door.state)
    return ClosedDoor(door.id, place(door.midpoint), None, width, door.state)


def _drawn(name: str, segment: Segment, width: float | None) -> ClosedDoor:
    """Place a door from jamb to jamb.

    Raises:
        InvalidInputError: Too far away, too narrow or too wide.
    """
    numbers = [value for point in segment for value in point]
    if not all(math.isfinite(value) and abs(value) <= FARTHEST for value in numbers):
        raise InvalidInputError(f"door {shown(name)} at {segment}", expected=f"finite metres up to {FARTHEST:g}")
    length = _length(segment)
    if not NARROWEST <= length <= WIDEST:
        raise InvalidInputError(f"a door of {length:.2f} m", expected=f"{NARROWEST:g} to {WIDEST:g} m")
    middle = (segment[0][0] / 2 + segment[1][0] / 2, segment[0][1] / 2 + segment[1][1] / 2)
    return _rounded(ClosedDoor(name, middle, segment, width or length))


def _moved(door: ClosedDoor, by: Point) -> ClosedDoor:
    """Shift a door by metres along x and y.

    Raises:
        InvalidInputError: The place is not finite or too far away.
    """

    def move(point: Point) -> Point:
        x, y = point[0] + by[0], point[1] + by[1]
        if not (math.isfinite(x) and math.isfinite(y) and max(abs(x), abs(y)) <= FARTHEST):
            raise InvalidInputError(f"door {door.id} at ({x}, {y})", expected=f"finite metres up to {FARTHEST:g}")
        return (x, y)

    segment = None if door.segment is None else (move(door.segment[0]), move(door.segment[1]))
    return _rounded(replace(door, midpoint=move(door.midpoint), segment=segment))


def _around(middle: Point, angle: float, length: float) -> Segment:
    """Place a segment of a length [m] and direction [rad] around a middle."""
    dx, dy = math.cos(angle) * length / 2, math.sin(angle) * length / 2
    return ((middle[0] - dx, middle[1] - dy), (middle[0] + dx, middle[1] + dy))


def _length(segment: Segment) -> float:
    return math.dist(*segment)
