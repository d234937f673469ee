"""From doors to edges and faces: distances against shapely, and hand-made maps with known reasons."""

import math

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from closedrooms.core.door import ClosedDoor
from closedrooms.core.errors import InvalidInputError
from closedrooms.core.grid import FREE, OCCUPIED, UNKNOWN, GridFrame, OccupancyGrid
from closedrooms.predictor.config import FacesConfig, PaperConfig
from closedrooms.predictor.paper.initial_faces import (
    _across,
    _merge_same,
    distances_to_edges,
    enter_face,
    find_entrance,
    splits_between,
)
from closedrooms.predictor.paper.initial_layouts import find_initial_faces, unusable
from closedrooms.predictor.paper.lines import Line

points = st.floats(-25.0, 25.0)


@given(x=points, y=points)
def test_doors_are_as_far_from_edges_as_points_from_segments(faces, x, y):
    arrangement = faces.cut([-5.0, 3.0], [0.0, 7.0], [Line(0.7, 2.0)])
    strings = shapely.linestrings(arrangement.edges)
    assert distances_to_edges(arrangement, np.array([x, y])) == pytest.approx(
        shapely.distance(strings, shapely.Point(x, y))
    )


@pytest.mark.parametrize("angle", [0.0, 0.4, 1.5])
def test_a_door_looks_across_its_edge_into_its_face(faces, angle):
    arrangement = faces.cut((), (), [Line(angle, 0.0), Line((angle + math.pi / 2) % math.pi, 3.0)])
    for edge, both in enumerate(arrangement.edge_faces.tolist()):
        if both[1] < 0:
            continue
        for face in both:
            entrance = enter_face(arrangement, ClosedDoor("d", tuple(arrangement.edges[edge].mean(axis=0))), edge, face)
            start, end = arrangement.edges[edge]
            inward = entrance.facing.inward
            assert np.hypot(*inward) == pytest.approx(1.0)
            assert inward @ (end - start) == pytest.approx(0.0, abs=1e-9)
            assert inward @ (np.array(arrangement.faces[face].centroid.coords[0]) - start) > 0
            assert (entrance.edge, entrance.face, entrance.door.id) == (edge, face, "d")


def _entrance(faces, door, unknown_at, xs=(-4.0, 4.0), ys=(0.0, 0.5), **limits):
    arrangement = faces.cut(xs, ys)
    unknown = np.zeros(len(arrangement.faces), dtype=np.bool_)
    unknown[[faces.at(arrangement, *point) for point in unknown_at]] = True
    return arrangement, find_entrance(arrangement, unknown, ClosedDoor("d", door), **{"reach": 1.0} | limits)


def test_an_edge_between_known_and_unknown_goes_before_a_closer_one_within_the_slack(faces):
    # A wall of 0.5 m, unknown, between lines at y = 0 and 0.5; beyond it all is unknown.
    unknown = [(0.0, 0.2), (0.0, 3.0)]
    for y, slack, upper in ((0.3, 0.25, False), (0.4, 0.25, True), (0.4, 0.31, False), (0.1, 0.25, False)):
        arrangement, found = _entrance(faces, (0.0, y), unknown, slack=slack)
        inside, beyond = faces.at(arrangement, 0.0, 0.2), faces.at(arrangement, 0.0, 3.0)
        # At y = 0.4 the line at 0.5 is 0.1 m away, that at 0 is 0.4 m away: 0.3 m more.
        assert found.face == (beyond if upper else inside)
        assert set(arrangement.edge_faces[found.edge].tolist()) == (
            {inside, beyond} if upper else {inside, faces.at(arrangement, 0.0, -3.0)}
        )


def test_of_an_edge_between_unknown_faces_the_side_away_from_the_door_is_meant(faces):
    unknown = [(0.0, -3.0), (0.0, 0.2), (0.0, 3.0)]
    for y, behind in ((0.02, -3.0), (-0.02, 0.2), (0.48, 3.0), (0.52, 0.2)):
        arrangement, found = _entrance(faces, (0.3, y), unknown)
        assert found.face == faces.at(arrangement, 0.0, behind)


def test_of_edges_as_close_the_longer_is_taken_then_the_first_by_place(faces):
    # On the corner (4, 0): edges of 8 m and 16 m along y = 0, of 20 m and 0.5 m along x = 4.
    unknown = [(0.0, 3.0), (10.0, 3.0), (0.0, 0.2), (10.0, 0.2)]
    arrangement, found = _entrance(faces, (4.0, 0.0), unknown)
    assert arrangement.edge_lengths[found.edge] == pytest.approx(16.0)
    assert found.face == faces.at(arrangement, 10.0, 0.2)
    arrangement, found = _entrance(faces, (0.0, 0.0), [(-3.0, 3.0), (3.0, 3.0)], xs=(-6.0, 0.0, 6.0), ys=(0.0,))
    assert found.face == faces.at(arrangement, -3.0, 3.0)


