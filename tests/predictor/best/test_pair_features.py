"""What two rooms say about each other, against plain geometry: corners, directions, areas."""

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from closedrooms.predictor.best.door_pose import SAME_WALL
from closedrooms.predictor.best.hypotheses import Hypotheses
from closedrooms.predictor.best.pair_features import (
    DEPTH_REACH,
    OFF_DEPTH,
    OFF_WIDTH,
    OVERLAP_WEIGHT,
    PAIR_FEATURES,
    Pairs,
    score_pairs,
    weigh_pairs,
)
from closedrooms.predictor.best.resolution import in_cells

# Where the room lies in the turned map, by quarter (`door_frame`: left of +y by so many quarter turns).
INWARD = [(0.0, 1.0), (-1.0, 0.0), (0.0, -1.0), (1.0, 0.0)]
THICKNESS = 4
WEIGHTS = {feature.name: feature.weight for feature in PAIR_FEATURES}


def rooms(
    boxes: list[list[int]], *, quarter: int = 0, u: float = 0.0, v: float = 0.0, angle: float = 0.0
) -> Hypotheses:
    """Rectangles of one door, in cells of 0.05 m."""
    array = np.array(boxes)
    corners = array[:, [[0, 1], [2, 1], [2, 3], [0, 3]]] * 0.05
    return Hypotheses(array, corners, np.zeros(len(array)), angle, quarter, u, v, np.zeros((len(array), 1)))


def extent(box: list[int], direction: tuple[float, float]) -> tuple[float, float]:
    """From where to where a rectangle reaches along a direction."""
    x0, y0, x1, y1 = box
    along = [x * direction[0] + y * direction[1] for x in (x0, x1) for y in (y0, y1)]
    return min(along), max(along)


BOXES = st.tuples(*[st.integers(0, 60)] * 2, *[st.integers(20, 90)] * 2).map(
    lambda box: [box[0], box[1], box[0] + box[2], box[1] + box[3]]
)


@given(st.integers(0, 3), BOXES, BOXES, st.floats(-300.0, 300.0))
@settings(max_examples=60, deadline=None)
def test_two_doors_of_one_wall_expect_backs_and_widths_to_agree(
    quarter: int, one: list[int], other: list[int], apart: float
) -> None:
    a = rooms([one], quarter=quarter, u=40.0, v=90.0)
    b = rooms([other], quarter=quarter, u=40.0 + apart, v=90.0 + SAME_WALL - 1)
    found = weigh_pairs(a, b, THICKNESS)
    inward = INWARD[quarter]
    wall = (inward[1], inward[0])
    off = abs(extent(one, inward)[1] - extent(other, inward)[1])
    widths = [np.ptp(extent(box, wall)) for box in (one, other)]
    agree = np.exp(-abs(apart) / DEPTH_REACH)
    assert found["same depth"] == pytest.approx(WEIGHTS["same depth"] * agree * np.exp(-off / OFF_DEPTH))
    assert found["same width"] == pytest.approx(
        WEIGHTS["same width"] * agree * np.exp(-abs(widths[0] - widths[1]) / OFF_WIDTH)
    )


@pytest.mark.parametrize(
    ("quarters", "v"),
    [((0, 0), SAME_WALL), ((0, 0), -SAME_WALL), ((0, 0), SAME_WALL + 5), ((0, 1), 0.0), ((0, 2), 0.0), ((3, 1), 0.0)],
)
def test_doors_of_two_walls_expect_nothing(quarters: tuple[int, int], v: float) -> None:
    box = [0, 0, 40, 40]
    found = weigh_pairs(
        rooms([box], quarter=quarters[0], v=7.0), rooms([box], quarter=quarters[1], v=7.0 + v), THICKNESS
    )
    assert found["same depth"] == 0.0
    assert found["same width"] == 0.0


@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize("order", [1, -1])
def test_what_lies_between_two_rooms_depends_on_how_wide_it_is(axis: int, order: int) -> None:
    wall, strip, gap = in_cells(0.3) + THICKNESS, in_cells(1.8) + THICKNESS, in_cells(5.0) + THICKNESS
    touching = -in_cells(0.1) - 1

    def between(distance: int) -> dict[str, float]:
        """Weights of a room of 40 cells and, so far beside it, one of 80 cells that faces half of it and a quarter."""
        boxes = [[0, 0, 40, 40], [40 + distance, 20, 120 + distance, 100]]
        if axis:
            boxes = [[box[1], box[0], box[3], box[2]] for box in boxes]
        a, b = (rooms([box]) for box in boxes[::order])
        return {name: float(value[0, 0]) for name, value in weigh_pairs(a, b, THICKNESS).items()}

    share = 20 / 40 + 20 / 80
    for distance in range(touching - 3, gap + 4):
        found = between(distance)
        expected = {
            "shared wall": WEIGHTS["shared wall"] * share * (touching < distance <= wall),
            "strip between": WEIGHTS["strip between"] * share * (wall < distance <= strip),
            "gap between": WEIGHTS["gap between"] * share * (strip < distance <= gap),
        }
        assert {name: found[name] for name in expected} == pytest.approx(expected), distance


@given(BOXES, BOXES, st.integers(0, 9))
@settings(max_examples=60, deadline=None)
def test_overlap_is_the_area_in_common_of_rooms_that_reach_into_the_wall(
    one: list[int], other: list[int], thickness: int
) -> None:
    # Growing either room by half a wall on one side of each axis grows what they have in common by as much.
    grow = min(thickness, 2 * in_cells(0.1)) / 2
    common = shapely.intersection(shapely.box(*one), shapely.box(*other))
    width, height = (min(one[k + 2], other[k + 2]) - max(one[k], other[k]) + grow for k in (0, 1))
    area = max(width, 0.0) * max(height, 0.0)
    assert area >= common.area
    smaller = min(shapely.box(*one).area, shapely.box(*other).area)
    share = area / smaller
    found = Pairs(np.array([one]), np.array([other]), None, thickness).overlap[0, 0]
    assert found == pytest.approx(share + 0.2 * (share > 0.03))


def test_rooms_of_two_directions_only_must_not_overlap() -> None:
    a, b = rooms([[0, 0, 40, 40]]), rooms([[20, 0, 100, 40], [50, 0, 90, 40]], angle=0.5)
    scores, shares = score_pairs(a, b, THICKNESS)
    assert shares == pytest.approx(np.array([[0.5 + 0.2, 0.0]]))
    assert scores == pytest.approx(OVERLAP_WEIGHT * shares)
    assert list(weigh_pairs(a, b, THICKNESS)) == ["overlap"]


def test_the_score_of_a_pair_is_the_sum_of_what_its_features_count() -> None:
    rng = np.random.default_rng(1)
    low = rng.integers(0, 60, (2, 4, 2))
    a, b = (rooms([*map(list, np.concatenate((part, part + 30), axis=1).tolist())]) for part in low)
    scores, shares = score_pairs(a, b, THICKNESS)
    terms = weigh_pairs(a, b, THICKNESS)
    assert scores == pytest.approx(sum(terms.values()))
    assert terms["overlap"] == pytest.approx(OVERLAP_WEIGHT * shares)
