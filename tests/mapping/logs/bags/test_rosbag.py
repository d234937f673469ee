import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from closedrooms.core.arrays import FloatArray
from closedrooms.core.errors import InvalidInputError
from closedrooms.core.pose import Pose2
from closedrooms.mapping.logs import RecordedRun, read_run

rosbags = pytest.importorskip("rosbags", reason="the optional extra 'bags' is not installed")

RANGES = np.linspace(1.0, 5.0, 180)
START, STEP = -1.5, 0.0175
ANGLES = START + STEP * np.arange(180)
# The sweep of every bag here, as a lidar in the middle of the robot sees it.
POINTS = np.column_stack((RANGES * np.cos(ANGLES), RANGES * np.sin(ANGLES)))
Bags = Callable[[], Any]


def points(run: RecordedRun) -> FloatArray:
    """Hits of the first scan in the robot's frame."""
    scan = run.scans[0]
    return Pose2(*scan.robot_T_sensor).transform(scan.points_sensor())


def told(run: RecordedRun) -> list[tuple[str, str]]:
    return [(remark.action, remark.what) for remark in run.remarks]


def test_scans_take_the_odometry_of_their_time_and_their_mount(any_bag: Any) -> None:
    any_bag.transform("base_link", "laser", (0.3, 0.0, 0.2))
    for i in range(5):
        any_bag.odometry(100.0 + i, float(i), 0.0, 0.1 * i)
    for t in (101.5, 102.0, 103.25, 160.0):
        any_bag.scan(t)
    run = read_run(any_bag.write())
    assert run.odometry == pytest.approx(np.array([[1.5, 0, 0.15], [2, 0, 0.2], [3.25, 0, 0.325]]))
    assert run.scans[0].robot_T_sensor == pytest.approx((0.3, 0.0, 0.0))
    assert run.scans[0].range_max == pytest.approx(10.0)
    (remark,) = run.remarks
    assert (remark.action, remark.what, remark.count, remark.loss) == ("dropped", "scans", 1, True)


def test_a_bare_file_is_read_by_its_content_and_so_is_a_folder_without_metadata(new_bag: Bags) -> None:
    folder = new_bag().drive().transform("base_link", "laser").write()
    (file,) = folder.glob("*.mcap")
    assert len(read_run(file).scans) == 11
    assert len(read_run(folder / "metadata.yaml").scans) == 11
    (folder / "metadata.yaml").unlink()
    assert len(read_run(folder).scans) == 11


def test_a_bag_of_another_name_is_read_by_its_content(any_bag: Any, tmp_path: Path) -> None:
    path = any_bag.drive().transform("base_link", "laser").write()
    file = path if path.is_file() else next(entry for entry in path.iterdir() if entry.suffix != ".yaml")
    assert len(read_run(file.rename(tmp_path / "drive.2026")).scans) == 11


def test_several_scan_topics_have_to_be_named(new_bag: Bags) -> None:
    path = new_bag().drive().transform("base_link", "laser").scan(100.0, topic="/rear").write()
    with pytest.raises(InvalidInputError, match="/rear, /scan"):
        read_run(path)
    assert len(read_run(path, scan_topic="/scan").scans) == 11
    with pytest.raises(InvalidInputError, match="no topic /front"):
        read_run(path, scan_topic="/front")


def test_a_broken_bag_is_one_clear_line(new_bag: Bags) -> None:
    (file,) = new_bag().drive().write().glob("*.mcap")
    file.write_bytes(file.read_bytes()[:200])
    with pytest.raises(InvalidInputError) as caught:
        read_run(file)
    assert "\n" not in str(caught.value)


def test_a_bag_without_a_lidar_says_what_it_holds(new_bag: Bags) -> None:
    with pytest.raises(InvalidInputError, match=r"no topic of sensor_msgs/LaserScan.*but nav_msgs/msg/Odometry"):
        read_run(new_bag().drive(scans=False).write())


@pytest.mark.parametrize("head", [b"#ROSBAG V1.2\n", b"#ROSRECORD V1.1\nop=3\n", b"#ROSLOG V1.0\n"])
def test_bags_before_2_0_are_named(tmp_path: Path, head: bytes) -> None:
    path = tmp_path / "old.bag"
    path.write_bytes(head)
    version = head.split(b"V")[1][:3].decode()
    with pytest.raises(InvalidInputError, match=rf"ROS bag {version}; expected ROS bag 2\.0"):
        read_run(path)


