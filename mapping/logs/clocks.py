"""The times of messages: clocks that stand, run backwards or disagree."""

from dataclasses import dataclass

import numpy as np

from closedrooms.core.arrays import FloatArray
from closedrooms.core.remarks import Remark

SAME_CLOCK = 1.0
"""Difference of two clocks [s] beyond which it is no delay on the way to the recorder."""
AHEAD, WITH_RECORDER = 0.25, 0.05
"""Time [s] by which one clock is ahead of the recorder's that it cannot be the other's, which is ahead by no more than
the second: no delay is negative."""
RESTART = 1.0
"""Step back [s] of a clock that started again; less is messages out of order."""
LEAST_GAP, GAP = 1.0, 5.0
"""Time [s], and multiple of the usual time, between two scans from which it is a gap."""
STEADY = 1.0
"""Spread of recording time against a sensor's own clock [s] up to which the two run alike."""


@dataclass(frozen=True, slots=True, eq=False)
class Times:
    """Times of the messages of one topic, shape (n,) each [s].

    Attributes:
        header: What the sensor wrote into them; zero or less where it wrote none.
        recorded: When they were recorded.
    """

    header: FloatArray
    recorded: FloatArray

    @property
    def told(self) -> bool:
        """Whether the sensor has a clock at all: one that is set, moves, and does not start again on the way."""
        set_ = self.header[self.header > 0.0]
        if 2 * set_.size <= self.header.size or (np.diff(set_) < -RESTART).any():
            return False
        return self.header.size < 3 or bool(np.ptp(set_) > 0.0) or not self.usable_recording

    @property
    def lag(self) -> FloatArray:
        """Recording time less the sensor's own, where it is set [s]."""
        return (self.recorded - self.header)[self.header > 0.0]

    @property
    def usable_recording(self) -> bool:
        """Whether the recorder has a clock that moves."""
        return self.recorded.size < 3 or bool(np.ptp(self.recorded) > 0.0)

    def by_header(self) -> FloatArray:
        """Take the sensor's own times; those that are not set come from the recorder."""
        unset = self.header <= 0.0
        if not unset.any() or not self.told:
            return self.header
        return np.where(unset, self.recorded - float(np.median(self.lag)), self.header)

    def by_recorder(self) -> FloatArray:
        """Take times on the recorder's clock, as even as the sensor's where that runs alike."""
        if not self.told:
            return self.recorded
        low, high = np.percentile(self.lag, (10.0, 90.0))
        if high - low > STEADY:
            return self.recorded
        return self.by_header() + float(np.median(self.lag))


def scan_and_odometry_times(scans: Times, odometry: Times | None) -> tuple[FloatArray, FloatArray, list[Remark]]:
    """Put the times of scans and odometry on one clock.

    Sensors' own clocks, where they agree; else the recorder's: sensors count from their own start, or write zeros.

    Returns:
        Stamps of the scans and of the odometry (empty without it) [s], and what was repaired.
    """
    streams = [times for times in (scans, odometry) if times is not None and times.header.size]
    recorder = all(times.usable_recording for times in streams)
    untold = [times for times in streams if not times.told]
    empty = np.zeros(0)
    why = ""
    if recorder and untold:
        why = "their sensor's clock is not set, or starts again; the times of recording are taken"
    elif recorder and len(streams) == 2:
        lags = [float(np.median(times.lag)) for times in streams]
        apart = abs(lags[0] - lags[1])
        if apart > SAME_CLOCK or (min(lags) < -AHEAD and max(lags) >= -WITH_RECORDER):
            why = (
                f"clocks of lidar and odometry are {apart:.1f} s apart; laid over each other by the times of recording"
            )
    if why:
        count = sum(times.header.size for times in untold or streams[:1])
        remark = Remark(action="repaired", what="stamps", why=why, count=count)
        return scans.by_recorder(), empty if odometry is None else odometry.by_recorder(), [remark]
    unset = sum(int((times.header <= 0.0).sum()) for times in streams if times.told)
    why = "not set by their sensor; the times of recording are taken, less its usual delay"
    remarks = [Remark(action="repaired", what="stamps", why=why, count=unset)] if unset else []
    return scans.by_header(), empty if odometry is None else odometry.by_header(), remarks


def forward(stamps: FloatArray) -> tuple[FloatArray, list[Remark]]:
    """Keep a clock from running backwards: a jump back in stamps [s] counts as no time."""
    steps = np.diff(stamps, prepend=stamps[:1])
    back = steps < 0.0
    steps[back] = 0.0
    start = float(stamps[0]) if len(stamps) else 0.0
    count = int(back.sum())
    why = "running backwards; the clock stands still instead"
    remarks = [Remark(action="repaired", what="stamps", why=why, count=count)] if count else []
    return start + np.cumsum(steps), remarks


def find_gaps(stamps: FloatArray) -> FloatArray:
    """Find where a run has no scans for long: begin and length of each gap [s], shape (k, 2)."""
    steps = np.diff(stamps)
    if not steps.size:
        return np.zeros((0, 2))
    long = np.flatnonzero(steps > max(LEAST_GAP, GAP * float(np.median(steps))))
    return np.column_stack((stamps[long], steps[long]))
