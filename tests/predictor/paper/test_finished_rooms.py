"""From grown layouts to rooms and to what a recording shows, on faces with known places."""

import math

import numpy as np
import pytest
import shapely
from shapely.geometry import box

from closedrooms.core.grid import FREE, OCCUPIED, UNKNOWN, GridFrame, OccupancyGrid
from closedrooms.predictor import absurd_rooms
from closedrooms.predictor.config import PaperConfig
from closedrooms.predictor.disjoint_rooms import NO_ROOM
from closedrooms.predictor.paper.expansion import Growth
from closedrooms.predictor.paper.finished_rooms import finish_rooms, unite
from closedrooms.predictor.paper.initial_layouts import InitialFaces
from closedrooms.predictor.paper.lines import Line
from closedrooms.predictor.paper.trace import level_of, trace_of
from closedrooms.predictor.paper.wall_lines import WallLines

BARE = PaperConfig(wall_thickness=0.0)


def _start(faces, doors, *, slanted=()):
    """Faces of 4 x 3 m above y = 0, unknown, the map known below; doors ``(name, behind, before)``."""
    arrangement = faces.cut((-8.0, -4.0, 0.0, 4.0, 8.0), (0.0, 3.0, 6.0), slanted)
    frame = GridFrame(0.05, -10.0, -4.0, 120, 400)
    cells = np.full(frame.shape, UNKNOWN, dtype=np.int8)
    cells[:78], cells[78:80] = FREE, OCCUPIED
    unknown = np.array([face.centroid.y > 0.0 for face in arrangement.faces])
    entrances = tuple(faces.entrance(arrangement, *door) for door in doors)
    structure = WallLines(np.zeros((3, 4)), np.array([0, -1, 1]), (), (), np.array([0.0, math.pi / 2]))
    start = InitialFaces(OccupancyGrid(frame, cells), structure, arrangement, unknown, entrances)
    return start, Growth(arrangement, unknown, entrances)


A, B, C = ("a", (2.0, 1.0), (2.0, -1.0)), ("b", (-2.0, 1.0), (-2.0, -1.0)), ("c", (-6.0, 1.0), (-6.0, -1.0))


def _differs(room, *bounds):
    return room.polygon.symmetric_difference(box(*bounds)).area


def test_rooms_are_their_layouts_in_the_order_of_the_doors_with_kind_score_and_bound(faces):
    start, growth = _start(faces, [A, C, B])
    growth.owner[faces.at(start.arrangement, 2.0, 4.0)] = 0
    growth.scores = [1.23456789012, 2.0, -1.0]
    growth.bounded = [False, True, False]
    rooms, failures = finish_rooms(start, growth, BARE)
    assert failures == {}
    assert [room.doors for room in rooms] == [("a",), ("c",), ("b",)]
    # Up to the leaf, which stands as far as the map is known.
    for room, bounds in zip(rooms, [(0, 0, 4, 6), (-8, 0, -4, 3), (-4, 0, 0, 3)], strict=True):
        assert _differs(room, *bounds) < 0.1
    assert [room.kind for room in rooms] == ["dependent"] * 3
    assert [room.score for room in rooms] == [1.23456789, 2.0, -1.0]
    assert [room.bounded for room in rooms] == [False, True, False]
    # a and c have no common edge.
    rooms, _ = finish_rooms(*_start(faces, [A, C]), BARE)
    assert [room.kind for room in rooms] == ["independent"] * 2


def test_walls_take_as_much_as_is_said_or_measured(faces):
    start, growth = _start(faces, [A])
    (room,), _ = finish_rooms(start, growth, PaperConfig(wall_thickness=0.4))
    # Half of it on every side that shows nothing; the side of the door, where the map is known, up to the leaf.
    assert room.polygon.bounds[:1] + room.polygon.bounds[2:] == pytest.approx((0.2, 3.8, 2.8))
    (room,), _ = finish_rooms(start, growth, PaperConfig())
    # Where nothing is measured, walls of 0.1 m.
    assert room.polygon.bounds[:1] + room.polygon.bounds[2:] == pytest.approx((0.05, 3.95, 2.95))