# The transform tree.


def constant_on_tf(bag: Any) -> None:
    """As robot_state_publisher of ROS 1: the same again and again, among a wheel that turns."""
    for i in range(5):
        bag.transform("base_link", "laser", (0.1, 0.0, 0.2), (0.0, 0.0, 0.4), topic="/tf", stamp=100.0 + i / 4)
        bag.transform("base_link", "wheel", turn=(0.0, 0.5 * i, 0.0), topic="/tf", stamp=100.0 + i / 4)


def upside_down_with_roll(bag: Any) -> None:
    bag.transform("base_link", "laser", (0.2, 0.1, 0.5), (math.pi, 0.0, 0.7))


def upside_down_with_pitch(bag: Any) -> None:
    bag.transform("base_link", "laser", turn=(0.0, math.pi, 0.0))


def twice_upside_down(bag: Any) -> None:
    bag.transform("base_link", "plate", (0.1, 0.0, 0.0), (math.pi, 0.0, 0.3))
    bag.transform("plate", "laser", (0.0, 0.2, 0.0), (math.pi, 0.0, 0.2))


def rooted_in_the_lidar(bag: Any) -> None:
    bag.transform("laser", "plate", (0.1, 0.2, 0.0), (0.0, 0.0, 0.5))
    bag.transform("plate", "base_link", (-0.3, 0.0, 0.0), (0.0, 0.0, 0.2))


def over_a_common_parent(bag: Any) -> None:
    bag.transform("chassis", "base_link", (0.0, 0.1, 0.0), (0.0, 0.0, 0.3))
    bag.transform("chassis", "laser", (0.2, 0.0, 0.0), (0.0, 0.0, -0.3))


def through_a_footprint(bag: Any) -> None:
    bag.transform("base_footprint", "base_link", (0.0, 0.0, 0.1))
    bag.transform("base_link", "laser", (0.25, 0.0, 0.0))


def under_a_prefix(bag: Any) -> None:
    bag.transform("/robot1/base_link", "/robot1/laser", (0.1, 0.0, 0.0), (0.0, 0.0, 0.3))
    bag.transform("/robot2/tower", "/robot2/laser2", (9.0, 0.0, 0.0))


def in_a_namespace(bag: Any) -> None:
    bag.transform("base_link", "laser", (0.1, 0.0, 0.0), (0.0, 0.0, 0.3), topic="/robot/tf_static")


MOUNTS = {
    constant_on_tf: ((0.1, 0.0, 0.4), False),
    upside_down_with_roll: ((0.2, 0.1, 0.7), True),
    upside_down_with_pitch: ((0.0, 0.0, math.pi), True),
    twice_upside_down: ((0.1 + 0.2 * math.sin(0.3), -0.2 * math.cos(0.3), 0.1), False),
    rooted_in_the_lidar: (
        (Pose2(0.1, 0.2, 0.5) @ Pose2(-0.3, 0.0, 0.2)).inverse().as_tuple(),
        False,
    ),
    over_a_common_parent: (
        (Pose2(0.0, 0.1, 0.3).inverse() @ Pose2(0.2, 0.0, -0.3)).as_tuple(),
        False,
    ),
    through_a_footprint: ((0.25, 0.0, 0.0), False),
    under_a_prefix: ((0.1, 0.0, 0.3), False),
    in_a_namespace: ((0.1, 0.0, 0.3), False),
}


@pytest.mark.parametrize("tree", MOUNTS, ids=lambda tree: tree.__name__)
def test_the_lidar_sits_where_the_transforms_say(any_bag: Any, tree: Callable[[Any], None]) -> None:
    tree(any_bag)
    run = read_run(any_bag.drive().write())
    mount, upside_down = MOUNTS[tree]
    seen = POINTS * (1.0, -1.0) if upside_down else POINTS
    expected = Pose2(*mount).transform(seen)
    assert points(run) == pytest.approx(expected[::-1] if upside_down else expected, abs=1e-5)
    assert run.scans[0].angle_increment > 0.0


def test_an_unknown_mounting_is_refused_and_can_be_given(new_bag: Bags) -> None:
    path = new_bag().drive().transform("base_link", "camera").write()
    with pytest.raises(InvalidInputError, match=r"unknown mounting.*base_link to laser.*--mount"):
        read_run(path)
    run = read_run(path, mount=(0.2, 0.0, 0.1), upside_down=True)
    assert points(run) == pytest.approx(Pose2(0.2, 0.0, 0.1).transform(POINTS * (1.0, -1.0))[::-1], abs=1e-5)


