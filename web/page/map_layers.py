"""What a session holds, drawn on the map."""

from collections.abc import Sequence

import numpy as np
from shapely.geometry import MultiPoint

from closedrooms.core.grid import Bounds, OccupancyGrid
from closedrooms.core.names import shown
from closedrooms.coverage.tour.coverage_tour import CoverageTour
from closedrooms.coverage.tour.tour_features import make_tour_features
from closedrooms.visualization.colours import INK, TOURS, Colour, room_colours
from closedrooms.web.editing.session import EditSession
from closedrooms.web.page.map_board import MapBoard, css
from closedrooms.web.page.pictures import paint_map

# Rooms are filled this much where the slider is all on the side of the prediction.
FILL = 0.35
# Room around the map, as a share of its longer side: a room behind an outer wall still shows.
AROUND = 0.08
# What is shown around a door that is looked for, on every side [m].
NEAR = 3.0


class MapLayers:
    """The layers of one page.

    Attributes:
        share: Between the map (0) and the prediction (1): how opaque this is.
        with_completed: Whether the completed map is drawn too.
    """

    def __init__(self, board: MapBoard, session: EditSession) -> None:
        self._board, self._session = board, session
        self._drawn: tuple[OccupancyGrid, tuple[str, Bounds]] | None = None
        self.share, self.with_completed = 1.0, False

    def draw_map(self) -> None:
        """Draw the map below all else and show what is known of it."""
        self.show_all()
        self._board.picture("map", *paint_map(self._session.sheet.read.grid))

    def show_all(self) -> None:
        """Fit the view to what is known and to the rooms that are predicted, with some room around them."""
        rooms = () if self._session.outcome is None else self._session.outcome.rooms
        self._show([self._session.sheet.bounds, *(room.polygon.bounds for room in rooms)], AROUND)

    def show_door(self, name: str) -> None:
        """Fit the view to a door and the room behind it, with their surroundings."""
        session = self._session
        door = MultiPoint(session.segment(session.document.door(name))).buffer(NEAR)
        rooms = () if session.outcome is None else session.outcome.rooms
        self._show([door.bounds, *(room.polygon.bounds for room in rooms if name in room.doors)], 2 * AROUND)

    def _show(self, boxes: Sequence[Bounds], share: float) -> None:
        """Fit the view to several bounds [m] and a share of their longer side around them."""
        all_boxes = np.array(boxes)
        (x0, y0), (x1, y1) = all_boxes[:, :2].min(axis=0), all_boxes[:, 2:].max(axis=0)
        around = share * max(x1 - x0, y1 - y0)
        self._board.show((float(x0 - around), float(y0 - around), float(x1 + around), float(y1 + around)))

    def fade(self, share: float) -> None:
        """Go between map and prediction."""
        self.share = share
        self._board.fade("completed", share)
        self._board.fade("notes", share)
        self._board.restyle("rooms", opacity=share, fillOpacity=FILL * share)

    def _colours(self) -> dict[str, Colour]:
        return room_colours(door.id for door in self._session.document.doors)

    def draw_doors(self) -> None:
        """Draw the doors with their handles; those of the selected one's jambs too."""
        with self._board.redrawn("doors"):
            colours, doors = self._colours(), self._session.document.doors
            segments = {door.id: self._session.segment(door) for door in doors}
            # A layer a colour, not one a door: each costs a message.
            self._board.lines("doors", list(segments.values()), color="#000", weight=9, lineCap="butt")
            for colour in dict.fromkeys(colours[door.id] for door in doors):
                own = [segments[door.id] for door in doors if colours[door.id] == colour]
                self._board.lines("doors", own, color=css(colour), weight=5, lineCap="butt")
            for door in doors:
                chosen, colour = door.id == self._session.selected, colours[door.id]
                middle = self._session.sheet.point_on_grid(door.midpoint)
                kind, label = "chosen" if chosen else "door", shown(door.id, longest=16)
                self._board.handle("doors", middle, kind=kind, name=door.id, label=label, colour=colour, draggable=True)
                for jamb, point in enumerate(segments[door.id] if chosen else ()):
                    self._board.handle(
                        "doors", point, kind="jamb", name=str(jamb), label="", colour=colour, draggable=True
                    )

    def draw_proposals(self) -> None:
        """Draw the proposals that are left, dashed, with their scores."""
        with self._board.redrawn("proposals"):
            proposals = self._session.open_proposals
            segments = [proposal.segment for _, proposal in proposals]
            self._board.lines("proposals", segments, color="#fff", weight=8, lineCap="butt")
            self._board.lines("proposals", segments, color=css(INK), weight=4, dashArray="6 5", lineCap="butt")
            for number, proposal in proposals:
                label = f"{proposal.score:.2f}"
                self._board.handle(
                    "proposals", proposal.midpoint, kind="proposal", name=str(number), label=label, colour=INK
                )

    def draw_rooms(self) -> None:
        """Draw the predicted rooms, and the completed map below them where it is wanted."""
        with self._board.redrawn("completed", "rooms", "notes"):
            self._draw_rooms()

    def _draw_rooms(self) -> None:
        outcome, share, colours = self._session.outcome, self.share, self._colours()
        if outcome is None or outcome.prediction is None:
            return
        if self.with_completed:
            grid = outcome.prediction.grid
            if self._drawn is None or self._drawn[0] is not grid:
                self._drawn = (grid, paint_map(grid))
            self._board.picture("completed", *self._drawn[1], share)
        for room in outcome.rooms:
            colour = css(next((colours[door] for door in room.doors if door in colours), INK))
            self._board.shape(
                "rooms", room.polygon, color=colour, weight=2, opacity=share, fillColor=colour, fillOpacity=FILL * share
            )
            place = room.polygon.representative_point()
            sure = "" if room.confidence is None else f"\n{100 * room.confidence:.0f} %"
            label = f"{room.polygon.area:.1f} m²{sure}"
            self._board.handle(
                "notes", (place.x, place.y), kind="note", name=label, label=label, colour=INK, opacity=share
            )

    def draw_tour(self, tour: CoverageTour | str | None) -> None:
        """Draw a tour; none where there is none."""
        with self._board.redrawn("tour"):
            if isinstance(tour, CoverageTour):
                for shape, about in make_tour_features(tour, "predicted"):
                    if about["type"] == "tour":
                        self._board.shape("tour", shape, color=css(TOURS["predicted"]), weight=3, opacity=0.8)