def test_border_rooms_take_what_others_leave_the_shallowest_first(faces):
    # Three border faces above y = 6, entered from below and from the left; grown rooms beside them.
    border = [("p", (2.0, 10.0), (2.0, 5.0)), ("q", (6.0, 10.0), (6.0, 5.0))]
    start, growth = _start(faces, [A, *border])
    rooms, failures = finish_rooms(start, growth, BARE)
    assert failures == {}
    assert [(room.doors, room.kind, room.score) for room in rooms] == [
        (("a",), "independent", 0.0), (("p",), "border", None), (("q",), "border", None)
    ]  # fmt: skip
    assert _differs(rooms[1], 0, 6, 4, 10) < 1e-6
    assert _differs(rooms[2], 4, 6, 8, 10) < 1e-6
    # From its other side the square of 14 m of q lies over p's, which is shallower.
    start, growth = _start(faces, [border[0], ("q", (6.0, 10.0), (10.0, 10.0))])
    rooms, _ = finish_rooms(start, growth, BARE)
    assert _differs(rooms[0], 0, 6, 4, 10) < 1e-6
    assert rooms[1].polygon.intersection(rooms[0].polygon).area < 1e-9
    assert _differs(rooms[1], 4, 6, 8, 10) < 1e-6


def test_a_border_room_that_another_room_fills_has_none_and_says_so(faces, monkeypatch):
    # The other one fills half of a map that shows no floor.
    monkeypatch.setattr(absurd_rooms, "HALL", 400.0)
    start, growth = _start(faces, [A, ("p", (2.0, 10.0), (2.0, 5.0))])
    growth.owner[
        [i for i, face in enumerate(start.arrangement.faces) if face.centroid.y > 6.0 and face.centroid.x > 0]
    ] = 0
    growth.owner[start.entrances[1].face] = 0
    growth.owner[[faces.at(start.arrangement, 2.0, 4.0)]] = 0
    rooms, failures = finish_rooms(start, growth, BARE)
    assert [room.doors for room in rooms] == [("a",)]
    assert failures == {"p": NO_ROOM}


def test_a_level_holds_the_layouts_and_scores_of_its_moment(faces):
    start, growth = _start(faces, [A, C])
    growth.owner[faces.at(start.arrangement, 2.0, 4.0)] = 0
    growth.scores = [3.0, 4.0]
    level = level_of(7, growth)
    growth.owner[:] = -1
    assert level.k == 7
    assert level.scores == {"a": 3.0, "c": 4.0}
    assert level.layouts["a"].symmetric_difference(box(0, 0, 4, 6)).area < 1e-9
    assert level.layouts["c"].symmetric_difference(box(-8, 0, -4, 3)).area < 1e-9


def test_a_trace_draws_lines_from_side_to_side_and_those_with_a_span_from_line_to_line(faces):
    slanted = (Line(math.pi / 4, 0.0, span=(0.5, 1.5)), Line(math.pi / 4, math.sqrt(2.0)))
    start, growth = _start(faces, [A], slanted=slanted)
    trace = trace_of(start, [level_of(0, growth)])
    ends = {tuple(sorted([tuple(line[:2].round(3)), tuple(line[2:].round(3))])) for line in trace.lines + 0.0}
    assert ends == {
        *(((x, -20.0), (x, 20.0)) for x in (-8.0, -4.0, 0.0, 4.0, 8.0, -20.0, 20.0)),
        *(((-20.0, y), (20.0, y)) for y in (0.0, 3.0, 6.0, -20.0, 20.0)),
        # y = x between x = 0 and y = 3; y = x + 2 whole.
        ((0.0, 0.0), (3.0, 3.0)),
        ((-20.0, -18.0), (18.0, 20.0)),
    }
    assert trace.line_kinds == tuple(line.kind for line in start.arrangement.lines)
    assert trace.line_kinds.count("border") == 4
    assert trace.initial == {"a": start.entrances[0].face}
    assert trace.faces is start.arrangement.faces
    assert (trace.unknown is start.unknown, trace.border is start.arrangement.border) == (True, True)
    assert (trace.segments is start.structure.segments, trace.clusters is start.structure.clusters) == (True, True)
    assert [level.k for level in trace.levels] == [0]
    assert unite(growth, 0).equals(shapely.union_all([start.arrangement.faces[f] for f in growth.layout(0)]))


def test_a_layout_narrower_than_a_door_is_no_room_and_takes_nothing_from_others(faces):
    start, growth = _start(
        faces, [("a", (2.0, 0.2), (2.0, -1.0)), ("b", (-2.0, 0.2), (-2.0, -1.0))], slanted=[Line(0.0, 0.5)]
    )
    growth.owner[faces.at(start.arrangement, -2.0, 1.0)] = 1
    rooms, failures = finish_rooms(start, growth, BARE)
    assert [room.doors for room in rooms] == [("b",)]
    assert failures == {"a": "its room would be less than 0.6 m wide"}
