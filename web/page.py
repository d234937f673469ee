"""The page itself: what a session holds, drawn with NiceGUI; what somebody does, handed to the session."""

import contextlib
import math
import time
from collections.abc import Callable
from typing import Any

from nicegui import run, ui
from nicegui.events import KeyEventArguments, UploadEventArguments, ValueChangeEventArguments

from closedrooms.core.door import Point
from closedrooms.core.errors import ClosedroomsError
from closedrooms.core.names import shown
from closedrooms.coverage.tour import CoverageTour
from closedrooms.coverage.tour_features import make_tour_features
from closedrooms.predictor.methods import METHODS
from closedrooms.visualization.colours import INK, TOURS, Colour, room_colours
from closedrooms.web.door_list import DoorList
from closedrooms.web.map_board import HandleEvent, MapBoard, css
from closedrooms.web.pictures import map_url
from closedrooms.web.session import EditSession
from closedrooms.web.settings_dialog import ask_settings

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
KEYS = (
    ("Ctrl+Z, Ctrl+Y", "undo, redo"),
    ("Ctrl+S", "save"),
    ("N", "set a door at the wall nearest to the middle of the view"),
    ("P", "accept the best proposal that is left"),
    ("Tab, Enter", "go from door to door on the map, select one"),
    ("arrows", "move the selected door by 5 cm (Shift: 50 cm), or the view"),
    ("[ ]", "turn the selected door by 5 degrees (Shift: 45)"),
    ("Del", "delete the selected door"),
    ("Esc", "select none"),
    ("+ -", "zoom"),
)
# What a door or the view moves at a press of an arrow, x to the right and y up.
ARROWS = {"ArrowLeft": (-1, 0), "ArrowRight": (1, 0), "ArrowUp": (0, 1), "ArrowDown": (0, -1)}
STEP, BIG_STEP, PAN = 0.05, 0.5, 80
TURNS = {"[": math.radians(5), "]": -math.radians(5), "{": math.radians(45), "}": -math.radians(45)}
# How long a browser may take to connect [s].
PATIENCE = 30.0
# Rooms are filled this much where the slider is all on the side of the prediction.
FILL = 0.35


