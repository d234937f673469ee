"""How the robot moved from one scan to the next: odometry, or what the motion so far suggests where it fails."""

import math
from dataclasses import dataclass

from closedrooms.core.pose import Pose2
from closedrooms.mapping.config import RecoveryConfig
from closedrooms.mapping.mapping_events import Event, EventLog

MOVING = (0.03, 0.02)
"""Estimated step ([m], [rad]) above which a robot whose odometry does not change is taken to be moving."""
SHORTEST_TIME = 0.2
"""Time between two scans below which a speed is not judged [s]: stamps jitter."""
UNKNOWN_TIME = 1.0
"""Time between two scans of one stamp [s]: some logs have no clock."""
LONG_GAP = 5.0
"""Times the usual time between scans beyond which there is a gap."""
SHORTEST_GAP = 1.0
"""Time without scans that is no gap, whatever is usual [s]."""
GAP_MOTION = (0.5, 0.5)
"""Motion over a gap ([m], [rad]) below which nothing was missed."""
TIME_MEMORY = 0.05
"""Weight of the newest time between scans in the usual one."""
SUDDEN = 1.5
"""Times the longest of the last steps from which one is too long to be believed at once."""
LONG_STEP = 0.6
"""Step [m] below which the window of the matcher holds one that was counted twice."""
LONGEST_FADING = 0.95
"""Share of the longest of the last steps that a robot is still thought capable of one step later."""
UNKNOWN_STEP = (0.1, 0.1)
"""Standard deviation ([m], [rad]) of a step that nothing measured, besides the size of the one before."""


@dataclass(frozen=True, slots=True)
class PredictedStep:
    """Predicted motion to the present scan.

    Attributes:
        motion: ``before_T_now``.
        alternative: Another motion that may be meant: an odometry that stood still may catch up, or not, and one that
            makes a sudden leap may have counted a step twice.
        leap: It is such a leap.
        unmeasured: How far it may be off, distance [m] and turn [rad], where no odometry measured it; else ``None``.
    """

    motion: Pose2
    unmeasured: tuple[float, float] | None = None
    alternative: Pose2 | None = None
    leap: bool = False


class MotionPrediction:
    """Steps of the odometry, where it can be believed.

    An odometry that does not change while the scans say that the robot moves is silent: at first it is taken for a stop
    with a wide window, then the last motion is continued. A jump that no robot can make is not followed.
    """

    def __init__(self, config: RecoveryConfig, events: EventLog) -> None:
        self._config, self._events = config, events
        self._odometry: Pose2 | None = None
        self._stamp: float | None = None
        self._usual_time = 0.0
        self._last = Pose2()
        self._longest = 0.0
        self._silent = False
        self._unreported = Pose2()

    @property
    def possible(self) -> tuple[float, float]:
        """Distance [m] and turn [rad] that the next step may have, as the last one had."""
        return (
            math.hypot(self._last.x, self._last.y) + UNKNOWN_STEP[0],
            abs(self._last.theta) + UNKNOWN_STEP[1],
        )

    def step(self, odometry: Pose2 | None, stamp: float) -> PredictedStep:
        """Predict the motion since the scan before.

        Args:
            odometry: ``odom_T_robot``, ``None`` without one.
            stamp: Time of the scan [s].
        """
        seconds = 0.0 if self._stamp is None else max(stamp - self._stamp, 0.0)
        first, before = self._stamp is None, self._odometry
        self._stamp = stamp
        if odometry is not None:
            self._odometry = odometry
        if first:
            return PredictedStep(Pose2())
        gap = self._usual_time > 0.0 and seconds > max(SHORTEST_GAP, LONG_GAP * self._usual_time)
        if not gap:
            self._usual_time += (TIME_MEMORY if self._usual_time > 0.0 else 1.0) * (seconds - self._usual_time)
        if odometry is None or before is None:
            self._events.note(Event.SILENT, stamp)
            return PredictedStep(self._last, self.possible)
        motion = before.inverse() @ odometry
        if not self._config.enabled:
            return PredictedStep(motion)
        if odometry == before:
            return self._without_change(stamp)
        return self._judged(motion, seconds, stamp, gap=gap)

    def _judged(self, motion: Pose2, seconds: float, stamp: float, *, gap: bool) -> PredictedStep:
        """Judge the step of an odometry that may jump, or catch up after it stood still."""
        distance, turn = math.hypot(motion.x, motion.y), abs(motion.theta)
        resumed, self._silent = self._silent, False
        unreported, self._unreported = self._unreported, Pose2()
        seconds = max(seconds, SHORTEST_TIME) if seconds > 0.0 else UNKNOWN_TIME
        if distance > self._config.possible_speed * seconds or turn > self._config.possible_turn_rate * seconds:
            self._events.note(Event.JUMP, stamp)
            return PredictedStep(self._last, self.possible)
        if gap and (distance > GAP_MOTION[0] or turn > GAP_MOTION[1]):
            self._events.note(Event.GAP, stamp)
        if resumed:
            return PredictedStep(motion, self.possible, unreported.inverse() @ motion)
        if distance > max(LONG_STEP, SUDDEN * self._longest) and self._longest > 0.0:
            return PredictedStep(
                motion, alternative=Pose2(motion.x / 2.0, motion.y / 2.0, motion.theta / 2.0), leap=True
            )
        return PredictedStep(motion)

    def _without_change(self, stamp: float) -> PredictedStep:
        """Predict a step from odometry that repeats itself: a robot that drove may be driving on unseen."""
        moving = math.hypot(self._last.x, self._last.y) > MOVING[0] or abs(self._last.theta) > MOVING[1]
        if not moving:
            self._silent = False
            return PredictedStep(Pose2())
        again, self._silent = self._silent, True
        if not again:
            return PredictedStep(Pose2(), self.possible)
        self._events.note(Event.SILENT, stamp)
        return PredictedStep(self._last, self.possible)

    def moved(self, motion: Pose2) -> None:
        """Remember the step as it was estimated."""
        self._last = motion
        self._longest = max(math.hypot(motion.x, motion.y), LONGEST_FADING * self._longest)
        if self._silent:
            self._unreported = self._unreported @ motion
