"""Small bags made by rosbags' writers, of every storage."""

import functools
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from closedrooms.core.arrays import FloatArray

RANGES = np.linspace(1.0, 5.0, 180)
START, STEP = -1.5, 0.0175


def quaternion(roll: float, pitch: float, yaw: float) -> tuple[float, float, float, float]:
    """``x, y, z, w`` of a turn about x, then y, then z, all fixed axes [rad]."""
    (sr, cr), (sp, cp), (sy, cy) = ((math.sin(a / 2), math.cos(a / 2)) for a in (roll, pitch, yaw))
    return (
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
        cr * cp * cy + sr * sp * sy,
    )


@functools.cache
def message_types(*, ros1: bool) -> Any:
    """The messages of ROS 1 or 2."""
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store, transforms = get_typestore(Stores.ROS1_NOETIC if ros1 else Stores.ROS2_HUMBLE), "tf2_msgs/msg/TFMessage"
    if transforms not in store.types:
        store.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", transforms))
    return store


class BagMaker:
    """Collector of messages, which writes them in the order of recording."""

    def __init__(self, path: Path, storage: str) -> None:
        self._path, self._storage, self._store = path, storage, message_types(ros1=storage == "ros1")
        self._messages: list[tuple[float, str, Any]] = []

    def _make(self, kind: str, *values: Any) -> Any:
        return self._store.types[kind](*values)

    def _header(self, stamp: float, frame: str) -> Any:
        whole = math.floor(stamp)
        time = self._make("builtin_interfaces/msg/Time", whole, round(1e9 * (stamp - whole)))
        return self._make("std_msgs/msg/Header", *((0,) if self._storage == "ros1" else ()), time, frame)

    def _put(self, topic: str, message: Any, stamp: float, recorded: float | None) -> "BagMaker":
        self._messages.append((stamp if recorded is None else recorded, topic, message))
        return self

    def scan(
        self,
        stamp: float,
        ranges: FloatArray = RANGES,
        *,
        frame: str = "laser",
        start: float = START,
        step: float = STEP,
        end: float | None = None,
        limits: tuple[float, float] = (0.1, 10.0),
        topic: str = "/scan",
        recorded: float | None = None,
    ) -> "BagMaker":
        """One sweep."""
        values = ranges.astype(np.float32)
        end = start + step * (len(values) - 1) if end is None else end
        empty = np.empty(0, dtype=np.float32)
        message = self._make(
            "sensor_msgs/msg/LaserScan", self._header(stamp, frame), start, end, step, 0.0, 0.1, *limits, values, empty
        )
        return self._put(topic, message, stamp, recorded)

    def echoes(self, stamp: float, beams: list[list[float]], *, topic: str = "/echoes") -> "BagMaker":
        """One sweep with several echoes a beam."""
        heard = [self._make("sensor_msgs/msg/LaserEcho", np.array(beam, dtype=np.float32)) for beam in beams]
        end = START + STEP * (len(beams) - 1)
        message = self._make(
            "sensor_msgs/msg/MultiEchoLaserScan",
            self._header(stamp, "laser"), START, end, STEP, 0.0, 0.1, 0.1, 10.0, heard, [],
        )  # fmt: skip
        return self._put(topic, message, stamp, None)

    def odometry(
        self,
        stamp: float,
        x: float,
        y: float = 0.0,
        yaw: float = 0.0,
        *,
        frame: str = "odom",
        child: str = "base_link",
        topic: str = "/odom",
        recorded: float | None = None,
    ) -> "BagMaker":
        """One reading of the wheels."""
        zero = self._make("geometry_msgs/msg/Vector3", 0.0, 0.0, 0.0)
        turned = self._make("geometry_msgs/msg/Quaternion", *quaternion(0.0, 0.0, yaw))
        pose = self._make("geometry_msgs/msg/Pose", self._make("geometry_msgs/msg/Point", x, y, 0.0), turned)
        message = self._make(
            "nav_msgs/msg/Odometry",
            self._header(stamp, frame),
            child,
            self._make("geometry_msgs/msg/PoseWithCovariance", pose, np.zeros(36)),
            self._make(
                "geometry_msgs/msg/TwistWithCovariance", self._make("geometry_msgs/msg/Twist", zero, zero), np.zeros(36)
            ),
        )
        return self._put(topic, message, stamp, recorded)

    def transform(
        self,
        parent: str,
        child: str,
        shift: tuple[float, float, float] = (0.0, 0.0, 0.0),
        turn: tuple[float, float, float] = (0.0, 0.0, 0.0),
        *,
        stamp: float = 100.0,
        topic: str = "/tf_static",
        recorded: float | None = None,
    ) -> "BagMaker":
        """``parent_T_child``: shift [m], and roll, pitch, yaw [rad]."""
        transform = self._make(
            "geometry_msgs/msg/Transform",
            self._make("geometry_msgs/msg/Vector3", *shift),
            self._make("geometry_msgs/msg/Quaternion", *quaternion(*turn)),
        )
        stamped = self._make("geometry_msgs/msg/TransformStamped", self._header(stamp, parent), child, transform)
        return self._put(topic, self._make("tf2_msgs/msg/TFMessage", [stamped]), stamp, recorded)

    def drive(self, count: int = 11, *, scans: bool = True, odometry: bool = True, **names: Any) -> "BagMaker":
        """Scans and odometry ten times a second: 0.05 m and 0.02 rad a step."""
        for i in range(count):
            stamp = 100.0 + 0.1 * i
            if odometry:
                self.odometry(stamp, 0.05 * i, 0.0, 0.02 * i, **names)
            if scans:
                self.scan(stamp)
        return self

    def write(self, compression: str = "") -> Path:
        """The bag on disk; compressed by ``bz2`` or ``lz4`` (ROS 1), ``file`` or ``message`` (ROS 2)."""
        from rosbags.rosbag1 import Writer as Writer1
        from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer

        if self._storage == "ros1":
            writer: Any = Writer1(self._path.with_suffix(".bag"))
            serialize = self._store.serialize_ros1
        else:
            plugin = StoragePlugin.MCAP if self._storage == "mcap" else StoragePlugin.SQLITE3
            writer = Writer(self._path, version=9, storage_plugin=plugin)
            serialize = self._store.serialize_cdr
        if compression and self._storage == "ros1":
            writer.set_compression(writer.CompressionFormat[compression.upper()])
        elif compression:
            writer.set_compression(CompressionMode[compression.upper()], CompressionFormat.ZSTD)
        with writer:
            connections: dict[str, Any] = {}
            for recorded, topic, message in sorted(self._messages, key=lambda entry: entry[0]):
                kind = message.__msgtype__
                if topic not in connections:
                    connections[topic] = writer.add_connection(topic, kind, typestore=self._store)
                writer.write(connections[topic], round(1e9 * recorded), serialize(message, kind))
        return self._path.with_suffix(".bag") if self._storage == "ros1" else self._path


@pytest.fixture(params=["ros1", "sqlite3", "mcap"])
def any_bag(request: pytest.FixtureRequest, tmp_path: Path) -> BagMaker:
    """A bag of each storage in turn."""
    return BagMaker(tmp_path / "bag", request.param)


@pytest.fixture
def new_bag(tmp_path: Path) -> Callable[[], BagMaker]:
    """Makes MCAP bags."""
    made = iter(range(100))
    return lambda: BagMaker(tmp_path / f"bag{next(made)}", "mcap")


@pytest.fixture
def bag_maker() -> type[BagMaker]:
    """Makes bags of any storage."""
    return BagMaker
