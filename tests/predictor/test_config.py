"""Settings of the methods: what the paper and the authors' logs say, and what is refused."""

import math
from dataclasses import fields

import pytest

from closedrooms.core.errors import InvalidInputError
from closedrooms.predictor.config import (
    BestConfig,
    DirectionsConfig,
    FacesConfig,
    LearnedConfig,
    LinesConfig,
    PaperConfig,
    RoseConfig,
    Weights,
)

CLASSES = (LinesConfig, DirectionsConfig, Weights, FacesConfig, PaperConfig, RoseConfig, BestConfig, LearnedConfig)
ABOVE_ZERO = {
    "hough_votes", "border_margin", "collinear_distance", "resolution", "hough_angle", "angle_bandwidth",
    "canny_aperture", "door_reach", "door_width", "smallest_side", "largest_side", "shortlist", "rated",
}  # fmt: skip


def _numbers():
    for kind in CLASSES:
        for item in fields(kind):
            value = getattr(kind(), item.name)
            if item.init and not isinstance(value, bool) and isinstance(value, int | float):
                yield kind, item.name, value


@pytest.mark.parametrize(("kind", "name", "value"), list(_numbers()))
def test_a_number_is_finite_and_not_negative_and_lengths_that_are_divided_by_are_above_zero(kind, name, value):
    assert getattr(kind(**{name: value}), name) == value
    for wrong in (-1e-9, math.nan, math.inf):
        with pytest.raises(InvalidInputError, match=name):
            kind(**{name: wrong})
    if name in ABOVE_ZERO:
        with pytest.raises(InvalidInputError, match=name):
            kind(**{name: 0.0})
    elif name != "canny_aperture":
        kind(**{name: 0.0 if isinstance(value, float) else 0})


def test_messages_say_what_was_expected():
    with pytest.raises(InvalidInputError, match=r"^door_reach 0.0; expected a finite number above 0$"):
        BestConfig(door_reach=0.0)
    with pytest.raises(InvalidInputError, match=r"^same_door -0.5; expected a finite number of at least 0$"):
        BestConfig(same_door=-0.5)


@pytest.mark.parametrize(
    ("kind", "good", "bad"),
    [
        (LinesConfig, {"hough_angle": 1e-3}, {"hough_angle": 0.99e-3}),
        (LinesConfig, {"hough_angle": math.pi / 2}, {"hough_angle": 1.58}),
        (LinesConfig, {"angle_bandwidth": 1e-3}, {"angle_bandwidth": 0.99e-3}),
        (LinesConfig, {"angle_bandwidth": math.pi / 4}, {"angle_bandwidth": 0.79}),
        (LinesConfig, {"canny_aperture": 3}, {"canny_aperture": 4}),
        (LinesConfig, {"canny_aperture": 7}, {"canny_aperture": 9}),
        (LinesConfig, {"canny_aperture": 5}, {"canny_aperture": 1}),
        (PaperConfig, {"exact_candidates": 16}, {"exact_candidates": 17}),
        (PaperConfig, {"exact_candidates": 0}, {"exact_candidates": -1}),
        (FacesConfig, {"min_unknown": 1.0}, {"min_unknown": 1.001}),
        (FacesConfig, {"max_free": 1.0}, {"max_free": 1.001}),
        (BestConfig, {"largest_side": 0.8}, {"largest_side": 0.799}),
        (BestConfig, {"smallest_side": 24.0}, {"smallest_side": 24.001}),
        (LearnedConfig, {"smallest_side": 24.0}, {"smallest_side": 24.001}),
    ],
)
def test_settings_are_taken_at_their_limits_and_refused_beyond(kind, good, bad):
    kind(**good)
    with pytest.raises(InvalidInputError, match="expected"):
        kind(**bad)


def test_weights_and_rules_are_those_of_the_paper_and_of_the_authors_program():
    # Section 4.1, the first a metre instead of a cell of 0.05 m.
    assert [getattr(Weights(), item.name) for item in fields(Weights)] == [0.06 / 0.05, 10, 7, 10, 2.5, 2, 1, 2]
    lines, paper = LinesConfig(), PaperConfig()
    assert (lines.canny_low, lines.canny_high, lines.canny_aperture) == (90, 100, 5)
    # 20 votes, segments of 3 cells, one degree, a box 20 cells outside, walls of 7 cells: in cells of 0.05 m.
    assert lines.resolution == 0.05
    cells = (lines.hough_votes, lines.min_segment, lines.border_margin, lines.collinear_distance)
    assert [length / 0.05 for length in cells] == pytest.approx([20, 3, 20, 7])
    assert [math.degrees(angle) for angle in (lines.hough_angle, lines.angle_bandwidth)] == pytest.approx([1, 12])
    assert (paper.min_unknown, paper.max_free, paper.max_level) == (0.30, 0.50, 9)
    assert paper.door_width == 0.80  # section 3.7
    assert (paper.phi, paper.room_order) == ("as-run", "smallest-first")
    assert (paper.joint_layout, paper.average_border_depth) == (True, True)


def test_traces_are_kept_where_they_are_asked_for_only():
    assert not PaperConfig().keep_trace
    assert not BestConfig().keep_trace
    assert RoseConfig().directions is None