def test_a_lidar_in_the_frame_of_the_robot_needs_no_transform(new_bag: Bags) -> None:
    run = read_run(new_bag().drive(child="/laser").write())
    assert points(run) == pytest.approx(POINTS, abs=1e-5)
    assert run.remarks == ()


@pytest.mark.parametrize(
    ("turns", "message"), [((0.0, 0.8), "moves against its robot"), ((1.2, 1.2), "unknown mounting")]
)
def test_a_lidar_that_moves_or_hangs_apart_is_refused(new_bag: Bags, turns: tuple[float, float], message: str) -> None:
    parent = "base_link" if turns[0] != turns[1] else "elsewhere"
    bag = new_bag().drive()
    for i, turn in enumerate(turns):
        bag.transform(parent, "laser", turn=(0.0, 0.0, turn), topic="/tf", stamp=100.0 + i)
    with pytest.raises(InvalidInputError, match=message):
        read_run(bag.write())


def test_a_lidar_on_its_side_is_refused_and_one_that_nods_is_not(new_bag: Bags) -> None:
    with pytest.raises(InvalidInputError, match="tilted by 90 degrees"):
        read_run(new_bag().drive().transform("base_link", "laser", turn=(math.pi / 2, 0.0, 0.0)).write())
    run = read_run(new_bag().drive().transform("base_link", "laser", turn=(0.0, 0.05, 0.0)).write())
    assert points(run) == pytest.approx(POINTS, abs=1e-5)


def test_a_lidar_of_another_robot_is_not_ours(new_bag: Bags) -> None:
    bag = new_bag().transform("robot1/base_link", "robot1/laser").transform("robot2/base_link", "robot2/laser")
    with pytest.raises(InvalidInputError, match="unknown mounting"):
        read_run(bag.drive(child="robot3/base_link").write())


def test_sweeps_to_the_right_are_turned_around(new_bag: Bags) -> None:
    bag = new_bag().drive(scans=False).transform("base_link", "laser")
    for i in range(5):
        bag.scan(100.0 + 0.1 * i, RANGES[::-1], start=float(ANGLES[-1]), step=-0.0175)
    assert points(read_run(bag.write())) == pytest.approx(POINTS, abs=1e-5)


# Odometry.


def transforms_of_odometry(bag: Any, parent: str = "odom", child: str = "base_link", *, inverted: bool = False) -> None:
    for i in range(11):
        pose = Pose2(0.05 * i, 0.0, 0.02 * i)
        first, second = parent, child
        if inverted:
            pose, first, second = pose.inverse(), child, parent
        bag.transform(first, second, (pose.x, pose.y, 0.0), (0.0, 0.0, pose.theta), topic="/tf", stamp=100.0 + 0.1 * i)


@pytest.mark.parametrize(
    ("parent", "child", "inverted"),
    [
        ("odom", "base_link", False),
        ("/odom_combined", "base_footprint", False),
        ("robot/odom", "robot/base_link", False),
        ("odom", "base_link", True),
        ("start", "base_link", False),
    ],
)
def test_odometry_comes_from_the_transforms(any_bag: Any, parent: str, child: str, inverted: bool) -> None:
    transforms_of_odometry(any_bag, parent, child, inverted=inverted)
    any_bag.transform(child, "laser", (0.2, 0.0, 0.0)).drive(odometry=False)
    for i in range(3):
        any_bag.transform("map", parent, (0.1 * i, 0.0, 0.0), topic="/tf", stamp=100.0 + 0.5 * i)
    run = read_run(any_bag.write())
    assert run.has_odometry
    assert run.odometry == pytest.approx(np.array([[0.05 * i, 0.0, 0.02 * i] for i in range(11)]), abs=1e-9)
    assert run.scans[0].robot_T_sensor == pytest.approx((0.2, 0.0, 0.0))
    assert ("guessed", "odometry") in told(run)


def test_nav_msgs_odometry_goes_before_the_transforms_unless_they_are_asked_for(new_bag: Bags) -> None:
    bag = new_bag().transform("base_link", "laser")
    transforms_of_odometry(bag)
    for i in range(11):
        bag.odometry(100.0 + 0.1 * i, 0.1 * i).scan(100.0 + 0.1 * i)
    path = bag.write()
    assert read_run(path).odometry[-1, 0] == pytest.approx(1.0)
    assert read_run(path, odometry_topic="/tf").odometry[-1, 0] == pytest.approx(0.5)


