from dataclasses import replace

import numpy as np
import pytest
from shapely.geometry import box

from closedrooms.core.door import ClosedDoor
from closedrooms.core.grid import GridFrame, OccupancyGrid
from closedrooms.core.room import Alternative, Room
from closedrooms.coverage import cost_spread
from closedrooms.coverage.cost_spread import HELD, measure_excursion, spread_cost, summarise
from closedrooms.coverage.graph.graph_builder import build_graph
from closedrooms.coverage.tour.tour_planner import plan_coverage, solve_tour

FRAME = GridFrame(0.05, 0.0, 0.0, 200, 400)
# In the upper wall of a corridor of 2 m that ends at y = 3.
DOORS = [ClosedDoor(f"d{n}", (x, 3.1), ((x - 0.45, 3.1), (x + 0.45, 3.1)), 0.9) for n, x in enumerate((3.0, 9.0))]


def _map(draw, *rooms):
    """The corridor with rooms ``(x0, x1, depth)`` behind open doors."""
    boxes = [(1.0, 1.0, 19.0, 3.0)]
    for door, (x0, x1, depth) in zip(DOORS, rooms, strict=False):
        x = door.midpoint[0]
        boxes += [(x0, 3.2, x1, 3.2 + depth), (x - 0.45, 2.9, x + 0.45, 3.3)]
    return draw(20.0, 12.0, boxes)


def _room(number, x0, x1, depth, *others):
    alternatives = tuple(Alternative(box(a, 3.2, b, 3.2 + d), chance) for a, b, d, chance in others)
    return Room(box(x0, 3.2, x1, 3.2 + depth), (f"d{number}",), alternatives=alternatives)


@pytest.mark.parametrize("other", [(1.0, 5.0, 8.0), (1.0, 8.0, 4.0), (2.0, 4.2, 2.5), (0.3, 6.0, 6.0)])
def test_what_another_shape_adds_is_what_the_tour_over_the_whole_map_says(draw, plain, other):
    usual, door = (1.0, 5.0, 4.0), DOORS[0]
    added = [measure_excursion(box(x0, 3.2, x1, 3.2 + d), door, FRAME, plain) for x0, x1, d in (usual, other)]
    tours = [plan_coverage(_map(draw, shape), config=plain, start=(10.0, 2.0)).length for shape in (usual, other)]
    assert added[1] - added[0] == pytest.approx(tours[1] - tours[0], abs=0.8)


def test_a_closet_that_no_robot_enters_adds_nothing(plain):
    assert measure_excursion(box(2.9, 3.2, 3.1, 3.4), DOORS[0], GridFrame(0.05, 0, 0, 9, 9), plain) < 1.5
    pointless = ClosedDoor("d9", (50.0, 50.0))
    assert measure_excursion(box(0.0, 0.0, 0.1, 0.1), pointless, FRAME, plain) < 200.0


def test_a_door_without_a_leaf_will_do(plain):
    point = ClosedDoor("d0", DOORS[0].midpoint)
    room = box(1.0, 3.2, 5.0, 7.2)
    with_leaf = measure_excursion(room, DOORS[0], FRAME, plain)
    assert measure_excursion(room, point, FRAME, plain) == pytest.approx(with_leaf, abs=0.5)


def _spread(rooms, plain, *, count=40, seed=0, probability=None, noise=0.0):
    return spread_cost(100.0, FRAME, DOORS, rooms, probability, plain, count=count, seed=seed, noise=noise)


def test_rooms_that_are_sure_cost_what_the_tour_costs(plain):
    spread = _spread([_room(0, 1, 5, 4), _room(1, 7, 11, 4)], plain)
    assert np.allclose(spread.lengths, 100.0)
    assert (spread.mean, spread.low, spread.high) == pytest.approx((100.0, 100.0, 100.0))


def test_a_deeper_alternative_makes_the_cost_higher_as_often_as_it_is_probable(plain):
    spread = _spread([_room(0, 1, 5, 4, (1, 5, 9, 0.25))], plain, count=2000)
    deeper = measure_excursion(box(1, 3.2, 5, 12.2), DOORS[0], FRAME, plain)
    more = deeper - measure_excursion(box(1, 3.2, 5, 7.2), DOORS[0], FRAME, plain)
    assert more > 3.0
    assert np.isclose(spread.lengths, 100.0 + more).mean() == pytest.approx(0.25, abs=0.04)
    assert spread.mean == pytest.approx(100.0 + 0.25 * more, abs=0.05 * more)
    assert spread.low == pytest.approx(100.0)
    assert spread.high == pytest.approx(100.0 + more)


def test_a_room_that_may_not_be_there_may_cost_nothing(plain):
    probability = OccupancyGrid(FRAME, np.full(FRAME.shape, 60, dtype=np.int8))
    room = _room(0, 1, 5, 4)
    spread = _spread([room], plain, count=1000, probability=probability)
    own = measure_excursion(room.polygon, DOORS[0], FRAME, plain)
    assert np.isclose(spread.lengths, 100.0 - own).mean() == pytest.approx(0.4, abs=0.05)


def test_what_the_rooms_do_not_tell_widens_the_interval_and_leaves_the_mean(plain):
    rooms = [_room(0, 1, 5, 4), _room(1, 7, 11, 4)]
    narrow, wide = (_spread(rooms, plain, count=200, noise=noise) for noise in (0.01, 0.02))
    # A normal distribution holds nine tenths within 1.645 standard deviations.
    assert (narrow.low, narrow.high) == pytest.approx((100.0 - 1.645, 100.0 + 1.645), abs=0.05)
    assert (wide.low, wide.high) == pytest.approx((100.0 - 3.29, 100.0 + 3.29), abs=0.1)
    assert narrow.mean == pytest.approx(wide.mean) == pytest.approx(100.0)


