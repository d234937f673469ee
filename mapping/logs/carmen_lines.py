"""Lines of CARMEN logs: scans with their geometry, odometry, parameters."""

import math
from collections import Counter
from dataclasses import dataclass, field

import numpy as np

from closedrooms.core.arrays import FloatArray
from closedrooms.core.pose import Pose2

MAX_BEAMS = 20_000
HALF_TURN = math.pi
STEP_OFF = 0.02
"""Share by which a stated step may miss field of view over beams: headers are rounded."""
START_OFF = 0.03
"""Difference [rad] up to which a field of view counts as centred ahead."""
LARGEST_ANGLE = 2.0 * math.pi + 0.1
"""No angle of a header is larger [rad]: it is in degrees."""
USUAL_BEAMS = (90, 91, 180, 181, 360, 361)
"""Numbers of beams of a SICK LMS over half a turn, as whose scans FLASER lines began."""
WITH_POSES = ("FLASER", "ROBOTLASER1", "ROBOTLASER2")
"""Scans that carry the poses of laser and robot."""


@dataclass(frozen=True, slots=True, eq=False)
class ScanLine:
    """One scan as a line has it; angles and range may be missing, unlike in a ``LaserScan``.

    Attributes:
        ranges: As written, shape (n,) [m].
        angle_min: Angle of the first beam [rad]; ``None`` in FLASER lines, which do not say.
        increment: From one beam to the next [rad], above 0.
        range_max: As stated [m].
        laser: ``odom_T_laser`` or a corrected pose.
        robot: The same of the robot; both ``None`` in RAWLASER lines.
        stamp: Time [s].
        since: How many odometry lines come before it.
    """

    ranges: FloatArray
    angle_min: float | None
    increment: float
    range_max: float | None
    laser: Pose2 | None
    robot: Pose2 | None
    stamp: float
    since: int


@dataclass(frozen=True, slots=True)
class OdometryLine:
    """One ODOM line; ``clock`` is its own timestamp [s], zero in many lines that a mapping program put in."""

    pose: Pose2
    clock: float


@dataclass(slots=True)
class CarmenLog:
    """Content of a log's lines.

    Attributes:
        scans: By the word that their lines begin with.
        moves: The odometry, in the order of the file.
        settings: Parameters that are numbers.
        malformed: Lines that could not be read, by the word they begin with.
        repaired: Scans whose geometry was mended, by how.
        truncated: The archive ends early.
        length: Unit of all positions [m].
        angle: Unit of all headings [rad].
        widest: Largest heading, as written.
    """

    scans: dict[str, list[ScanLine]] = field(default_factory=dict)
    moves: list[OdometryLine] = field(default_factory=list)
    settings: dict[str, float] = field(default_factory=dict)
    malformed: Counter[str] = field(default_factory=Counter)
    repaired: Counter[str] = field(default_factory=Counter)
    truncated: bool = False
    length: float = 1.0
    angle: float = 1.0
    widest: float = 0.0

    def take(self, line: str) -> None:
        """Read one line; what is none of ours is ignored, what is broken is counted."""
        words = line.split()
        kind = words[0] if words else ""
        laser = kind.startswith(("ROBOTLASER", "RAWLASER"))
        if not laser and kind not in {"FLASER", "RLASER", "ODOM", "PARAM"}:
            return
        try:
            if laser:
                self._add(kind, self._laser(words, robot=kind.startswith("ROBOT")))
            elif kind == "ODOM":
                self.moves.append(OdometryLine(self._pose(words[1:4]), float(words[7])))
            elif kind == "PARAM":
                self.settings[words[1]] = float(words[2])
            else:
                self._add(kind, self._flaser(words))
        except (ValueError, IndexError, ArithmeticError):
            if kind != "PARAM":
                self.malformed[kind] += 1

    def _pose(self, words: list[str]) -> Pose2:
        """Read three words as x, y and heading, in the units of the log.

        Raises:
            ValueError: They are no finite numbers.
        """
        x, y, theta = map(float, words)
        if not (math.isfinite(x) and math.isfinite(y) and math.isfinite(theta)):
            raise ValueError("a pose that is not finite")
        self.widest = max(self.widest, abs(theta))
        return Pose2(self.length * x, self.length * y, self.angle * theta)

    def _add(self, kind: str, scan: ScanLine) -> None:
        self.scans.setdefault(kind, []).append(scan)

    def _flaser(self, words: list[str]) -> ScanLine:
        """Read ``FLASER n r1..rn x y theta odom_x odom_y odom_theta clock host logger_clock``."""
        n = _count(words[1])
        ranges = _numbers(words[2 : 2 + n], n)
        tail = words[2 + n :]
        if not all(map(_is_number, tail[:7])) or (len(tail) > 8 and not _is_number(tail[8])):
            raise ValueError("more or fewer readings than the line says")
        stamp = _stamp(tail[6], tail[-1])
        return ScanLine(ranges, None, 0.0, None, self._pose(tail[0:3]), self._pose(tail[3:6]), stamp, len(self.moves))

    def _laser(self, words: list[str], *, robot: bool) -> ScanLine:
        """Read ``KIND type start fov step max accuracy mode n r1..rn m e1..em [laser robot ...] clock host clock``."""
        start, view, step, longest = (float(word) for word in words[2:6])
        n = _count(words[8])
        ranges = _numbers(words[9 : 9 + n], n)
        tail = words[10 + n + int(words[9 + n]) :]
        fov = resolve_field_of_view(start, view, step, n)
        laser_pose, robot_pose = (self._pose(tail[0:3]), self._pose(tail[3:6])) if robot else (None, None)
        stamp = _stamp(tail[-3], tail[-1])
        if fov.repair:
            self.repaired[fov.repair] += 1
        if fov.increment < 0.0:
            last = fov.angle_min + fov.increment * (n - 1)
            fov, ranges = FieldOfView(last, -fov.increment), ranges[::-1]
        range_max = longest if math.isfinite(longest) and longest > 0.0 else None
        return ScanLine(ranges, fov.angle_min, fov.increment, range_max, laser_pose, robot_pose, stamp, len(self.moves))