class EditPage:
    """One open page."""

    def __init__(self, session: EditSession) -> None:
        self._session = session
        self._tour: CoverageTour | str | None = None
        self._busy = False
        ui.page_title(f"{session.config.map.name} - closedrooms")
        self._bar()
        with ui.element("div").classes("work"):
            with ui.element("div").classes("stage"):
                self._board = MapBoard(self._clicked, self._pointed, self._handled)
                self._pointer = ui.label("").classes("pointer").props("data-id=pointer")
            with ui.column().classes("side"):
                self._status = ui.label("").props("data-id=status role=status aria-live=polite")
                self._list = DoorList(session, self._done, self._select)
        self._keys = ui.keyboard(self._pressed, ignore=["input", "select", "textarea"])

    async def start(self) -> None:
        """Draw the map once the browser is there, offer the draft, predict."""
        await self._board.ready()
        grid = self._session.sheet.read.grid
        self._board.picture("map", map_url(grid), grid.frame.bounds)
        self._board.show(self._session.sheet.bounds)
        if self._session.trouble:
            _tell(f"no doors were read: {self._session.trouble}", bad=True)
        self.draw()
        await self._offer_draft()
        await self._refresh()

    def draw(self) -> None:
        """Draw doors, proposals, rooms and tour as they stand, and the lists beside."""
        self._draw_rooms()
        self._draw_doors()
        self._draw_proposals()
        self._draw_tour()
        self._list.draw()
        for button, on in ((self._undo, self._session.can_undo), (self._redo, self._session.can_redo)):
            button.set_enabled(on)
        self._method.set_value(self._session.document.method)

    # The bar

    def _bar(self) -> None:
        session = self._session
        with ui.row().classes("bar"):
            ui.label(session.config.map.name).classes("text-bold wide")
            self._undo = _button("undo", "undo (Ctrl+Z)", lambda: self._done(session.undo()))
            self._redo = _button("redo", "redo (Ctrl+Y)", lambda: self._done(session.redo()))
            _button("add_location", "set a door in the middle of the view (N)", self._door_in_the_middle)
            self._method = ui.select(list(METHODS), value=session.document.method, on_change=self._method_chosen)
            self._method.props("dense options-dense label=method data-id=method").classes("w-32")
            _button("tune", "settings of the method", self._ask_settings)
            self._completed = _switch("completed map", self.draw)
            self._with_tour = _switch("tour", self._tour_switched)
            with ui.row().classes("items-center no-wrap gap-2"):
                ui.label("map").classes("wide")
                self._slider = ui.slider(min=0, max=1, step=0.05, value=1, on_change=self._faded).classes("w-28")
                self._slider.props('aria-label="between map and prediction" data-id=slider')
                ui.label("prediction").classes("wide")
            ui.space()
            _button("folder_open", "take doors from a GeoJSON file", self._pick_file)
            self._upload = ui.upload(on_upload=self._uploaded, auto_upload=True, max_file_size=20_000_000)
            self._upload.classes("hidden")
            _button("help_outline", "keys", _show_keys)
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
        self._draw_tour()
        await self._plan_tour()

    def _pick_file(self) -> None:
        self._upload.run_method("pickFiles")

    async def _uploaded(self, event: UploadEventArguments) -> None:
        content = await event.file.read()
        self._upload.reset()
        await self._done(self._session.load_doors(event.file.name, content))

    def _faded(self) -> None:
        share = float(self._slider.value)
        self._board.fade("completed", share)
        self._board.fade("notes", share)
        self._board.restyle("rooms", opacity=share, fillOpacity=FILL * share)

    # The map

    async def _clicked(self, point: Point) -> None:
        await self._done(self._session.point_at(point))

    def _pointed(self, point: Point) -> None:
        x, y = self._session.sheet.point_on_map(point)
        self._pointer.set_text(f"x {x:.2f} m, y {y:.2f} m")

    async def _handled(self, event: HandleEvent) -> None:
        session = self._session
        if event.kind in {"door", "chosen"} and event.type == "dragend":
            await self._done(session.drag(event.name, event.point))
        elif event.kind in {"door", "chosen"}:
            self._select(event.name)
        elif event.kind == "jamb" and event.type == "dragend" and session.selected is not None:
            await self._done(session.drag_jamb(session.selected, int(event.name == "1"), event.point))
        elif event.kind == "proposal" and event.type == "click" and event.name.isdecimal():
            await self._done(session.accept(int(event.name)))

    async def _door_in_the_middle(self) -> None:
        await self._done(self._session.point_at(self._board.middle))

    def _select(self, name: str | None) -> None:
        self._session.selected = name
        self.draw()

    async def _pressed(self, event: KeyEventArguments) -> None:
        if not event.action.keydown:
            return
        session, key, held = self._session, event.key.name, event.modifiers
        if held.ctrl or held.meta:
            work = {"z": session.redo if held.shift else session.undo, "y": session.redo}.get(key.lower())
            if work is not None:
                await self._done(work())
            elif key.lower() == "s":
                await self._save()
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
        elif key.lower() == "n":
            await self._door_in_the_middle()
        elif key.lower() == "p" and session.open_proposals:
            await self._done(session.accept(session.open_proposals[0][0]))

    async def _arrow(self, right: int, up: int, *, far: bool) -> None:
        name = self._session.selected
        if name is None:
            self._board.pan(right * PAN, -up * PAN)
            return
        step = BIG_STEP if far else STEP
        await self._done(self._session.change(lambda document: document.shifted(name, (right * step, up * step))))

    # What is drawn

    def _colours(self) -> dict[str, Colour]:
        return room_colours(door.id for door in self._session.document.doors)

    def _draw_doors(self) -> None:
        self._board.clear("doors")
        colours = self._colours()
        for door in self._session.document.doors:
            segment, chosen = self._session.segment(door), door.id == self._session.selected
            self._board.line("doors", segment, color="#000", weight=9, lineCap="butt")
            self._board.line("doors", segment, color=css(colours[door.id]), weight=5, lineCap="butt")
            middle = self._session.sheet.point_on_grid(door.midpoint)
            kind, label = "chosen" if chosen else "door", shown(door.id, longest=16)
            self._board.handle(
                "doors", middle, kind=kind, name=door.id, label=label, colour=colours[door.id], draggable=True
            )
            for jamb, point in enumerate(segment if chosen else ()):
                self._board.handle(
                    "doors", point, kind="jamb", name=str(jamb), label="", colour=colours[door.id], draggable=True
                )

    def _draw_proposals(self) -> None:
        self._board.clear("proposals")
        for number, proposal in self._session.open_proposals:
            self._board.line("proposals", proposal.segment, color="#fff", weight=8, lineCap="butt")
            self._board.line("proposals", proposal.segment, color=css(INK), weight=4, dashArray="6 5", lineCap="butt")
            label = f"{proposal.score:.2f}"
            self._board.handle(
                "proposals", proposal.midpoint, kind="proposal", name=str(number), label=label, colour=INK
            )

    def _draw_rooms(self) -> None:
        for group in ("completed", "rooms", "notes"):
            self._board.clear(group)
        outcome, share, colours = self._session.outcome, float(self._slider.value), self._colours()
        if outcome is None or outcome.prediction is None:
            return
        if self._completed.value:
            grid = outcome.prediction.grid
            self._board.picture("completed", map_url(grid), grid.frame.bounds, share)
        for room in outcome.rooms:
            colour = css(next((colours[door] for door in room.doors if door in colours), INK))
            self._board.shape(
                "rooms", room.polygon, color=colour, weight=2, opacity=share, fillColor=colour, fillOpacity=FILL * share
            )
            place = room.polygon.representative_point()
            label = f"{room.polygon.area:.1f} m²"
            self._board.handle(
                "notes", (place.x, place.y), kind="note", name=label, label=label, colour=INK, opacity=share
            )

    def _draw_tour(self) -> None:
        self._board.clear("tour")
        if isinstance(self._tour, CoverageTour):
            for shape, about in make_tour_features(self._tour, "predicted"):
                if about["type"] == "tour":
                    self._board.shape("tour", shape, color=css(TOURS["predicted"]), weight=3, opacity=0.8)

    # What comes of it

    async def _done(self, told: str) -> None:
        """After an action: tell what it said, draw what stands, predict anew."""
        if told:
            _tell(told)
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
                await run.io_bound(self._session.predict)
                self.draw()
        finally:
            self._busy = False
        self._say_outcome()
        await self._plan_tour()

    def _say_outcome(self) -> None:
        outcome, doors = self._session.outcome, self._session.document.doors
        if outcome is None:
            return
        if outcome.trouble:
            text = f"no prediction: {outcome.trouble}"
        elif not doors:
            text = "click on a wall where a closed door is, or on a dashed proposal"
        else:
            text = f"{_count(len(outcome.rooms), 'room')} behind {_count(len(doors), 'door')}, {outcome.seconds:.2f} s"
        if isinstance(self._tour, str):
            text += f"; {self._tour}"
        elif self._tour is not None:
            text += f"; tour {self._tour.length:.1f} m"
        self._status.set_text(text)

    async def _plan_tour(self) -> None:
        if not self._with_tour.value or self._busy or self._session.stale:
            return
        if self._tour is None:
            self._status.set_text("planning the tour ...")
            outcome = self._session.outcome
            tour = await run.io_bound(self._session.tour)
            if outcome is self._session.outcome and not self._session.stale:
                self._tour = tour
                self._draw_tour()
        self._say_outcome()

    async def _save(self) -> None:
        session = self._session
        if session.out_is_taken and not await self._ask(
            f"{session.out} holds files already. Replace what a prediction wrote there?", "replace", "keep it"
        ):
            return
        self._status.set_text(f"saving to {session.out} ...")
        try:
            report = await run.io_bound(session.save)
        except ClosedroomsError as error:
            _tell(f"not saved: {error}", bad=True)
        else:
            _tell(f"saved to {report.folder}: {report.title}")
        self._say_outcome()

    async def _offer_draft(self) -> None:
        try:
            draft = self._session.draft()
        except ClosedroomsError as error:
            _tell(f"what was left of the last visit cannot be read: {error}", bad=True)
            return
        if draft is None:
            return
        when = time.strftime("%d %B, %H:%M", time.localtime(draft.saved))
        question = f"On {when} you left {_count(len(draft.document.doors), 'door')} unsaved here. Go on with them?"
        if await self._ask(question, "go on", "begin anew"):
            told = self._session.take(draft)
            if told:
                _tell(told)
            self.draw()

    async def _ask(self, question: str, yes: str, no: str) -> bool:
        """Ask before something; keys mean nothing meanwhile."""
        self._keys.active = False
        with ui.dialog() as dialog, ui.card():
            ui.label(question)
            with ui.row().classes("w-full justify-end"):
                ui.button(no, on_click=lambda: dialog.submit(False)).props("flat")
                ui.button(yes, on_click=lambda: dialog.submit(True))
        answer = await dialog
        dialog.delete()
        self._keys.active = True
        return bool(answer)


