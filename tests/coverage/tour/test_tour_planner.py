import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from closedrooms.core.door import ClosedDoor
from closedrooms.core.errors import InvalidInputError
from closedrooms.core.files.geojson import read_doors, read_features, write_features
from closedrooms.core.files.rosmap import read_map
from closedrooms.core.grid import OCCUPIED, UNKNOWN, GridFrame, OccupancyGrid
from closedrooms.coverage.config import CoverageConfig, TourConfig
from closedrooms.coverage.estimates import compare_tours
from closedrooms.coverage.room_count import count_rooms
from closedrooms.coverage.tour.tour_features import make_tour_features
from closedrooms.coverage.tour.tour_planner import plan_coverage

AUTHORS = Path(__file__).parents[4] / "shared" / "data" / "authors"


def test_a_longer_corridor_costs_a_longer_tour(corridor_with_rooms, plain):
    two, three = (plan_coverage(corridor_with_rooms(n), config=plain) for n in (2, 3))
    assert three.length > two.length + 5.0
    assert two.status == three.status == "complete"
    assert two.search == "optimal"


def test_the_tour_begins_where_the_robot_is(corridor_with_rooms, plain):
    tour = plan_coverage(corridor_with_rooms(3), config=plain, start=(12.0, 2.0))
    assert np.hypot(*(tour.path[0] - [12.0, 2.0])) < 2.5
    assert tour.path[0, 1] < 3.0


def test_closed_doors_are_visited_and_those_out_of_reach_are_named(corridor_with_rooms, plain):
    doors = [ClosedDoor("in", (5.0, 0.95)), ClosedDoor("out", (50.0, 50.0))]
    tour = plan_coverage(corridor_with_rooms(2), doors, plain)
    without = plan_coverage(corridor_with_rooms(2), (), plain)
    assert tour.status == "partial"
    assert tour.unreached_doors == ("out",)
    assert tour.length == pytest.approx(without.length + 2.0 * 1.05, abs=0.3)
    assert tour.graph.door_vertices["in"] in tour.order.tolist()


def test_the_same_map_gives_the_same_tour(ring, plain):
    one, other = plan_coverage(ring, config=plain), plan_coverage(ring, config=plain)
    assert one.path.tobytes() == other.path.tobytes()
    assert one.graph.vertices.tobytes() == other.graph.vertices.tobytes()


def test_the_map_goes_through_the_clutter_filter_unless_told_otherwise(draw, plain, monkeypatch):
    boxes = [(1.0, 1.0, 12.0, 9.0), (12.2, 1.0, 18.0, 9.0), (11.9, 4.0, 12.4, 5.0)]
    tables = [(3.0, 3.0, 4.0, 4.0), (6.0, 6.0, 7.0, 7.0)]
    furnished, empty = draw(19.0, 10.0, boxes, occupied=tables), draw(19.0, 10.0, boxes)
    monkeypatch.setattr("closedrooms.predictor.structure.clutter.filter_clutter", lambda _: empty)
    filtered, unfiltered = plan_coverage(furnished), plan_coverage(furnished, config=plain)
    assert _count_loops(unfiltered) > _count_loops(filtered) == _count_loops(plan_coverage(empty, config=plain))


def _count_loops(tour):
    return tour.graph.number_of_edges() - tour.graph.number_of_nodes() + int(tour.graph.parts.max()) + 1


def test_what_no_scan_saw_inside_of_filtered_furniture_goes_with_it(draw, plain, monkeypatch):
    boxes = [(1.0, 1.0, 12.0, 9.0), (12.2, 1.0, 18.0, 9.0), (11.9, 4.0, 12.4, 5.0)]
    empty = draw(19.0, 10.0, boxes)
    furnished, filtered = empty.cells.copy(), empty.cells.copy()
    furnished[60:100, 60:100] = OCCUPIED
    furnished[62:98, 62:98] = filtered[62:98, 62:98] = UNKNOWN  # a table of 2 m, seen from outside
    monkeypatch.setattr(
        "closedrooms.predictor.structure.clutter.filter_clutter", lambda _: OccupancyGrid(empty.frame, filtered)
    )
    given = OccupancyGrid(empty.frame, furnished)
    tour, without = plan_coverage(given), plan_coverage(empty, config=plain)
    # The same places, reached around the table: no loop leads around it, and no edge through it.
    assert _count_loops(tour) == _count_loops(without) == 0
    assert tour.length == pytest.approx(without.length, rel=0.1)
    cells = given.frame.to_cells(tour.graph.vertices)
    assert given.free[cells[:, 0], cells[:, 1]].all()
    # What is unknown without furniture around it stays in the way.
    assert _count_loops(plan_coverage(OccupancyGrid(empty.frame, filtered))) == 1


def test_an_empty_map_is_refused():
    frame = GridFrame(0.05, 0.0, 0.0, 40, 40)
    with pytest.raises(InvalidInputError, match="without free space"):
        plan_coverage(OccupancyGrid(frame, np.full(frame.shape, 100, dtype=np.int8)))


def test_features_carry_the_map_and_survive_a_file(corridor_with_rooms, plain, tmp_path):
    tour = plan_coverage(corridor_with_rooms(2), [ClosedDoor("d", (5.0, 0.95))], plain)
    features = make_tour_features(tour, "closed")
    write_features(tmp_path / "tour.geojson", features)
    read = read_features(tmp_path / "tour.geojson")
    assert {properties["map"] for _, properties in read} == {"closed"}
    kinds = [properties["type"] for _, properties in read]
    assert kinds.count("vertex") == len(tour.graph.vertices)
    assert kinds.count("edge") == len(tour.graph.edges)
    assert [properties["door"] for _, properties in read if "door" in properties] == ["d"]
    (line,) = [geometry for geometry, properties in read if properties["type"] == "tour"]
    assert line.length == pytest.approx(tour.length, abs=0.01)
    json.dumps([properties for _, properties in features])


