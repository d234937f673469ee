"""A run written as a rosbag 2 and read back."""

from pathlib import Path

import numpy as np
import pytest

from closedrooms.core.errors import InvalidInputError, OutputError
from closedrooms.core.scan import LaserScan
from closedrooms.mapping.logs.bags.bag_options import BagOptions
from closedrooms.mapping.logs.bags.bag_writer import START, write_bag
from closedrooms.mapping.logs.bags.clicked_points import is_bag, read_clicked_points
from closedrooms.mapping.logs.bags.rosbag import read_bag
from closedrooms.mapping.logs.recorded_run import RecordedRun

rosbags = pytest.importorskip("rosbags", reason="the optional extra 'bags' is not installed")
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


def test_a_folder_that_is_there_is_one_clear_error(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match="cannot write the bag"):
        write_bag(tmp_path, a_run())


def clicks(path: Path, points: list[tuple[float, float]], *, frame: str = "map", topic: str = "/clicked_point") -> Path:
    """A bag of what RViz's tool sends."""
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    make = {name.rsplit("/", 1)[-1]: kind for name, kind in store.types.items()}
    with Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        kind = "geometry_msgs/msg/PointStamped"
        connection = writer.add_connection(topic, kind, typestore=store)
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


def test_points_of_another_frame_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InvalidInputError, match="the frame 'odom'"):
        read_clicked_points(clicks(tmp_path / "clicks", [(1.0, 1.0)], frame="odom"))


def test_a_bag_without_points_is_refused(tmp_path: Path) -> None:
    write_bag(tmp_path / "sensed", a_run())
    with pytest.raises(InvalidInputError, match="no PointStamped"):
        read_clicked_points(tmp_path / "sensed")
