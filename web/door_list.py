"""The lists beside the map: doors with what is behind them, proposals to accept or dismiss."""

import math
from collections.abc import Awaitable, Callable
from functools import partial
from typing import Any

from nicegui import ui

from closedrooms.core.door import ClosedDoor
from closedrooms.core.names import shown
from closedrooms.core.room import Room
from closedrooms.visualization.colours import room_colours
from closedrooms.web.document import Document, as_segment
from closedrooms.web.map_board import css
from closedrooms.web.session import EditSession

# Turning by a button [rad].
TURN = math.radians(15)


class DoorList:
    """Doors and proposals as rows.

    Args:
        session: What is shown.
        done: Takes what an action had to tell.
        select: Selects a door.
    """

    def __init__(
        self,
        session: EditSession,
        done: Callable[[str], Awaitable[None]],
        select: Callable[[str | None], None],
    ) -> None:
        self._session, self._done, self._select = session, done, select
        self._doors = ui.column().classes("w-full gap-1").props("data-id=doors")
        self._proposals = ui.column().classes("w-full gap-1").props("data-id=proposals")

    def draw(self) -> None:
        """Show what stands."""
        session = self._session
        colours = room_colours(door.id for door in session.document.doors)
        self._doors.clear()
        with self._doors:
            ui.label("Doors").classes("text-bold")
            for door in session.document.doors:
                self._door(door, css(colours[door.id]))
        self._proposals.clear()
        left = session.open_proposals
        if not left:
            return
        with self._proposals:
            with ui.row().classes("w-full items-center justify-between"):
                ui.label("Proposed").classes("text-bold")
                ui.button("accept all", on_click=lambda: self._done(session.accept_all())).props("flat dense no-caps")
            for number, proposal in left:
                x, y = session.sheet.point_on_map(proposal.midpoint)
                with ui.row().classes("w-full items-center justify-between no-wrap gap-1"):
                    ui.label(f"score {proposal.score:.2f}, {proposal.width:.2f} m at ({x:.1f}, {y:.1f})")
                    with ui.row().classes("no-wrap gap-0"):
                        self._button("check", f"accept proposal {number}", partial(session.accept, number))
                        self._button("close", f"dismiss proposal {number}", partial(session.dismiss, number))

    def _door(self, door: ClosedDoor, colour: str) -> None:
        session, name = self._session, door.id
        chosen = name == session.selected
        with (
            ui.column()
            .classes("w-full gap-0 q-pa-xs")
            .style(f"border-left: 6px solid {colour};" + ("background: #eee;" if chosen else ""))
        ):
            with ui.row().classes("w-full items-center no-wrap gap-1"):
                field = ui.input(value=name).props('dense borderless aria-label="name of the door"').classes("col-grow")
                field.props["data-door"] = name
                field.on("change", lambda: self._done(session.rename(name, str(field.value))))
                field.on("keydown.enter", js_handler="event => event.target.blur()")
                self._plain("my_location", "select", lambda: self._select(None if chosen else name))
                self._button("rotate_left", "turn left", self._turn(name, TURN))
                self._button("rotate_right", "turn right", self._turn(name, -TURN))
                self._button("delete", "delete", lambda: session.change(lambda d: d.without_door(name)))
            ui.label(self._behind(door)).classes("text-body2").props("data-id=behind")
            if chosen:
                self._numbers(door)

    def _numbers(self, door: ClosedDoor) -> None:
        """Draw width and direction of the selected door, to type."""
        name = door.id
        (x0, y0), (x1, y1) = as_segment(door)
        with ui.row().classes("no-wrap gap-2"):
            width = ui.number("width [m]", value=round(math.hypot(x1 - x0, y1 - y0), 3), step=0.05, min=0.2)
            turn = ui.number("direction [°]", value=round(math.degrees(math.atan2(y1 - y0, x1 - x0)), 1), step=1)
            for field in (width, turn):
                field.props("dense").classes("w-28")
                field.on("keydown.enter", js_handler="event => event.target.blur()")
        width.on("change", lambda: self._typed(width, name, Document.widened))
        turn.on("change", lambda: self._typed(turn, name, _aimed))

    async def _typed(self, field: ui.number, name: str, change: Callable[[Document, str, float], Document]) -> None:
        if field.value is not None:
            value = float(field.value)
            await self._done(self._session.change(lambda document: change(document, name, value)))

    def _turn(self, name: str, angle: float) -> Callable[[], str]:
        return lambda: self._session.change(lambda document: document.turned(name, angle))

    def _behind(self, door: ClosedDoor) -> str:
        """Describe what is known of the room behind a door."""
        outcome = self._session.outcome
        if outcome is None or self._session.stale:
            return "..."
        room = next((room for room in outcome.rooms if door.id in room.doors), None)
        if room is None:
            return shown(outcome.failures.get(door.id) or outcome.trouble or "no room was predicted")
        return describe(room)

    def _button(self, icon: str, about: str, work: Callable[[], str]) -> None:
        self._plain(icon, about, lambda: self._done(work()))

    @staticmethod
    def _plain(icon: str, about: str, work: Callable[[], Any]) -> None:
        ui.button(icon=icon, on_click=work).props(f'flat dense round size=sm aria-label="{about}"')


def _aimed(document: Document, name: str, degrees: float) -> Document:
    return document.aimed(name, math.radians(degrees))


def describe(room: Room) -> str:
    """Describe a room in one line: area, kind, and how sure the prediction is where the method says so."""
    parts = [f"{room.polygon.area:.1f} m²", room.kind or ""]
    confidence = getattr(room, "confidence", None)
    if confidence is not None:
        parts.append(f"{100 * confidence:.0f} % sure")
    if len(room.doors) > 1:
        parts.append(f"shared by {', '.join(shown(door, longest=20) for door in room.doors)}")
    if room.bounded:
        parts.append("the search was cut")
    return ", ".join(filter(None, parts))