def test_a_bag_without_odometry_says_so(any_bag: Any) -> None:
    run = read_run(any_bag.drive(odometry=False).transform("base_link", "laser", (0.1, 0.0, 0.0)).write())
    assert not run.has_odometry
    assert len(run.scans) == 11
    assert run.scans[0].robot_T_sensor == pytest.approx((0.1, 0.0, 0.0))
    assert told(run) == [("guessed", "motion")]


def test_corrected_poses_are_no_odometry(new_bag: Bags) -> None:
    bag = new_bag().drive(odometry=False).transform("base_link", "laser")
    transforms_of_odometry(bag, "map")
    run = read_run(bag.write())
    assert not run.has_odometry
    assert "map" in str(run.remarks[0])


def test_odometry_that_never_changes_counts_as_none(new_bag: Bags) -> None:
    bag = new_bag().transform("base_link", "laser")
    for i in range(11):
        bag.odometry(100.0 + 0.1 * i, 3.0).scan(100.0 + 0.1 * i)
    run = read_run(bag.write())
    assert not run.has_odometry
    assert told(run) == [("guessed", "motion")]


def test_a_short_gap_of_odometry_is_bridged_and_a_long_one_costs_its_scans(new_bag: Bags) -> None:
    bag = new_bag().transform("base_link", "laser")
    for i in range(200):
        if not 20 < i < 60 and not 80 < i < 160:
            bag.odometry(100.0 + 0.1 * i, 0.03 * i)
        bag.scan(100.0 + 0.1 * i)
    run = read_run(bag.write())
    found = {remark.action: remark for remark in run.remarks}
    assert found["guessed"].count == 29
    # Five on either side are within half a second of a reading.
    assert found["dropped"].count == 69
    assert found["dropped"].loss
    assert run.odometry[40, 0] == pytest.approx(0.03 * 40)


# Clocks.


def stamped(bag: Any, scans: Callable[[int], float], odometry: Callable[[int], float]) -> RecordedRun:
    """A drive of 4 s with clocks of its own for lidar and odometry; recorded at 100 s and after."""
    bag.transform("base_link", "laser")
    for i in range(41):
        recorded = 100.0 + 0.1 * i
        bag.odometry(odometry(i), 0.05 * i, recorded=recorded).scan(scans(i), recorded=recorded + 0.01)
    return read_run(bag.write())


def right(i: int) -> float:
    return 100.0 + 0.1 * i


@pytest.mark.parametrize(
    ("scans", "odometry"),
    [
        (lambda _: 0.0, right),
        (right, lambda _: 0.0),
        (lambda _: 0.0, lambda _: 0.0),
        (lambda i: 12.0 + 0.1 * i, right),
        (lambda i: 1.7e9 + 0.1 * i, right),
        (lambda i: 3700.0 + 0.1 * i, lambda i: 100.0 + 0.1 * i),
        (lambda i: 0.0 if i < 5 else right(i), right),
        (lambda i: right(i) if i < 30 else right(i) - 50.0, right),
        (lambda i: 5.0 + 0.3 * i, right),
    ],
    ids=["zero scans", "zero odometry", "zero", "since boot", "unix", "an hour", "first zero", "restarted", "too fast"],
)
def test_scans_find_their_odometry_whatever_the_clocks_say(
    new_bag: Bags, scans: Callable[[int], float], odometry: Callable[[int], float]
) -> None:
    run = stamped(new_bag(), scans, odometry)
    assert len(run.scans) >= 40
    expected = 0.05 * np.arange(41)[-len(run.scans) :]
    # Recorded 0.01 s apart at 0.5 m/s.
    assert run.odometry[:, 0] == pytest.approx(expected, abs=0.011)
    assert all(a.stamp <= b.stamp for a, b in zip(run.scans, run.scans[1:], strict=False))


def test_clocks_that_agree_are_not_touched_by_a_recorder_that_is_late(new_bag: Bags) -> None:
    bag = new_bag().transform("base_link", "laser")
    for i in range(41):
        stamp = 100.0 + 0.1 * i
        bag.odometry(stamp, 0.05 * i, recorded=stamp).scan(stamp, recorded=stamp + 0.4)
    run = read_run(bag.write())
    assert run.odometry[:, 0] == pytest.approx(0.05 * np.arange(41), abs=1e-9)
    assert run.remarks == ()


