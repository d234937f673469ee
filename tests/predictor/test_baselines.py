"""The two baselines, held against one ray and one face at a time."""

import math

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from closedrooms.core.door import ClosedDoor
from closedrooms.core.grid import FREE, OCCUPIED, UNKNOWN, GridFrame, OccupancyGrid
from closedrooms.predictor.baselines import (
    RAYS,
    _behind_wall,
    _faces_in_sight,
    _in_sight,
    _seen,
    geometric,
    line_of_sight,
)
from closedrooms.predictor.config import FacesConfig
from closedrooms.predictor.paper.arrangement import build_arrangement
from closedrooms.predictor.paper.initial_faces import Entrance, enter_face
from closedrooms.predictor.paper.initial_layouts import InitialFaces, find_initial_faces
from closedrooms.predictor.paper.lines import Line
from closedrooms.predictor.structure.doorways import FacingDoor


def _start(grid, x, y, angle=math.pi / 2):
    """A door that looks along an angle, on a grid alone."""
    door = FacingDoor(ClosedDoor("d", (x, y)), np.array([math.cos(angle), math.sin(angle)]))
    return InitialFaces(grid, None, None, None, (Entrance(door, 0, 0),))


def _trace(grid, eye, angle):
    """The first step at which a ray leaves what is unknown within the bounds of what is known, else the last."""
    frame, known = grid.frame, np.argwhere(grid.known)
    (r0, c0), (r1, c1) = known.min(axis=0), known.max(axis=0)
    unknown, size = grid.unknown, frame.resolution
    steps = np.arange(0.0, math.hypot(r1 - r0 + 1, c1 - c0 + 1) * size, size).tolist()
    for step in steps:
        row = math.floor((eye[1] + step * math.sin(angle) - frame.origin_y) / size)
        col = math.floor((eye[0] + step * math.cos(angle) - frame.origin_x) / size)
        if not (r0 <= row <= r1 and c0 <= col <= c1) or not unknown[row, col]:
            return step
    return steps[-1]


def _scattered(seed, size=26):
    """Unknown space with specks, within a frame that has unknown cells all around what is known."""
    rng = np.random.default_rng(seed)
    cells = np.full((size, size), UNKNOWN, dtype=np.int8)
    inner = cells[3:-5, 4:-2]
    inner[rng.random(inner.shape) < 0.02] = FREE
    inner[rng.random(inner.shape) < 0.01] = OCCUPIED
    inner[0, 0] = inner[-1, -1] = FREE
    return OccupancyGrid(GridFrame(0.25, -1.0, 2.0, size, size), cells)


@given(seed=st.integers(0, 1000), angle=st.floats(-math.pi, math.pi))
@settings(max_examples=4)
def test_a_star_of_rays_ends_where_each_leaves_what_is_unknown(seed, angle):
    grid = _scattered(seed)
    start = _start(grid, 2.1, 5.0, angle)
    eye = _behind_wall(start, 0)
    # From the right of the door's way in to its left, half a step from either.
    angles = angle - math.pi / 2 + (np.arange(RAYS) + 0.5) / RAYS * math.pi
    ends = [eye + _trace(grid, eye, a) * np.array([math.cos(a), math.sin(a)]) for a in angles]
    star = shapely.Polygon([eye, *ends]).buffer(0)
    expected = max(shapely.get_parts(star), key=lambda part: part.area)
    assert _seen(start, 0).symmetric_difference(expected).area < 1e-9


def test_what_is_seen_of_a_large_room_is_all_of_it():
    # 30 x 20 m of cells of 0.25 m: rays of more steps than are taken at once.
    cells = np.full((84, 124), UNKNOWN, dtype=np.int8)
    cells[:2], cells[-2:], cells[:, :2], cells[:, -2:] = FREE, FREE, OCCUPIED, OCCUPIED
    seen = _seen(_start(OccupancyGrid(GridFrame(0.25, -0.5, -0.5, 84, 124), cells), 15.0, 0.0), 0)
    room = shapely.box(0.0, 0.0, 30.0, 20.0)
    assert seen.intersection(room).area / seen.union(room).area > 0.96


