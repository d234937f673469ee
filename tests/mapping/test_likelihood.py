import numpy as np
import pytest

from closedrooms.mapping.config import MatcherConfig
from closedrooms.mapping.likelihood import LikelihoodField


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