def test_a_door_as_far_as_it_may_be_has_an_edge_still(faces):
    for y, reach, found in ((-1.0, 1.0, True), (-1.001, 1.0, False), (-1.5, 1.5, True), (-1.6, 1.5, False)):
        _, entrance = _entrance(faces, (0.0, y), [(0.0, 0.2)], reach=reach)
        assert isinstance(entrance, str) != found
    assert entrance == "no wall line within 1.5 m of the door"
    _, entrance = _entrance(faces, (0.0, 0.0), [])
    assert entrance == "everything around the door is observed: nothing is hidden behind it"
    # The outline of the box is no wall.
    _, entrance = _entrance(faces, (0.0, 20.0), [(0.0, 3.0)])
    assert entrance == "no wall line within 1 m of the door"


def _splits(faces, doors, xs=(-4.0, 4.0), ys=(0.0, 6.0)):
    """Lines between doors ``(x, y)`` on the edges of the face around (0, 3), as (angle, offset)."""
    arrangement = faces.cut(xs, ys)
    unknown = np.zeros(len(arrangement.faces), dtype=np.bool_)
    unknown[faces.at(arrangement, 0.0, 3.0)] = True
    entrances = [find_entrance(arrangement, unknown, ClosedDoor(f"d{i}", at), reach=1.0) for i, at in enumerate(doors)]
    return [(line.angle, line.offset, line.kind) for line in splits_between(arrangement, entrances)]


def test_doors_on_two_edges_of_a_face_are_parted_where_they_spread_more(faces):
    # The shortest edge with a door is the left one, along y.
    assert _splits(faces, [(-4.0, 3.0), (2.0, 0.0)]) == [(pytest.approx(math.pi / 2), pytest.approx(1.0), "split")]
    assert _splits(faces, [(-4.0, 5.0), (-3.0, 0.0)]) == [(pytest.approx(0.0), pytest.approx(2.5), "split")]
    assert _splits(faces, [(-4.0, 4.1), (0.0, 0.0)]) == [(pytest.approx(0.0), pytest.approx(2.05), "split")]
    assert _splits(faces, [(-4.0, 3.9), (0.0, 0.0)]) == [(pytest.approx(math.pi / 2), pytest.approx(2.0), "split")]
    assert _splits(faces, [(-4.0, 2.0)]) == []
    # Doors opposite each other are one place along, and apart across.
    assert _splits(faces, [(1.0, 0.0), (1.0, 6.0)]) == [(pytest.approx(0.0), pytest.approx(3.0), "split")]


@pytest.mark.parametrize("angle", [0.0, 0.3, 1.5, 3.0, -0.4])
def test_a_line_across_an_axis_holds_the_place_on_it(angle):
    axis = np.array([math.cos(angle), math.sin(angle)])
    for place in (-3.0, 0.0, 2.0):
        line = _across(axis, place)
        assert 0.0 <= line.angle < math.pi
        assert line.kind == "split"
        assert line.along @ axis == pytest.approx(0.0, abs=1e-12)
        assert line.distance(place * axis) == pytest.approx(0.0, abs=1e-12)


def test_lines_that_differ_by_rounding_become_their_mean_and_others_stay():
    def merged(*lines):
        return [(line.angle, line.offset) for line in _merge_same([Line(*line, "split") for line in lines])]

    assert merged((0.5, 2.0), (0.5, 2.0009), (0.5, 2.0018)) == [(0.5, pytest.approx(2.0009))]
    assert merged((0.5, 2.0), (0.5, 2.0011)) == [(0.5, 2.0), (0.5, 2.0011)]
    assert merged((0.5 + 9e-7, 2.0), (0.5, 2.0)) == [(pytest.approx(0.5 + 4.5e-7, abs=1e-12), 2.0)]
    assert merged((0.5 + 2e-6, 2.0), (0.5, 2.0)) == [(0.5, 2.0), (0.5 + 2e-6, 2.0)]
    # Ordered by direction, then offset; directions apart are not chained by their offsets.
    assert merged((1.0, 2.0), (0.5, 2.0), (0.5, -1.0)) == [(0.5, -1.0), (0.5, 2.0), (1.0, 2.0)]
    assert merged() == []


def test_of_doors_at_one_place_the_smallest_id_stays():
    doors = [ClosedDoor("b", (0.0, 0.0)), ClosedDoor("a", (0.29, 0.0)), ClosedDoor("c", (0.31, 0.0))]
    assert unusable(doors, 0.3) == {"b": "at the same place as door a", "c": "at the same place as door a"}
    assert unusable([doors[0], doors[2]], 0.3) == {}
    # As far apart as is asked is far enough; what was left out says nothing of others.
    pair = [ClosedDoor("a", (0.0, 0.0)), ClosedDoor("b", (0.25, 0.0)), ClosedDoor("c", (0.5, 0.0))]
    assert unusable(pair, 0.25) == {}
    assert unusable(pair, 0.26) == {"b": "at the same place as door a"}