def test_nothing_is_seen_where_all_around_the_door_is_known_or_beyond_the_bounds():
    cells = np.full((40, 40), FREE, dtype=np.int8)
    grid = OccupancyGrid(GridFrame(0.25, 0.0, 0.0, 40, 40), cells)
    assert _seen(_start(grid, 5.0, 5.0), 0).is_empty
    assert _seen(_start(grid, 5.0, 9.9), 0).is_empty


@pytest.mark.parametrize(("rows", "away"), [(0, 0.1), (1, 0.1), (2, 0.2), (3, 0.3), (9, 0.9), (10, 0.1)])
def test_the_eye_is_right_behind_the_wall_less_than_a_metre_in(rows, away):
    # In steps of half a cell of 0.1 m, from a cell on; known up to so many rows behind y = 2.
    cells = np.full((60, 40), UNKNOWN, dtype=np.int8)
    cells[: 20 + rows] = OCCUPIED
    grid = OccupancyGrid(GridFrame(0.1, 0.0, 0.0, 60, 40), cells)
    assert _behind_wall(_start(grid, 2.02, 2.02), 0) == pytest.approx([2.02, 2.02 + away])


def test_outside_of_the_map_is_unknown_to_the_eye():
    grid = OccupancyGrid(GridFrame(0.1, 0.0, 0.0, 20, 20), np.full((20, 20), FREE, dtype=np.int8))
    assert _behind_wall(_start(grid, 1.0, 1.8), 0) == pytest.approx([1.0, 2.0], abs=0.051)
    # Where nothing is unknown: as near as may be.
    assert _behind_wall(_start(grid, 1.0, 0.5), 0) == pytest.approx([1.0, 0.6])


def _faces_of(xs, ys, unknown, behind, before, slanted=()):
    """Faces of a box of 20 m to every side; unknown ones by points in them; a door from one into another."""
    box = [Line(a, o, "border") for a in (0.0, math.pi / 2) for o in (-20.0, 20.0)]
    lines = [Line(math.pi / 2, -x) for x in xs] + [Line(0.0, y) for y in ys]
    arrangement = build_arrangement([*lines, *slanted], box)

    def at(point):
        return next(i for i, face in enumerate(arrangement.faces) if face.contains(shapely.Point(point)))

    mask = np.zeros(len(arrangement.faces), dtype=np.bool_)
    mask[[at(point) for point in unknown]] = True
    face, other = at(behind), at(before)
    edge = arrangement.neighbours[face][other]
    entrance = enter_face(arrangement, ClosedDoor("d", tuple(arrangement.edges[edge].mean(axis=0))), edge, face)
    return InitialFaces(None, None, arrangement, mask, (entrance,))


XS, YS = (-6.0, -2.0, 2.0, 6.0), (0.0, 4.0, 8.0, 12.0)


def test_unknown_faces_are_in_sight_through_unknown_ones_only():
    inner = [(x, y) for x in (-4.0, 0.0, 4.0) for y in (2.0, 6.0, 10.0)]
    whole = _faces_in_sight(_faces_of(XS, YS, inner, (0.0, 2.0), (0.0, -3.0)), 0)
    assert whole.symmetric_difference(shapely.box(-6.0, 0.0, 6.0, 12.0)).area < 1e-6
    # Without the middle: what lies behind it is hidden, what stands beside is not, seen through the sides.
    ring = [point for point in inner if point != (0.0, 6.0)]
    seen = _faces_in_sight(_faces_of(XS, YS, ring, (0.0, 2.0), (0.0, -3.0)), 0)
    # The centre of (4, 6) from the door (0, 0): the way leaves the first face at (2, 3).
    assert seen.contains(shapely.Point(4.0, 6.0))
    assert seen.contains(shapely.Point(-4.0, 6.0))
    assert not seen.contains(shapely.Point(0.0, 10.0))
    assert not seen.contains(shapely.Point(4.0, 10.0))


def test_faces_on_the_border_end_what_is_in_sight_but_the_first():
    unknown = [(0.0, y) for y in (2.0, 6.0, 10.0, 16.0)]
    seen = _faces_in_sight(_faces_of(XS, YS, unknown, (0.0, 2.0), (0.0, -3.0)), 0)
    assert seen.symmetric_difference(shapely.box(-2.0, 0.0, 2.0, 12.0)).area < 1e-6
    seen = _faces_in_sight(_faces_of(XS, YS, unknown, (0.0, 16.0), (4.0, 16.0)), 0)
    # Through the first, which is one of them, into the others.
    assert seen.symmetric_difference(shapely.box(-2.0, 0.0, 2.0, 20.0)).area < 1e-6


