"""Settings of graph and tour at their limits, and what the paper says of them."""

import math
from dataclasses import fields

import pytest

from closedrooms.core.errors import InvalidInputError
from closedrooms.coverage.config import CoverageConfig, GraphConfig, TourConfig
from closedrooms.coverage.estimates import compare_lengths


@pytest.mark.parametrize("name", [item.name for item in fields(GraphConfig)][1:])
def test_lengths_are_finite_and_not_negative(name):
    for wrong in (-1e-9, math.nan, math.inf):
        with pytest.raises(InvalidInputError, match=rf"^{name} .*; expected a finite number of at least 0$"):
            GraphConfig(**{name: wrong})
    if name != "doorway":
        assert getattr(GraphConfig(**{name: 0.0}), name) == 0.0


def test_a_doorway_is_wider_than_what_the_opening_closes():
    for good in ({"doorway": 0.31}, {"opening_radius": 0.39}, {"doorway": 0.1, "opening_radius": 0.0499}):
        GraphConfig(**good)
    for wrong, line in (
        ({"doorway": 0.0, "opening_radius": 0.0}, r"^doorway 0.0; expected a width above 0 m$"),
        ({"doorway": 0.3}, r"^opening_radius 0.15; expected less than half a doorway \(0.3 m\)$"),
        ({"opening_radius": 0.4}, r"^opening_radius 0.4; expected less than half a doorway \(0.8 m\)$"),
    ):
        with pytest.raises(InvalidInputError, match=line):
            GraphConfig(**wrong)


@pytest.mark.parametrize("name", ["kicks", "patience", "solution_limit", "convergence", "bound_steps"])
def test_searches_take_one_step_at_least(name):
    assert getattr(TourConfig(**{name: 1}), name) == 1
    with pytest.raises(InvalidInputError, match=f"^{name} 0; expected at least 1$"):
        TourConfig(**{name: 0})


def test_a_search_has_some_time():
    assert TourConfig(seconds=1e-9).seconds == 1e-9
    for wrong in (0.0, -1.0, math.nan):
        with pytest.raises(InvalidInputError, match=r"^seconds .*; expected a time above 0 s$"):
            TourConfig(seconds=wrong)


def test_widths_and_times_are_those_of_the_paper():
    config = CoverageConfig()
    assert config.graph.doorway == 0.80  # section 3.7
    assert config.tour.seconds == 60.0  # section 5.2
    assert config.graph.clutter_filter  # section 5.1
    assert (config.parts, config.tour.method) == ("start", "default")


@pytest.mark.parametrize(
    ("rooms", "doors", "baseline"), [(4, 2, 60.0), (1, 0, 40.0), (1, 3, 160.0), (0, 3, 160.0), (8, 1, 45.0)]
)
def test_the_baseline_adds_the_mean_cost_of_a_room_for_every_door(rooms, doors, baseline):
    errors = compare_lengths(40.0, 90.0, 80.0, n_rooms=rooms, n_doors=doors)
    assert errors.tsp_baseline == pytest.approx(baseline)
    assert (errors.error_closed, errors.error_pred) == pytest.approx((50.0, 12.5))
    assert errors.error_baseline == pytest.approx(abs(80.0 - baseline) / 80.0 * 100.0)