def test_a_tour_of_one_vertex_is_a_point_feature(draw, plain):
    features = make_tour_features(plan_coverage(draw(6.0, 6.0, [(1.0, 1.0, 5.0, 5.0)]), config=plain), "truth")
    assert [geometry.geom_type for geometry, _ in features] == ["Point", "Point"]


def test_errors_follow_the_paper(corridor_with_rooms, plain):
    tour = plan_coverage(corridor_with_rooms(2), config=plain)
    closed, predicted, truth = (replace(tour, length=length) for length in (60.0, 95.0, 100.0))
    errors = compare_tours(closed, predicted, truth, n_rooms=6, n_doors=3)
    assert (errors.tsp_closed, errors.tsp_pred, errors.tsp_gt) == (60.0, 95.0, 100.0)
    assert errors.tsp_baseline == pytest.approx(90.0)
    assert (errors.error_closed, errors.error_baseline, errors.error_pred) == pytest.approx((40.0, 10.0, 5.0))


def test_tours_of_different_methods_are_not_compared(corridor_with_rooms, plain):
    tour = plan_coverage(corridor_with_rooms(2), config=plain)
    with pytest.raises(InvalidInputError, match="same method"):
        compare_tours(tour, replace(tour, method="paper"), tour, 1, 1)


def test_there_is_no_error_where_the_true_tour_has_no_length(corridor_with_rooms, plain):
    tour = plan_coverage(corridor_with_rooms(2), config=plain)
    errors = compare_tours(tour, tour, replace(tour, length=0.0), 1, 1)
    assert (errors.error_closed, errors.error_baseline, errors.error_pred) == (None, None, None)
    assert errors.tsp_closed == tour.length


@pytest.mark.parametrize("rooms", [1, 2, 4])
def test_rooms_and_corridor_are_counted(corridor_with_rooms, plain, rooms):
    assert count_rooms(corridor_with_rooms(rooms), plain.graph) == rooms + 1


def test_a_single_room_counts_one(draw, plain):
    assert count_rooms(draw(8.0, 8.0, [(1.0, 1.0, 7.0, 5.0)]), plain.graph) == 1


def test_the_paper_method_can_be_chosen_for_a_map(ring, plain):
    config = CoverageConfig(graph=plain.graph, tour=TourConfig(method="paper", convergence=20))
    tour = plan_coverage(ring, config=config)
    assert tour.method == "paper"
    assert tour.length == pytest.approx(plan_coverage(ring, config=plain).length, rel=0.05)


@pytest.mark.skipif(not AUTHORS.is_dir(), reason="shared/data/authors is not beside the checkout")
def test_on_an_authors_map_all_doors_are_reached_and_the_prediction_helps():
    folder = AUTHORS / "Sabadell1_updated" / "06"
    doors = read_doors(folder / "doors.geojson")
    closed = plan_coverage(read_map(folder / "map.yaml"), doors)
    predicted, truth = (plan_coverage(read_map(folder / f"{name}.yaml")) for name in ("authors", "truth"))
    assert closed.status == "complete"
    assert set(closed.graph.door_vertices) == {door.id for door in doors}
    errors = compare_tours(closed, predicted, truth, 6, len(doors))
    assert errors.error_pred < errors.error_closed
    assert max(tour.gap for tour in (closed, predicted, truth)) < 0.01


@pytest.mark.parametrize(("neck", "rooms"), [(0.8, 2), (1.6, 2), (2.2, 2), (2.8, 1), (5.0, 1)])
def test_a_neck_parts_two_rooms_up_to_the_width_of_double_doors(draw, plain, neck, rooms):
    # Two rooms of 5 x 5 m with a neck between them: two thirds of 5 m are 3.3 m, a doorway has 2.5 m at most.
    grid = draw(13.0, 7.0, [(1.0, 1.0, 6.0, 6.0), (6.2, 1.0, 11.2, 6.0), (5.9, 3.5 - neck / 2, 6.3, 3.5 + neck / 2)])
    assert count_rooms(grid, plain.graph) == rooms


@pytest.mark.parametrize(("wide", "rooms"), [(0.9, 1), (1.3, 2)])
def test_what_is_narrower_than_a_room_is_part_of_the_one_beside_it(draw, plain, wide, rooms):
    # A neck of 0.5 m: the room behind it is wider by the half, but no room.
    grid = draw(13.0, 7.0, [(1.0, 1.0, 6.0, 6.0), (6.2, 1.0, 6.2 + wide, 6.0), (5.9, 3.25, 6.3, 3.75)])
    assert count_rooms(grid, plain.graph) == rooms


@pytest.mark.parametrize(("neck", "rooms"), [(1.2, 2), (1.7, 1)])
def test_a_neck_of_two_thirds_of_the_width_of_a_room_parts_nothing(draw, plain, neck, rooms):
    # A corridor of 2.2 m, narrowed by pillars.
    grid = draw(16.0, 5.0, [(1.0, 1.0, 7.0, 3.2), (7.2, 1.0, 14.0, 3.2), (6.9, 2.1 - neck / 2, 7.3, 2.1 + neck / 2)])
    assert count_rooms(grid, plain.graph) == rooms
