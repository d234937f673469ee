import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from closedrooms.predictor.config import Weights
from closedrooms.predictor.paper.arrangement import build_arrangement
from closedrooms.predictor.paper.layout_score import FaceSet, Terms, face_set, score_layouts
from closedrooms.predictor.paper.lines import Line
from closedrooms.predictor.paper.subsets import best_subset

W = Weights()
BOX = tuple(Line(a, o, "border") for a in (0.0, math.pi / 2) for o in (-20.0, 20.0))


def _terms(**changes):
    base = dict.fromkeys(("free_edges", "free_length", "two_free", "more_free"), 0.0) | {
        "area": 25.0,
        "hull": 25.0,
        "faces": 1.0,
        "contour": 20.0,
        "proportion": 1.0,
    }
    return Terms(**{name: np.array([float(value)]) for name, value in (base | changes).items()})


def _value(phi, dependent, **changes):
    return float(score_layouts(_terms(**changes), W, phi, dependent=dependent)[0])


def test_a_square_of_a_hundred_cells_scores_its_side_as_the_logs_do():
    assert _value("as-run", False) == pytest.approx(0.06 * 100)
    assert _value("as-run", True) == pytest.approx(0.06 * 100)


def test_as_run_follows_every_term_of_the_logs():
    changes = {"area": 20.0, "faces": 2, "free_edges": 3, "two_free": 1, "more_free": 1, "proportion": 3.0}
    size, hull = 0.06 * math.sqrt(20.0 / 0.05**2), 10 * (25.0 / 20.0 - 1)
    assert _value("as-run", False, **changes) == pytest.approx(size - hull - 7 * 1.5 - 10 * 6)
    assert _value("as-run", True, **changes) == pytest.approx(size - hull - 2.5 * 1.5 - 10 * 5 - 2 * 1.0)


def test_as_printed_follows_every_term_of_the_text():
    changes = {"area": 20.0, "free_length": 5.0, "two_free": 1, "more_free": 1, "proportion": 3.0}
    size, hull = 1.2 * math.sqrt(20.0), 10 * 25.0 / 20.0
    assert _value("as-printed", False, **changes) == pytest.approx(size - hull - 7 * 0.25 + 10 * 2)
    assert _value("as-printed", True, **changes) == pytest.approx(size - hull - 2.5 * 0.25 - 10 - 2 * 3.0)


def test_proportion_counts_only_with_a_free_face_and_beyond_two():
    assert _value("as-run", True, proportion=9.0) == _value("as-run", True)
    assert _value("as-run", True, proportion=1.9, two_free=1) == _value("as-run", True, two_free=1)
    assert _value("as-run", True, proportion=2.5, two_free=1) == _value("as-run", True, two_free=1) - 1.0


def _pool(xs, ys, unknown_share, seed):
    """A random set of faces between slightly slanted lines, one of them fixed."""
    rng = np.random.default_rng(seed)
    lines = [Line(math.pi / 2 + 0.02, -x) for x in xs] + [Line(0.0, y) for y in ys]
    arrangement = build_arrangement(lines, BOX)
    inner = np.flatnonzero(~arrangement.border)
    start = int(inner[rng.integers(inner.size)])
    unknown = rng.random(len(arrangement.faces)) < unknown_share
    unknown[start] = True
    candidates = [f for f in arrangement.neighbours[start] if unknown[f]]
    candidates += [g for f in candidates for g in arrangement.neighbours[f] if unknown[g]]
    candidates = sorted(set(candidates) - {start})[:9]
    faces = np.array([start, *candidates])
    fixed = np.arange(faces.size) == 0
    free = unknown.copy()
    free[start] = False
    return arrangement, face_set(arrangement, faces, ~fixed, free, np.array([1.0, 0.0])), fixed, free


# Up to 18.6 m: inside of BOX, so that there are faces that do not touch it.
CUTS = st.lists(st.integers(-16, 16), min_size=3, max_size=7, unique=True).map(
    lambda values: sorted(v + 0.01 * v**2 for v in values)
)