@given(seed=st.integers(0, 10_000))
@settings(max_examples=25)
def test_what_is_in_sight_is_found_face_by_face(seed):
    rng = np.random.default_rng(seed)
    box = [Line(a, o, "border") for a in (0.0, math.pi / 2) for o in (-20.0, 20.0)]
    slanted = [Line(float(a), float(o)) for a, o in zip(rng.uniform(0, math.pi, 4), rng.uniform(-9, 9, 4), strict=True)]
    lines = [Line(math.pi / 2, -x) for x in (-9.0, -3.0, 4.0)] + [Line(0.0, y) for y in (-7.0, 1.0, 8.0)]
    arrangement = build_arrangement([*lines, *slanted], box)
    unknown = rng.random(len(arrangement.faces)) < 0.8
    face = int(rng.choice(np.flatnonzero(unknown)))
    other, edge = next(iter(arrangement.neighbours[face].items()))
    entrance = enter_face(arrangement, ClosedDoor("d", tuple(arrangement.edges[edge].mean(axis=0))), edge, face)
    inner = {face, *np.flatnonzero(unknown & ~arrangement.border).tolist()}
    whole = shapely.union_all([arrangement.faces[f].buffer(1e-9) for f in inner])
    eye = entrance.facing.middle + 1e-3 * entrance.facing.inward

    def sees(f):
        path = shapely.LineString([eye, arrangement.faces[f].centroid])
        return path.intersection(whole).length >= path.length - 0.1

    seen, queue = {face}, [face]
    while queue:
        more = {f for f in arrangement.neighbours[queue.pop()] if f in inner and f not in seen and sees(f)}
        seen |= more
        queue += more
    found = _faces_in_sight(InitialFaces(None, None, arrangement, unknown, (entrance,)), 0)
    assert found.area == pytest.approx(sum(arrangement.areas[f] for f in seen))
    assert other not in seen or found.covers(arrangement.faces[other].buffer(-1e-6))


def test_a_way_may_cross_a_tenth_of_a_metre_of_what_is_known():
    for gap, sees in ((0.0, True), (0.09, True), (0.11, False)):
        tree = shapely.STRtree([shapely.box(0, 0, 2, 2), shapely.box(0, 2 + gap, 2, 4 + gap)])
        assert _in_sight(tree, np.array([1.0, 0.0]), shapely.box(0, 2 + gap, 2, 4 + gap)) == sees


@pytest.mark.parametrize("method", [line_of_sight, geometric])
def test_a_gap_between_rooms_is_found_and_drawn(mapped, iou, method):
    scene = mapped(closed=("t2", "b1"))
    doors = [*scene.doors, ClosedDoor("far", (90.0, 90.0))]
    prediction = method(scene.grid, doors, FacesConfig())
    assert [room.doors for room in prediction.rooms] == [("b1",), ("t2",)]  # in the order of the doors
    assert prediction.failures == {"far": "no wall line within 1 m of the door"}
    for room in prediction.rooms:
        assert iou(room.polygon, scene.hidden[room.doors[0]]) > 0.85
        middle = prediction.grid.frame.to_cells(np.array(room.polygon.centroid.coords[0]))
        assert prediction.grid.free[tuple(middle)]
    for door in scene.doors:
        assert prediction.grid.free[tuple(prediction.grid.frame.to_cells(np.array(door.midpoint)))]
    # The same from given faces, and reasons of others are not changed.
    started = find_initial_faces(scene.grid, doors, FacesConfig())
    again = method(scene.grid, doors, FacesConfig(), started=started)
    assert [room.polygon for room in again.rooms] == [room.polygon for room in prediction.rooms]
    assert method(scene.grid, doors, FacesConfig(), started=(None, {"t2": "why"})).failures == {"t2": "why"}


def test_a_door_out_of_the_building_sees_nothing_within_the_bounds(mapped):
    scene = mapped(closed=("t0", "t1", "t2", "t3", "t4"))
    prediction = line_of_sight(scene.grid, scene.doors, FacesConfig())
    assert prediction.rooms == ()
    reason = "nothing unknown is in sight of the door within the bounds of the map"
    assert prediction.failures == dict.fromkeys(("t0", "t1", "t2", "t3", "t4"), reason)
