"""Odometry as robots record it: jumps bridged, and its value at the time of a scan."""

import math

import numpy as np

from closedrooms.core.arrays import BoolArray, FloatArray, IntArray
from closedrooms.core.pose import Pose2
from closedrooms.core.remarks import Remark

LATE = 0.5
"""Time [s] from the nearest odometry from which what lies between two readings counts as a gap."""
OUTSIDE = 0.1
"""Time [s] up to which a scan before the first reading, or after the last, takes it as it is: some centimetres."""
LONGEST_GAP = 5.0
"""Time without odometry [s] across which it is interpolated: it counts on while messages are lost."""
SPEED, TURN_RATE = 2.0, math.pi
"""Speeds [m/s] and [rad/s] that any robot may reach; indoor robots drive 0.3 to 1.5 m/s."""
USUAL = 3.0
"""How many times faster than it usually drives (95 % of its steps) a robot may be."""
SLACK, TURN_SLACK = 0.2, 0.3
"""Motion [m] and [rad] that stamps which jitter by a tenth of a second hide."""
RETURN_SHARE, RETURN_SLACK = 1.5, 0.05
"""The same for a step that ends exactly where the odometry began, which is what a reset does."""
EXACT = 1e-9
"""Difference [m and rad] that rounding leaves."""
LONGEST_STEP = 0.5
"""Time across a jump [s] for which the robot is taken to go on as before; after that it is taken to stand."""


def bridge_jumps(stamps: FloatArray, poses: FloatArray) -> tuple[FloatArray, int]:
    """Take jumps that no robot can make out of odometry: resets, and readings gone wrong.

    Across a jump the robot goes on as before and after it; what follows keeps its shape.

    Args:
        stamps: Shape (n,) [s].
        poses: ``odom_T_robot``, shape (n, 3).

    Returns:
        The poses, the same array without a jump, and how many there were.
    """
    if len(poses) < 2:
        return poses, 0
    steps = _steps(poses)
    durations = _durations(stamps)
    jumps = np.flatnonzero(_impossible(poses, steps, durations))
    if jumps.size == 0:
        return poses, 0
    velocities = steps / durations[:, None]
    bridged = poses.copy()
    ends = [*jumps[1:].tolist(), len(poses) - 1]
    for jump, end in zip(jumps.tolist(), ends, strict=True):
        beside = [i for i in (jump - 1, jump + 1) if 0 <= i < len(steps) and i not in jumps]
        velocity = velocities[beside].mean(axis=0) if beside else np.zeros(3)
        step = Pose2(*(velocity * min(float(durations[jump]), LONGEST_STEP)))
        arrived = Pose2(*bridged[jump]) @ step
        moved = arrived @ Pose2(*poses[jump + 1]).inverse()
        after = slice(jump + 1, end + 1)
        bridged[after, :2] = moved.transform(poses[after, :2])
        bridged[after, 2] = poses[after, 2] + moved.theta
    return bridged, len(jumps)


def jump_remarks(count: int) -> list[Remark]:
    """Say what :func:`bridge_jumps` did."""
    if not count:
        return []
    what = "jumps of the odometry" if count > 1 else "a jump of the odometry"
    why = "more than a robot can make (a reset?); taken to go on as before"
    return [Remark(action="repaired", what=what, why=why, count=count)]


def _steps(poses: FloatArray) -> FloatArray:
    """Compute the motion from each pose to the next in the robot's frame, shape (n - 1, 3)."""
    c, s = np.cos(poses[:-1, 2]), np.sin(poses[:-1, 2])
    dx, dy = np.diff(poses[:, 0]), np.diff(poses[:, 1])
    turns = (np.diff(poses[:, 2]) + np.pi) % (2 * np.pi) - np.pi
    return np.column_stack((c * dx + s * dy, c * dy - s * dx, turns))


def _durations(stamps: FloatArray) -> FloatArray:
    """Time of each step [s]; none below the usual, as messages that were held up arrive in bursts."""
    durations = np.diff(stamps)
    passing = durations[durations > 0.0]
    usual = float(np.median(passing)) if passing.size else 0.1
    return np.maximum(durations, usual)


