"""One visitor at work: what they see, point at, change and save. Knows nothing of a browser."""

import math
import tempfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from closedrooms.core.door import ClosedDoor, Point, Segment
from closedrooms.core.errors import ClosedroomsError, InvalidInputError
from closedrooms.core.files.geojson import read_doors
from closedrooms.core.files.incoming import is_folder
from closedrooms.core.files.outgoing import write_bytes
from closedrooms.core.names import file_name
from closedrooms.core.report import Report, counted
from closedrooms.coverage.tour.coverage_tour import CoverageTour
from closedrooms.pipeline.edit import EditedPrediction, plan_edited_tour, predict_rooms, save_rooms
from closedrooms.pipeline.options.predict import PredictConfig
from closedrooms.predictor.structure.door_proposals import DoorProposal
from closedrooms.web.config import EditConfig
from closedrooms.web.editing.document import USUAL_WIDTH, Document, History, as_saved, as_segment
from closedrooms.web.editing.drafts import Draft, Drafts
from closedrooms.web.editing.sheet import MapSheet

# Pointing this near to a door means that door [m]: closer, the methods take two for the same.
SAME_DOOR = 0.30
NO_WALL = "no wall near here: a door lies in one"


class EditSession:
    """The state of one page.

    Actions return what to tell the visitor, and nothing where all is well; they never raise for what a visitor can do.

    Args:
        config: Options.
        sheet: The map.
        drafts: Where what is not saved is kept.
        visitor: Whose page it is.
    """

    def __init__(self, config: EditConfig, sheet: MapSheet, drafts: Drafts, visitor: str) -> None:
        self.config, self.sheet = config, sheet
        self._drafts, self._visitor = drafts, visitor
        self.trouble = ""
        document = Document(config.method, config.predictor)
        try:
            if config.doors is not None:
                document = replace(document, doors=as_saved(read_doors(config.doors)))
        except InvalidInputError as error:
            self.trouble = str(error)
        self._history = History(document)
        self.selected: str | None = None
        self.outcome: EditedPrediction | None = None
        self._predicted: Document | None = None

    # What stands

    @property
    def document(self) -> Document:
        """All that the visitor has decided so far."""
        return self._history.present

    @property
    def can_undo(self) -> bool:
        """Whether there is a step to undo."""
        return bool(self._history.past)

    @property
    def can_redo(self) -> bool:
        """Whether there is an undone step to do again."""
        return bool(self._history.future)

    @property
    def stale(self) -> bool:
        """Whether the prediction is older than the document."""
        return self._predicted is None or not _same_prediction(self._predicted, self.document)

    @property
    def open_proposals(self) -> list[tuple[int, DoorProposal]]:
        """Proposals that were not dismissed and where no door is yet, with their numbers."""
        middles = [self.sheet.point_on_grid(door.midpoint) for door in self.document.doors]
        return [
            (number, proposal)
            for number, proposal in enumerate(self.sheet.proposals)
            if self._place_of(proposal) not in self.document.dismissed
            and all(math.dist(proposal.midpoint, middle) > max(SAME_DOOR, proposal.width / 2) for middle in middles)
        ]

    def segment(self, door: ClosedDoor) -> Segment:
        """Look up the jambs of a door in the frame of the grid [m]."""
        a, b = as_segment(door)
        return (self.sheet.point_on_grid(a), self.sheet.point_on_grid(b))

    # What a visitor does; points are in the frame of the grid [m]

    def point_at(self, point: Point) -> str:
        """Take a click: on a door it is selected, on a proposal that is accepted, on a wall a door is set."""
        for door in self.document.doors:
            if math.dist(self.sheet.point_on_grid(door.midpoint), point) <= SAME_DOOR:
                self.selected = door.id
                return ""
        for number, proposal in self.open_proposals:
            if math.dist(proposal.midpoint, point) <= proposal.width / 2:
                return self.accept(number)
        snapped = self.sheet.snapper.snap(point, width=USUAL_WIDTH)
        return NO_WALL if snapped is None else self._add(snapped.segment)

    def accept(self, number: int) -> str:
        """Make a door of a proposal."""
        if not 0 <= number < len(self.sheet.proposals):
            return "no such proposal"
        return self._add(self.sheet.proposals[number].segment)

    def accept_all(self) -> str:
        """Make doors of all proposals that are left, as one step."""

        def add(document: Document) -> Document:
            for _, proposal in self.open_proposals:
                document = document.with_door(self.sheet.segment_on_map(proposal.segment))
            return document

        return self.change(add)

    def dismiss(self, number: int) -> str:
        """Say that a proposal is no door."""
        if not 0 <= number < len(self.sheet.proposals):
            return "no such proposal"
        return self.change(lambda document: document.without_proposal(self._place_of(self.sheet.proposals[number])))

    def drag(self, name: str, point: Point) -> str:
        """Move a door to a point: onto the wall there with the width of the leaf, where there is one."""

        def move(document: Document) -> Document:
            door = document.door(name)
            width = math.dist(*as_segment(door))
            snapped = self.sheet.snapper.snap(point, width=width)
            if snapped is not None:
                return document.placed(name, self.sheet.segment_on_map(snapped.segment))
            x, y = self.sheet.point_on_map(point)
            return document.shifted(name, (x - door.midpoint[0], y - door.midpoint[1]))

        self.selected = name
        return self.change(move)

    def drag_jamb(self, name: str, jamb: int, point: Point) -> str:
        """Move one jamb of a door, 0 or 1; the other one stays: the door turns and changes its width."""

        def move(document: Document) -> Document:
            jambs = list(as_segment(document.door(name)))
            jambs[jamb] = self.sheet.point_on_map(point)
            return document.placed(name, (jambs[0], jambs[1]))

        self.selected = name
        return self.change(move)

    def rename(self, name: str, new: str) -> str:
        """Give a door another id."""
        chosen = self.selected == name
        told = self.change(lambda document: document.renamed(name, new))
        if chosen and any(door.id == new.strip() for door in self.document.doors):
            self.selected = new.strip()
        return told

    def load_doors(self, name: str, content: bytes) -> str:
        """Take the doors of a GeoJSON file in place of all others, as one step.

        Args:
            name: Of the file, for messages.
            content: Untrusted.

        Returns:
            How many there are.

        Raises:
            InvalidInputError: They cannot be read; nothing is changed.
        """
        with tempfile.TemporaryDirectory(prefix="closedrooms-") as folder:
            path = Path(folder) / file_name(name, otherwise="doors.geojson")
            try:
                write_bytes(path, content)
                doors = as_saved(read_doors(path))
            except ClosedroomsError as error:
                raise InvalidInputError(str(error).replace(f"{folder}/", "")) from error
        document = Document(self.document.method, self.document.settings, doors, self.document.dismissed)
        told = f"{counted(len(doors), 'door')} read from {name}, in place of those that were here"
        return self.change(lambda _: document) or told

    def change(self, make: Callable[[Document], Document]) -> str:
        """Make a new document of the present one; a refusal is told and changes nothing."""
        try:
            changed = self._history.do(make(self.document))
        except InvalidInputError as error:
            return str(error)
        return self._after() if changed else ""

    def undo(self) -> str:
        """Take the last step back."""
        return self._after() if self._history.undo() else "nothing to undo"

    def redo(self) -> str:
        """Do the last undone step again."""
        return self._after() if self._history.redo() else "nothing to redo"

    # What comes of it

    def predict(self) -> EditedPrediction:
        """Predict the rooms of the document as it stands; may run on another thread than the page's."""
        document = self.document
        outcome = predict_rooms(self.sheet.read, document.doors, document.method, document.settings)
        self.outcome, self._predicted = outcome, document
        return outcome

    def tour(self) -> CoverageTour | str:
        """Plan a tour over the completed map, or say why there is none."""
        outcome, document = self.outcome, self._predicted
        if outcome is None or outcome.prediction is None or document is None:
            return "no tour: no prediction"
        return plan_edited_tour(outcome.prediction, document.method, self.config.coverage)

    @property
    def out(self) -> Path:
        """The folder to save to."""
        return self.config.out or Path(f"{self.config.map.stem}-rooms")

    @property
    def out_is_taken(self) -> bool:
        """Whether saving replaces something."""
        return is_folder(self.out) and any(self.out.iterdir())

    def save(self) -> Report:
        """Write the folder of the prediction.

        Raises:
            ClosedroomsError: It cannot be written, holds something that is not ours, or the map is gone.
        """
        document = self.document
        config = PredictConfig(
            map=self.config.map, doors=self.out / "doors.geojson", out=self.out, method=document.method,
            allow_outside=self.config.allow_outside, predictor=document.settings,
        )  # fmt: skip
        report = save_rooms(config, document.doors, self.config.coverage)
        if self.document is document:
            self._drafts.forget(self._visitor, self.config.map)
        return report

    def draft(self) -> Draft | None:
        """Read what this visitor left unsaved at their last visit, where it is not what the page shows anyway.

        Raises:
            ClosedroomsError: It cannot be read any more.
        """
        draft = self._drafts.find(self._visitor, self.config.map)
        return None if draft is None or draft.document == self.document else draft

    def take(self, draft: Draft) -> str:
        """Go on with a draft; undo leads back to what the page began with."""
        return self.change(lambda _: draft.document)

    def _add(self, segment: Segment) -> str:
        """Set a door on a segment, frame of the grid [m], and select it; returns what is to be told."""
        told = self.change(lambda document: document.with_door(self.sheet.segment_on_map(segment)))
        if not told:
            self.selected = self.document.doors[-1].id
        return told

    def _place_of(self, proposal: DoorProposal) -> Point:
        """Say where a proposal is, map frame, to the millimetre: what tells it from others."""
        x, y = self.sheet.point_on_map(proposal.midpoint)
        return (round(x, 3), round(y, 3))

    def _after(self) -> str:
        """Keep what stands now; the selection stays where its door is still there."""
        if self.selected not in {door.id for door in self.document.doors}:
            self.selected = None
        try:
            self._drafts.keep(self._visitor, self.config.map, self.document)
        except ClosedroomsError as error:
            return f"this change is not kept for later: {error}"
        return ""


def _same_prediction(a: Document, b: Document) -> bool:
    """Check whether two documents ask for the same prediction."""
    return (a.doors, a.method, a.settings) == (b.doors, b.method, b.settings)
