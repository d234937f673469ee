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
