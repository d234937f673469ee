"""The lists beside the map: doors with what is behind them, proposals to accept or dismiss."""

from collections.abc import Awaitable, Callable
from functools import partial

from nicegui import ui
from nicegui.element import Element

from closedrooms.core.door import ClosedDoor
from closedrooms.core.names import shown
from closedrooms.core.room import Room
from closedrooms.predictor.structure.door_proposals import DoorProposal
from closedrooms.visualization.colours import room_colours
from closedrooms.web.editing.session import EditSession
from closedrooms.web.page.door_row import DoorRow
from closedrooms.web.page.map_board import css
from closedrooms.web.page.prompts import plain_button


class DoorList:
    """Doors and proposals as rows; a row stays while its door or proposal does, and with it the focus.

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
        self._rows: list[DoorRow] = []
        self._proposed: dict[int, Element] = {}
        with ui.column().classes("w-full gap-1").props("data-id=doors") as self._doors:
            ui.label("Doors").classes("text-bold")
        self._proposals = ui.column().classes("w-full gap-1").props("data-id=proposals")
        with self._proposals, ui.row().classes("w-full items-center justify-between"):
            ui.label("Proposed").classes("text-bold")
            ui.button("accept all", on_click=lambda: done(session.accept_all())).props("flat dense no-caps")
        self._proposals.set_visibility(False)

    def draw(self) -> None:
        """Show what stands."""
        self._draw_doors()
        self._draw_proposals()

    def _draw_doors(self) -> None:
        doors = self._session.document.doors
        names = [door.id for door in doors]
        self._rename_rows(names)
        last = {row.name: row for row in self._rows}
        for name in last.keys() - set(names):
            last.pop(name).box.delete()
        with self._doors:
            self._rows = [last.get(name) or DoorRow(self._session, self._done, self._select, name) for name in names]
        _order(self._doors, [row.box for row in self._rows])
        colours = room_colours(names)
        for row, door in zip(self._rows, doors, strict=True):
            row.show(door, css(colours[door.id]), self._describe_behind(door))

    def _rename_rows(self, names: list[str]) -> None:
        """Let the row of a door that has another name now, at its old place, be that of the new name."""
        last = {row.name for row in self._rows}
        if len(names) != len(self._rows):
            return
        for row, name in zip(self._rows, names, strict=True):
            if row.name not in names and name not in last:
                row.rename(name)

    def _draw_proposals(self) -> None:
        left = dict(self._session.open_proposals)
        for number in self._proposed.keys() - left.keys():
            self._proposed.pop(number).delete()
        with self._proposals:
            self._proposed = {
                number: self._proposed.get(number) or self._proposal(number, proposal)
                for number, proposal in left.items()
            }
        _order(self._proposals, list(self._proposed.values()))
        self._proposals.set_visibility(bool(left))

    def _proposal(self, number: int, proposal: DoorProposal) -> Element:
        session, done = self._session, self._done
        x, y = session.sheet.point_on_map(proposal.midpoint)
        with ui.row().classes("w-full items-center justify-between no-wrap gap-1") as row:
            ui.label(f"score {proposal.score:.2f}, {proposal.width:.2f} m at ({x:.1f}, {y:.1f})")
            with ui.row().classes("no-wrap gap-0"):
                for icon, verb, work in (("check", "accept", session.accept), ("close", "dismiss", session.dismiss)):
                    plain_button(icon, f"{verb} proposal {number}", partial(_do, done, partial(work, number)))
        return row

    def _describe_behind(self, door: ClosedDoor) -> str:
        """Describe what is known of the room behind a door."""
        outcome = self._session.outcome
        if outcome is None or self._session.stale:
            return "..."
        room = next((room for room in outcome.rooms if door.id in room.doors), None)
        if room is None:
            return shown(outcome.failures.get(door.id) or outcome.trouble or "no room was predicted")
        return describe(room)


async def _do(done: Callable[[str], Awaitable[None]], work: Callable[[], str]) -> None:
    await done(work())


def _order(box: Element, rows: list[Element]) -> None:
    """Bring the rows of a list into their order, below its heading; one that is in its place is not touched."""
    for place, row in enumerate(rows, start=1):
        if box.default_slot.children[place] is not row:
            row.move(box, target_index=place)


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
