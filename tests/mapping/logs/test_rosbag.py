import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from closedrooms.core.errors import InvalidInputError
from closedrooms.mapping.logs import read_run

rosbags = pytest.importorskip("rosbags", reason="the optional extra 'bags' is not installed")


def bag(path: Path, *, storage: str = "mcap", second_scan: bool = False) -> Path:
    """Three scans between odometry at whole seconds, the lidar 0.3 m ahead."""
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    types = store.types

    def header(frame: str, stamp: float) -> Any:
        time = types["builtin_interfaces/msg/Time"](int(stamp), round(1e9 * (stamp - int(stamp))))
        return types["std_msgs/msg/Header"](time, frame)

    def quaternion(yaw: float) -> Any:
        return types["geometry_msgs/msg/Quaternion"](0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2))

    def odometry(stamp: float, x: float, yaw: float) -> Any:
        point = types["geometry_msgs/msg/Point"](x, 0.0, 0.0)
        zero = types["geometry_msgs/msg/Vector3"](0.0, 0.0, 0.0)
        pose = types["geometry_msgs/msg/PoseWithCovariance"](
            types["geometry_msgs/msg/Pose"](point, quaternion(yaw)), np.zeros(36)
        )
        twist = types["geometry_msgs/msg/TwistWithCovariance"](
            types["geometry_msgs/msg/Twist"](zero, zero), np.zeros(36)
        )
        return types["nav_msgs/msg/Odometry"](header("odom", stamp), "base_link", pose, twist)

    def scan(stamp: float) -> Any:
        ranges = np.full(180, 4.0, dtype=np.float32)
        ranges[0] = np.inf
        empty = np.empty(0, dtype=np.float32)
        return types["sensor_msgs/msg/LaserScan"](
            header("laser", stamp), -1.57, 1.57, 0.0175, 0.0, 0.1, 0.1, 10.0, ranges, empty
        )

    def mount() -> Any:
        transform = types["geometry_msgs/msg/Transform"](
            types["geometry_msgs/msg/Vector3"](0.3, 0.0, 0.2), quaternion(0.0)
        )
        stamped = types["geometry_msgs/msg/TransformStamped"](header("base_link", 0.0), "laser", transform)
        return types["tf2_msgs/msg/TFMessage"]([stamped])

    messages = [("/odom", odometry(float(t), float(t), 0.1 * t), float(t)) for t in range(5)]
    messages += [("/scan", scan(t), t) for t in (1.5, 2.0, 3.25, 60.0)]
    messages += [("/tf_static", mount(), 0.0)]
    if second_scan:
        messages += [("/rear", scan(1.0), 1.0)]
    plugin = StoragePlugin.MCAP if storage == "mcap" else StoragePlugin.SQLITE3
    with Writer(path, version=9, storage_plugin=plugin) as writer:
        connections = {}
        for topic, message, stamp in sorted(messages, key=lambda m: m[2]):
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, message.__msgtype__, typestore=store)
            data = store.serialize_cdr(message, message.__msgtype__)
            writer.write(connections[topic], round(1e9 * stamp), data)
    return path


@pytest.mark.parametrize("storage", ["mcap", "sqlite3"])
def test_scans_take_the_odometry_of_their_time_and_their_mount(tmp_path: Path, storage: str) -> None:
    run = read_run(bag(tmp_path / "bag", storage=storage))
    assert len(run.scans) == 3
    assert run.odometry == pytest.approx(np.array([[1.5, 0, 0.15], [2, 0, 0.2], [3.25, 0, 0.325]]))
    assert run.scans[0].robot_T_sensor == pytest.approx((0.3, 0.0, 0.0))
    assert run.scans[0].range_max == pytest.approx(10.0)
    (remark,) = run.remarks
    assert (remark.action, remark.what, remark.count) == ("dropped", "scans", 1)


def test_a_bare_mcap_file_is_read_by_its_content(tmp_path: Path) -> None:
    (file,) = bag(tmp_path / "bag").glob("*.mcap")
    assert len(read_run(file).scans) == 3


def test_several_scan_topics_have_to_be_named(tmp_path: Path) -> None:
    path = bag(tmp_path / "bag", second_scan=True)
    with pytest.raises(InvalidInputError, match="/rear, /scan"):
        read_run(path)
    assert len(read_run(path, scan_topic="/scan").scans) == 3
    with pytest.raises(InvalidInputError, match="no topic /front"):
        read_run(path, scan_topic="/front")


def test_a_broken_bag_is_one_clear_line(tmp_path: Path) -> None:
    (file,) = bag(tmp_path / "bag").glob("*.mcap")
    file.write_bytes(file.read_bytes()[:200])
    with pytest.raises(InvalidInputError) as caught:
        read_run(file)
    assert "\n" not in str(caught.value)
