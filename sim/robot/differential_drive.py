"""A differential drive: velocities that follow their command within limits, and arcs driven exactly."""

import math
from collections.abc import Callable, Sequence

from closedrooms.core.robot import RobotConfig
from closedrooms.sim.contacts import SKIN, Obstacles, SolidEdge, distance, move_disc, offset
from closedrooms.sim.robot.driven_robot import DrivenRobot, Motion

# While velocities change, an arc is driven with the mean of so much time [s]: at the default limits this leaves the
# true path by at most 0.1 mm in half a second (0.5 mm with 0.05 s).
RAMP_SECONDS = 0.02
# One arc is at most this long [m] and turns by no more than this [rad].
ARC_LENGTH = 0.3
ARC_TURN = 0.5
# Beside obstacles an arc is cut into chords of this length [m] and turn [rad]: they leave it by less than 0.3 mm.
CHORD_LENGTH = 0.02
CHORD_TURN = 0.1
# A robot that gets less than this share of its motion is stopped; what gets more slides along, its wheels slipping.
STALLED = 0.1


class Drive(DrivenRobot):
    """A disc that drives arcs exactly.

    The robot is a disc that is moved, not pushed: contacts are found in the plane, against the very edges that the
    walls are extruded from. It slides along what it meets at an angle and stops at what it meets head-on. A wheeled
    body in PyBullet costs 65 microseconds for each step of some milliseconds; this is exact and nearly free. It has no
    body there: every ray would start inside its box, which costs a third of the rays' speed.
    """

    def __init__(self, config: RobotConfig, obstacles: Obstacles, x: float, y: float, theta: float) -> None:
        super().__init__(config, (x, y, theta))
        self._obstacles = obstacles

    @staticmethod
    def reach(config: RobotConfig) -> float:
        """Compute how far from its centre the robot may meet something within one arc [m]."""
        return config.radius + ARC_LENGTH + 2 * SKIN

    def _advance(self, v: float, w: float, duration: float, sink: Callable[[Motion], None]) -> None:
        limits = self.config
        left = duration
        while left > 1e-12:
            time = self._piece(v, w, left)
            v0, w0 = self.v, self.w
            self.v = towards(v0, v, limits.max_acceleration * time)
            self.w = towards(w0, w, limits.max_turn_acceleration * time)
            motion = self._arc((v0 + self.v) / 2 * time, (w0 + self.w) / 2 * time)
            sink(motion)
            left -= time

    def _piece(self, v: float, w: float, left: float) -> float:
        """Choose how long to go on with one arc: until a ramp ends, and never too far [s]."""
        time = left
        for now, wanted, rate in (
            (self.v, v, self.config.max_acceleration),
            (self.w, w, self.config.max_turn_acceleration),
        ):
            if now != wanted:
                time = min(time, RAMP_SECONDS, max(abs(wanted - now) / rate, 1e-9))
        fastest = max(abs(self.v), abs(v)) if self.v != v else abs(v)
        turning = max(abs(self.w), abs(w)) if self.w != w else abs(w)
        if fastest * time > ARC_LENGTH:
            time = ARC_LENGTH / fastest
        if turning * time > ARC_TURN:
            time = ARC_TURN / turning
        return time

    def _arc(self, length: float, turn: float) -> Motion:
        """Drive one arc of ``length`` [m] that turns by ``turn`` [rad], chord by chord where something is near."""
        edges = self._obstacles.near(self.x, self.y) if length else ()
        if not edges or distance(self.x, self.y, edges) > self.config.radius + SKIN + abs(length):
            motion = Motion(*chord(length, turn), turn)
            self._apply(motion)
            return motion
        return self._arc_beside(length, turn, edges)

    def _arc_beside(self, length: float, turn: float, edges: Sequence[SolidEdge]) -> Motion:
        """Drive an arc that may meet something, chord by chord."""
        x0, y0, theta0 = self.x, self.y, self.theta
        chords = max(math.ceil(abs(length) / CHORD_LENGTH), math.ceil(abs(turn) / CHORD_TURN), 1)
        step_x, step_y = chord(length / chords, turn / chords)
        touched = False
        for _ in range(chords):
            c, s = math.cos(self.theta), math.sin(self.theta)
            dx, dy = c * step_x - s * step_y, s * step_x + c * step_y
            self.x, self.y, touch = move_disc(self.x, self.y, dx, dy, self.config.radius, edges)
            self.theta += turn / chords
            touched |= touch
        dx, dy = self.x - x0, self.y - y0
        c, s = math.cos(theta0), math.sin(theta0)
        motion = Motion(c * dx + s * dy, c * dy - s * dx, turn)
        if touched:
            self._feel(edges)
            if math.hypot(dx, dy) < STALLED * abs(length):
                self.v = 0.0
        return motion

    def _feel(self, edges: Sequence[SolidEdge]) -> None:
        """Note from which direction the nearest thing touches, in the robot frame [rad]."""
        away = min((offset(self.x, self.y, edge) for edge in edges), key=lambda v: math.hypot(*v))
        bearing = math.remainder(math.atan2(-away[1], -away[0]) - self.theta, 2.0 * math.pi)
        self.bumps = tuple(sorted({round(bearing, 1), *self.bumps}))

    def _apply(self, motion: Motion) -> None:
        """Move by a motion in the robot frame."""
        c, s = math.cos(self.theta), math.sin(self.theta)
        self.x += c * motion.dx - s * motion.dy
        self.y += s * motion.dx + c * motion.dy
        self.theta += motion.turn


def towards(now: float, wanted: float, change: float) -> float:
    """Change ``now`` towards ``wanted`` by at most ``change``."""
    if abs(wanted - now) <= change * (1 + 1e-9):
        return wanted
    return now + math.copysign(change, wanted - now)


def chord(length: float, turn: float) -> tuple[float, float]:
    """Find where an arc of ``length`` [m] that turns by ``turn`` [rad] ends, in the frame of its start [m]."""
    if abs(turn) < 1e-9:
        return (length, length * turn / 2)
    radius = length / turn
    return (radius * math.sin(turn), radius * (1.0 - math.cos(turn)))
