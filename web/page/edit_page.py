"""The page itself: what a session holds, drawn with NiceGUI; what somebody does, handed to the session."""

import asyncio
import contextlib
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

from nicegui import run, ui
from nicegui.events import UploadEventArguments, ValueChangeEventArguments

from closedrooms.core.door import Point
from closedrooms.core.errors import ClosedroomsError
from closedrooms.core.report import counted
from closedrooms.coverage.tour.coverage_tour import CoverageTour
from closedrooms.predictor.methods import METHODS
from closedrooms.web.editing.document import Document
from closedrooms.web.editing.session import EditSession
from closedrooms.web.page.door_list import DoorList
from closedrooms.web.page.keyboard import Keyboard
from closedrooms.web.page.map_board import PATIENCE, HandleEvent, MapBoard
from closedrooms.web.page.map_layers import MapLayers
from closedrooms.web.page.prompts import ask, icon_button, show_keys, switch, tell
from closedrooms.web.page.settings_dialog import ask_settings

CSS = """
body { margin: 0; }
.nicegui-content { padding: 0; gap: 0; height: 100dvh; }
.bar { width: 100%; padding: 4px 8px; gap: 4px 8px; align-items: center; border-bottom: 1px solid #bbb; }
.work { width: 100%; flex: 1 1 0; min-height: 0; display: flex; }
.stage { position: relative; flex: 1 1 0; min-width: 0; min-height: 0; }
.board { position: absolute; inset: 0; height: auto; width: auto; }
.pointer { position: absolute; right: 6px; bottom: 4px; z-index: 500; background: rgba(255, 255, 255, .8);
  padding: 0 6px; font-variant-numeric: tabular-nums; }
.side { width: 360px; overflow-y: auto; padding: 8px; gap: 6px; border-left: 1px solid #bbb; flex-wrap: nowrap; }
@media (max-width: 800px) {
  .work { flex-direction: column; }
  .side { width: 100%; flex: 0 0 42%; border-left: 0; border-top: 1px solid #bbb; }
  .wide { display: none; }
}
"""
# Largest list of doors [bytes].
MOST_BYTES = 20_000_000
T = TypeVar("T")


