import math

import numpy as np
import pytest

from closedrooms.core.arrays import FloatArray
from closedrooms.core.pose import Pose2
from closedrooms.mapping.beams import clean
from closedrooms.mapping.glass.met_surfaces import Glimpse, MetSurfaces
from closedrooms.mapping.glass.scan_view import faces
from tests.conftest import SegmentWorld

LIMIT = math.radians(22.0)
WINDOW = (-30, -50, 300, 400)
"""First row and column, rows and columns [cells]: more than the glimpses reach on one side, less on another."""


def glimpses(world: SegmentWorld, count: int = 12) -> list[Glimpse]:
    rng = np.random.default_rng(4)
    found = []
    for number in range(count):
        pose = Pose2(1.0 + 0.7 * number, 1.0, 0.2 * number)
        beams = clean(world.scan(pose, beams=360, noise=0.02, outliers=0.02, rng=rng), max_range=25.0)
        found.append(Glimpse(number // 3, KEYFRAMES[number // 3].inverse() @ pose, beams.points, beams.origin))
    return found


KEYFRAMES = [Pose2(1.0 + 2.1 * i, 1.0, 0.6 * i) for i in range(4)]


def by_hand(seen: list[Glimpse], asked: np.ndarray) -> dict[tuple[int, int], tuple[FloatArray, FloatArray]]:
    """Go through every point of every glimpse: mean place and normal of each cell that is asked for."""
    sums: dict[tuple[int, int], FloatArray] = {}
    for glimpse in seen:
        map_T_robot = KEYFRAMES[glimpse.keyframe] @ glimpse.keyframe_T_robot
        everyone = np.arange(len(glimpse.points))
        normals, incidence = faces(glimpse.points, everyone, glimpse.points - glimpse.origin)
        for i in np.flatnonzero(incidence < LIMIT):
            place = map_T_robot.transform(glimpse.points[i : i + 1])[0]
            row, col = math.floor(place[1] / 0.05), math.floor(place[0] / 0.05)
            inside = 0 <= row - WINDOW[0] < WINDOW[2] and 0 <= col - WINDOW[1] < WINDOW[3]
            if inside and asked[row - WINDOW[0], col - WINDOW[1]]:
                angle = 2.0 * (math.atan2(normals[i, 1], normals[i, 0]) + map_T_robot.theta)
                values = np.array([*place, math.cos(angle), math.sin(angle), 1.0])
                sums[row, col] = sums.get((row, col), np.zeros(5)) + values
    halves = {cell: math.atan2(s[3], s[2]) / 2.0 for cell, s in sums.items()}
    return {c: (s[:2] / s[4], np.array([math.cos(halves[c]), math.sin(halves[c])])) for c, s in sums.items()}


def add(surfaces: MetSurfaces, some: list[Glimpse]) -> None:
    surfaces.add(some, [KEYFRAMES[glimpse.keyframe] for glimpse in some])


@pytest.mark.parametrize("parts", [1, 2, 12])
def test_places_and_normals_are_those_of_all_points_in_a_cell(office: SegmentWorld, parts: int) -> None:
    seen, asked = glimpses(office), np.random.default_rng(0).random(WINDOW[2:]) < 0.2
    surfaces = MetSurfaces(0.05)
    for first in range(0, 12, 12 // parts):
        add(surfaces, seen[first : first + 12 // parts])
    expected = by_hand(seen, asked)
    places, normals = surfaces.near_normal(*WINDOW[:2], asked, LIMIT)
    assert len(places) == len(expected) > 100
    for place, normal in zip(places, normals, strict=True):
        wanted = expected[math.floor(place[1] / 0.05), math.floor(place[0] / 0.05)]
        assert place == pytest.approx(wanted[0], abs=1e-9)
        assert abs(float(normal @ wanted[1])) == pytest.approx(1.0, abs=1e-9)


def test_a_cell_is_told_once_even_after_poses_were_corrected(office: SegmentWorld) -> None:
    seen, asked = glimpses(office), np.ones(WINDOW[2:], dtype=np.bool_)
    surfaces = MetSurfaces(0.05)
    add(surfaces, seen[:6])
    first, _ = surfaces.near_normal(*WINDOW[:2], asked, LIMIT)
    assert len(surfaces.near_normal(*WINDOW[:2], asked, LIMIT)[0]) == 0
    surfaces.clear()
    assert len(surfaces) == 0
    add(surfaces, seen)
    later, _ = surfaces.near_normal(*WINDOW[:2], asked, LIMIT)
    cells = {tuple(np.floor(place / 0.05)) for place in first}
    assert 0 < len(later) == len(by_hand(seen, asked)) - len(first)
    assert not cells & {tuple(np.floor(place / 0.05)) for place in later}


def test_a_cell_met_askew_is_told_once_it_is_met_near_its_normal() -> None:
    wall = SegmentWorld([(-4.0, 3.0, 4.0, 3.0)])
    asked = np.zeros(WINDOW[2:], dtype=np.bool_)
    asked[60 - WINDOW[0], 60 - WINDOW[1]] = True  # the cell of the wall at x = 3
    surfaces = MetSurfaces(0.05)
    for x, count in ((-1.5, 0), (3.0, 1)):
        beams = clean(wall.scan(Pose2(x, 0.5), beams=720), max_range=25.0)
        add(surfaces, [Glimpse(0, KEYFRAMES[0].inverse() @ Pose2(x, 0.5), beams.points, beams.origin)])
        places, _ = surfaces.near_normal(*WINDOW[:2], asked, LIMIT)
        assert len(places) == count
    # Only what was seen from in front counts.
    assert places[0] == pytest.approx([3.025, 3.0], abs=0.02)


def test_a_glimpse_without_points_says_nothing() -> None:
    surfaces = MetSurfaces(0.05)
    add(surfaces, [Glimpse(0, Pose2(), np.zeros((0, 2)), np.zeros(2))])
    places, normals = surfaces.near_normal(0, 0, np.ones((5, 5), dtype=np.bool_), LIMIT)
    assert places.shape == normals.shape == (0, 2)
