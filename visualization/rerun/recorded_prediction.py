"""The predicted rooms in a recording: how they come about, how sure they are, and how well they match the true ones."""

from collections.abc import Collection, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from closedrooms.core.door import ClosedDoor
from closedrooms.core.grid import OccupancyGrid
from closedrooms.core.room import Room
from closedrooms.core.shapes import Shape, polygon_iou
from closedrooms.visualization import colours
from closedrooms.visualization.rerun import drawables
from closedrooms.visualization.rerun.curves import Curves
from closedrooms.visualization.rerun.drawn_prediction import draw_input, draw_rooms, draw_trace
from closedrooms.visualization.rerun.drawn_sureness import draw_nothing_yet, draw_sureness
from closedrooms.visualization.rerun.stream import RecordingStream, Stage
from closedrooms.visualization.rerun.weighed import draw_weighed, room_name

if TYPE_CHECKING:
    from closedrooms.predictor.prediction import Level, Prediction


class RecordedPrediction:
    """Predictions in a recording, in the map frame [m]; every closed door keeps the colour of its room throughout."""

    def __init__(self, stream: RecordingStream, curves: Curves) -> None:
        self._stream, self._curves = stream, curves
        self._palette: dict[str, colours.Colour] = {}
        self._true_rooms: dict[str, Shape] = {}

    def give_colours(self, doors: Collection[str]) -> None:
        """Give a colour to the rooms behind these doors, by id, and to no others."""
        self._palette = colours.room_colours(doors)

    def draw_truth(self, grid: OccupancyGrid, rooms: Sequence[Room]) -> None:
        """Draw the true map and rooms, there whatever the time."""
        draw_rooms(self._stream, "rooms/truth", grid, rooms, self._palette, static=True)
        self._true_rooms = {door: room.polygon for room in rooms for door in room.doors}

    def draw_nothing_yet(self, observed: OccupancyGrid) -> None:
        """Draw what there is before the first prediction, so that no view is empty."""
        self._stream.log("rooms/predicted/grid", drawables.grid_map(observed))
        draw_nothing_yet(self._stream, observed)

    def draw_final(
        self,
        observed: OccupancyGrid,
        doors: Sequence[ClosedDoor],
        prediction: "Prediction",
        iou: Mapping[str, float],
        stamp: float | None,
    ) -> dict[str, Any]:
        """Draw a prediction on the timeline of stages, each step at its own stage.

        Args:
            observed: The map M.
            doors: Closed doors in it.
            prediction: What is predicted behind them.
            iou: How well, by door (0..1), where the truth is known.
            stamp: Where its curves lie in time [s]; ``None`` without a map that grew over time.

        Returns:
            What the recording holds now, as changes of :class:`~closedrooms.visualization.rerun.tabs.Contents`.
        """
        self._stream.at(stage=Stage.SEGMENTS)
        held = self._draw_steps(observed, doors, prediction, staged=True)
        trace = prediction.trace
        self._add_levels(() if trace is None else trace.levels)
        self._stream.at(stage=Stage.ROOMS)
        return held | self._draw_rooms(observed, prediction, iou, stamp, Stage.ROOMS)

    def draw_interim(
        self,
        observed: OccupancyGrid,
        doors: Sequence[ClosedDoor],
        prediction: "Prediction",
        iou: Mapping[str, float],
        stamp: float,
        stage: int,
    ) -> dict[str, Any]:
        """Draw a prediction on the map so far as :meth:`draw_final`, but all of it at ``stamp`` [s] and ``stage``."""
        self._stream.at(stamp, stage)
        held = self._draw_steps(observed, doors, prediction, staged=False)
        return held | self._draw_rooms(observed, prediction, iou, stamp, stage)

    def draw_remaining(self, prediction: "Prediction") -> None:
        """Draw the rooms that are still predicted while the robot drives."""
        draw_rooms(self._stream, "driving/predicted", prediction.grid, prediction.rooms, self._palette)

    def _draw_steps(
        self, observed: OccupancyGrid, doors: Sequence[ClosedDoor], prediction: "Prediction", *, staged: bool
    ) -> dict[str, Any]:
        """Draw what the prediction starts from and how it came about, each step at its stage where ``staged``."""
        from closedrooms.predictor.prediction import WeighedTrace

        self.give_colours({*self._palette, *(door.id for door in doors)})
        draw_input(self._stream, observed, doors)
        trace = prediction.trace
        if isinstance(trace, WeighedTrace):
            draw_weighed(self._stream, trace, self._palette, staged=staged)
            return {"weighed": tuple(room_name(room) for room in trace.rooms)} if staged else {}
        if trace is not None:
            draw_trace(self._stream, trace, self._palette, staged=staged)
            return {"expansion": True}
        return {}

    def _draw_rooms(
        self,
        observed: OccupancyGrid,
        prediction: "Prediction",
        iou: Mapping[str, float],
        stamp: float | None,
        stage: int,
    ) -> dict[str, Any]:
        """Draw the predicted rooms and how sure they are, and add how well they match to the curves."""
        draw_rooms(self._stream, "rooms/predicted", prediction.grid, prediction.rooms, self._palette, iou=iou)
        draw_sureness(self._stream, observed, prediction, iou)
        self._curves.add_iou(iou, self._palette, stamp=stamp, stage=stage)
        held = {"rooms": True, "sureness": prediction.probability is not None, "room_iou": bool(iou)}
        return {part: True for part, is_there in held.items() if is_there}

    def _add_levels(self, levels: Sequence["Level"]) -> None:
        """Add how well each room is predicted level by level to the curves over the stages."""
        for level in levels:
            true = {door: self._true_rooms[door] for door in level.layouts if door in self._true_rooms}
            iou = {door: polygon_iou(level.layouts[door], shape) for door, shape in true.items()}
            stage = min(Stage.EXPANSION + level.k, Stage.ROOMS - 1)
            self._curves.add_iou(iou, self._palette, stamp=None, stage=stage)
