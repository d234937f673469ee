import numpy as np
import pytest

from closedrooms.mapping.matching.block_maxima import FEW_BLOCKS, BlockMaxima, pairs


def field_and_points(seed: int, turns: int = 3, count: int = 17) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    values = (rng.random((90, 100)) ** 4).astype(np.float32)
    return values, rng.integers(30, 60, (turns, count)), rng.integers(30, 70, (turns, count))


def exact(values: np.ndarray, rows: np.ndarray, cols: np.ndarray, shift: tuple[int, int], cells: int) -> float:
    """Mean over the points of the largest value in the block of shifts that begins at one."""
    return float(
        np.mean([
            values[row + shift[0] : row + shift[0] + cells, col + shift[1] : col + shift[1] + cells].max()
            for row, col in zip(rows, cols, strict=True)
        ])
    )  # fmt: skip


@pytest.mark.parametrize(("half", "cells"), [(2, 1), (3, 2), (8, 4), (9, 3), (12, 4), (10, 6), (11, 5)])
def test_bounds_are_the_mean_of_the_largest_values_of_blocks_rounded_up(half: int, cells: int) -> None:
    values, rows, cols = field_and_points(half)
    maxima = BlockMaxima(values, rows, cols, half + cells)
    starts = pairs(np.arange(2 * half // cells + 1) * cells - half)
    bounds = maxima.bounds(half, cells)
    assert bounds.shape == (3, len(starts))
    for turn in range(3):
        expected = np.array([exact(values, rows[turn], cols[turn], tuple(shift), cells) for shift in starts.tolist()])
        assert (bounds[turn] >= expected - 1e-6).all()
        assert (bounds[turn] <= expected + 1.0 / 255.0 + 1e-6).all()
    # Few blocks or many, asked for one by one they are the same.
    some = np.array([0, 2, 1])
    shifts = np.stack([starts[[0, -1]], starts[[1, 0]], starts[[-1, 1]]])
    single = maxima.bounds_of(some, shifts, cells)
    for number, turn in enumerate(some):
        for place in range(2):
            at = int(np.flatnonzero((starts == shifts[number, place]).all(axis=1))[0])
            assert single[number, place] == pytest.approx(bounds[turn, at])


def test_both_ways_of_looking_up_are_tried() -> None:
    sides = [2 * half // cells + 1 for half, cells in [(2, 1), (3, 2), (8, 4), (9, 3), (12, 4), (10, 6), (11, 5)]]
    assert min(sides) <= FEW_BLOCKS < max(sides)


def test_pairs_are_listed_by_rows() -> None:
    assert pairs(np.array([-1, 0, 1])).tolist() == [[r, c] for r in (-1, 0, 1) for c in (-1, 0, 1)]
