"""A recorded run as a rosbag 2 in MCAP, as a robot under ROS 2 records it, through the optional ``rosbags``."""

import math
from pathlib import Path
from typing import Any, Literal

import numpy as np

from closedrooms.core.errors import InvalidInputError, OutputError
from closedrooms.core.pose import Pose2
from closedrooms.core.scan import LaserScan
from closedrooms.mapping.logs.recorded_run import RecordedRun

# The version of metadata.yaml that ROS 2 Iron and later write; Humble reads it too.
VERSION: Literal[9] = 9
SCAN_TOPIC, ODOMETRY_TOPIC, MOVING_TOPIC, FIXED_TOPIC = "/scan", "/odom", "/tf", "/tf_static"
ODOMETRY, ROBOT, LIDAR = "odom", "base_link", "laser"
# Stamps begin here: 0 means "the latest" to tf2 [s].
START = 1.0


def check_bags() -> None:
    """Say early that bags cannot be written.

    Raises:
        InvalidInputError: ``rosbags`` is not installed.
    """
    try:
        import rosbags.rosbag2  # noqa: F401
    except ImportError as error:
        raise InvalidInputError(
            "bags need the optional package rosbags", expected="pip install 'closedrooms[bags]'"
        ) from error


def write_bag(path: Path, run: RecordedRun) -> None:
    """Write what a robot sensed as a rosbag 2: a folder with one MCAP file and ``metadata.yaml``.

    ``/scan`` holds sensor_msgs/LaserScan, ``/odom`` nav_msgs/Odometry, ``/tf`` the same as odom to base_link, and
    ``/tf_static`` where the lidar sits. Stamps begin at :data:`START`. A LaserScan's numbers are of single precision,
    its stamp is that of the first beam, where the run's is that of the latest.

    Args:
        path: The folder; it must not be there yet.
        run: Scans with odometry.

    Raises:
        InvalidInputError: ``rosbags`` is not installed.
        OutputError: The folder cannot be written.
    """
    check_bags()
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.rosbag2.errors import WriterError

    messages = _Messages()
    try:
        with Writer(path, version=VERSION, storage_plugin=StoragePlugin.MCAP) as writer:
            topics = {
                topic: writer.add_connection(topic, kind, typestore=messages.store) for topic, kind in KINDS.items()
            }

            def put(topic: str, message: Any, stamp: float) -> None:
                data = messages.store.serialize_cdr(message, KINDS[topic])
                writer.write(topics[topic], _nanoseconds(stamp), data)

            first = run.scans[0].stamp if run.scans else 0.0
            mounts: set[tuple[float, float, float]] = set()
            for scan, pose in zip(run.scans, run.odometry, strict=True):
                stamp = scan.stamp - first + START
                odometry = Pose2(*map(float, pose))
                if scan.robot_T_sensor not in mounts:
                    mounts.add(scan.robot_T_sensor)
                    put(FIXED_TOPIC, messages.transform(stamp, ROBOT, LIDAR, Pose2(*scan.robot_T_sensor)), stamp)
                put(MOVING_TOPIC, messages.transform(stamp, ODOMETRY, ROBOT, odometry), stamp)
                put(ODOMETRY_TOPIC, messages.odometry(stamp, odometry), stamp)
                put(SCAN_TOPIC, messages.scan(stamp, scan), stamp)
    except (OSError, WriterError) as error:
        raise OutputError(f"cannot write the bag ({error}): {path}") from error


KINDS = {
    SCAN_TOPIC: "sensor_msgs/msg/LaserScan",
    ODOMETRY_TOPIC: "nav_msgs/msg/Odometry",
    MOVING_TOPIC: "tf2_msgs/msg/TFMessage",
    FIXED_TOPIC: "tf2_msgs/msg/TFMessage",
}


def _nanoseconds(stamp: float) -> int:
    return round(1e9 * stamp)


class _Messages:
    """Maker of ROS 2 messages."""

    def __init__(self) -> None:
        from rosbags.typesys import Stores, get_typestore

        self.store = get_typestore(Stores.ROS2_HUMBLE)

    def _make(self, kind: str, *values: Any) -> Any:
        return self.store.types[kind](*values)

    def _header(self, stamp: float, frame: str) -> Any:
        seconds, rest = divmod(_nanoseconds(stamp), 1_000_000_000)
        return self._make("std_msgs/msg/Header", self._make("builtin_interfaces/msg/Time", seconds, rest), frame)

    def _turn(self, theta: float) -> Any:
        """Make the quaternion of a heading [rad]."""
        return self._make("geometry_msgs/msg/Quaternion", 0.0, 0.0, math.sin(theta / 2), math.cos(theta / 2))

    def scan(self, stamp: float, scan: LaserScan) -> Any:
        ranges = np.asarray(scan.ranges, dtype=np.float32)
        end = scan.angle_min + scan.angle_increment * (ranges.size - 1)
        angles = scan.angle_min, end, scan.angle_increment
        limits = scan.range_min, scan.range_max
        none = np.empty(0, dtype=np.float32)
        header = self._header(stamp - max(scan.sweep, 0.0), LIDAR)
        times = scan.sweep / max(ranges.size - 1, 1), abs(scan.sweep)
        return self._make("sensor_msgs/msg/LaserScan", header, *angles, *times, *limits, ranges, none)

    def odometry(self, stamp: float, odom_T_robot: Pose2) -> Any:
        zero = self._make("geometry_msgs/msg/Vector3", 0.0, 0.0, 0.0)
        place = self._make("geometry_msgs/msg/Point", odom_T_robot.x, odom_T_robot.y, 0.0)
        pose = self._make("geometry_msgs/msg/Pose", place, self._turn(odom_T_robot.theta))
        twist = self._make("geometry_msgs/msg/Twist", zero, zero)
        return self._make(
            "nav_msgs/msg/Odometry",
            self._header(stamp, ODOMETRY),
            ROBOT,
            self._make("geometry_msgs/msg/PoseWithCovariance", pose, np.zeros(36)),
            self._make("geometry_msgs/msg/TwistWithCovariance", twist, np.zeros(36)),
        )

    def transform(self, stamp: float, parent: str, child: str, parent_T_child: Pose2) -> Any:
        shift = self._make("geometry_msgs/msg/Vector3", parent_T_child.x, parent_T_child.y, 0.0)
        transform = self._make("geometry_msgs/msg/Transform", shift, self._turn(parent_T_child.theta))
        stamped = self._make("geometry_msgs/msg/TransformStamped", self._header(stamp, parent), child, transform)
        return self._make("tf2_msgs/msg/TFMessage", [stamped])
