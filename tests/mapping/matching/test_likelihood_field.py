import numpy as np
import pytest

from closedrooms.mapping.config import MatcherConfig
from closedrooms.mapping.matching.likelihood_field import LikelihoodField


def value(field: LikelihoodField, x: float, y: float) -> float:
    rows, cols = field.lattice.cells(np.array([[x, y]]))
    return float(field.values[rows[0], cols[0]])


def test_likelihood_is_one_at_a_hit_and_falls_off_as_a_gaussian() -> None:
    field = LikelihoodField(0.05, MatcherConfig(field_sigma=0.1))
    field.add(np.array([[0.025, 0.025]]))
    assert value(field, 0.03, 0.03) == 1.0
    assert value(field, 0.125, 0.025) == pytest.approx(np.exp(-0.5), rel=1e-5)
    assert value(field, 1.0, 1.0) == 0.0


def test_known_surfaces_do_not_grow_thick() -> None:
    field = LikelihoodField(0.05, MatcherConfig())
    wall = np.column_stack((np.arange(0, 3, 0.05), np.full(60, 1.025)))
    field.add(wall)
    before = field.values.copy()
    field.add(wall + np.array([0.0, 0.05]))
    assert np.array_equal(field.values, before)
    field.add(wall + np.array([0.0, 0.5]))
    assert field.values.sum() > 1.5 * before.sum()


def test_the_field_grows_with_a_border_of_zeros() -> None:
    field = LikelihoodField(0.05, MatcherConfig())
    field.add(np.array([[40.025, -32.975], [-12.0, 5.0]]))
    edge = np.concatenate((field.values[0], field.values[-1], field.values[:, 0], field.values[:, -1]))
    assert not edge.any()
    assert value(field, 40.025, -32.975) == 1.0


def test_an_empty_scan_changes_nothing() -> None:
    field = LikelihoodField(0.05, MatcherConfig())
    field.add(np.empty((0, 2)))
    assert not field.values.any()


def test_each_scan_stamps_what_those_before_it_left_unknown_wherever_an_empty_one_comes() -> None:
    rng = np.random.default_rng(0)
    scans = [np.column_stack((np.linspace(0.0, 2.0, 60), rng.normal(scale=0.03, size=60))) for _ in range(3)]
    nothing = np.empty((0, 2))
    alone = LikelihoodField(0.05, MatcherConfig())
    for scan in scans:
        alone.add(scan)
    for order in (scans, [nothing, *scans], [scans[0], nothing, *scans[1:]], [*scans, nothing]):
        together = LikelihoodField(0.05, MatcherConfig())
        together.add_scans(order)
        size = np.minimum(alone.values.shape, together.values.shape)
        assert (together.values[: size[0], : size[1]] == alone.values[: size[0], : size[1]]).all()


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize(("resolution", "sigma"), [(0.05, 0.08), (0.1, 0.08), (0.05, 0.12)])
def test_a_cell_is_as_likely_as_the_nearest_hit_within_reach_makes_it(
    seed: int, resolution: float, sigma: float
) -> None:
    rng = np.random.default_rng(seed)
    # Far enough apart that all of them are new surfaces.
    hits = np.stack(np.meshgrid(np.arange(-2, 3), np.arange(-2, 3)), axis=-1).reshape(-1, 2) * 4 * sigma + 0.3
    hits = hits + rng.uniform(-0.3, 0.3, hits.shape) * sigma
    field = LikelihoodField(resolution, MatcherConfig(field_sigma=sigma))
    field.add(hits)
    frame = field.lattice.frame
    middles = frame.to_points(np.argwhere(np.ones(frame.shape, dtype=bool)))
    offsets = middles[:, None] - hits
    away = np.hypot(*offsets.transpose(2, 0, 1))
    expected = np.exp(-0.5 * (away.min(axis=1) / sigma) ** 2).reshape(frame.shape)
    # Where in its cell a hit fell is rounded to a 32nd of it; beyond three and a half sigmas nothing is left.
    assert np.abs(field.values - expected).max() < 0.02 * (resolution / 0.05) * (0.08 / sigma) + 0.004
    assert field.values[(away.min(axis=1) > 3.5 * sigma * 1.5 + 2 * resolution).reshape(frame.shape)].max() == 0.0
    assert field.values[(away.min(axis=1) < 2.9 * sigma).reshape(frame.shape)].min() > 0.0


@pytest.mark.parametrize(("threshold", "stamped"), [(0.55, False), (0.65, True)])
def test_a_hit_is_stamped_where_its_cell_is_less_likely_than_a_known_surface(threshold: float, stamped: bool) -> None:
    # A cell away: exp(-0.5 (0.05 / 0.05)^2) = 0.607.
    field = LikelihoodField(0.05, MatcherConfig(field_sigma=0.05, new_surface=threshold))
    field.add(np.array([[0.025, 0.025]]))
    assert value(field, 0.075, 0.025) == pytest.approx(0.6065, abs=1e-3)
    field.add(np.array([[0.075, 0.025]]))
    assert (value(field, 0.075, 0.025) == 1.0) == stamped


def test_of_beams_that_hit_one_cell_after_another_the_first_is_stamped() -> None:
    field = LikelihoodField(0.05, MatcherConfig(field_sigma=0.1))
    field.add(np.array([[0.01, 0.025], [0.04, 0.025]]))
    alone = LikelihoodField(0.05, MatcherConfig(field_sigma=0.1))
    alone.add(np.array([[0.01, 0.025]]))
    assert np.array_equal(field.values, alone.values)
    # Of two scans each has its first, where neither knows the surface yet.
    scans = [np.array([[0.01, 0.025]]), np.array([[2.01, 0.025], [2.04, 0.025]]), np.array([[2.04, 3.0]])]
    both, each = LikelihoodField(0.05, MatcherConfig()), LikelihoodField(0.05, MatcherConfig())
    both.add_scans(scans)
    for scan in scans:
        each.add(scan)
    assert np.array_equal(both.values, each.values)


def test_a_field_that_is_cleared_knows_nothing_and_learns_again() -> None:
    field = LikelihoodField(0.05, MatcherConfig())
    hits = np.array([[20.0, -3.0], [1.0, 1.0]])
    field.add(hits)
    before, frame = field.values.copy(), field.lattice.frame
    field.clear()
    assert not field.values.any()
    assert field.lattice.frame == frame
    field.add(hits)
    assert np.array_equal(field.values, before)