@dataclass(frozen=True, slots=True)
class FieldOfView:
    """Angle of the first beam, angle to the next [rad], and what had to be mended in the header."""

    angle_min: float
    increment: float
    repair: str = ""


def resolve_field_of_view(start: float, view: float, step: float, beams: int) -> FieldOfView:
    """Resolve the field of view of a scan from a header whose parts need not agree.

    Public writers put degrees, the number of steps, or nothing where the step belongs.

    Args:
        start: Angle of the first beam [rad, or degrees].
        view: Field of view [rad, or degrees].
        step: Angle between beams [rad, or degrees]; below 0 for a sweep to the right.
        beams: Number of ranges.

    Raises:
        ValueError: Nothing to tell the field of view by.
    """
    if not (math.isfinite(start) and math.isfinite(view) and math.isfinite(step)):
        raise ValueError("angles that are not finite")
    degrees = max(abs(start), abs(view)) > LARGEST_ANGLE
    if degrees:
        # Some writers turn only the field of view and the step into degrees: half of it tells.
        view = math.radians(view)
        start = start if abs(abs(start) - abs(view) / 2.0) < START_OFF else math.radians(start)
    view = abs(view)
    if max(abs(start), view) > LARGEST_ANGLE:
        raise ValueError("angles of more than a turn")
    if view == 0.0 and step == 0.0:
        if not 0.0 < -start <= math.pi:
            raise ValueError("a scan without angles")
        return FieldOfView(start, _even_step(-2.0 * start, beams), "no field of view; taken to be centred ahead")
    units = (math.radians(step), step) if degrees else (step,)
    for stated in units:
        if stated != 0.0 and _agrees(abs(stated), view, beams):
            return FieldOfView(start, stated, "angles in degrees" if degrees else "")
    centred = _centred(start, units[0], beams)
    if units[0] != 0.0 and centred and not abs(abs(start) - view / 2.0) < START_OFF:
        return FieldOfView(start, units[0], "field of view disagrees; step and start agree" if view else "")
    if view == 0.0:
        if abs(step) * (beams - 1) > LARGEST_ANGLE:
            raise ValueError("a step that leads around more than once")
        return FieldOfView(start, units[0])
    increment = _even_step(view, beams, hint=abs(step))
    # From the left end rightwards, where the start lies there.
    backwards = step < 0.0 or (start > 0.0 and abs(start - view / 2.0) < START_OFF)
    return FieldOfView(
        start, -increment if backwards else increment, "step disagrees; taken from field of view and beams"
    )


def flaser_field_of_view(beams: int, settings: dict[str, float]) -> tuple[FieldOfView, bool]:
    """Resolve the field of view of FLASER lines: by parameters of the log, else half a turn.

    Returns:
        The field of view, and whether the half turn is a guess.
    """
    view = settings.get("laser_front_laser_fov", 0.0)
    if math.isfinite(view) and view > 0.0:
        view = view if view <= LARGEST_ANGLE else math.radians(view)
        if view <= LARGEST_ANGLE:
            return FieldOfView(-view / 2.0, _even_step(view, beams)), False
    half = FieldOfView(-HALF_TURN / 2.0, _even_step(HALF_TURN, beams))
    step = math.radians(settings.get("laser_front_laser_resolution", 0.0))
    if math.isfinite(step) and 0.0 < step * (beams - 1) <= LARGEST_ANGLE:
        if _agrees(step, HALF_TURN, beams):
            return half, False
        return FieldOfView(-step * (beams - 1) / 2.0, step), False
    return half, beams not in USUAL_BEAMS


def _agrees(step: float, view: float, beams: int) -> bool:
    """Check whether steps between beams add up to a field of view [rad], with or without its last end."""
    return any(abs(step * gaps - view) <= STEP_OFF * view for gaps in (beams - 1, beams))


def _centred(start: float, step: float, beams: int) -> bool:
    """Check whether beams from ``start`` on end as far on the other side."""
    return any(abs(start + step * gaps / 2.0) < START_OFF for gaps in (beams - 1, beams))


def _even_step(view: float, beams: int, *, hint: float = 0.0) -> float:
    """Compute the angle between beams [rad]: 181 and 361 include both ends of the view, 180 and 360 only one.

    Args:
        view: Field of view [rad].
        beams: Number of ranges.
        hint: The number of steps, where a header says it.
    """
    gaps = beams - 1 if beams % 2 or hint == beams - 1 else beams
    return view / max(gaps, 1)


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


def _numbers(words: list[str], count: int) -> FloatArray:
    if len(words) != count:
        raise ValueError("a line that ends early")
    return np.array([float(word) for word in words])


def _count(word: str) -> int:
    """Read how many ranges a line announces.

    Raises:
        ValueError: None, or more than a scan may have.
    """
    count = int(word)
    if not 1 <= count <= MAX_BEAMS:
        raise ValueError("a scan of no or too many beams")
    return count


def _stamp(clock: str, logger_clock: str) -> float:
    """Read the time of a line [s]: its own clock, or the logger's where that is 0."""
    value = float(clock) or float(logger_clock)
    if not math.isfinite(value):
        raise ValueError("a time that is no number")
    return value
