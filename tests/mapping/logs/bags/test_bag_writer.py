"""A run written as a rosbag 2 and read back."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from closedrooms.core.errors import InvalidInputError, OutputError
from closedrooms.core.scan import LaserScan
from closedrooms.mapping.logs.bags import clicked_points
from closedrooms.mapping.logs.bags.bag_messages import stamp_of
from closedrooms.mapping.logs.bags.bag_options import BagOptions
from closedrooms.mapping.logs.bags.bag_writer import START, write_bag
from closedrooms.mapping.logs.bags.clicked_points import is_bag, read_clicked_points
from closedrooms.mapping.logs.bags.rosbag import read_bag
from closedrooms.mapping.logs.recorded_run import RecordedRun
from closedrooms.sim.config import LIDAR_PRESETS

rosbags = pytest.importorskip("rosbags", reason="the optional extra 'bags' is not installed")
AnyReader = pytest.importorskip("rosbags.highlevel").AnyReader
MOUNT = (0.12, -0.03, 0.4)


def a_run(count: int = 12) -> RecordedRun:
    rng = np.random.default_rng(4)
    ranges = rng.uniform(0.5, 9.0, (count, 40))
    ranges[2, 3], ranges[4, 5] = np.nan, np.inf
    scans = tuple(
        LaserScan(row, -2.0, 0.1, 10.0, 0.05, stamp=0.1 * i, robot_T_sensor=MOUNT) for i, row in enumerate(ranges)
    )
    steps = np.arange(count)[:, None] * np.array([[0.05, -0.01, 0.7]])
    steps[:, 2] = (steps[:, 2] + np.pi) % (2 * np.pi) - np.pi
    return RecordedRun(scans, steps)


def test_a_run_is_read_back_as_it_was_sensed(tmp_path: Path) -> None:
    run = a_run()
    write_bag(tmp_path / "sensed", run)
    read = read_bag(tmp_path / "sensed", BagOptions())
    assert not read.remarks
    assert read.has_odometry
    assert np.array([s.stamp for s in read.scans]) == pytest.approx([START + s.stamp for s in run.scans], abs=1e-6)
    assert np.asarray(read.odometry)[:, :2] == pytest.approx(np.asarray(run.odometry)[:, :2])
    turned = np.asarray(read.odometry)[:, 2] - np.asarray(run.odometry)[:, 2]
    assert np.exp(1j * turned) == pytest.approx(np.ones(len(turned)))
    for one, other in zip(read.scans, run.scans, strict=True):
        np.testing.assert_allclose(one.ranges, other.ranges, rtol=1e-6)
        assert one.angles == pytest.approx(other.angles, abs=1e-5)
        assert one.robot_T_sensor == pytest.approx(MOUNT)
        assert (one.range_min, one.range_max) == pytest.approx((0.05, 10.0))


@pytest.mark.parametrize("sweep", ["instant", "rolling"])
@pytest.mark.parametrize("lidar", list(LIDAR_PRESETS))
def test_what_the_simulated_lidar_says_is_read_back_to_the_last_bit(tmp_path: Path, lidar: str, sweep: Any) -> None:
    """A LaserScan carries single precision: the sensor says no more than that."""
    config = replace(LIDAR_PRESETS[lidar], sweep=sweep)
    rng = np.random.default_rng(2)
    limits = float(np.float32(config.range_max)), float(np.float32(config.range_min))
    ranges = rng.uniform(limits[1], limits[0], (5, config.beams)).astype(np.float32).astype(np.float64)
    took = config.beam_times[1] - config.beam_times[0]
    angles = config.angle_min, config.angle_increment
    scans = tuple(LaserScan(row, *angles, *limits, 0.25 * i, sweep=took) for i, row in enumerate(ranges))
    poses = np.arange(5)[:, None] * np.array([[0.125, 0.25, 0.0]])
    write_bag(tmp_path / "sensed", RecordedRun(scans, poses))
    read = read_bag(tmp_path / "sensed", BagOptions())
    assert not read.remarks
    assert np.asarray(read.odometry) == pytest.approx(poses, abs=1e-8)
    for one, other in zip(read.scans, scans, strict=True):
        assert one.stamp - read.scans[0].stamp == pytest.approx(other.stamp, abs=1e-8)
        assert (one.angle_min, one.angle_increment, one.sweep) == (other.angle_min, other.angle_increment, other.sweep)
        assert (one.range_max, one.range_min) == limits
        np.testing.assert_array_equal(one.ranges, other.ranges)


def test_a_scan_stands_at_its_latest_beam_and_a_message_at_its_first(tmp_path: Path) -> None:
    for name, sweep in (("left", 0.0625), ("right", -0.0625)):
        scans = tuple(LaserScan(np.full(5, 2.0), -1.0, 0.5, 8.0, 0.0, 0.25 * i, sweep=sweep) for i in range(4))
        poses = np.arange(4)[:, None] * np.array([[0.5, 0.0, 0.0]])
        write_bag(tmp_path / name, RecordedRun(scans, poses))
        with AnyReader([tmp_path / name]) as reader:
            (topic,) = [connection for connection in reader.connections if connection.topic == "/scan"]
            messages = [reader.deserialize(data, topic.msgtype) for _, _, data in reader.messages([topic])]
        assert [stamp_of(message) for message in messages] == pytest.approx(
            [START + 0.25 * i - max(sweep, 0.0) for i in range(4)]
        )
        assert messages[0].time_increment == sweep / 4
        read = read_bag(tmp_path / name, BagOptions())
        assert np.asarray(read.odometry)[:, 0] == pytest.approx(poses[:, 0], abs=1e-6)


def test_times_between_beams_that_cannot_be_are_not_believed(tmp_path: Path) -> None:
    scans = tuple(LaserScan(np.full(5, 2.0), -1.0, 0.5, 8.0, 0.0, 0.25 * i, sweep=0.5) for i in range(4))
    write_bag(tmp_path / "sensed", RecordedRun(scans, np.zeros((4, 3))))
    read = read_bag(tmp_path / "sensed", BagOptions())
    # The first two messages are of a time before the odometry begins.
    assert [scan.sweep for scan in read.scans] == [0.0] * 2
    assert ("repaired", "times between beams", 4) in [(r.action, r.what, r.count) for r in read.remarks]


def test_a_folder_that_is_there_is_one_clear_error(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match="cannot write the bag"):
        write_bag(tmp_path, a_run())


def clicks(
    path: Path,
    points: list[tuple[float, float]],
    *,
    frame: str = "map",
    topic: str = "/clicked_point",
    beside: str = "",
) -> Path:
    """A bag of what RViz's tool sends, and of another topic of points without a message."""
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    make = {name.rsplit("/", 1)[-1]: kind for name, kind in store.types.items()}
    with Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        kind = "geometry_msgs/msg/PointStamped"
        connection = writer.add_connection(topic, kind, typestore=store)
        if beside:
            writer.add_connection(beside, kind, typestore=store)
        for number, (x, y) in enumerate(points):
            header = store.types["std_msgs/msg/Header"](make["Time"](number + 1, 0), frame)
            point = store.types["geometry_msgs/msg/Point"](x, y, 0.0)
            data = store.serialize_cdr(store.types[kind](header, point), kind)
            writer.write(connection, (number + 1) * 10**9, data)
    return path


