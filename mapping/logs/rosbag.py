"""Recorded runs in rosbag 1, rosbag 2 and MCAP files, through the optional ``rosbags``."""

import math
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from closedrooms.core.arrays import FloatArray
from closedrooms.core.errors import InvalidInputError
from closedrooms.core.incoming import check_regular, is_folder, reading
from closedrooms.core.pose import Pose2
from closedrooms.core.scan import LaserScan
from closedrooms.mapping.logs.recorded_run import RecordedRun, forward

SCAN, ODOMETRY, TRANSFORMS = "sensor_msgs/msg/LaserScan", "nav_msgs/msg/Odometry", "tf2_msgs/msg/TFMessage"
LATE = 0.5
"""Time [s] from the nearest odometry beyond which a scan counts as without odometry."""
MAX_SCANS = 2_000_000
MAX_CHAIN = 16
"""Static transforms from the base to the lidar; more is a circle."""


@dataclass(frozen=True, slots=True)
class _Mount:
    """A static transform in the plane; ``flipped`` when its z axis points down (a lidar hung upside down)."""

    parent: str
    pose: Pose2
    flipped: bool


@dataclass(slots=True)
class _Messages:
    """What was read, in the order of the bag."""

    scans: list[Any] = field(default_factory=list)
    odometry: list[tuple[float, float, float, float]] = field(default_factory=list)
    mounts: dict[str, _Mount] = field(default_factory=dict)
    base: str = ""
    skipped: Counter[str] = field(default_factory=Counter)


def read_bag(path: Path, *, scan_topic: str | None, odometry_topic: str | None) -> RecordedRun:
    """Read laser scans, and the odometry interpolated at their times.

    Where the lidar sits comes from ``/tf_static``, seen from the odometry's child frame; without it, it is taken to
    sit in the middle of the robot.

    Args:
        path: A ``.bag``, ``.mcap`` or ``.db3`` file, or a rosbag 2 folder.
        scan_topic: Needed where a bag holds several of ``sensor_msgs/LaserScan``.
        odometry_topic: Needed where it holds several of ``nav_msgs/Odometry``.

    Raises:
        InvalidInputError: ``rosbags`` is not installed, a broken bag, a topic missing or ambiguous.
    """
    try:
        from rosbags.highlevel import AnyReader
        from rosbags.typesys import Stores, get_typestore
    except ImportError as error:
        raise InvalidInputError(
            "bags need the optional package rosbags", expected="pip install 'closedrooms[bags]'", where=path
        ) from error
    for file in path.iterdir() if is_folder(path) else [path]:
        check_regular(file, "a rosbag")
    # Bags of ROS 2 before Iron do not carry the definitions of their messages.
    with reading(path, "a rosbag"), AnyReader([path], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as reader:
        topics = [
            _topic(reader.connections, SCAN, scan_topic, path),
            _topic(reader.connections, ODOMETRY, odometry_topic, path),
            "/tf_static",
        ]
        wanted = [c for c in reader.connections if c.topic in topics]
        messages = _read(reader, wanted)
    return _resolved(messages)


def _topic(connections: Iterable[Any], kind: str, asked: str | None, path: Path) -> str:
    found = sorted({c.topic for c in connections if c.msgtype == kind})
    if asked is not None and asked in found:
        return asked
    if asked is None and len(found) == 1:
        return str(found[0])
    what = f"no topic {asked}" if asked is not None else f"{len(found)} topics of {kind}"
    raise InvalidInputError(what, expected=f"one of {', '.join(found)}" if found else f"a {kind}", where=path)


def _read(reader: Any, connections: list[Any]) -> _Messages:
    messages = _Messages()
    for connection, _, data in reader.messages(connections=connections):
        try:
            message = reader.deserialize(data, connection.msgtype)
        except Exception:  # as above: one broken message does not spoil the bag
            messages.skipped["broken messages"] += 1
            continue
        if connection.msgtype == SCAN:
            if len(messages.scans) < MAX_SCANS:
                messages.scans.append(message)
        elif connection.msgtype == ODOMETRY:
            pose = message.pose.pose
            yaw, _ = _yaw(pose.orientation)
            messages.odometry.append((_seconds(message), pose.position.x, pose.position.y, yaw))
            messages.base = message.child_frame_id.lstrip("/")
        elif connection.msgtype == TRANSFORMS:
            for transform in message.transforms:
                yaw, flipped = _yaw(transform.transform.rotation)
                shift = transform.transform.translation
                mount = _Mount(transform.header.frame_id.lstrip("/"), Pose2(shift.x, shift.y, yaw), flipped)
                messages.mounts[transform.child_frame_id.lstrip("/")] = mount
    return messages


def _seconds(message: Any) -> float:
    stamp = message.header.stamp
    return float(stamp.sec) + 1e-9 * float(stamp.nanosec)


def _yaw(q: Any) -> tuple[float, bool]:
    """Heading [rad] of a quaternion's x axis, and whether its z axis points down."""
    x, y, z, w = q.x, q.y, q.z, q.w
    return math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)), 1.0 - 2.0 * (x * x + y * y) < 0.0