def test_different_clocks_are_said(new_bag: Bags) -> None:
    run = stamped(new_bag(), lambda i: 12.0 + 0.1 * i, right)
    assert told(run) == [("repaired", "stamps")]
    assert "88.0 s apart" in str(run.remarks[0])


@pytest.mark.parametrize(("ahead", "laid"), [(0.6, True), (0.2, False)])
def test_a_lidar_whose_clock_is_ahead_of_the_recorder_is_put_back(new_bag: Bags, ahead: float, laid: bool) -> None:
    run = stamped(new_bag(), lambda i: right(i) + ahead, right)
    assert (("repaired", "stamps") in told(run)) == laid
    late = 0.0 if laid else ahead
    count = len(run.scans)
    assert run.odometry[0, 0] == pytest.approx(0.5 * late, abs=0.011)
    assert np.diff(run.odometry[: count - 5, 0]) == pytest.approx(np.full(count - 6, 0.05), abs=1e-6)


# Frames of several robots, and frames upside down.


def test_transforms_of_another_namespace_are_another_robots(any_bag: Any) -> None:
    any_bag.transform("base_link", "laser", (0.3, 0.0, 0.0), topic="/one/tf_static")
    any_bag.transform("base_link", "laser", (-0.2, 0.0, 0.0), (0.0, 0.0, 3.0), stamp=100.05, topic="/two/tf_static")
    for i in range(11):
        any_bag.scan(100.0 + 0.1 * i, topic="/one/scan").odometry(100.0 + 0.1 * i, 0.05 * i)
    run = read_run(any_bag.write())
    assert run.scans[0].robot_T_sensor == pytest.approx((0.3, 0.0, 0.0))
    assert told(run) == [("dropped", "transforms")]


def test_odometry_in_a_frame_whose_z_axis_points_down_is_not_mirrored(new_bag: Bags) -> None:
    bag, plain = new_bag().transform("base_link", "laser"), new_bag().transform("base_link", "laser")
    for i in range(11):
        stamp, x, y, yaw = 100.0 + 0.1 * i, 0.05 * i, 0.01 * i, 0.03 * i
        bag.transform("odom_ned", "base_link", (x, -y, 0.0), (math.pi, 0.0, -yaw), stamp=stamp, topic="/tf").scan(stamp)
        plain.transform("odom", "base_link", (x, y, 0.0), (0.0, 0.0, yaw), stamp=stamp, topic="/tf").scan(stamp)
    assert read_run(bag.write()).odometry == pytest.approx(read_run(plain.write()).odometry)


def test_corrected_poses_give_way_to_transforms_of_the_odometry(new_bag: Bags) -> None:
    bag = new_bag().transform("base_link", "laser")
    for i in range(11):
        stamp = 100.0 + 0.1 * i
        bag.transform("odom", "base_link", (0.05 * i, 0.0, 0.0), stamp=stamp, topic="/tf").scan(stamp)
        bag.odometry(stamp, 0.07 * i, frame="map")
    run = read_run(bag.write())
    assert run.odometry[:, 0] == pytest.approx(0.05 * np.arange(11))
    assert told(run) == [("guessed", "odometry")]


# Jumps of the odometry.


def with_reset(count: int = 60) -> list[tuple[float, float]]:
    """Driving ahead at 0.5 m/s; position and heading by the odometry, which starts again half-way."""
    half = count // 2
    return [(0.05 * (i if i < half else i - half), 0.0) for i in range(count)]


def test_a_reset_of_the_odometry_is_bridged_and_counted(any_bag: Any) -> None:
    any_bag.transform("base_link", "laser")
    for i, (x, yaw) in enumerate(with_reset()):
        any_bag.odometry(100.0 + 0.1 * i, x, 0.0, yaw).scan(100.04 + 0.1 * i)
    run = read_run(any_bag.write())
    assert run.odometry[:, 0] == pytest.approx(0.05 * np.arange(60) + 0.02 * (np.arange(60) < 59), abs=1e-9)
    (remark,) = run.remarks
    assert (remark.action, remark.count, remark.loss) == ("repaired", 1, False)


# Several echoes.


