"""One door in the list beside the map: its name to type, its buttons, what is behind it, its numbers when selected."""

import math
from collections.abc import Awaitable, Callable

from nicegui import ui

from closedrooms.core.door import ClosedDoor
from closedrooms.web.editing.document import Document, as_segment
from closedrooms.web.editing.session import EditSession
from closedrooms.web.page.prompts import plain_button

# Turning by a button [rad].
TURN = math.radians(15)


class DoorRow:
    """Row of a door, which stays while the door does: what somebody types in it outlives a prediction.

    Args:
        session: What is shown.
        done: Takes what an action had to tell.
        select: Selects a door.
        name: Id of the door.

    Attributes:
        name: Id of the door.
        box: Element that holds all of the row.
    """

    def __init__(
        self,
        session: EditSession,
        done: Callable[[str], Awaitable[None]],
        select: Callable[[str | None], None],
        name: str,
    ) -> None:
        self._session, self._done, self._select, self.name = session, done, select, name
        self._style = ""
        with ui.column().classes("w-full gap-0 q-pa-xs") as self.box:
            with ui.row().classes("w-full items-center no-wrap gap-1"):
                self._field = ui.input(value=name).props('dense borderless aria-label="name of the door"')
                self._field.classes("col-grow").props["data-door"] = name
                self._field.on("change", self._renamed)
                self._field.on("keydown.enter", js_handler="event => event.target.blur()")
                plain_button("my_location", "select and show on the map", self._selected)
                plain_button("rotate_left", "turn left", lambda: self._turned(TURN))
                plain_button("rotate_right", "turn right", lambda: self._turned(-TURN))
                plain_button("delete", "delete", self._deleted)
            self._behind = ui.label().classes("text-body2").props("data-id=behind")
            self._numbers = DoorNumbers(self)

    def rename(self, name: str) -> None:
        """Show the same door under another id."""
        self.name = name
        self._field.props["data-door"] = name
        self._field.set_value(name)

    def show(self, door: ClosedDoor, colour: str, behind: str) -> None:
        """Show what stands; what is the same as before is left alone."""
        chosen = self.name == self._session.selected
        style = f"border-left: 6px solid {colour};" + ("background: #eee;" if chosen else "")
        if style != self._style:
            self._style = style
            self.box.style(replace=style)
        self._behind.set_text(behind)
        self._numbers.show(door if chosen else None)

    async def change(self, make: Callable[[Document, str], Document]) -> None:
        """Change the document by a function of it and of the door's id."""
        await self._done(self._session.change(lambda document: make(document, self.name)))

    async def _renamed(self) -> None:
        told = self._session.rename(self.name, str(self._field.value))
        if any(door.id == self.name for door in self._session.document.doors):  # it was refused
            self._field.set_value(self.name)
        await self._done(told)

    def _selected(self) -> None:
        self._select(None if self.name == self._session.selected else self.name)

    async def _turned(self, angle: float) -> None:
        await self.change(lambda document, name: document.turned(name, angle))

    async def _deleted(self) -> None:
        await self.change(lambda document, name: document.without_door(name))


class DoorNumbers:
    """Width and direction of the selected door, to type.

    Args:
        row: The row that they belong to.
    """

    def __init__(self, row: DoorRow) -> None:
        self._row = row
        self._box = ui.row().classes("no-wrap gap-2")
        self._shown: tuple[float, float] | None = None
        self._fields: tuple[ui.number, ui.number] | None = None

    def show(self, door: ClosedDoor | None) -> None:
        """Show the numbers of a door, or none."""
        if door is None:
            self._box.clear()
            self._shown = self._fields = None
            return
        (x0, y0), (x1, y1) = as_segment(door)
        numbers = (round(math.hypot(x1 - x0, y1 - y0), 3), round(math.degrees(math.atan2(y1 - y0, x1 - x0)), 1))
        if self._fields is None:
            self._fields = self._draw()
        if numbers != self._shown:
            self._shown = numbers
            self._reset()

    def _draw(self) -> tuple[ui.number, ui.number]:
        with self._box:
            width = ui.number("width [m]", step=0.05, min=0.2)
            turn = ui.number("direction [°]", step=1)
        for field in (width, turn):
            field.props("dense").classes("w-28")
            field.on("keydown.enter", js_handler="event => event.target.blur()")
        width.on("change", lambda: self._typed(width, Document.widened))
        turn.on("change", lambda: self._typed(turn, _aimed))
        return width, turn

    def _reset(self) -> None:
        """Write the door's numbers into the fields."""
        for field, number in zip(self._fields or (), self._shown or (), strict=True):
            field.set_value(number)

    async def _typed(self, field: ui.number, change: Callable[[Document, str, float], Document]) -> None:
        if field.value is None:
            self._reset()
            return
        value, self._shown = float(field.value), None  # what comes of it is written into the field, whatever it is
        await self._row.change(lambda document, name: change(document, name, value))


def _aimed(document: Document, name: str, degrees: float) -> Document:
    return document.aimed(name, math.radians(degrees))
