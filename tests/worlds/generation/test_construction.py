"""From a sketch to walls and doors: where passages stand, and what is left out where none fits."""

import itertools
import math

import numpy as np
import pytest
import shapely
from shapely.geometry import Polygon, box

from closedrooms.worlds.generation.construction import (
    _place,
    _place_all,
    _unreached,
    _without,
    build_plan,
    turned_sketch,
)
from closedrooms.worlds.generation.sketch import Sketch, SketchPassage
from closedrooms.worlds.wall_assembly import free_spans, shared_edges

CORRIDOR = Polygon([(0, 0), (12, 0), (12, 2), (8, 2), (4, 2), (0, 2)])
ROOMS = [CORRIDOR, box(0, 2, 4, 6), box(4, 2, 8, 6), box(8, 2, 12, 6)]


def door(a: int, b: int, where: float = 0.5, width: float = 0.9) -> SketchPassage:
    return SketchPassage((a, b), width, where, True)


def opening(a: int, b: int, width: float) -> SketchPassage:
    return SketchPassage((a, b), width, 0.5, False)


def sketch(*passages: SketchPassage) -> Sketch:
    return Sketch(["corridor", "office", "store", "lab"], [*ROOMS], [*passages])


def ends(segment: tuple[tuple[float, float], tuple[float, float]] | None) -> tuple[float, float]:
    """From where to where a passage in the corridor's wall stands."""
    assert segment is not None
    (x0, y0), (x1, y1) = segment
    assert y0 == y1 == 2.0
    return (min(x0, x1), max(x0, x1))


@pytest.mark.parametrize(
    ("where", "stretch"), [(0.0, (4.3, 5.2)), (0.5, (5.55, 6.45)), (1.0, (6.8, 7.7)), (0.1, (4.55, 5.45))]
)
def test_a_door_stands_where_its_sketch_says_clear_of_the_corners(where: float, stretch: tuple[float, float]) -> None:
    edges = shared_edges(ROOMS)
    found = ends(_place(door(0, 2, where), edges, []))
    # Which end of a wall comes first is not the sketch's to say.
    assert found == pytest.approx(stretch) or found == pytest.approx((12.0 - stretch[1], 12.0 - stretch[0]))


def test_doors_stand_side_by_side_and_what_fits_nowhere_is_left_out() -> None:
    edges = shared_edges(ROOMS)
    passages = [*(door(0, 1, where) for where in (0.5, 0.5, 0.0, 0.5)), door(1, 3)]
    placed = _place_all(passages, edges)
    assert [passage for passage, _ in placed] == passages[:3]
    stretches = sorted(ends(segment) for _, segment in placed)
    assert [high - low for low, high in stretches] == pytest.approx([0.9] * 3)
    assert all(low - high >= 0.3 - 1e-9 for (_, high), (low, _) in itertools.pairwise(stretches))
    assert stretches[1] == pytest.approx((1.55, 2.45))
    # Wider ones leave no place beside the first.
    assert len(_place_all([door(0, 1, 0.5, 1.0)] * 2, edges)) == 1


@pytest.mark.parametrize(("asked", "made"), [(1.5, 1.5), (3.4, 3.4), (5.0, 3.4), (0.8, 0.8), (0.7, None)])
def test_an_opening_is_made_narrower_where_its_wall_is_short(asked: float, made: float | None) -> None:
    segment = _place(opening(0, 1, asked), shared_edges(ROOMS), [])
    assert (None if segment is None else math.dist(*segment)) == (None if made is None else pytest.approx(made))


@pytest.mark.parametrize(("width", "fits"), [(3.39, True), (3.41, False), (0.8, True), (0.79, False)])
def test_a_door_is_never_made_narrower(width: float, fits: bool) -> None:
    assert (_place(door(0, 1, 0.5, width), shared_edges(ROOMS), []) is not None) == fits


def test_the_longest_free_stretch_is_taken() -> None:
    edges = shared_edges(ROOMS)
    taken = ((1.0, 2.0), (1.9, 2.0))
    low, high = ends(_place(door(0, 1, 0.5), edges, [taken]))
    assert (low, high) == pytest.approx(((2.2 + 3.7 - 0.9) / 2, (2.2 + 3.7 + 0.9) / 2))


