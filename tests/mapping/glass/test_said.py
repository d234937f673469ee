"""What keyframes say about places, kept as the few entries that there are."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from closedrooms.core.pose import Pose2
from closedrooms.mapping.beams import clean
from closedrooms.mapping.glass.before_glass import before_glass
from closedrooms.mapping.glass.panes import Panes
from closedrooms.mapping.glass.testimony import (
    HIT_NEAR,
    HIT_OBLIQUE,
    PAST_NEAR,
    PAST_OBLIQUE,
    VIEWPOINT,
    Said,
    Witnesses,
)
from closedrooms.mapping.graph.keyframe import Keyframe
from tests.conftest import SegmentWorld


@given(seed=st.integers(0, 10_000), keyframes=st.integers(1, 12), places=st.integers(1, 9))
def test_each_viewpoint_counts_once(seed: int, keyframes: int, places: int) -> None:
    rng = np.random.default_rng(seed)
    said = rng.integers(0, 5, (keyframes, places)).astype(np.int8)
    sensors = rng.uniform(0.0, 3.0 * VIEWPOINT, (keyframes, 2))
    who, what = np.nonzero(said)
    shuffled = rng.permutation(len(who))
    entries = Said(who[shuffled].astype(np.int32), what[shuffled].astype(np.int32), said[who, what][shuffled])
    squares = [tuple(square) for square in np.floor(sensors / VIEWPOINT).tolist()]
    counts = entries.count_viewpoints(sensors, places)
    for code, counted in zip((HIT_NEAR, HIT_OBLIQUE, PAST_NEAR, PAST_OBLIQUE), counts, strict=True):
        for place in range(places):
            assert counted[place] == len({squares[k] for k in np.flatnonzero(said[:, place] == code)})


def keyframes_of(world: SegmentWorld, route: list[tuple[float, float]]) -> list[Keyframe]:
    drive = world.drive(route, noise=0.01, beams=360)
    keyframes = []
    for number, (scan, odometry) in enumerate(zip(drive.scans[::8], drive.odometry[::8], strict=True)):
        beams = clean(scan, max_range=20.0)
        keyframes.append(Keyframe(number, scan.stamp, Pose2(*odometry), beams, beams.points, beams.points, 0.0))
    return keyframes


def test_exactly_the_keyframes_whose_beams_went_through_a_pane_are_cut_at_it(office: SegmentWorld) -> None:
    keyframes, panes, rng = keyframes_of(office, [(0.7, 1.0), (10.0, 1.0)]), Panes(0.05), np.random.default_rng(4)
    cut = 0
    for count in (3, len(keyframes), len(keyframes)):
        panes.segments = rng.uniform((-2.0, -6.0), (14.0, 6.0), (2, 1, 2)) + rng.uniform(-1.0, 1.0, (2, 2, 2))
        keyframes[1].pose = keyframes[1].pose @ Pose2(0.2, -0.3, 0.1)
        wanted = [before_glass(k.beams, k.pose, panes.segments) for k in keyframes[:count]]
        found = panes.shown(keyframes[:count], keyframes[:count])
        for keyframe, beams, expected in zip(keyframes, found, wanted, strict=False):
            assert (beams is keyframe.beams) == (expected is keyframe.beams)
            assert np.array_equal(beams.points, expected.points)
            assert np.array_equal(beams.outline, expected.outline)
        through = [k for k, beams in zip(keyframes, wanted, strict=False) if beams is not k.beams]
        assert panes.seen_through(keyframes[:count], panes.segments) == through
        cut += len(through)
    assert 5 < cut < 2 * len(keyframes)


def test_of_new_places_and_moved_keyframes_is_said_what_asking_all_of_all_says(office: SegmentWorld) -> None:
    keyframes = keyframes_of(office, [(0.7, 1.0), (10.0, 1.0)])
    rng = np.random.default_rng(0)
    panes = Panes(0.05)
    for count, known in ((3, 40), (len(keyframes), 40), (len(keyframes), 300), (len(keyframes), 320)):
        new = rng.uniform((-2.0, -6.0), (14.0, 6.0), (known - len(panes._places), 2))
        angles = rng.uniform(0.0, np.pi, len(new))
        panes._places = np.concatenate((panes._places, new))
        panes._normals = np.concatenate((panes._normals, np.column_stack((np.cos(angles), np.sin(angles)))))
        panes._asked = np.concatenate((panes._asked, rng.permutation(np.arange(known - len(new), known))))
        keyframes[1].pose = keyframes[1].pose @ Pose2(0.02, -0.03, 0.01)
        panes._ask(keyframes[:count])
        places, normals = panes._places[panes._asked], panes._normals[panes._asked]
        witnesses = Witnesses()
        assert witnesses.call(keyframes[:count]) == list(range(count))
        whole, said = witnesses.say(range(count), places, normals), panes._said
        assert len(whole.codes) > 0
        assert sorted(zip(said.keyframes, said.places, said.codes, strict=True)) == sorted(
            zip(whole.keyframes, whole.places, whole.codes, strict=True)
        )
        assert (panes._counts == whole.count_viewpoints(witnesses.sensors, len(places))).all()