def test_points_clicked_in_rviz_are_doors_in_their_order(tmp_path: Path) -> None:
    path = clicks(tmp_path / "clicks", [(1.5, 2.0), (-3.0, 0.25)])
    assert is_bag(path)
    assert not is_bag(tmp_path / "doors.geojson")
    doors = read_clicked_points(path)
    assert [(door.id, door.midpoint) for door in doors] == [("d00", (1.5, 2.0)), ("d01", (-3.0, 0.25))]


def test_points_without_coordinates_are_dropped_and_said(tmp_path: Path) -> None:
    remarks: list = []
    doors = read_clicked_points(clicks(tmp_path / "clicks", [(np.nan, 0.0), (1.0, 1.0)]), remarks=remarks)
    assert [door.midpoint for door in doors] == [(1.0, 1.0)]
    assert [(remark.what, remark.count) for remark in remarks] == [("points", 1)]


def test_points_that_are_all_there_leave_nothing_to_say(tmp_path: Path) -> None:
    remarks: list = []
    path = clicks(tmp_path / "clicks", [(1.0, 1.0)])
    assert len(read_clicked_points(path, remarks=remarks)) == 1
    assert remarks == []
    assert read_clicked_points(clicks(tmp_path / "bad", [(np.nan, 0.0)])) == []