def test_of_stretches_of_one_length_the_first_is_taken() -> None:
    edges = shared_edges(ROOMS)
    (edge,) = [edge for edge in edges if edge.rooms == (0, 1)]
    taken = ((1.8, 2.0), (2.2, 2.0))
    first, second = free_spans(edge, edges, [taken], 0.3)
    assert first[1] - first[0] == pytest.approx(second[1] - second[0])
    placed = _place(door(0, 1, 0.5), edges, [taken])
    assert ends(placed) == pytest.approx(ends(edge.part(sum(first) / 2, 0.9)))


def test_rooms_that_nothing_joins_to_the_corridor_are_left_out() -> None:
    assert _unreached(sketch(), []) == {1, 2, 3}
    assert _unreached(sketch(), [door(2, 3), door(0, 1), door(1, 2)]) == set()
    assert _unreached(sketch(), [door(2, 3), door(0, 1)]) == {2, 3}
    left = _without(sketch(door(0, 1), door(1, 2), door(2, 3), opening(0, 3, 1.5)), {1})
    assert left.labels == ["corridor", "store", "lab"]
    assert left.polygons == [ROOMS[0], ROOMS[2], ROOMS[3]]
    assert left.passages == [door(1, 2), opening(0, 2, 1.5)]


def test_a_plan_has_the_doors_of_its_sketch() -> None:
    drawn = sketch(door(0, 1, 0.2), door(0, 2, 0.5), door(0, 3, 0.8), opening(1, 2, 1.2))
    plan = build_plan(np.random.default_rng(0), drawn)
    assert [room.label for room in plan.rooms] == ["corridor", "office", "store", "lab"]
    assert [(d.id, d.rooms, d.hinge, d.opens_into) for d in plan.doors] == [
        ("d00", ("r00", "r01"), 0, "r01"),
        ("d01", ("r00", "r02"), 1, "r02"),
        ("d02", ("r00", "r03"), 1, "r03"),
    ]
    assert [(o.id, o.rooms, math.dist(*o.segment)) for o in plan.openings] == [
        ("o00", ("r01", "r02"), pytest.approx(1.2))
    ]
    for wall in plan.walls:
        low, high = sorted(point[1] for point in wall.segment)
        if (low, high) == (2.0, 2.0):
            assert wall.thickness in {0.15, 0.2, 0.24}
        elif (low, high) == (2.0, 6.0) and wall.segment[0][0] in {4.0, 8.0}:
            assert wall.thickness in {0.1, 0.12, 0.15}
        else:
            assert wall.thickness in {0.25, 0.3}


def test_a_room_whose_door_fits_nowhere_is_no_room_of_the_plan() -> None:
    plan = build_plan(np.random.default_rng(0), sketch(door(0, 1), door(0, 2, width=3.6), door(2, 3)))
    assert [room.label for room in plan.rooms] == ["corridor", "office"]
    assert [d.rooms for d in plan.doors] == [("r00", "r01")]


@pytest.mark.parametrize("degrees", [0.0, 30.0, 90.0, 200.0])
def test_a_sketch_is_turned_into_the_corner_of_the_axes(degrees: float) -> None:
    made = turned_sketch(sketch(door(0, 1)), math.radians(degrees))
    assert (made.labels, made.passages) == (sketch().labels, [door(0, 1)])
    low = shapely.get_coordinates(made.polygons).min(axis=0)
    assert low.tolist() == [0.0, 0.0]
    assert [polygon.area for polygon in made.polygons] == pytest.approx([24.0, 16.0, 16.0, 16.0], rel=1e-3)
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    middles = np.array([polygon.centroid.coords[0] for polygon in made.polygons])
    given = np.array([polygon.centroid.coords[0] for polygon in ROOMS])
    expected = np.diff(given, axis=0) @ np.array([[c, s], [-s, c]])
    assert np.diff(middles, axis=0) == pytest.approx(expected, abs=1e-3)


def test_a_slit_between_rooms_is_given_to_one_of_them_and_never_to_the_corridor() -> None:
    rooms = [CORRIDOR, box(0, 2, 4, 6), box(5, 2, 12, 6)]
    made = turned_sketch(Sketch(["corridor", "office", "lab"], rooms, []), 0.0)
    areas = [polygon.area for polygon in made.polygons]
    assert areas[0] == pytest.approx(24.0)
    assert sum(areas) == pytest.approx(24.0 + 48.0)
