import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from closedrooms.core.door import DoorSighting
from closedrooms.core.pose import Pose2
from closedrooms.mapping.beams import Beams
from closedrooms.mapping.graph.keyframe import Keyframe

NOTHING = np.empty((0, 2))


def keyframe(points: np.ndarray = NOTHING, pose: Pose2 | None = None) -> Keyframe:
    return Keyframe(3, 1.5, pose or Pose2(), Beams(NOTHING, NOTHING, np.zeros(2)), points, NOTHING, 2.0)


@given(st.lists(st.tuples(st.floats(-9, 9), st.floats(-9, 9)), min_size=1, max_size=20))
def test_the_middle_of_a_scan_is_the_upper_median_of_its_points(points: list[tuple[float, float]]) -> None:
    found = keyframe(np.array(points), Pose2(1.0, 2.0, math.pi / 2))
    half = len(points) // 2
    x, y = sorted(p[0] for p in points)[half], sorted(p[1] for p in points)[half]
    assert found.middle.tolist() == [x, y]
    assert found.view == pytest.approx([1.0 - y, 2.0 + x])


def test_a_scan_without_points_sees_where_it_stands() -> None:
    assert keyframe(pose=Pose2(1.0, 2.0, 0.3)).view.tolist() == [1.0, 2.0]
    fresh = keyframe()
    assert (fresh.submap, fresh.shown, fresh.drawn, fresh.sightings) == (0, None, None, {})


def test_of_the_sightings_of_a_door_the_nearest_is_kept_by_the_distance_of_its_middle() -> None:
    frame = keyframe()
    robot = Pose2(1.0, 0.5, math.pi / 2)

    def see(name: str, a: tuple[float, float], b: tuple[float, float]) -> None:
        frame.remember(DoorSighting(name, (a, b), 0.0), robot)

    see("d0", (3.0, -1.0), (3.0, 1.0))
    segment, distance = frame.sightings["d0"]
    assert distance == 3.0
    # In the keyframe's frame: ahead of the robot is up, its left is towards smaller x.
    assert np.array(segment) == pytest.approx(np.array([(2.0, 3.5), (0.0, 3.5)]))
    see("d0", (4.0, 0.5), (4.0, 1.5))
    see("d0", (0.0, 3.0), (0.0, 3.0))
    assert frame.sightings["d0"][1] == 3.0
    see("d0", (1.0, 2.0), (2.0, 2.0))
    assert frame.sightings["d0"][1] == 2.5
    see("d1", (9.0, 0.0), (9.0, 1.0))
    assert set(frame.sightings) == {"d0", "d1"}
