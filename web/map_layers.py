"""What a session holds, drawn on the map."""

from closedrooms.core.grid import OccupancyGrid
from closedrooms.core.names import shown
from closedrooms.coverage.tour.coverage_tour import CoverageTour
from closedrooms.coverage.tour.tour_features import make_tour_features
from closedrooms.visualization.colours import INK, TOURS, Colour, room_colours
from closedrooms.web.map_board import MapBoard, css
from closedrooms.web.pictures import map_url
from closedrooms.web.session import EditSession

# Rooms are filled this much where the slider is all on the side of the prediction.
FILL = 0.35


class MapLayers:
    """The layers of one page.

    Attributes:
        share: Between the map (0) and the prediction (1): how opaque this is.
        with_completed: Whether the completed map is drawn too.
    """

    def __init__(self, board: MapBoard, session: EditSession) -> None:
        self._board, self._session = board, session
        self._drawn: tuple[OccupancyGrid, str] | None = None
        self.share, self.with_completed = 1.0, False

    def draw_map(self) -> None:
        """Draw the map below all else and show what is known of it."""
        grid = self._session.sheet.read.grid
        self._board.picture("map", map_url(grid), grid.frame.bounds)
        self._board.show(self._session.sheet.bounds)

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

    def draw_proposals(self) -> None:
        """Draw the proposals that are left, dashed, with their scores."""
        self._board.clear("proposals")
        for number, proposal in self._session.open_proposals:
            self._board.line("proposals", proposal.segment, color="#fff", weight=8, lineCap="butt")
            self._board.line("proposals", proposal.segment, color=css(INK), weight=4, dashArray="6 5", lineCap="butt")
            label = f"{proposal.score:.2f}"
            self._board.handle(
                "proposals", proposal.midpoint, kind="proposal", name=str(number), label=label, colour=INK
            )

    def draw_rooms(self) -> None:
        """Draw the predicted rooms, and the completed map below them where it is wanted."""
        for group in ("completed", "rooms", "notes"):
            self._board.clear(group)
        outcome, share, colours = self._session.outcome, self.share, self._colours()
        if outcome is None or outcome.prediction is None:
            return
        if self.with_completed:
            grid = outcome.prediction.grid
            if self._drawn is None or self._drawn[0] is not grid:
                self._drawn = (grid, map_url(grid))
            self._board.picture("completed", self._drawn[1], grid.frame.bounds, share)
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

    def draw_tour(self, tour: CoverageTour | str | None) -> None:
        """Draw a tour; none where there is none."""
        self._board.clear("tour")
        if isinstance(tour, CoverageTour):
            for shape, about in make_tour_features(tour, "predicted"):
                if about["type"] == "tour":
                    self._board.shape("tour", shape, color=css(TOURS["predicted"]), weight=3, opacity=0.8)
