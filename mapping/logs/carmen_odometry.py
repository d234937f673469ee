"""What counts as odometry in a CARMEN log: scans' own poses, ODOM lines, or nothing."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from closedrooms.core.arrays import FloatArray
from closedrooms.core.pose import Pose2
from closedrooms.core.remarks import Remark
from closedrooms.mapping.logs.carmen_lines import LARGEST_ANGLE, OdometryLine, ScanLine
from closedrooms.mapping.logs.recorded_odometry import lost_remarks, odometry_at

SAME_ROBOT = 1.5
"""Offset [m] up to which the two poses of a scan are laser and robot; beyond it one of them is corrected."""
STRAY = 1.0
"""Distance [m] from the ODOM lines beyond which a scan's own odometry is not theirs."""
ECHOED = 0.9
"""Share of the scans whose pose a new ODOM line repeats, from which these lines are echoes."""
DRIVEN = 0.8
"""Share of such lines that go on as the odometry before them, from which they are odometry after all."""
SMOOTH, SMOOTH_REST = 0.3, 0.01
"""Difference from going on evenly, as a share of the step and beside it [m], that driving explains."""
ONLY_ECHOES = 0.8
"""Share of the ODOM lines from which there is nothing but echoes."""
STANDING = 0.05
"""Length of odometry, as a share of the distance by the scans' poses, below which it says nothing."""
LEAST_DISTANCE = 0.5
"""Travelled distance [m] below which nothing is concluded from its length."""


@dataclass(frozen=True, slots=True, eq=False)
class LocatedScans:
    """Scans of a CARMEN log with their odometry: still lines, of which :mod:`~.carmen` makes a ``RecordedRun``.

    Attributes:
        scans: Those that have one.
        odometry: ``odom_T_robot`` at each, shape (n, 3); zeros where there is none.
        reference: Corrected poses, shape (n, 3).
        mount: ``robot_T_sensor``.
        has_odometry: Whether there is any.
        remarks: What was dropped or guessed.
    """

    scans: list[ScanLine]
    odometry: FloatArray
    reference: FloatArray | None = None
    mount: Pose2 = field(default_factory=Pose2)
    has_odometry: bool = True
    remarks: tuple[Remark, ...] = ()


def motion_of(
    scans: list[ScanLine], moves: list[OdometryLine], settings: dict[str, float], *, rear: bool = False
) -> LocatedScans:
    """Find the odometry of the scans.

    As recorded, a scan carries its own, or has the ODOM lines around it. In logs that a mapping program corrected, the
    poses in the scan lines are its result: they become ``reference``, and odometry is what the ODOM lines report. Some
    of those programs write each corrected pose as one more ODOM line and continue from there; those jumps are taken
    out again, or the correction would leak into the odometry. Where nothing else is left, there is no odometry.

    Args:
        scans: Of one laser, in the order of the file; all with poses or none.
        moves: The ODOM lines.
        settings: Parameters of the log.
        rear: Whether the laser, where it does not say where it sits, is the one at the back.
    """
    own = [(scan.laser, scan.robot) for scan in scans if scan.laser is not None and scan.robot is not None]
    if len(own) < len(scans) or _stuck([robot for _, robot in own], moves):
        return _paired(scans, moves, _stated_mount(settings, "rearlaser" if rear else "frontlaser"))
    robots = [robot for _, robot in own]
    poses = _array(robots)
    echoes = _echoes(scans, robots, moves)
    corrected = max(laser.distance(robot) for laser, robot in own) > SAME_ROBOT
    strays = [robot.distance(moves[s.since - 1].pose) for s, robot in zip(scans, robots, strict=True) if s.since > 0]
    if not echoes and not (strays and max(strays) > STRAY and not corrected):
        if corrected:
            lasers = _array([laser for laser, _ in own])
            if _travelled(lasers) == 0.0:
                why = "the poses of the laser never change; it is taken to sit in the middle of the robot"
                return LocatedScans(scans, poses, remarks=(Remark(action="guessed", what="mounting", why=why),))
            return LocatedScans(scans, poses, lasers)
        return LocatedScans(scans, poses, None, robots[0].inverse() @ own[0][0])
    raw = _raw_odometry(moves, echoes)
    known = np.array([scan.since > 0 for scan in scans])
    if echoes and _travelled(_array(raw)) < STANDING * _travelled(poses):
        why = "the ODOM lines only repeat the poses of the scans; found by matching scans alone"
        remark = Remark(action="guessed", what="motion", why=why)
        return LocatedScans(scans, np.zeros((len(scans), 3)), poses, has_odometry=False, remarks=(remark,))
    kept = [scan for scan in scans if scan.since > 0]
    odometry = _array([raw[scan.since - 1] for scan in kept])
    return LocatedScans(kept, odometry, poses[known], remarks=tuple(lost_remarks(known)))


def _stuck(robots: Sequence[Pose2], moves: list[OdometryLine]) -> bool:
    """Check whether the scans' poses never change while the ODOM lines do: their writer had none."""
    return _travelled(_array(robots)) == 0.0 and _travelled(_array([move.pose for move in moves])) > LEAST_DISTANCE


