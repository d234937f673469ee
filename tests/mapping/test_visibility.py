import numpy as np
import pytest

from closedrooms.core.pose import Pose2
from closedrooms.mapping.beams import clean
from closedrooms.mapping.visibility import conflict


def beams_at(world, pose: Pose2):  # type: ignore[no-untyped-def]
    return clean(world.scan(pose, noise=0.02, rng=np.random.default_rng(1)), max_range=25.0)


A, B = Pose2(2.5, 4.0, 0.4), Pose2(2.9, 3.7, 0.9)


def test_two_scans_at_their_true_poses_do_not_contradict_each_other(office) -> None:  # type: ignore[no-untyped-def]
    share = conflict(beams_at(office, A), beams_at(office, B), A.inverse() @ B)
    assert share is not None
    assert share < 0.05


@pytest.mark.parametrize("off", [Pose2(0.8, 0.0, 0.0), Pose2(-0.6, 0.6, 0.0), Pose2(0.0, 0.0, 0.7)])
def test_a_wrong_pose_puts_walls_where_beams_passed(office, off: Pose2) -> None:  # type: ignore[no-untyped-def]
    share = conflict(beams_at(office, A), beams_at(office, B), A.inverse() @ B @ off)
    assert share is not None
    assert share > 0.2


def test_a_room_that_was_not_seen_before_contradicts_nothing(office) -> None:  # type: ignore[no-untyped-def]
    corridor, room = Pose2(1.0, 1.0, 0.0), Pose2(2.45, 2.4, 1.57)
    share = conflict(beams_at(office, corridor), beams_at(office, room), corridor.inverse() @ room)
    assert share is None or share < 0.1


def test_scans_far_apart_say_nothing_about_each_other(office) -> None:  # type: ignore[no-untyped-def]
    assert conflict(beams_at(office, A), beams_at(office, B), Pose2(100.0, 0.0, 0.0)) is None