def _show_keys() -> None:
    with ui.dialog() as dialog, ui.card(), ui.grid(columns="auto 1fr"):
        for keys, what in KEYS:
            ui.label(keys).classes("text-bold")
            ui.label(what)
    dialog.set_value(True)


def _button(icon: str, about: str, work: Any) -> ui.button:
    button = ui.button(icon=icon, on_click=work).props(f'flat dense round aria-label="{about}"')
    button.tooltip(about)
    return button


def _switch(about: str, work: Any) -> ui.switch:
    return ui.switch(about, value=False, on_change=work).props(f'dense aria-label="{about}"')


def _tell(text: str, *, bad: bool = False) -> None:
    kind: Any = "negative" if bad else "info"
    ui.notify(shown(text, longest=600), type=kind, multi_line=True, close_button=True, timeout=0 if bad else 6000)


def _count(number: int, noun: str) -> str:
    return f"{number} {noun}{'' if number == 1 else 's'}"


async def open_page(begin: Callable[[], EditSession]) -> None:
    """Build the page of one visitor.

    Args:
        begin: Reads the map and begins the session; takes seconds for a large one, and may refuse it.
    """
    ui.add_css(CSS)
    ui.page_title("closedrooms")
    waiting = ui.label("reading the map ...").classes("q-ma-lg")
    # Who only fetches the page, or has left again, needs no map.
    with contextlib.suppress(TimeoutError):
        await ui.context.client.connected(timeout=PATIENCE)
        try:
            session = await run.io_bound(begin)
        except ClosedroomsError as error:
            waiting.delete()
            _tell_trouble(str(error))
            return
        waiting.delete()
        await EditPage(session).start()


def _tell_trouble(text: str) -> None:
    with ui.card().classes("q-ma-lg"):
        ui.label("This map cannot be read.").classes("text-bold")
        ui.label(text).props("role=alert")
        ui.button("read it again", on_click=ui.navigate.reload)
