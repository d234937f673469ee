"""The keys of the page; :data:`~.prompts.KEYS` says what they do."""

import math
from collections.abc import Awaitable, Callable

from nicegui import ui
from nicegui.events import KeyEventArguments

from closedrooms.web.editing.session import EditSession
from closedrooms.web.page.map_board import MapBoard

# What a door or the view moves at a press of an arrow, x to the right and y up.
ARROWS = {"ArrowLeft": (-1, 0), "ArrowRight": (1, 0), "ArrowUp": (0, 1), "ArrowDown": (0, -1)}
STEP, BIG_STEP, PAN = 0.05, 0.5, 80
TURNS = {"[": math.radians(5), "]": -math.radians(5), "{": math.radians(45), "}": -math.radians(45)}


class Keyboard:
    """Effect of keys on a session and its map.

    Args:
        session: What is edited.
        board: The map that is moved.
        done: Takes what an action had to tell.
        select: Selects a door.
        show_all: Shows the whole map.
    """

    def __init__(
        self,
        session: EditSession,
        board: MapBoard,
        done: Callable[[str], Awaitable[None]],
        select: Callable[[str | None], None],
        show_all: Callable[[], None],
    ) -> None:
        self._session, self._board = session, board
        self._done, self._select, self._show_all = done, select, show_all
        self._keys = ui.keyboard(self._pressed, ignore=["input", "select", "textarea"])

    @property
    def active(self) -> bool:
        """Whether keys do anything."""
        return bool(self._keys.active)

    @active.setter
    def active(self, active: bool) -> None:
        self._keys.active = active

    async def set_door(self) -> None:
        """Set a door in the middle of the view."""
        await self._done(self._session.point_at(await self._board.find_middle()))

    async def _pressed(self, event: KeyEventArguments) -> None:
        """Do what a key that goes down means."""
        if not event.action.keydown:
            return
        session, key, held = self._session, event.key.name, event.modifiers
        if held.ctrl or held.meta:
            work = {"z": session.redo if held.shift else session.undo, "y": session.redo}.get(key.lower())
            if work is not None:
                await self._done(work())
        elif key in ARROWS:
            await self._arrow(*ARROWS[key], far=bool(held.shift))
        elif key in TURNS and session.selected is not None:
            name = session.selected
            await self._done(session.change(lambda document: document.turned(name, TURNS[key])))
        elif key in {"Delete", "Backspace"} and session.selected is not None:
            name = session.selected
            await self._done(session.change(lambda document: document.without_door(name)))
        elif key == "Escape":
            self._select(None)
        elif key in {"+", "-"}:
            self._board.zoom(1 if key == "+" else -1)
        else:
            await self._pressed_letter(key.lower())

    async def _pressed_letter(self, key: str) -> None:
        if key == "0":
            self._show_all()
        elif key == "n":
            await self.set_door()
        elif key == "p" and self._session.open_proposals:
            await self._done(self._session.accept(self._session.open_proposals[0][0]))

    async def _arrow(self, right: int, up: int, *, far: bool) -> None:
        """Move the selected door by a step, else the view."""
        name = self._session.selected
        if name is None:
            self._board.pan(right * PAN, -up * PAN)
            return
        step = BIG_STEP if far else STEP
        await self._done(self._session.change(lambda document: document.shifted(name, (right * step, up * step))))