def _resolved(messages: _Messages) -> RecordedRun:
    skipped = messages.skipped
    odometry = np.array(messages.odometry, dtype=np.float64).reshape(-1, 4)
    odometry = odometry[np.isfinite(odometry).all(axis=1)]
    odometry = odometry[np.argsort(odometry[:, 0], kind="stable")]
    scans, poses, stamps = [], [], []
    for message in messages.scans:
        stamp = _seconds(message)
        pose = _interpolated(odometry, stamp)
        if pose is None:
            skipped["scans without odometry"] += 1
            continue
        try:
            scan = _scan(message, messages)
        except InvalidInputError:
            skipped["broken messages"] += 1
            continue
        scans.append(scan)
        poses.append(pose)
        stamps.append(stamp)
    forwards, backwards = forward(np.array(stamps, dtype=np.float64))
    skipped["stamps running backwards"] += backwards
    swept = tuple(
        LaserScan(s.ranges, s.angle_min, s.angle_increment, s.range_max, s.range_min, float(stamp), s.robot_T_sensor)
        for s, stamp in zip(scans, forwards, strict=True)
    )
    counts = {what: count for what, count in skipped.items() if count}
    return RecordedRun(swept, np.array(poses, dtype=np.float64).reshape(-1, 3), None, counts)


def _interpolated(odometry: FloatArray, stamp: float) -> tuple[float, float, float] | None:
    """Odometry at ``stamp``, ``None`` when none is near in time."""
    after = int(np.searchsorted(odometry[:, 0], stamp))
    near = [i for i in (after - 1, after) if 0 <= i < len(odometry)]
    if not near or min(abs(odometry[i, 0] - stamp) for i in near) > LATE:
        return None
    if len(near) == 1:
        x, y, theta = odometry[near[0], 1:]
        return float(x), float(y), float(theta)
    (t0, x0, y0, a0), (t1, x1, y1, a1) = odometry[near]
    share = (stamp - t0) / (t1 - t0) if t1 > t0 else 0.0
    turn = math.remainder(a1 - a0, 2.0 * math.pi)
    return float(x0 + share * (x1 - x0)), float(y0 + share * (y1 - y0)), float(a0 + share * turn)


def _scan(message: Any, messages: _Messages) -> LaserScan:
    mount, flipped = _mount(message.header.frame_id.lstrip("/"), messages)
    ranges = np.array(message.ranges, dtype=np.float64)
    start, step = float(message.angle_min), float(message.angle_increment)
    longest, shortest = float(message.range_max), max(float(message.range_min), 0.0)
    if not (math.isfinite(start) and math.isfinite(step) and step != 0.0 and ranges.size):
        raise InvalidInputError("a scan without angles", expected="finite angles")
    if flipped:
        start, ranges = -(start + step * (ranges.size - 1)), ranges[::-1]
    # Zero and what lies below range_min is no measurement (REP-117).
    ranges = np.where(ranges < max(shortest, 1e-6), np.nan, ranges)
    return LaserScan(ranges, start, step, longest, shortest, robot_T_sensor=mount.as_tuple())


def _mount(frame: str, messages: _Messages) -> tuple[Pose2, bool]:
    pose, flipped, name = Pose2(), False, frame
    for _ in range(MAX_CHAIN):
        if name == messages.base:
            return pose, flipped
        if name not in messages.mounts:
            break
        step = messages.mounts[name]
        if step.flipped:
            # Below a flipped frame, left is right.
            pose = Pose2(pose.x, -pose.y, -pose.theta)
            flipped = not flipped
        pose = step.pose @ pose
        name = step.parent
    if frame != messages.base:
        messages.skipped["scans of unknown mounting"] += 1
    return Pose2(), False
