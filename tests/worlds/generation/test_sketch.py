"""Rooms as they are drawn along a corridor, before walls exist."""

import numpy as np
import pytest
import shapely
from shapely.geometry import Polygon, box

from closedrooms.worlds.generation.corridors import Run, Skeleton
from closedrooms.worlds.generation.room_programme import BAYS, Bay
from closedrooms.worlds.generation.sketch import (
    Sketch,
    SketchPassage,
    _add,
    _connect,
    _depth,
    _door_place,
    _draw_bay,
    _draw_end,
    sketch_rooms,
)

RUN = Run((0.0, 0.0), 0.0, 1, 30.0, 6.0, deepest=8.0)


def empty() -> Sketch:
    return Sketch(["corridor"], [box(0.0, -2.0, 30.0, 0.0)], [])


@pytest.mark.parametrize(
    ("drawn", "kept"),
    [
        (box(0.0, 0.0, 4.0, 5.0), True),
        # Of a room that loses floor to others at least 45 % has to be left.
        (box(0.0, -1.9, 4.0, 1.6), True),
        (box(0.0, -1.9, 4.0, 1.5), False),
        # 1.6 m wide at least.
        (box(0.0, 0.0, 1.62, 5.0), True),
        (box(0.0, 0.0, 1.58, 5.0), False),
    ],
)
def test_a_room_is_drawn_where_enough_of_it_is_left(drawn: Polygon, kept: bool) -> None:
    sketch = empty()
    assert _add(sketch, "office", drawn) == (1 if kept else None)
    assert sketch.labels == ["corridor", "office"][: 1 + kept]
    if kept:
        assert sketch.polygons[1].equals(drawn.difference(sketch.polygons[0]))


def test_of_a_room_that_others_cut_the_largest_part_is_kept() -> None:
    sketch = empty()
    sketch.polygons.append(box(3.0, 0.0, 4.0, 9.0))
    sketch.labels.append("store")
    assert _add(sketch, "office", box(0.0, 0.0, 10.0, 5.0)) == 2
    assert sketch.polygons[2].equals(box(4.0, 0.0, 10.0, 5.0))


def test_doors_name_their_rooms_in_order_where_there_are_two() -> None:
    sketch = empty()
    _connect(sketch, 3, 1, 0.9, 0.2)
    _connect(sketch, None, 1, 0.9, 0.2)
    _connect(sketch, 3, None, 0.9, 0.2)
    assert sketch.passages == [SketchPassage((1, 3), 0.9, 0.2, True)]


@pytest.mark.parametrize("kind", BAYS)
def test_doors_stand_near_a_corner_or_in_the_middle_of_wide_rooms(kind: str) -> None:
    for bay in BAYS[kind]:
        rng = np.random.default_rng(0)
        places = [_door_place(rng, bay) for _ in range(400)]
        wide = bay.widths[1] > 6.5
        assert set(places) == ({0.05, 0.5, 0.95} if wide else {0.05, 0.95})
        assert places.count(0.95) == pytest.approx(160, abs=35)
        assert places.count(0.5) == pytest.approx(100 if wide else 0, abs=30 if wide else 0)


def test_a_bay_has_the_depth_of_its_run_or_its_own_where_it_is_wide() -> None:
    def depths(bay: Bay, width: float, *, section: float = 1.0, previous: float = 0.0, run: Run = RUN) -> set[float]:
        return {_depth(np.random.default_rng(seed), run, bay, width, section, previous) for seed in range(20)}

    plain, deep, shallow = Bay("a", (3, 9), 1.0), Bay("b", (3, 9), 1.0, deep=1.2), Bay("c", (3, 9), 1.0, shallow=0.75)
    assert depths(plain, 6.0) == {6.0}
    assert depths(deep, 5.4) == {6.0, 7.2}
    assert depths(deep, 5.3) == {6.0}
    assert depths(shallow, 6.0) == {6.0, 4.5}
    assert depths(plain, 6.0, section=1.18) == {7.1}
    # No deeper than the run allows; small steps are left out.
    assert depths(deep, 6.0, section=1.18) == {7.1, 8.0}
    assert depths(plain, 6.0, previous=6.5) == {6.5}
    assert depths(plain, 6.0, previous=6.7) == {6.0}
    fixed = Run((0.0, 0.0), 0.0, 1, 30.0, 6.0, deepest=6.0)
    assert depths(deep, 6.0, section=0.85, run=fixed) == {6.0}
    assert depths(deep, 6.0, section=0.85, run=Run((0.0, 0.0), 0.0, 1, 30.0, 6.0)) == {6.0}


def drawn(layout: str, depth: float = 6.0, seed: int = 0, width: float = 8.0) -> tuple[Sketch, list[int]]:
    sketch = empty()
    bay = Bay("lab", (4.0, 6.0), 1.0, layout)
    return sketch, _draw_bay(np.random.default_rng(seed), RUN, bay, 2.0, 2.0 + width, depth, sketch)


def test_a_bay_is_one_room_with_one_door() -> None:
    sketch, rooms = drawn("room")
    assert rooms == [1]
    assert sketch.polygons[1].equals(box(2.0, 0.0, 10.0, 6.0))
    (door,) = sketch.passages
    assert (door.rooms, door.is_door, door.where in {0.05, 0.95}) == ((0, 1), True, True)
    assert 0.8 <= door.width <= 1.0


