"""The log of a recording: what a robot found out, when, and what that changed; about twenty lines a run."""

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from closedrooms.core.arrays import FloatArray
from closedrooms.core.door import ClosedDoor
from closedrooms.core.grid import OccupancyGrid
from closedrooms.core.remarks import Remark
from closedrooms.core.report import counted
from closedrooms.core.shapes import polygon_iou
from closedrooms.pipeline.options.run import RunConfig
from closedrooms.predictor.prediction import Prediction

if TYPE_CHECKING:
    from closedrooms.visualization.rerun.recorder import Recorder

# A predicted room is another one when it shares less than this with what it was before (intersection over union).
SAME_ROOM = 0.8
QUARTERS = (0.25, 0.5, 0.75)


class Story:
    """Source of the lines in the recording's log; what happens often is told once, then when it has doubled."""

    def __init__(self, recorder: "Recorder", *, floor: FloatArray | None = None, closed: int | None = None) -> None:
        """Begin.

        Args:
            recorder: Takes the lines.
            floor: Points spread evenly over all rooms, map frame, shape (n, 2) [m], where they are known. What is
                known outside, through glass, does not count.
            closed: How many doors are closed, where it is known.
        """
        self._recorder, self._floor, self._closed = recorder, floor, closed
        self._quarters = 0
        self._loops_told = 0
        self._events: set[str] = set()
        self._doors: set[str] = set()
        self._prediction: Prediction | None = None
        self._iou: Mapping[str, float] = {}

    def known(self, grid: OccupancyGrid, stamp: float) -> None:
        """Tell when another quarter of the floor is known."""
        if self._floor is None or not len(self._floor):
            return
        cells = grid.frame.to_cells(self._floor)
        cells = cells[grid.frame.contains(cells)]
        share = int(np.count_nonzero(grid.known[cells[:, 0], cells[:, 1]])) / len(self._floor)
        quarters = sum(1 for quarter in QUARTERS if share >= quarter)
        if quarters > self._quarters:
            self._quarters = quarters
            self._recorder.note(f"{100 * QUARTERS[quarters - 1]:.0f} % of the floor is known", stamp)

    def loops(self, count: int, stamp: float) -> None:
        """Tell of the first loop that was closed, then when there are twice as many."""
        if count >= max(2 * self._loops_told, 1):
            self._recorder.note("first loop closed" if count == 1 else f"{count} loops closed by now", stamp)
            self._loops_told = count

    def events(self, remarks: Iterable[Remark], stamp: float) -> None:
        """Tell of every kind of trouble, gap or repair when it is first met."""
        for remark in remarks:
            if remark.what not in self._events:
                self._events.add(remark.what)
                self._recorder.note(f"{remark.action} {remark.what} for the first time: {remark.why}", stamp)

    def doors(
        self,
        doors: Sequence[ClosedDoor],
        stamp: float,
        prediction: Prediction | None = None,
        iou: Mapping[str, float] | None = None,
    ) -> None:
        """Tell of doors that are new, of what is predicted behind them, and of rooms that are others than before.

        Args:
            doors: All that were seen.
            stamp: Timestamp [s].
            prediction: What is predicted behind them now, where that was asked.
            iou: With the true room, by door, where it is known.
        """
        iou = iou or {}
        new = [door.id for door in doors if door.id not in self._doors]
        for door in new:
            self._doors.add(door)
            of = "" if self._closed is None else f" ({len(self._doors)} of {self._closed})"
            behind = "" if prediction is None else f"; behind it: {_behind(door, prediction, iou)}"
            self._recorder.note(f"closed door {door} seen{of}{behind}", stamp)
        if prediction is None:
            return
        if self._prediction is not None:
            old = self._prediction
            changed = [door.id for door in doors if door.id not in new and _is_another(door.id, old, prediction)]
            was = {door: _behind(door, old, self._iou) for door in changed}
            told = "; ".join(f"{door} from {was[door]} to {_behind(door, prediction, iou)}" for door in changed)
            if told:
                self._recorder.note(f"prediction revised, behind {told}", stamp)
        self._prediction, self._iou = prediction, iou


def describe_robot(config: RunConfig) -> str:
    """Describe in one line what drives, and what predicts."""
    lidar, robot = config.sim.lidar, config.sim.robot
    sensor = f"lidar of {lidar.beams} beams up to {lidar.range_max:g} m"
    return (
        f"robot of radius {robot.radius:g} m, {sensor}, noise {config.noise}, seed {config.seed}; "
        f"rooms are predicted by the method {config.method}"
    )


def summarise_run(metrics: Mapping[str, Any]) -> str:
    """Sum up the figures of a run in one line.

    Args:
        metrics: As in ``run.json``.
    """
    told = [f"trajectory error {metrics['ate_m']:.3f} m (ATE)"]
    if metrics["area_mapped"] is not None:
        told.insert(0, f"{100 * metrics['area_mapped']:.1f} % of what can be reached is mapped")
    if metrics["room_iou_mean"] is not None:
        told.append(f"IoU {metrics['room_iou_mean']:.3f} on average over {counted(metrics['rooms_closed'], 'room')}")
    error = metrics["tour"]["errors_percent"]["predicted"]
    if error is not None:
        told.append(f"length of the tour predicted to {error:.1f} %")
    return f"in the end: {', '.join(told)}"


def known_area(grid: OccupancyGrid) -> float:
    """Measure what a map knows [m²]."""
    return float(np.count_nonzero(grid.known)) * grid.frame.resolution**2


def _is_another(door: str, old: Prediction, new: Prediction) -> bool:
    """Check whether another room is predicted behind a door than before."""
    before, after = (
        next((room.polygon for room in prediction.rooms if door in room.doors), None) for prediction in (old, new)
    )
    if before is None or after is None:
        return before is not after
    return polygon_iou(before, after) < SAME_ROOM


def _behind(door: str, prediction: Prediction, iou: Mapping[str, float]) -> str:
    """Say in few words what is predicted behind a door."""
    room = next((room for room in prediction.rooms if door in room.doors), None)
    if room is None:
        return f"nothing ({prediction.failures.get(door, 'no room yet')})"
    return f"{room.polygon.area:.1f} m²" + (f" (IoU {iou[door]:.2f})" if door in iou else "")