def test_doors_that_no_map_reaches_are_named():
    far = "it lies more than 1e+09 m from the origin of the map"
    doors = [ClosedDoor("a", (1e9, 0.0)), ClosedDoor("b", (0.0, -1.1e9)), ClosedDoor("c", (1.1e9, 3.0))]
    assert unusable(doors, 0.3) == {"b": far, "c": far}


def test_two_doors_of_one_id_are_refused_wherever_they_are():
    for second in ((5.0, 0.0), (0.1, 0.0), (2e9, 0.0)):
        for doors in ([(0.0, 0.0), second], [second, (0.0, 0.0)], [second, second]):
            with pytest.raises(InvalidInputError, match=r"two doors with the id 'd'.*expected one door an id"):
                unusable([ClosedDoor("d", at) for at in doors], 0.3)


def _map():
    """A corridor of 2 m below a wall that is unknown above, from x = 0 to 12; a known room behind it right of x = 8."""
    frame = GridFrame(0.05, -1.0, -1.0, 160, 280)
    cells = np.full(frame.shape, UNKNOWN, dtype=np.int8)

    def fill(x0, y0, x1, y1, value):
        (r0, c0), (r1, c1) = frame.to_cells(np.array([(x0 + 0.01, y0 + 0.01), (x1 - 0.01, y1 - 0.01)])).tolist()
        cells[r0 : r1 + 1, c0 : c1 + 1] = value

    fill(-0.1, -0.1, 12.1, 2.1, OCCUPIED)
    fill(0.0, 0.0, 12.0, 2.0, FREE)
    fill(7.9, 2.0, 12.1, 6.1, OCCUPIED)
    fill(8.0, 2.1, 12.0, 6.0, FREE)
    fill(-0.1, 2.0, 0.0, 6.1, OCCUPIED)
    return OccupancyGrid(frame, cells)


def test_reasons_of_doors_are_told_by_id():
    doors = [
        ClosedDoor("good", (3.0, 2.05)), ClosedDoor("twin", (3.1, 2.05)), ClosedDoor("far", (60.0, 60.0)),
        ClosedDoor("seen", (10.0, 2.05)),
    ]  # fmt: skip
    start, reasons = find_initial_faces(_map(), doors, PaperConfig())
    assert [entrance.door.id for entrance in start.entrances] == ["good"]
    assert reasons == {
        "twin": "at the same place as door good", "far": "no wall line within 1 m of the door",
        "seen": "everything around the door is observed: nothing is hidden behind it",
    }  # fmt: skip
    assert start.entrances[0].facing.inward == pytest.approx([0.0, 1.0])
    assert start.unknown[start.entrances[0].face]


def test_doors_of_one_face_get_faces_of_their_own_in_the_order_of_the_doors():
    doors = [ClosedDoor("b", (6.0, 2.05)), ClosedDoor("a", (2.0, 2.05)), ClosedDoor("c", (4.0, 2.05))]
    start, reasons = find_initial_faces(_map(), doors, PaperConfig())
    assert reasons == {}
    assert [entrance.door.id for entrance in start.entrances] == ["b", "a", "c"]
    assert len({entrance.face for entrance in start.entrances}) == 3
    splits = [line for line in start.arrangement.lines if line.kind == "split"]
    assert sorted(-line.offset for line in splits) == pytest.approx([3.0, 5.0])


def test_doors_that_no_line_parts_have_one_room():
    doors = [ClosedDoor("b", (3.0, 2.05)), ClosedDoor("a", (3.0, 2.05)), ClosedDoor("c", (6.0, 2.05))]
    start, reasons = find_initial_faces(_map(), doors, PaperConfig(same_door=0.0))
    assert reasons == {"b": "behind the same piece of wall as door a"}
    assert [entrance.door.id for entrance in start.entrances] == ["a", "c"]


@pytest.mark.parametrize(
    ("fill", "reason"),
    [
        (UNKNOWN, "the map is all unknown"), (OCCUPIED, "the map holds no free cell"),
        (FREE, "the map holds no wall line"),
    ],
)  # fmt: skip
def test_a_map_of_one_kind_has_its_reason(fill, reason):
    grid = OccupancyGrid(GridFrame(0.05, 0.0, 0.0, 80, 80), np.full((80, 80), fill, dtype=np.int8))
    doors = [ClosedDoor("a", (1.0, 1.0)), ClosedDoor("b", (1.1, 1.0))]
    assert find_initial_faces(grid, doors, FacesConfig()) == (None, {"a": reason, "b": reason})
