"""The curves of a run in a recording: poses, their errors, what is known, how well each room is predicted."""

from collections.abc import Mapping

import numpy as np
import rerun as rr

from closedrooms.core.arrays import FloatArray
from closedrooms.core.pose import Pose2
from closedrooms.visualization import colours
from closedrooms.visualization.rerun import drawables
from closedrooms.visualization.rerun.stream import RecordingStream, Stage

UNKNOWN_POSE = (np.nan,) * 3
ROW = 11


class Curves:
    """Store of what is plotted as curves, sent as whole columns: many times cheaper than one call a value.

    Attributes:
        corrected: Stamps [s] and poses of the trajectory after the last optimisation.
        tops: Largest value of each plot, by its name, in its unit.
    """

    def __init__(self, stream: RecordingStream) -> None:
        self._stream = stream
        self._poses: list[tuple[float, ...]] = []
        self._sent = 0
        self._styled: set[str] = set()
        self._by_stage: dict[str, dict[int, float]] = {}
        self.corrected: tuple[FloatArray, FloatArray] | None = None
        self.tops: dict[str, float] = {}

    def __len__(self) -> int:
        return len(self._poses)

    @property
    def has_reference(self) -> bool:
        """Whether true poses are known."""
        return any(np.isfinite(row[8]) for row in self._poses)

    def add_poses(self, stamp: float, stage: int, odometry: Pose2, estimate: Pose2, truth: Pose2 | None) -> None:
        """Add the poses at one scan."""
        third = UNKNOWN_POSE if truth is None else truth.as_tuple()
        self._poses.append((stamp, float(stage), *odometry.as_tuple(), *estimate.as_tuple(), *third))

    def set_reference(self, poses: FloatArray) -> None:
        """Set the true poses of every scan, where they come afterwards."""
        self._poses = [(*row[:8], *map(float, pose)) for row, pose in zip(self._poses, poses, strict=True)]

    def add(
        self,
        path: str,
        value: float,
        name: str,
        colour: colours.Colour,
        *,
        stamp: float | None,
        stage: int,
        dots: bool = False,
    ) -> None:
        """Add one value of a curve.

        Over the time it is one of many; over the stages the last one counts (:meth:`send_stages`).

        Args:
            path: Of the curve.
            value: The value.
            name: Of the curve, for people.
            colour: Of the curve.
            stamp: Timestamp [s]; ``None`` where no time goes by.
            stage: At which stage.
            dots: Mark the values.
        """
        if path not in self._styled:
            self._styled.add(path)
            marks = [rr.SeriesPoints(colors=[colour], marker_sizes=[5.0])] if dots else []
            lines = rr.SeriesLines(colors=[colour], names=[name], widths=[1.5])
            self._stream.log(path, lines, *marks, static=True)
        if stamp is not None:
            self._stream.columns(path, rr.Scalars.columns(scalars=[value]), stamps=np.array([stamp]))
        self._by_stage.setdefault(path, {})[int(stage)] = value
        self._raise_top(path, value)

    def add_iou(
        self, iou: Mapping[str, float], palette: Mapping[str, colours.Colour], *, stamp: float | None, stage: int
    ) -> None:
        """Add how well each room is predicted, by door."""
        for door, value in iou.items():
            path, colour = f"metrics/room_iou/{rr.escape_entity_path_part(door)}", palette.get(door, colours.INK)
            self.add(path, value, door, colour, stamp=stamp, stage=stage, dots=True)

    def send_stages(self, last: int) -> None:
        """Send every curve over the stages: each value stays until the next one, up to the last stage."""
        for path, values in self._by_stage.items():
            stages = sorted({*values, *(stage for stage in (*Stage, last) if min(values) <= stage <= last)})
            held, told = 0.0, []
            for stage in stages:
                held = values.get(stage, held)
                told.append(held)
            self._stream.columns(path, rr.Scalars.columns(scalars=told), stages=stages)

    def send_poses(self) -> None:
        """Send the poses since the last time, so that a robot moves."""
        rows, self._sent = self._poses[self._sent :], len(self._poses)
        if not rows:
            return
        stamps, steps, _, estimate, truth = _split(rows)
        self._stream.columns("map/robot", drawables.pose_columns(estimate), stamps=stamps, stages=steps)
        if np.isfinite(truth[:, 0]).all():
            self._stream.columns("building/robot", drawables.pose_columns(truth), stamps=stamps, stages=steps)

    def send_errors(self) -> None:
        """Send the errors against the true poses, once they are all known."""
        if not self.has_reference:
            return
        stamps, _, odometry, estimate, truth = _split(self._poses)
        given = np.isfinite(truth[:, 0])
        tracks = {"estimate": (estimate, colours.ESTIMATE)}
        if self.corrected is not None and np.array_equal(self.corrected[0], stamps[: len(self.corrected[0])]):
            tracks["corrected"] = (self.corrected[1], colours.LOOP)
        for name, (poses, colour) in tracks.items():
            kept = given[: len(poses)]
            times, theirs, true = stamps[: len(poses)][kept], poses[kept], truth[: len(poses)][kept]
            self._send(f"metrics/position_error/{name}", times, _apart(theirs, true), name, colour)
            self._send(f"metrics/heading_error/{name}", times, _turned(theirs, true), name, colour)
        drift = _apart(odometry[given], truth[given])
        self._send("metrics/odometry_error/position", stamps[given], drift, "odometry", colours.ODOMETRY)

    def _raise_top(self, path: str, value: float) -> None:
        """Note the largest value of a plot, of ``metrics/<plot>/<curve>``."""
        plot = path.split("/")[1]
        self.tops[plot] = max(self.tops.get(plot, 0.0), value)

    def _send(self, path: str, stamps: FloatArray, values: FloatArray, name: str, colour: colours.Colour) -> None:
        """Send a whole curve over its stamps [s]; over the stages its first and last value stand for it."""
        self._stream.log(path, rr.SeriesLines(colors=[colour], names=[name], widths=[1.5]), static=True)
        self._stream.columns(path, rr.Scalars.columns(scalars=values), stamps=stamps)
        if len(values):
            self._raise_top(path, float(values.max()))
            self._by_stage[path] = {Stage.BUILDING: float(values[0]), Stage.MAPPING: float(values[-1])}


def _split(rows: list[tuple[float, ...]]) -> tuple[FloatArray, list[int], FloatArray, FloatArray, FloatArray]:
    """Split the poses by odometry, estimate and truth, with stamps and stages."""
    table = np.array(rows).reshape(-1, ROW)
    stamps, stages, odometry, estimate, truth = np.split(table, [1, 2, 5, 8], axis=1)
    return stamps[:, 0], stages[:, 0].astype(int).tolist(), odometry, estimate, truth


def _apart(poses: FloatArray, true: FloatArray) -> FloatArray:
    """Measure the distance [m] of positions, shape (n,)."""
    distance: FloatArray = np.hypot(poses[:, 0] - true[:, 0], poses[:, 1] - true[:, 1])
    return distance


def _turned(poses: FloatArray, true: FloatArray) -> FloatArray:
    """Measure the angle [deg] between headings, 0 to 180, shape (n,)."""
    angle: FloatArray = np.degrees(np.abs((poses[:, 2] - true[:, 2] + np.pi) % (2 * np.pi) - np.pi))
    return angle