def test_the_first_echo_of_each_beam_is_taken(any_bag: Any) -> None:
    beams: list[list[float]] = [[float(r)] for r in RANGES]
    beams[3] = [2.0, 4.0, 6.0]
    beams[4] = []
    beams[5] = [math.inf]
    beams[6] = [0.01, 3.0]
    any_bag.drive(scans=False).transform("base_link", "laser")
    for i in range(5):
        any_bag.echoes(100.0 + 0.1 * i, beams)
    run = read_run(any_bag.write())
    scan = run.scans[0]
    assert scan.ranges[[2, 3, 6]] == pytest.approx([RANGES[2], 2.0, 3.0])
    assert math.isnan(scan.ranges[4])
    assert scan.ranges[5] == math.inf
    (remark,) = run.remarks
    assert (remark.action, remark.what, remark.count) == ("dropped", "echoes", 5 * 3)


def test_plain_scans_go_before_echoes_of_the_same_lidar(new_bag: Bags) -> None:
    path = new_bag().drive().transform("base_link", "laser").echoes(100.0, [[1.0]] * 180).write()
    run = read_run(path)
    assert len(run.scans) == 11
    assert ("dropped", "topics of scans") in told(run)
    assert len(read_run(path, scan_topic="/echoes").scans) == 1


def test_an_odometry_that_stands_still_gives_way_to_transforms_that_move(any_bag: Any) -> None:
    any_bag.transform("base_link", "laser")
    for i in range(11):
        any_bag.odometry(100.0 + 0.1 * i, 0.0)
        any_bag.transform("odom", "base_link", (0.05 * i, 0.0, 0.0), topic="/tf", stamp=100.0 + 0.1 * i)
    path = any_bag.drive(odometry=False).write()
    run = read_run(path)
    assert run.odometry[:, 0] == pytest.approx(0.05 * np.arange(11), abs=1e-6)
    assert [remark.why for remark in run.remarks if remark.what == "odometry"] == [
        "nav_msgs/Odometry never changes; taken from the transforms odom to base_link"
    ]
    assert not read_run(path, odometry_topic="/odom").has_odometry


@pytest.mark.parametrize(
    ("start", "end", "step", "repair"),
    [
        (START, START + 179 * STEP, 0.0, "from the first and the last angle"),
        (START, START + 179 * STEP, 180.0, "from the first and the last angle"),
        (math.degrees(START), math.degrees(START + 179 * STEP), math.degrees(STEP), "in degrees"),
        (math.degrees(START), math.degrees(START + 180 * STEP), math.degrees(STEP), "in degrees"),
    ],
)
def test_angles_that_make_no_sense_are_taken_from_those_that_do(
    new_bag: Bags, start: float, end: float, step: float, repair: str
) -> None:
    bag = new_bag().transform("base_link", "laser").drive(scans=False)
    for i in range(3):
        bag.scan(100.0 + 0.1 * i, start=start, step=step, end=end)
    run = read_run(bag.write())
    assert points(run) == pytest.approx(POINTS, abs=1e-3)
    (remark,) = run.remarks
    assert (remark.action, remark.what, remark.count) == ("repaired", "angles of scans", 3)
    assert repair in remark.why


def test_scans_without_any_angle_are_refused(new_bag: Bags) -> None:
    bag = new_bag().transform("base_link", "laser").drive(scans=False).scan(100.0, step=0.0, end=START)
    with pytest.raises(InvalidInputError, match="no scan that can be used"):
        read_run(bag.write())


def test_stamps_that_are_missing_now_and_then_are_said(new_bag: Bags) -> None:
    bag = new_bag().transform("base_link", "laser").drive(scans=False)
    for i in range(9):
        bag.scan(0.0 if i % 3 == 1 else 100.0 + 0.1 * i, recorded=100.0 + 0.1 * i)
    run = read_run(bag.write())
    assert [scan.stamp for scan in run.scans] == pytest.approx(100.0 + 0.1 * np.arange(9), abs=1e-6)
    assert [(remark.action, remark.what, remark.count) for remark in run.remarks] == [("repaired", "stamps", 3)]


def test_scans_that_were_recorded_out_of_order_are_sorted(new_bag: Callable[[], Any]) -> None:
    bag = new_bag().drive(scans=False).transform("base_link", "laser")
    for place, i in enumerate((1, 0, 3, 2, 4)):
        bag.scan(100.0 + 0.1 * i, recorded=100.0 + 0.1 * place)
    run = read_run(bag.write())
    assert [round(scan.stamp - 100.0, 6) for scan in run.scans] == [0.0, 0.1, 0.2, 0.3, 0.4]
    assert run.odometry[:, 0] == pytest.approx([0.0, 0.05, 0.1, 0.15, 0.2])
    assert [str(r) for r in run.remarks] == ["repaired 2 scans: recorded out of order; sorted by their time"]