def test_two_doors_stand_at_both_ends_and_an_opening_in_the_middle() -> None:
    sketch, _ = drawn("two doors")
    assert [(p.rooms, p.where, p.is_door) for p in sketch.passages] == [((0, 1), 0.04, True), ((0, 1), 0.96, True)]
    for seed in range(20):
        (opening,) = drawn("open", seed=seed)[0].passages
        assert (opening.rooms, opening.where, opening.is_door) == ((0, 1), 0.5, False)
        assert 1.4 <= opening.width <= 5.0
        assert opening.width == round(opening.width, 1)
        assert 1.4 <= drawn("open", seed=seed, width=2.0)[0].passages[0].width <= 1.6
        assert 1.4 <= drawn("open", seed=seed, width=4.0)[0].passages[0].width <= 3.0


def test_a_pair_is_two_halves_with_their_doors_side_by_side() -> None:
    sketch, rooms = drawn("pair")
    assert rooms == [1, 2]
    assert sketch.polygons[1].equals(box(2.0, 0.0, 6.0, 6.0))
    assert sketch.polygons[2].equals(box(6.0, 0.0, 10.0, 6.0))
    assert [(p.rooms, p.where) for p in sketch.passages] == [((0, 1), 0.85), ((0, 2), 0.15)]


@pytest.mark.parametrize(("depth", "split"), [(5.1, False), (5.2, True), (7.0, True)])
def test_a_deep_suite_has_a_back_room_behind_its_front(depth: float, split: bool) -> None:
    sketch, rooms = drawn("suite", depth)
    assert rooms == [1]
    assert sketch.labels == (["corridor", "lab", "office"] if split else ["corridor", "lab"])
    if split:
        assert 0.42 * depth - 0.05 <= sketch.polygons[1].bounds[3] <= 0.5 * depth + 0.05
        assert sketch.polygons[2].bounds == (2.0, sketch.polygons[1].bounds[3], 10.0, depth)
        first, second = sketch.passages
        assert (first.rooms, second.rooms) == ((0, 1), (1, 2))
        assert first.where + second.where == pytest.approx(1.0)


def test_a_store_is_cut_out_at_the_back_of_its_room() -> None:
    corners = set()
    for seed in range(8):
        sketch, rooms = drawn("store", seed=seed)
        assert rooms == [1]
        assert sketch.labels == ["corridor", "lab", "store"]
        x0, y0, x1, y1 = sketch.polygons[2].bounds
        assert (x1 - x0, y0, y1) == pytest.approx((2.4, 4.2, 6.0))
        corners.add(round(x0, 6))
        assert shapely.union_all(sketch.polygons[1:]).symmetric_difference(box(2.0, 0.0, 10.0, 6.0)).area < 1e-9
        door, inner = sketch.passages
        assert (door.rooms, inner) == ((0, 1), SketchPassage((1, 2), 0.8, 0.5, True))
    assert corners == {2.0, 7.6}


@pytest.mark.parametrize("kind", BAYS)
def test_an_end_room_lies_across_the_dead_end(kind: str) -> None:
    offsets = set()
    for seed in range(30):
        sketch = empty()
        _draw_end(np.random.default_rng(seed), kind, (30.0, -1.0), 0.0, 2.0, sketch)
        x0, y0, x1, y1 = sketch.polygons[1].bounds
        assert x0 == 30.0
        assert 4.0 <= round(x1 - x0, 6) <= 18.0
        assert 2.6 <= round(y1 - y0, 6) <= 15.0
        # Flush with one face of the corridor or centred on it.
        assert y0 <= -2.0 + 1e-9
        assert y1 >= -1e-9
        kind_of = "low" if abs(y0 + 2.0) < 1e-6 else "high" if abs(y1) < 1e-6 else "middle"
        assert kind_of != "middle" or (y0 + y1) / 2 == pytest.approx(-1.0)
        offsets.add(kind_of)
        (door,) = sketch.passages
        assert (door.rooms, door.is_door, door.where in {0.1, 0.5, 0.9}) == ((0, 1), True, True)
    assert offsets == {"low", "middle", "high"}


def test_an_end_room_is_no_narrower_than_its_corridor() -> None:
    for seed in range(10):
        sketch = empty()
        _draw_end(np.random.default_rng(seed), "office", (30.0, -1.0), 0.0, 20.0, sketch)
        assert sketch.polygons[1].bounds[3] - sketch.polygons[1].bounds[1] == pytest.approx(20.0)


@pytest.mark.parametrize("kind", BAYS)
def test_rooms_lie_side_by_side_and_some_are_joined(kind: str) -> None:
    joined = 0
    for seed in range(12):
        runs = (RUN, Run((0.0, -2.0), 0.0, -1, 30.0, 5.0, deepest=5.0))
        skeleton = Skeleton(box(0.0, -2.0, 30.0, 0.0), runs, (((30.0, -1.0), 0.0),), 2.0)
        sketch = sketch_rooms(np.random.default_rng(seed), kind, skeleton)
        assert sum(p.area for p in sketch.polygons) == pytest.approx(shapely.union_all(sketch.polygons).area)
        assert len(sketch.labels) == len(sketch.polygons)
        # Along both sides of the corridor its whole length is taken.
        rooms = shapely.union_all(sketch.polygons[1:])
        assert rooms.intersection(box(0.0, 0.1, 30.0, 0.2)).area == pytest.approx(3.0, rel=0.1)
        assert rooms.intersection(box(0.0, -2.2, 30.0, -2.1)).area == pytest.approx(3.0, rel=0.1)
        assert rooms.bounds[1] >= -7.0 - 10.0
        for passage in sketch.passages:
            a, b = passage.rooms
            assert a < b
            assert sketch.polygons[a].distance(sketch.polygons[b]) < 1e-9
            if a > 0 and "store" not in (sketch.labels[a], sketch.labels[b]):
                joined += 1
                assert passage.is_door
                assert 0.0 <= passage.where <= 1.0
    assert joined >= 1
