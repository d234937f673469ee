import itertools
from functools import partial

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from closedrooms.coverage.config import CoverageConfig
from closedrooms.navigation.remaining_tour import open_tour


@settings(max_examples=20, deadline=None)
@given(places=st.lists(st.tuples(st.integers(0, 50), st.integers(0, 50)), min_size=3, max_size=6, unique=True))
def test_an_open_tour_runs_from_here_to_home_by_the_shortest_way(places: list[tuple[int, int]]) -> None:
    points = np.array(places, dtype=np.float64)
    distances = np.hypot(*(points[:, None] - points[None]).transpose(2, 0, 1))
    order = open_tour(distances, CoverageConfig())
    assert order[0] == 0
    assert order[-1] == 1
    assert sorted(order) == list(range(len(places)))
    length = distances[order[:-1], order[1:]].sum()
    best = min(distances[[0, *middle], [*middle, 1]].sum() for middle in itertools.permutations(range(2, len(places))))
    assert length == pytest.approx(best, rel=1e-6)


@pytest.mark.slow
def test_the_tour_of_a_small_office_is_driven_and_every_room_is_seen() -> None:
    from closedrooms.core.random import stream
    from closedrooms.coverage.tour_planner import plan_coverage
    from closedrooms.mapping.config import MapperConfig
    from closedrooms.mapping.mapper import Mapper
    from closedrooms.navigation.config import NavigationConfig
    from closedrooms.navigation.drive import drive
    from closedrooms.navigation.exploration import explore
    from closedrooms.pipeline.drive_report import drive_metrics
    from closedrooms.predictor.methods import predict
    from closedrooms.sim.config import SimConfig
    from closedrooms.sim.simulation import Simulation
    from closedrooms.worlds.closing import draw_closed
    from closedrooms.worlds.library import load_world
    from closedrooms.worlds.truth import reachable, true_rooms

    plan = load_world("office-01")
    closed = draw_closed(plan, 2, stream(0, "closed doors"))
    predictor, coverage, navigation = partial(predict, method="paper"), CoverageConfig(), NavigationConfig()
    with Simulation(plan, closed, SimConfig(), 0) as sim:
        mapper = Mapper(MapperConfig())
        assert explore(sim, mapper, navigation).status == "complete"
        prediction = predictor(mapper.grid(), mapper.doors())
        tour = plan_coverage(prediction.grid, (), coverage, start=(mapper.pose.x, mapper.pose.y))
        result = drive(
            sim, mapper, prediction, tour, mapper.doors(), navigation,
            closed=closed, predictor=predictor, coverage=coverage,
        )  # fmt: skip
        start = sim.world_T_map
    truth = true_rooms(plan, closed, start.inverse())
    grid = mapper.grid()
    cells = reachable(plan, (), grid.frame, start.inverse(), (start.x, start.y))
    figures = drive_metrics(result, truth, grid, cells, None)
    assert result.status == "complete"
    assert {door for revision in result.revisions for door in revision.doors} == set(closed)
    assert figures["area_covered"] > 0.97
    assert figures["room_iou_mean_end"] > 0.8
    assert result.driven_length < 2.0 * result.planned_length
