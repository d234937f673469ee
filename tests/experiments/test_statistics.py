import numpy as np
import pytest

from closedrooms.experiments.statistics import bootstrap, compare_pairs, described


def test_the_bootstrap_interval_holds_the_mean_and_narrows_with_more_samples() -> None:
    values = [np.random.default_rng(i).random(3) for i in range(200)]
    low, high = bootstrap(values, 500, "test")
    few_low, few_high = bootstrap(values[:10], 500, "test")
    assert low is not None
    assert high is not None
    assert few_low is not None
    assert few_high is not None
    assert low < float(np.concatenate(values).mean()) < high
    assert high - low < few_high - few_low
    assert bootstrap([], 10, "test") == (None, None)


def test_drawing_buildings_is_the_wider_interval_where_buildings_differ() -> None:
    rng = np.random.default_rng(0)
    worlds = [f"w{number % 5}" for number in range(100)]
    groups = [np.array([int(world[1]) / 5 + 0.01 * rng.random()]) for world in worlds]
    row = described(groups, worlds, 500, "test")
    assert row["world_high"] - row["world_low"] > 2 * (row["high"] - row["low"])
    assert row["low"] < row["mean"] < row["high"]


def test_a_constant_difference_is_found_and_none_where_there_is_none() -> None:
    rng = np.random.default_rng(1)
    first = {f"s{number:02d}": float(value) for number, value in enumerate(rng.random(40))}
    worlds = {sample: f"w{int(sample[1:]) % 10}" for sample in first}
    better = {sample: value + 0.05 + 0.01 * rng.random() for sample, value in first.items()}
    test = compare_pairs(first, better, worlds, 500, "test")
    assert test is not None
    assert test.p_samples < 1e-6
    assert test.p_worlds < 0.01
    assert test.low > 0.04
    same = compare_pairs(first, first, worlds, 500, "test")
    assert same is not None
    assert (same.p_samples, same.p_worlds, same.difference) == (1.0, 1.0, 0.0)


def test_only_samples_that_both_have_are_compared() -> None:
    worlds = {"a": "w", "b": "w", "c": "v"}
    test = compare_pairs({"a": 0.5, "b": 0.2}, {"b": 0.4, "c": 0.9}, worlds, 100, "test")
    assert test is not None
    assert (test.samples, test.worlds) == (1, 1)
    assert test.difference == pytest.approx(0.2)
    assert compare_pairs({"a": 0.5}, {"c": 0.5}, worlds, 100, "test") is None