class EditPage:
    """One open page."""

    def __init__(self, session: EditSession) -> None:
        self._session = session
        self._tour: CoverageTour | str | None = None
        self._busy = False
        self._saved: tuple[Document, Path] | None = None
        ui.page_title(f"{session.config.map.name} - closedrooms")
        self._bar()
        with ui.element("div").classes("work"):
            with ui.element("div").classes("stage"):
                self._board = MapBoard(self._clicked, self._pointed, self._handled)
                self._layers = MapLayers(self._board, session)
                self._pointer = ui.label("").classes("pointer").props("data-id=pointer")
            with ui.column().classes("side"):
                self._status = ui.label("").props("data-id=status role=status aria-live=polite")
                self._list = DoorList(session, self._done, self._show_door)
        self._keys = Keyboard(session, self._board, self._done, self._select, self._layers.show_all)
        ui.on("save", self._save_pressed)

    async def start(self) -> None:
        """Draw the map once the browser is there, offer the draft, predict."""
        await self._board.ready()
        self._layers.draw_map()
        if self._session.trouble:
            tell(f"no doors were read: {self._session.trouble}", bad=True)
        self.draw()
        await self._offer_draft()
        await self._refresh()

    def draw(self) -> None:
        """Draw doors, proposals, rooms and tour as they stand, and the lists beside."""
        self._layers.draw_rooms()
        self._layers.draw_doors()
        self._layers.draw_proposals()
        self._layers.draw_tour(self._tour)
        self._list.draw()
        for button, on in ((self._undo, self._session.can_undo), (self._redo, self._session.can_redo)):
            button.set_enabled(on)
        self._method.set_value(self._session.document.method)

    # The bar

    def _bar(self) -> None:
        """Build the bar above the map."""
        session = self._session
        with ui.row().classes("bar"):
            ui.label(session.config.map.name).classes("text-bold wide")
            self._undo = icon_button("undo", "undo (Ctrl+Z)", lambda: self._done(session.undo()))
            self._redo = icon_button("redo", "redo (Ctrl+Y)", lambda: self._done(session.redo()))
            icon_button("add_location", "set a door in the middle of the view (N)", self._set_door)
            self._method = ui.select(list(METHODS), value=session.document.method, on_change=self._method_chosen)
            self._method.props("dense options-dense label=method data-id=method").classes("w-32")
            icon_button("tune", "settings of the method", self._ask_settings)
            self._completed = switch("completed map", self._completed_switched)
            self._with_tour = switch("tour", self._tour_switched)
            with ui.row().classes("items-center no-wrap gap-2"):
                ui.label("map").classes("wide")
                self._slider = ui.slider(min=0, max=1, step=0.05, value=1, on_change=self._faded).classes("w-28")
                self._slider.props('aria-label="between map and prediction" data-id=slider')
                ui.label("prediction").classes("wide")
            icon_button("fit_screen", "show all (0)", self._show_all)
            ui.space()
            self._upload = ui.upload(
                on_upload=self._uploaded, on_rejected=self._refused, auto_upload=True, max_file_size=MOST_BYTES
            )
            self._upload.classes("hidden")
            pick = icon_button("folder_open", "take doors from a GeoJSON file")
            # Browsers open a list of files only within seconds of a click: not after a way to the server and back.
            pick.on("click", js_handler=f"() => runMethod({self._upload.id}, 'pickFiles', [])")
            icon_button("help_outline", "keys", show_keys)
            ui.button("save", icon="save", on_click=self._save).props("dense data-id=save")

    async def _method_chosen(self, event: ValueChangeEventArguments[Any]) -> None:
        if event.value != self._session.document.method:
            await self._done(self._session.change(lambda document: document.with_method(event.value)))

    async def _ask_settings(self) -> None:
        self._keys.active = False
        settings = await ask_settings(self._session.document)
        self._keys.active = True
        if settings is not None:
            await self._done(self._session.change(lambda _: settings))

    async def _tour_switched(self) -> None:
        self._tour = None
        self._layers.draw_tour(self._tour)
        if not self._busy:
            self._say_outcome()
        await self._plan_tour()

    async def _uploaded(self, event: UploadEventArguments) -> None:
        content = await event.file.read()
        self._upload.reset()
        try:
            told = self._session.load_doors(event.file.name, content)
        except ClosedroomsError as error:
            tell(f"no doors were read: {error}", bad=True)
        else:
            await self._done(told)

    def _refused(self) -> None:
        tell(f"no doors were read: the file has more than {MOST_BYTES // 1_000_000} MB", bad=True)

    def _show_all(self) -> None:
        self._layers.show_all()

    def _faded(self) -> None:
        self._layers.fade(float(self._slider.value))

    def _completed_switched(self) -> None:
        self._layers.with_completed = bool(self._completed.value)
        self.draw()

    # The map

    async def _clicked(self, point: Point) -> None:
        await self._done(self._session.point_at(point))

    def _pointed(self, point: Point) -> None:
        x, y = self._session.sheet.point_on_map(point)
        self._pointer.set_text(f"x {x:.2f} m, y {y:.2f} m")

    async def _handled(self, event: HandleEvent) -> None:
        """Do what a click on a handle or the end of its drag means."""
        session = self._session
        if event.kind in {"door", "chosen"} and event.type == "dragend":
            await self._done(session.drag(event.name, event.point))
        elif event.kind in {"door", "chosen"}:
            self._select(event.name)
        elif event.kind == "jamb" and event.type == "dragend" and session.selected is not None:
            await self._done(session.drag_jamb(session.selected, int(event.name == "1"), event.point))
        elif event.kind == "proposal" and event.type == "click" and event.name.isdecimal():
            await self._done(session.accept(int(event.name)))

    async def _set_door(self) -> None:
        await self._keys.set_door()

    def _select(self, name: str | None) -> None:
        self._session.selected = name
        self.draw()

    def _show_door(self, name: str | None) -> None:
        """Select a door from the list, where nobody sees which one it is, and go to it on the map."""
        self._select(name)
        if name is not None:
            self._layers.show_door(name)

    # What comes of it

    async def _done(self, told: str) -> None:
        """After an action: tell what it said, draw what stands, predict anew."""
        if told:
            tell(told)
        self.draw()
        await self._refresh()

    async def _refresh(self) -> None:
        """Predict until the prediction is of what stands; changes meanwhile wait for the next turn."""
        if self._busy:
            return
        self._busy = True
        try:
            while self._session.stale:
                self._status.set_text("predicting ...")
                self._tour = None
                await work_aside(self._session.predict)
                self.draw()
        finally:
            self._busy = False
        self._say_outcome()
        await self._plan_tour()

    def _say_outcome(self) -> None:
        """Say in one line what stands: rooms, time, tour."""
        outcome, doors = self._session.outcome, self._session.document.doors
        if outcome is None:
            return
        if outcome.trouble:
            text = f"no prediction: {outcome.trouble}"
        elif not doors:
            text = "click on a wall where a closed door is, or on a dashed proposal"
        else:
            text = (
                f"{counted(len(outcome.rooms), 'room')} behind {counted(len(doors), 'door')}, {outcome.seconds:.2f} s"
            )
        if isinstance(self._tour, str):
            text += f"; {self._tour}"
        elif self._tour is not None:
            text += f"; tour {self._tour.length:.1f} m"
        if self._saved is not None and self._saved[0] is self._session.document:
            text += f"; saved to {self._saved[1]}"
        self._status.set_text(text)

    async def _plan_tour(self) -> None:
        """Plan the tour of what stands, where it is wanted and nothing changes meanwhile."""
        if not self._with_tour.value or self._busy or self._session.stale:
            return
        if self._tour is None:
            self._status.set_text("planning the tour ...")
            outcome = self._session.outcome
            tour = await work_aside(self._session.tour)
            if outcome is self._session.outcome and not self._session.stale:
                self._tour = tour
                self._layers.draw_tour(self._tour)
        self._say_outcome()

    async def _save_pressed(self) -> None:
        """Save by the keyboard, but not while a question is open."""
        if self._keys.active:
            await self._save()

    async def _save(self) -> None:
        """Save, after a question where files would be replaced."""
        session = self._session
        if session.out_is_taken and not await self._ask(
            f"{session.out} holds files already. Replace what a prediction wrote there?", "replace", "keep it"
        ):
            return
        self._status.set_text(f"saving to {session.out} ...")
        try:
            document = session.document
            report = await work_aside(session.save)
        except ClosedroomsError as error:
            tell(f"not saved: {error}", bad=True)
        else:
            self._saved = (document, Path(report.folder).resolve())
            tell(f"saved to {self._saved[1]}: {report.title}")
        self._say_outcome()

    async def _offer_draft(self) -> None:
        """Ask whether to go on with what the last visit left unsaved."""
        try:
            draft = self._session.draft()
        except ClosedroomsError as error:
            tell(f"what was left of the last visit cannot be read: {error}", bad=True)
            return
        if draft is None:
            return
        when = time.strftime("%d %B, %H:%M", time.localtime(draft.saved))
        question = f"On {when} you left {counted(len(draft.document.doors), 'door')} unsaved here. Go on with them?"
        if await self._ask(question, "go on", "begin anew"):
            told = self._session.take(draft)
            if told:
                tell(told)
            self.draw()

    async def _ask(self, question: str, yes: str, no: str) -> bool:
        """Ask before something; keys mean nothing meanwhile."""
        self._keys.active = False
        answer = await ask(question, yes, no)
        self._keys.active = True
        return answer