def test_points_of_one_other_topic_are_taken(tmp_path: Path) -> None:
    assert len(read_clicked_points(clicks(tmp_path / "other", [(1.0, 1.0)], topic="/points"))) == 1


def test_of_several_topics_only_the_one_of_rviz_is_taken(tmp_path: Path) -> None:
    assert len(read_clicked_points(clicks(tmp_path / "clicks", [(1.0, 1.0)], beside="/points"))) == 1
    with pytest.raises(InvalidInputError, match="2 topics of PointStamped"):
        read_clicked_points(clicks(tmp_path / "others", [(1.0, 1.0)], topic="/corners", beside="/points"))


def test_there_are_so_many_points_and_no_more(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = clicks(tmp_path / "clicks", [(1.0, 1.0), (2.0, 1.0)])
    monkeypatch.setattr(clicked_points, "MOST", 2)
    assert len(read_clicked_points(path)) == 2
    monkeypatch.setattr(clicked_points, "MOST", 1)
    with pytest.raises(InvalidInputError, match="more than 1 points"):
        read_clicked_points(path)


def test_odometry_and_transforms_say_the_same_and_lie_in_the_plane(tmp_path: Path) -> None:
    run = a_run(5)
    write_bag(tmp_path / "sensed", run)
    poses, moved, fixed = [], [], []
    with AnyReader([tmp_path / "sensed"]) as reader:
        for connection, stamp, data in reader.messages():
            message = reader.deserialize(data, connection.msgtype)
            if connection.topic == "/odom":
                at, turned = message.pose.pose.position, message.pose.pose.orientation
                poses.append((stamp, at.x, at.y, 2 * np.arctan2(turned.z, turned.w)))
                assert (at.z, turned.x, turned.y) == (0.0, 0.0, 0.0)
                speeds = (message.twist.twist.linear, message.twist.twist.angular)
                assert [(v.x, v.y, v.z) for v in speeds] == [(0.0, 0.0, 0.0)] * 2
                assert not message.pose.covariance.any()
                assert not message.twist.covariance.any()
                assert (message.header.frame_id, message.child_frame_id) == ("odom", "base_link")
            elif connection.topic in {"/tf", "/tf_static"}:
                (stamped,) = message.transforms
                shift, turned = stamped.transform.translation, stamped.transform.rotation
                assert (shift.z, turned.x, turned.y) == (0.0, 0.0, 0.0)
                place = (stamp, shift.x, shift.y, 2 * np.arctan2(turned.z, turned.w))
                frames = (stamped.header.frame_id, stamped.child_frame_id)
                assert frames == (("odom", "base_link") if connection.topic == "/tf" else ("base_link", "laser"))
                (moved if connection.topic == "/tf" else fixed).append(place)
    assert poses == moved
    assert np.array(poses)[:, 1:3] == pytest.approx(np.asarray(run.odometry)[:, :2])
    assert [stamp for stamp, *_ in poses] == [10**9 + number * 10**8 for number in range(5)]
    # The mounting is said once.
    assert fixed == [(10**9, MOUNT[0], MOUNT[1], pytest.approx(MOUNT[2]))]


def test_points_of_another_frame_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InvalidInputError, match="the frame 'odom'"):
        read_clicked_points(clicks(tmp_path / "clicks", [(1.0, 1.0)], frame="odom"))


def test_a_bag_without_points_is_refused(tmp_path: Path) -> None:
    write_bag(tmp_path / "sensed", a_run())
    with pytest.raises(InvalidInputError, match="no PointStamped"):
        read_clicked_points(tmp_path / "sensed")