def _impossible(poses: FloatArray, steps: FloatArray, durations: FloatArray) -> BoolArray:
    """Mark the steps that no robot can make in their time, and those that end exactly where the odometry began."""
    distances, turns = np.hypot(steps[:, 0], steps[:, 1]), np.abs(steps[:, 2])
    # With few steps, the jump itself must not count as usual.
    usual, usual_turn = (
        np.percentile(values / durations, 95.0 if len(steps) >= 20 else 50.0) for values in (distances, turns)
    )
    jump = distances > max(SPEED, USUAL * usual) * durations + SLACK
    jump |= turns > max(TURN_RATE, USUAL * usual_turn) * durations + TURN_SLACK
    returned = (np.abs(poses[1:] - poses[0]) < EXACT).all(axis=1) | (np.abs(poses[1:]) < EXACT).all(axis=1)
    fast = distances > RETURN_SHARE * usual * durations + RETURN_SLACK
    fast |= turns > RETURN_SHARE * usual_turn * durations + RETURN_SLACK
    return np.asarray(jump | (returned & fast), dtype=np.bool_)


def odometry_at(track: FloatArray, stamps: FloatArray) -> tuple[FloatArray, BoolArray, list[Remark]]:
    """Interpolate the odometry at the times of scans.

    Args:
        track: ``stamp, x, y, theta`` in the order of time, shape (m, 4).
        stamps: Times of the scans [s], shape (n,).

    Returns:
        Poses of the scans that have one, shape (k, 3); which these are, shape (n,); what was guessed and dropped.
    """
    poses, known = [], np.zeros(len(stamps), dtype=np.bool_)
    guessed = 0
    for i, stamp in enumerate(stamps.tolist()):
        pose, late = _interpolated(track, stamp)
        if pose is None:
            continue
        known[i] = True
        guessed += late
        poses.append(pose)
    remarks = []
    if guessed:
        why = f"no odometry for up to {LONGEST_GAP:g} s; interpolated"
        remarks.append(Remark(action="guessed", what="scans' odometry", why=why, count=guessed))
    remarks += lost_remarks(known)
    return np.array(poses, dtype=np.float64).reshape(-1, 3), known, remarks


def lost_remarks(known: BoolArray) -> list[Remark]:
    """Say which scans have no odometry; it is a loss but at the two ends of a run, where recording begins and ends."""
    if known.all():
        return []
    used: IntArray = np.flatnonzero(known)
    inside = int((~known[used[0] : used[-1] + 1]).sum()) if used.size else 0
    outside = int((~known).sum()) - inside
    remarks = []
    if inside:
        why = f"no odometry for more than {LONGEST_GAP:g} s around them"
        remarks.append(Remark(action="dropped", what="scans", why=why, count=inside, loss=True))
    if outside:
        why = "before the odometry begins or after it ends"
        loss = outside > MOST_OUTSIDE * len(known)
        remarks.append(Remark(action="dropped", what="scans", why=why, count=outside, loss=loss))
    return remarks


MOST_OUTSIDE = 0.1
"""Share of a run that may lie outside its odometry without being missed."""


def _interpolated(track: FloatArray, stamp: float) -> tuple[tuple[float, float, float] | None, bool]:
    """Interpolate the odometry at ``stamp``, ``None`` when none is near in time; says whether it lies in a gap."""
    after = int(np.searchsorted(track[:, 0], stamp))
    near = [i for i in (after - 1, after) if 0 <= i < len(track)]
    if not near:
        return None, False
    apart = min(abs(track[i, 0] - stamp) for i in near)
    if len(near) == 1:
        x, y, theta = track[near[0], 1:]
        return (None if apart > OUTSIDE else (float(x), float(y), float(theta))), False
    late = apart > LATE
    (t0, x0, y0, a0), (t1, x1, y1, a1) = track[near]
    if late and t1 - t0 > LONGEST_GAP:
        return None, False
    share = (stamp - t0) / (t1 - t0) if t1 > t0 else 0.0
    turn = math.remainder(a1 - a0, 2.0 * math.pi)
    return (float(x0 + share * (x1 - x0)), float(y0 + share * (y1 - y0)), float(a0 + share * turn)), bool(late)