async def work_aside(work: Callable[[], T]) -> T:
    """Work on another thread while the page goes on.

    Raises:
        CancelledError: The server stops; NiceGUI 3 returns ``None`` then.
    """

    def wrapped() -> tuple[T]:
        return (work(),)

    result: tuple[T] | None = await run.io_bound(wrapped)
    if result is None:
        raise asyncio.CancelledError
    value: T = result[0]
    return value


async def open_page(begin: Callable[[], EditSession]) -> None:
    """Build the page of one visitor.

    Args:
        begin: Reads the map and begins the session; takes seconds for a large one, and may refuse it.
    """
    ui.add_css(CSS)
    ui.page_title("closedrooms")
    waiting = ui.label("reading the map and looking for closed doors ...").classes("q-ma-lg")
    # Who only fetches the page, or has left again, needs no map.
    with contextlib.suppress(TimeoutError):
        await ui.context.client.connected(timeout=PATIENCE)
        try:
            session = await work_aside(begin)
        except ClosedroomsError as error:
            waiting.delete()
            _tell_trouble(str(error))
            return
        waiting.delete()
        await EditPage(session).start()


def _tell_trouble(text: str) -> None:
    """Show why there is no page, and a way to try again."""
    with ui.card().classes("q-ma-lg"):
        ui.label("This map cannot be read.").classes("text-bold")
        ui.label(text).props("role=alert")
        ui.button("read it again", on_click=ui.navigate.reload)
