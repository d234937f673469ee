import numpy as np
import pytest

from closedrooms.core.door import DoorSighting
from closedrooms.core.pose import Pose2
from closedrooms.mapping.beams import Beams
from closedrooms.mapping.door_fusion import fuse_doors
from closedrooms.mapping.graph.keyframe import Keyframe

NOTHING = np.empty((0, 2))
DOOR = ((3.0, 1.0), (3.0, 1.9))


def keyframe(index: int, pose: Pose2) -> Keyframe:
    return Keyframe(index, 0.0, pose, Beams(NOTHING, NOTHING, np.zeros(2)), NOTHING, NOTHING, 0.0)


def sighted(frame: Keyframe, robot: Pose2 | None = None, *, shift: float = 0.0, swap: bool = False) -> None:
    """Let a robot at ``robot`` (map frame) see the door, kept relative to ``frame``."""
    robot = robot or frame.pose
    ends = robot.inverse().transform(np.array(DOOR) + np.array([shift, 0.0]))
    a, b = ((float(x), float(y)) for x, y in (ends[::-1] if swap else ends))
    frame.remember(DoorSighting("d00", (a, b), 0.0), frame.pose.inverse() @ robot)


def test_a_sighting_becomes_a_door_in_the_map_frame() -> None:
    frame = keyframe(0, Pose2(1.0, 0.5, 0.7))
    sighted(frame, Pose2(1.3, 0.6, 0.2))
    (door,) = fuse_doors([frame])
    assert door.id == "d00"
    assert door.segment is not None
    assert np.array(door.segment) == pytest.approx(np.array(DOOR))
    assert door.midpoint == pytest.approx((3.0, 1.45))
    assert door.width == pytest.approx(0.9)


def test_a_few_wrong_sightings_move_nothing() -> None:
    frames = [keyframe(i, Pose2(0.3 * i, 0.0, 0.1 * i)) for i in range(7)]
    for i, frame in enumerate(frames):
        sighted(frame, shift=2.0 if i in {0, 3} else 0.001 * i, swap=i % 2 == 1)
    (door,) = fuse_doors(frames)
    assert door.midpoint == pytest.approx((3.0, 1.45), abs=0.01)
    assert door.width == pytest.approx(0.9, abs=0.01)


def test_nearer_sightings_count_more_down_to_a_metre() -> None:
    # One from 1.2 m against two from 2 m; then one from 0.4 m, which counts as from 1 m, against two from 1.2 m.
    for near, far, first in ((1.2, 2.0, True), (0.4, 1.2, False)):
        frames = [keyframe(i, Pose2(3.0 - away, 1.45, 0.0)) for i, away in enumerate((near, far, far))]
        for frame, shift in zip(frames, (0.0, 0.1, 0.1), strict=True):
            sighted(frame, shift=shift)
        (door,) = fuse_doors(frames)
        assert door.midpoint[0] == pytest.approx(3.0 if first else 3.1)


def test_a_corrected_keyframe_takes_its_doors_along() -> None:
    frame = keyframe(0, Pose2())
    sighted(frame)
    correction = Pose2(0.5, -0.2, 0.3)
    frame.pose = correction
    (door,) = fuse_doors([frame])
    assert np.array(door.segment) == pytest.approx(correction.transform(np.array(DOOR)))


def test_a_keyframe_keeps_its_nearest_sighting() -> None:
    frame = keyframe(0, Pose2())
    sighted(frame, Pose2(2.0, 1.0, 0.0))
    sighted(frame, Pose2(-5.0, 0.0, 0.0), shift=0.4)
    (door,) = fuse_doors([frame])
    assert door.midpoint == pytest.approx((3.0, 1.45))


def test_no_sighting_is_no_door() -> None:
    assert fuse_doors([keyframe(0, Pose2())]) == []


@pytest.mark.parametrize("swapped", [set(), {0}, {1, 2}, {0, 1, 2}, {2, 3}, {0, 2}])
def test_from_which_end_a_door_is_seen_makes_no_difference(swapped: set[int]) -> None:
    # All from the same place: they weigh the same.
    frames = [keyframe(i, Pose2(0.5, 0.1, 0.05)) for i in range(4)]
    for i, frame in enumerate(frames):
        sighted(frame, swap=i in swapped)
    (door,) = fuse_doors(frames)
    assert door.width == pytest.approx(0.9)
    assert door.segment is not None
    assert sorted(y for _, y in door.segment) == pytest.approx([1.0, 1.9])