@given(CUTS, CUTS, st.floats(0.3, 1.0), st.integers(0, 99))
@settings(max_examples=40, deadline=None)
def test_sums_over_faces_agree_with_geometry(xs, ys, share, seed):
    arrangement, pool, fixed, free = _pool(xs, ys, share, seed)
    chosen = fixed | (np.random.default_rng(seed).random(fixed.size) < 0.5)
    terms = pool.terms(chosen[None, :])
    members = set(pool.faces[chosen].tolist())
    free = free.copy()
    free[list(members)] = False
    counts = [sum(free[g] for g in arrangement.neighbours[f]) for f in members]
    assert terms.area[0] == pytest.approx(sum(arrangement.faces[f].area for f in members))
    assert terms.free_edges[0] == sum(counts)
    assert terms.two_free[0] == counts.count(2)
    assert terms.more_free[0] == sum(c > 2 for c in counts)
    outline = sum(
        length
        for (a, b), length in zip(arrangement.edge_faces.tolist(), arrangement.edge_lengths, strict=True)
        if (a in members) != (b in members)
    )
    assert terms.contour[0] == pytest.approx(outline)
    assert terms.hull[0] >= terms.area[0] - 1e-9


@given(CUTS, CUTS, st.floats(0.3, 1.0), st.integers(0, 99), st.booleans(), st.sampled_from(["as-run", "as-printed"]))
@settings(max_examples=60, deadline=None)
def test_branch_and_bound_finds_what_the_power_set_finds(xs, ys, share, seed, dependent, phi):
    _, pool, fixed, _ = _pool(xs, ys, share, seed)
    options = {"dependent": dependent, "door": np.zeros(2)}
    every = best_subset(pool, fixed, W, phi, exact=12, max_nodes=0, **options)
    searched = best_subset(pool, fixed, W, phi, exact=0, max_nodes=100_000, **options)
    assert not every.bounded
    assert not searched.bounded
    assert searched.score == pytest.approx(every.score)
    assert (searched.chosen == every.chosen).all()


def test_a_search_that_is_cut_says_so():
    _, pool, fixed, _ = _pool([-9.0, -3.0, 2.0, 8.0], [-9.0, -3.0, 2.0, 8.0], 1.0, 1)
    cut = best_subset(pool, fixed, W, "as-run", dependent=False, door=np.zeros(2), exact=0, max_nodes=1)
    assert cut.bounded
    assert cut.chosen[fixed].all()


@settings(max_examples=40)
@given(
    sides=st.tuples(st.floats(0.5, 9.0), st.floats(0.5, 9.0), st.floats(0.5, 9.0)),
    angle=st.floats(0.0, math.pi),
    both=st.booleans(),
)
def test_terms_of_two_rectangles_in_a_row_are_those_of_the_rectangle_they_make(sides, angle, both):
    first, second, height = sides
    along = np.array([math.cos(angle), math.sin(angle)])
    axes = np.stack((along, (-along[1], along[0])))
    boxes = np.array([[0.0, first, 0.0, height], [first, first + second, 0.0, height]])
    corners = tuple(np.array([(x0, y0), (x1, y0), (x1, y1), (x0, y1)]) @ axes for x0, x1, y0, y1 in boxes)
    apart = np.array([[0.0, 1.0], [1.0, 0.0]])
    faces = FaceSet(
        faces=np.arange(2), areas=np.array([first, second]) * height,
        perimeters=2 * (np.array([first, second]) + height), outer_free=np.zeros(2), outer_length=np.zeros(2),
        inner=apart, inner_length=apart * height, returnable=np.array([False, True]), boxes=boxes, corners=corners,
    )  # fmt: skip
    width = first + second if both else first
    terms = faces.terms(np.array([[True, both]]))
    assert terms.area[0] == pytest.approx(width * height)
    assert terms.hull[0] == pytest.approx(width * height)
    assert terms.contour[0] == pytest.approx(2 * (width + height))
    assert terms.proportion[0] == pytest.approx(max(width, height) / min(width, height))
    # The face that is left out is free, behind one edge as long as the rectangles are high.
    assert terms.free_edges[0] == (0 if both else 1)
    assert terms.free_length[0] == pytest.approx(0 if both else height)
