"""Frames and the transforms between them, without a bag."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from closedrooms.core.errors import InvalidInputError
from closedrooms.core.pose import Pose2
from closedrooms.mapping.logs.bags.transform_tree import TransformTree, clean_name, last_name, transform_matrix


def matrix(x: float = 0.0, y: float = 0.0, yaw: float = 0.0, *, roll: float = 0.0, z: float = 0.0) -> np.ndarray:
    """A turn about x and then about z, and a shift."""
    c, s = math.cos(yaw), math.sin(yaw)
    cr, sr = math.cos(roll), math.sin(roll)
    turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1.0]]) @ np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])
    full = np.eye(4)
    full[:3, :3], full[:3, 3] = turn, (x, y, z)
    return full


def tree(*links: tuple[str, str, np.ndarray]) -> TransformTree:
    made = TransformTree()
    for parent, child, transform in links:
        made.add(parent, child, transform, static=True)
    return made


@given(st.floats(-9, 9), st.floats(-9, 9), st.tuples(*[st.floats(-1, 1)] * 4), st.floats(0.1, 5.0))
def test_a_quaternion_of_any_length_turns_as_its_axis_and_angle_do(
    x: float, y: float, q: tuple[float, ...], scale: float
) -> None:
    length = math.sqrt(sum(value * value for value in q))
    if length < 0.01:
        return
    found = transform_matrix((x, y, 1.0), tuple(scale * value for value in q))  # type: ignore[arg-type]
    axis, w = np.array(q[:3]) / length, q[3] / length
    skew = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    # Rodrigues with half angles.
    expected = np.eye(3) + 2 * w * skew + 2 * skew @ skew
    assert found[:3, :3] == pytest.approx(expected, abs=1e-9)
    assert found[:3, 3].tolist() == [x, y, 1.0]
    assert found[3].tolist() == [0, 0, 0, 1]


@pytest.mark.parametrize(
    ("shift", "turn"),
    [
        ((0, 0, 0), (0, 0, 0, 0)),
        ((0, 0, 0), (0, 0, 0, 1e-7)),
        ((math.nan, 0, 0), (0, 0, 0, 1)),
        ((0, 0, 0), (0, 0, math.inf, 1)),
    ],
)
def test_what_is_no_rotation_is_refused(shift: Any, turn: Any) -> None:
    with pytest.raises(InvalidInputError, match="without a rotation"):
        transform_matrix(shift, turn)


def test_names_lose_their_slashes_blanks_and_prefixes() -> None:
    assert [clean_name(name) for name in ("/laser", " laser/ ", "robot/laser", "")] == [
        "laser",
        "laser",
        "robot/laser",
        "",
    ]
    assert [last_name(name) for name in ("/robot/laser", "laser", "a/b/c/")] == ["laser", "laser", "c"]


def test_a_lidar_sits_where_the_chain_of_transforms_puts_it_both_ways() -> None:
    a, b, c = Pose2(0.2, 0.1, 0.5), Pose2(-0.1, 0.3, -1.2), Pose2(0.05, 0.0, 2.0)
    found = tree(
        ("base_link", "plate", matrix(*a.as_tuple())),
        ("mast", "plate", matrix(*b.inverse().as_tuple())),
        ("mast", "laser", matrix(*c.as_tuple())),
    ).mount("base_link", "/laser")
    assert found.pose.as_tuple() == pytest.approx((a @ b @ c).as_tuple())
    assert not found.upside_down
    over = tree(("base_link", "laser", matrix(0.2, 0.1, 0.7, roll=math.pi))).mount("base_link", "laser")
    assert over.upside_down
    assert over.pose.as_tuple() == pytest.approx((0.2, 0.1, 0.7))
    assert tree().mount("laser", "/laser").pose == Pose2()


@pytest.mark.parametrize(
    ("degrees", "level"), [(14.0, True), (16.0, False), (164.0, False), (166.0, True), (90.0, False)]
)
def test_a_lidar_may_be_tilted_a_little(degrees: float, level: bool) -> None:
    tilted = tree(("base_link", "laser", matrix(roll=math.radians(degrees))))
    if level:
        assert tilted.mount("base_link", "laser").upside_down == (degrees > 90.0)
    else:
        with pytest.raises(InvalidInputError, match=rf"tilted by {min(degrees, 180 - degrees):.0f} degrees"):
            tilted.mount("base_link", "laser")


def moving(parent: str, child: str, *poses: Pose2, made: TransformTree | None = None) -> TransformTree:
    made = TransformTree() if made is None else made
    for number, pose in enumerate(poses):
        made.add(parent, child, matrix(*pose.as_tuple()), static=False, stamp=float(number), recorded=10.0 + number)
    return made


@pytest.mark.parametrize(
    ("pose", "steady"),
    [
        (Pose2(0.019), True),
        (Pose2(0.021), False),
        (Pose2(0, 0, 0.019), True),
        (Pose2(0, 0, -0.021), False),
        (Pose2(0, 0.021), False),
    ],
)
def test_what_hardly_moves_is_rigid(pose: Pose2, steady: bool) -> None:
    made = moving("base_link", "laser", Pose2(), Pose2(0.01), pose)
    if steady:
        # Where it first was.
        assert made.mount("base_link", "laser").pose == Pose2()
    else:
        with pytest.raises(InvalidInputError, match="moves against its robot"):
            made.mount("base_link", "laser")


def test_a_lidar_that_is_turned_over_on_the_way_is_not_rigid() -> None:
    made = TransformTree()
    made.add("base_link", "laser", matrix(), static=False)
    made.add("base_link", "laser", matrix(roll=math.pi), static=False)
    with pytest.raises(InvalidInputError, match="moves"):
        made.mount("base_link", "laser")


def test_a_static_transform_counts_before_a_moving_one_and_the_last_of_them() -> None:
    made = moving("base_link", "laser", Pose2(), Pose2(1.0))
    made.add("base_link", "laser", matrix(0.3), static=True)
    made.add("base_link", "laser", matrix(0.4), static=True)
    made.add("base_link", "laser", matrix(9.0), static=False)
    assert made.mount("base_link", "laser").pose.x == pytest.approx(0.4)
    assert made
    assert not TransformTree()


def test_what_is_not_joined_is_an_unknown_mounting() -> None:
    apart = tree(("base_link", "imu", matrix()), ("mast", "laser", matrix()))
    for lidar in ("laser", "lidar", ""):
        with pytest.raises(InvalidInputError, match="unknown mounting"):
            apart.mount("base_link", lidar)
    with pytest.raises(InvalidInputError, match="the base to"):
        apart.mount("", "laser")


FOUND = [
    (("a", "base_link", "laser"), "laser", "", "laser"),
    (("robot1/base_link", "robot1/laser"), "laser", "", "robot1/laser"),
    (("base_link", "laser"), "robot1/laser", "", "laser"),
    (("robot1/laser", "robot2/laser"), "laser", "", None),
    (("robot1/laser", "robot2/laser"), "laser", "robot2/base_link", "robot2/laser"),
    (("robot1/laser",), "robot2/laser", "", None),
    (("base_link", "laser"), "base_footprint", "", "base_link"),
    (("base_footprint", "laser"), "base_link", "", "base_footprint"),
    (("a/base_link", "b/base_link"), "base_footprint", "", None),
    (("robot/base_link", "laser"), "base_footprint", "", "robot/base_link"),
    (("base_link", "other/base_footprint", "third/base_footprint"), "base_footprint", "", None),
    (("base_link",), "", "", None),
    (("mylaser", "base_link"), "laser", "", None),
]


@pytest.mark.parametrize(("frames", "name", "beside", "found"), FOUND)
def test_a_frame_is_found_by_its_name_or_what_it_ends_in(
    frames: tuple[str, ...], name: str, beside: str, found: str | None
) -> None:
    made = tree(*(("root", frame, matrix()) for frame in frames))
    assert made.find(name, beside=beside) == found
    assert made.find(f"/{name}" if name else name, beside=beside) == found


def test_the_base_has_a_usual_name_or_is_the_root() -> None:
    for names, base in (
        (("base_footprint", "base_link"), "base_footprint"),
        (("base", "base_link"), "base_link"),
        (("x/base_link", "plate"), "x/base_link"),
        (("plate", "mast"), "root"),
    ):
        made = tree(*(("root", name, matrix()) for name in (*names, "laser")))
        assert made.base_of("laser") == base
    assert tree(("root", "laser", matrix())).base_of("lidar") is None
    # What moves is not carried along.
    made = moving("odom", "base_link", Pose2(), Pose2(1.0), made=tree(("base_link", "laser", matrix())))
    assert made.base_of("laser") == "base_link"
    alone = moving("odom", "root", Pose2(), Pose2(1.0), made=tree(("root", "laser", matrix())))
    assert alone.base_of("laser") == "root"


WAY = (Pose2(), Pose2(0.5, 0.1, 0.2), Pose2(1.0, 0.3, 0.4))


def carried() -> TransformTree:
    return tree(("base_link", "laser", matrix(0.2)))


def test_odometry_is_the_transform_that_moves_the_robot_in_a_frame_of_that_name() -> None:
    made = moving("odom", "base_link", *WAY, made=carried())
    found = made.odometry("laser")
    assert found is not None
    assert (found.frame, found.base) == ("odom", "base_link")
    expected = [(float(n), 10.0 + n, *pose.as_tuple()) for n, pose in enumerate(WAY)]
    assert found.track == pytest.approx(np.array(expected))
    assert made.odometry("lidar") is None
    # Told the other way round it is the same.
    back = moving("base_link", "odom", *(pose.inverse() for pose in WAY), made=carried()).odometry("laser")
    assert back is not None
    assert (back.frame, back.base) == ("odom", "base_link")
    assert back.track == pytest.approx(np.array(expected))


def test_a_robot_that_stands_has_an_odometry_all_the_same() -> None:
    made = moving("odom", "base_link", Pose2(), Pose2(), made=carried())
    found = made.odometry("laser")
    assert found is not None
    assert found.base == "base_link"
    assert made.base_of("laser") == "base_link"


@pytest.mark.parametrize(
    ("parent", "child", "frame"),
    [
        ("map", "base_link", None),
        ("world", "base_link", None),
        ("robot/mocap0", "base_link", None),
        ("start", "base_link", "start"),
        ("base_link", "wheel", None),
        ("base_link", "odometry_x", "odometry_x"),
        ("robot/odom_combined", "base_link", "robot/odom_combined"),
    ],
)
def test_corrected_frames_and_wheels_are_no_odometry(parent: str, child: str, frame: str | None) -> None:
    made = moving(parent, child, *WAY, made=carried())
    found = made.odometry("laser")
    assert (None if found is None else found.frame) == frame
    assert made.corrected == (["map"] if parent == "map" else [parent] if parent in {"world", "robot/mocap0"} else [])


def test_of_several_the_one_that_is_named_so_is_taken() -> None:
    made = moving("start", "base_link", *WAY, made=carried())
    moving("odom", "base_link", *WAY, made=made)
    moving("base_link", "wheel", *WAY, made=made)
    found = made.odometry("laser")
    assert found is not None
    assert found.frame == "odom"
    assert made.frames == {"base_link", "laser", "start", "odom", "wheel"}