def test_the_same_seed_draws_the_same_and_without_rooms_there_is_still_a_cost(plain):
    rooms = [_room(0, 1, 5, 4, (1, 5, 9, 0.4)), _room(1, 7, 11, 4, (7, 12, 6, 0.4))]
    one, other, third = (_spread(rooms, plain, seed=seed).lengths.tobytes() for seed in (1, 1, 2))
    assert one == other != third
    assert _spread([], plain, count=1).lengths.tolist() == [100.0]
    assert _spread([Room(box(0, 0, 1, 1), ("elsewhere",))], plain, count=1).mean == 100.0


def test_the_next_draw_lies_in_the_interval_as_often_as_it_says_however_few_there_are():
    rng = np.random.default_rng(5)
    for count in (20, 60):
        held = []
        for _ in range(3000):
            spread = summarise(rng.normal(200.0, 9.0, count))
            held.append(spread.figures(rng.normal(200.0, 9.0))["true_within"])
        assert np.mean(held) == pytest.approx(HELD, abs=0.02)


def test_a_few_draws_hold_less_and_say_so():
    rng = np.random.default_rng(6)
    lengths = rng.normal(0.0, 1.0, (4000, 5))
    spreads = [summarise(row[:4]) for row in lengths]
    held = np.mean([spread.low <= row[4] <= spread.high for spread, row in zip(spreads, lengths, strict=True)])
    assert spreads[0].held == pytest.approx(0.6)
    assert held == pytest.approx(0.6, abs=0.03)
    assert summarise(np.arange(19.0)).held == HELD


def test_doors_without_a_room_are_named(plain):
    spread = _spread([_room(0, 1, 5, 4)], plain)
    assert spread.without_room == ("d1",)
    assert spread.figures()["doors_without_room"] == ["d1"]
    assert "doors_without_room" not in _spread([_room(0, 1, 5, 4), _room(1, 7, 11, 4)], plain).figures()


def test_figures_tell_every_draw_and_the_truth_only_where_it_is_known():
    spread = summarise(np.array([3.0, 1.0, 2.0]))
    assert spread.figures() == {
        "count": 3, "mean_m": 2.0, "interval": 0.5, "low_m": 1.0, "high_m": 3.0, "lengths_m": [3.0, 1.0, 2.0],
    }  # fmt: skip
    assert spread.figures(3.5)["true_within"] is False


def test_a_door_without_a_vertex_of_its_own_is_walked_to_and_back(plain, monkeypatch):
    graphs = []

    def without_door(grid, doors, *words, **named):
        built = build_graph(grid, [replace(door, id="another") for door in doors], *words, **named)
        # The walk begins at the vertex that is farthest from the door.
        apart = np.linalg.norm(built.graph.vertices - np.array(doors[0].midpoint), axis=1)
        graphs.append(replace(built, start=int(apart.argmax())))
        return graphs[-1]

    room, door = box(1.0, 3.2, 5.0, 7.2), DOORS[0]
    usual = measure_excursion(room, door, FRAME, plain)
    monkeypatch.setattr(cost_spread, "build_graph", without_door)
    length = measure_excursion(room, door, FRAME, plain)
    (built,) = graphs
    away = np.hypot(*(built.graph.vertices[built.start] - np.array(door.midpoint)))
    assert away > 1.0
    tour = solve_tour(built.graph, plain.tour, start=built.start).length
    assert length == pytest.approx(tour + 2.0 * away)
    assert tour <= usual + 1e-9


def test_unless_told_otherwise_sixteen_thousandths_of_the_tour_are_in_doubt(plain):
    # What was measured: a standard deviation of 1.6 % of its length.
    spread = spread_cost(1000.0, FRAME, DOORS, [], None, plain, count=400, seed=3)
    assert (spread.high - spread.low) / 2.0 == pytest.approx(1.645 * 16.0, rel=0.05)
    assert spread.mean == pytest.approx(1000.0)


def test_figures_are_told_to_a_tenth_of_a_millimetre():
    spread = replace(summarise(np.array([1.23456, 1.23456])), held=0.123456)
    assert spread.figures() == {
        "count": 2, "mean_m": 1.2346, "interval": 0.1235, "low_m": 1.2346, "high_m": 1.2346,
        "lengths_m": [1.2346, 1.2346],
    }  # fmt: skip


@pytest.mark.parametrize("leaf", [True, False])
def test_a_room_is_drawn_by_itself_with_its_door_open(leaf):
    # In cells of 0.5 m: the room from (2, 2) to (5, 4) m, its outline through the middles of cells; a door below.
    frame = GridFrame(0.5, 0.0, 0.0, 20, 20)
    door = ClosedDoor("d", (3.5, 2.25), ((3.0, 2.25), (4.0, 2.25)) if leaf else None)
    grid = cost_spread._rasterise_room(box(2.25, 2.25, 5.25, 4.25), door, frame)
    # Half a metre and what a cell holds around room and opening.
    assert grid.frame == frame.cropped(2, 3, 8, 9)
    expected = np.full((8, 9), -1)
    expected[2:7, 1:8] = 100
    expected[3:6, 2:7] = 0
    # Centres of cells within 0.3 m of the leaf, or within 0.4 m of the middle of a door without one.
    centres = grid.frame.to_points(np.stack(np.indices((8, 9)), axis=-1)) - (3.5, 2.25)
    if leaf:
        expected[(np.abs(centres[..., 0]) < 0.5) & (np.abs(centres[..., 1]) < 0.3)] = 0
    else:
        expected[np.hypot(centres[..., 0], centres[..., 1]) < 0.4] = 0
    assert np.array_equal(grid.cells, expected)