def test_scans_well_before_the_first_odometry_do_not_take_it(new_bag: Callable[[], Any]) -> None:
    bag = new_bag().drive(scans=False).transform("base_link", "laser")
    for stamp in (99.6, 99.85, 99.95, 100.0, 100.5):
        bag.scan(stamp)
    run = read_run(bag.write())
    assert run.odometry[:, 0] == pytest.approx([0.0, 0.0, 0.25])
    assert "dropped 2 scans: before the odometry begins or after it ends" in [str(r) for r in run.remarks]


FRONT, REAR = (0.2, 0.05, 0.1), (-0.2, 0.0, 3.0)


def with_two_lidars(bag: Any, *known: tuple[str, tuple[float, float, float]]) -> Any:
    for frame, (x, y, yaw) in known:
        bag.transform("base_link", frame, (x, y, 0.2), (0.0, 0.0, yaw))
    for i in range(12):
        bag.scan(100.0 + 0.1 * i, frame="rear" if i % 3 == 0 else "front")
    return bag


def mounts(run: RecordedRun) -> list[tuple[float, float, float]]:
    return [scan.robot_T_sensor for scan in run.scans]


def test_scans_of_two_lidars_on_one_topic_have_the_mounting_of_their_own_frame(any_bag: Any) -> None:
    both = with_two_lidars(any_bag.drive(12, scans=False), ("front", FRONT), ("rear", REAR))
    run = read_run(both.write())
    assert np.array(mounts(run)) == pytest.approx(np.array([REAR, FRONT, FRONT] * 4))
    assert run.remarks == ()


def test_of_two_lidars_the_mounting_of_one_is_no_help_for_the_other(new_bag: Bags) -> None:
    path = with_two_lidars(new_bag().drive(12, scans=False), ("front", FRONT)).write()
    run = read_run(path)
    assert np.array(mounts(run)) == pytest.approx(np.array([FRONT] * 8))
    (remark,) = run.remarks
    assert (remark.action, remark.what, remark.count, remark.loss) == ("dropped", "scans", 4, True)
    assert "no transform says where rear sits" in remark.why
    # That of most scans has to be known.
    rear = with_two_lidars(new_bag().drive(12, scans=False), ("rear", REAR)).write()
    with pytest.raises(InvalidInputError, match=r"unknown mounting.*base_link to front"):
        read_run(rear)
    run = read_run(path, mount=REAR)
    assert np.array(mounts(run)) == pytest.approx(np.array([REAR, FRONT, FRONT] * 4))
    (remark,) = run.remarks
    assert (remark.action, remark.what, remark.loss) == ("guessed", "mountings", False)
    assert "taken for rear, for the others that of the transforms" in remark.why


def test_without_odometry_scans_of_a_second_lidar_are_left_out(new_bag: Bags) -> None:
    run = read_run(with_two_lidars(new_bag(), ("front", FRONT), ("rear", REAR)).write())
    assert np.array(mounts(run)) == pytest.approx(np.array([FRONT] * 8))
    assert len(run.odometry) == 8
    remark = next(remark for remark in run.remarks if remark.what == "scans")
    assert (remark.action, remark.count, remark.loss) == ("dropped", 4, True)
    with pytest.raises(InvalidInputError, match="unknown mounting"):
        read_run(with_two_lidars(new_bag()).write())


@pytest.mark.parametrize(("second", "said"), [((0.3, 0, 0.2), False), ((0.305, 0, 0.2), False), ((0.4, 0, 0.2), True)])
def test_a_static_transform_that_changes_is_said_and_the_last_one_counts(
    new_bag: Bags, second: tuple[float, float, float], said: bool
) -> None:
    bag = new_bag().drive().transform("base_link", "laser", (0.3, 0.0, 0.2))
    run = read_run(bag.transform("base_link", "laser", second, stamp=100.5).write())
    assert run.scans[0].robot_T_sensor == pytest.approx((second[0], 0.0, 0.0))
    assert [str(remark) for remark in run.remarks] == (
        ["guessed 1 transforms (laser): published as static with different values; the last are taken"] if said else []
    )