def _paired(
    scans: list[ScanLine], moves: list[OdometryLine], mounting: tuple[Pose2, tuple[Remark, ...]]
) -> LocatedScans:
    """Pair scans without poses with the ODOM lines around them."""
    mount, remarks = mounting
    if not moves:
        why = "no ODOM lines and no poses in the scans; found by matching scans alone"
        remark = Remark(action="guessed", what="motion", why=why)
        odometry = np.zeros((len(scans), 3))
        return LocatedScans(scans, odometry, None, mount, has_odometry=False, remarks=(*remarks, remark))
    clocks = np.array([move.clock for move in moves])
    poses = _array([move.pose for move in moves])
    if (clocks > 0.0).all() and (np.diff(clocks) >= 0.0).all():
        odometry, known, lost = odometry_at(np.column_stack((clocks, poses)), np.array([s.stamp for s in scans]))
        if 2 * len(odometry) >= len(scans):
            kept = [scan for scan, has in zip(scans, known, strict=True) if has]
            return LocatedScans(kept, odometry, None, mount, remarks=(*remarks, *lost))
    known = np.array([scan.since > 0 for scan in scans])
    why = "clocks of ODOM lines and scans differ; each scan takes the ODOM line before it"
    guessed = Remark(action="guessed", what="scans' odometry", why=why, count=max(int(known.sum()), 1))
    kept = [scan for scan in scans if scan.since > 0]
    odometry = poses[[scan.since - 1 for scan in kept]].reshape(-1, 3)
    return LocatedScans(kept, odometry, None, mount, remarks=(*remarks, guessed, *lost_remarks(known)))


def _stated_mount(settings: dict[str, float], laser: str) -> tuple[Pose2, tuple[Remark, ...]]:
    """Read where a laser sits from CARMEN's parameters, whose default is the middle of the robot; the rear looks back.

    Args:
        settings: Parameters of the log.
        laser: ``frontlaser`` or ``rearlaser``.
    """
    names = tuple(f"robot_{laser}_{which}offset" for which in ("", "side_", "angular_"))
    usual = (0.0, 0.0, 0.0 if laser == "frontlaser" else math.pi)
    x, y, angle = (settings.get(name, value) for name, value in zip(names, usual, strict=True))
    if not all(map(math.isfinite, (x, y, angle))):
        x, y, angle = usual
    angle = math.radians(angle) if abs(angle) > LARGEST_ANGLE else angle
    if any(name in settings for name in names):
        return Pose2(x, y, angle), ()
    back = "" if laser == "frontlaser" else " and to look back"
    why = f"no {names[0]} in the log; the laser is taken to sit in the middle of the robot{back}"
    return Pose2(x, y, angle), (Remark(action="guessed", what="mounting", why=why),)


def _echoes(scans: list[ScanLine], robots: Sequence[Pose2], moves: list[OdometryLine]) -> set[int]:
    """Find ODOM lines right after a scan that only repeat its corrected pose.

    Told by the pose: a line that equals the scan's, where the line before it does not. An echo of a standing robot's
    pose takes no motion out. Some loggers write the odometry of a scan after it: that goes on as the lines before.
    """
    pairs = [(scan.since, robot) for scan, robot in zip(scans, robots, strict=True) if scan.since < len(moves)]
    new = [(i, robot) for i, robot in pairs if i == 0 or moves[i - 1].pose != robot]
    if not new:
        return set()
    echoes = [i for i, robot in new if moves[i].pose == robot]
    if len(echoes) < ECHOED * len(new):
        return set()
    if len(set(echoes)) < ONLY_ECHOES * len(moves) and _go_on(echoes, moves):
        return set()
    return {i for i, robot in pairs if moves[i].pose == robot}


def _go_on(lines: list[int], moves: list[OdometryLine]) -> bool:
    """Check whether ODOM lines lie where the two lines before them lead, by their clocks."""
    good = driven = 0
    for i in lines:
        if i < 2:
            continue
        before, last, now = moves[i - 2 : i + 1]
        duration = now.clock - last.clock
        if last.clock <= before.clock or duration <= 0.0:
            return False
        step = last.pose.distance(now.pose)
        if step < 2 * SMOOTH_REST:
            continue
        share = duration / (last.clock - before.clock)
        x, y = (b + share * (b - a) for a, b in ((before.pose.x, last.pose.x), (before.pose.y, last.pose.y)))
        driven += 1
        good += math.hypot(now.pose.x - x, now.pose.y - y) <= SMOOTH * step + SMOOTH_REST
    return driven > 0 and good >= DRIVEN * driven


def _raw_odometry(moves: list[OdometryLine], echoes: set[int]) -> list[Pose2]:
    """Accumulate the odometry over the ODOM lines without the jumps to corrected poses."""
    pose, raw = Pose2(), []
    for i, move in enumerate(moves):
        if i > 0 and i not in echoes:
            pose = pose @ (moves[i - 1].pose.inverse() @ move.pose)
        raw.append(pose)
    return raw


def _array(poses: Sequence[Pose2]) -> FloatArray:
    """List poses as an array, shape (n, 3) [m, rad]."""
    return np.array([pose.as_tuple() for pose in poses], dtype=np.float64).reshape(-1, 3)


def _travelled(poses: FloatArray) -> float:
    """Measure the travelled distance [m], a radian of turning as a metre."""
    turns = (np.diff(poses[:, 2]) + np.pi) % (2 * np.pi) - np.pi
    return float(np.hypot(*np.diff(poses[:, :2], axis=0).T).sum() + np.abs(turns).sum())
