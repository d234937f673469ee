"""Which keyframes make the surroundings that a scan is matched against."""

import numpy as np
import pytest

from closedrooms.core.pose import Pose2
from closedrooms.mapping.beams import Beams
from closedrooms.mapping.config import LoopConfig, MapperConfig
from closedrooms.mapping.graph.keyframe import Keyframe
from closedrooms.mapping.local_map import HYSTERESIS, STALE_MEMBERS, LocalMap

CONFIG = MapperConfig(loops=LoopConfig(horizon=10.0), max_range=8.0)
ANGLES = np.linspace(0, 2 * np.pi, 40, endpoint=False)
RING = np.column_stack((np.cos(ANGLES), np.sin(ANGLES)))


def frames(*places: tuple[float, float]) -> list[Keyframe]:
    """Keyframes that see a circle of a metre around themselves."""
    beams = Beams(RING, RING, np.zeros(2))
    return [Keyframe(n, float(n), Pose2(x, y), beams, RING, RING, 0.0) for n, (x, y) in enumerate(places)]


def seen(local: LocalMap, frame: Keyframe) -> bool:
    rows, cols = local.field.lattice.cells(frame.pose.transform(RING))
    inside = (rows >= 0) & (cols >= 0) & (rows < local.field.lattice.rows) & (cols < local.field.lattice.cols)
    return bool(inside.all() and local.field.values[rows, cols].min() > 0.5)


@pytest.mark.parametrize(
    ("path", "away", "member"), [(9.9, 7.9, True), (10.1, 1.0, False), (1.0, 8.1, False), (10.0, 0.0, True)]
)
def test_keyframes_near_along_the_graph_and_as_the_crow_flies_are_matched_against(
    path: float, away: float, member: bool
) -> None:
    local = LocalMap(CONFIG)
    pair = frames((0.0, 0.0), (30.0, 0.0))
    local.update(pair, np.array([path, 0.0]), np.array([away, 0.0]))
    assert seen(local, pair[0]) == member
    assert seen(local, pair[1])


def test_what_once_was_near_stays_until_it_is_far_behind_for_many() -> None:
    count = STALE_MEMBERS + 3
    places = [(3.0 * n, 0.0) for n in range(count)]
    local, some = LocalMap(CONFIG), frames(*places)
    near = np.zeros(count)
    local.update(some, near, near)
    assert all(seen(local, frame) for frame in some)
    # Behind the horizon, but not by half as much again: they stay.
    behind = np.full(count, HYSTERESIS * 10.0 - 0.1)
    behind[-1] = 0.0
    local.update(some, behind, near)
    assert all(seen(local, frame) for frame in some)
    # A dozen may stay beyond that, one more and all is drawn anew.
    for far, kept in ((STALE_MEMBERS, True), (STALE_MEMBERS + 1, False)):
        lengths = np.zeros(count)
        lengths[:far] = HYSTERESIS * 10.0 + 0.1
        local.update(some, lengths, near)
        assert [seen(local, frame) for frame in some] == [kept] * far + [True] * (count - far)
    # Those that are too far to be seen anyway are not counted.
    local = LocalMap(CONFIG)
    local.update(some, near, near)
    lengths, far_off = np.full(count, 99.0), np.full(count, 9.0)
    lengths[-1] = far_off[-1] = 0.0
    local.update(some, lengths, far_off)
    assert all(seen(local, frame) for frame in some)


def test_each_keyframe_is_stamped_once_and_after_a_correction_again() -> None:
    local, (one, two) = LocalMap(CONFIG), frames((0.0, 0.0), (20.0, 0.0))
    local.update([one], np.zeros(1), np.zeros(1))
    one.pose = Pose2(5.0, 5.0)
    local.update([one, two], np.zeros(2), np.zeros(2))
    assert not seen(local, one)
    assert seen(local, two)
    local.clear()
    assert not local.field.values.any()
    local.update([one, two], np.zeros(2), np.zeros(2))
    assert seen(local, one)
    assert seen(local, two)


def test_what_members_saw_through_is_known_and_forgotten_with_them() -> None:
    local = LocalMap(MapperConfig())
    wide = 3.0 * RING
    some = [Keyframe(n, 0.0, Pose2(0.05 * n, 0.0), Beams(wide, wide, np.zeros(2)), wide, wide, 0.0) for n in range(5)]
    scan = np.concatenate((wide, 0.2 * RING[::5] + np.array([1.0, 0.5])))
    local.update(some, np.zeros(5), np.zeros(5))
    assert not local.crossed.stands_still(Pose2(), scan)[len(wide) :].any()
    local.clear()
    assert local.crossed.stands_still(Pose2(), scan).all()
