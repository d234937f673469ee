"""Clocks of sensors and recorders, laid over each other."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from closedrooms.mapping.logs.clocks import Times, find_gaps, forward, scan_and_odometry_times

TEN = np.arange(10.0)


def times(header: list[float] | np.ndarray, recorded: list[float] | np.ndarray | None = None) -> Times:
    header = np.asarray(header, dtype=float)
    return Times(header, header + 0.25 if recorded is None else np.asarray(recorded, dtype=float))


@pytest.mark.parametrize(
    ("header", "told"),
    [
        (100.0 + TEN, True),
        (np.zeros(10), False),
        (np.where(TEN < 4, 0.0, 100.0 + TEN), True),  # most are set
        (np.where(TEN < 5, 0.0, 100.0 + TEN), False),  # no more than half
        (100.0 + TEN - 1.9 * (TEN == 5), True),  # out of order by 0.9 s
        (100.0 + TEN - 2.1 * (TEN == 5), False),  # started again
        (np.full(10, 7.0), False),  # stands
        (np.array([7.0, 7.0]), True),  # of two, nobody knows
        (-1.0 - TEN, False),
    ],
)
def test_a_sensor_has_a_clock_that_is_set_and_goes_on(header: np.ndarray, told: bool) -> None:
    assert times(header, 1000.0 + np.arange(len(header))).told == told


def test_a_clock_that_stands_counts_where_the_recorders_stands_too() -> None:
    assert times(np.full(10, 7.0), np.full(10, 3.0)).told
    assert not Times(TEN, np.full(10, 3.0)).usable_recording
    assert Times(TEN[:2], np.full(2, 3.0)).usable_recording
    assert Times(TEN, TEN).usable_recording


def test_times_that_are_not_set_come_from_the_recorder_less_its_usual_delay() -> None:
    header = np.where((TEN == 3) | (TEN == 7), 0.0, 100.0 + TEN)
    own = times(header, 150.2 + TEN)
    assert own.lag == pytest.approx(np.full(8, 50.2))
    assert own.by_header() == pytest.approx(100.0 + TEN)
    # On the recorder's clock: as even as the sensor's, where the two run alike.
    jitter = np.array([0.0, 0.3, -0.2, 0.1, 0.4, -0.3, 0.0, 0.2, -0.1, 0.0])
    own = times(100.0 + TEN, 150.0 + TEN + jitter)
    assert own.by_recorder() == pytest.approx(150.0 + TEN)
    # Where they drift apart by more than a second it is the recorder's.
    for drift, even in ((0.11, True), (0.14, False)):
        recorded = 150.0 + TEN * (1.0 + drift)
        found = times(100.0 + TEN, recorded).by_recorder()
        expected = 100.0 + TEN + np.median(recorded - 100.0 - TEN) if even else recorded
        assert found == pytest.approx(expected)
    untold = times(np.zeros(10), 150.0 + TEN)
    assert untold.by_recorder().tolist() == untold.recorded.tolist()
    assert untold.by_header().tolist() == untold.header.tolist()


def test_clocks_that_agree_are_taken_as_they_are() -> None:
    scans, odometry = times(100.0 + TEN), times(100.5 + TEN, 101.6 + TEN)
    stamps, moved, remarks = scan_and_odometry_times(scans, odometry)
    assert (stamps.tolist(), moved.tolist(), remarks) == (scans.header.tolist(), odometry.header.tolist(), [])
    stamps, moved, remarks = scan_and_odometry_times(scans, None)
    assert (stamps.tolist(), moved.tolist(), remarks) == (scans.header.tolist(), [], [])


@pytest.mark.parametrize(("apart", "repaired"), [(0.9, False), (1.1, True), (-1.1, True), (-0.9, False)])
def test_clocks_more_than_a_second_apart_are_laid_over_each_other(apart: float, repaired: bool) -> None:
    # Both recorded at the same times.
    scans, odometry = times(100.0 + TEN, 500.0 + TEN), times(100.0 + apart + TEN, 500.0 + TEN)
    stamps, moved, remarks = scan_and_odometry_times(scans, odometry)
    if repaired:
        assert stamps == pytest.approx(500.0 + TEN)
        assert moved == pytest.approx(500.0 + TEN)
        (remark,) = remarks
        assert (remark.action, remark.what, remark.count) == ("repaired", "stamps", 10)
        assert "1.1 s apart" in remark.why
    else:
        assert stamps.tolist() == scans.header.tolist()
        assert moved.tolist() == odometry.header.tolist()
        assert remarks == []


def test_a_sensor_without_a_clock_takes_the_recorders() -> None:
    scans, odometry = times(np.zeros(10), 500.0 + TEN), times(100.0 + np.arange(20.0), 500.0 + np.arange(20.0))
    stamps, moved, (remark,) = scan_and_odometry_times(scans, odometry)
    assert stamps.tolist() == scans.recorded.tolist()
    assert moved == pytest.approx(odometry.recorded)
    assert (remark.action, remark.count) == ("repaired", 10)
    assert "recording" in remark.why
    # Where the recorder's stands, there is nothing better.
    stands = Times(np.zeros(10), np.full(10, 5.0))
    stamps, _, remarks = scan_and_odometry_times(stands, odometry)
    assert stamps.tolist() == [0.0] * 10
    assert remarks == []


def test_few_stamps_that_are_not_set_are_filled_and_counted() -> None:
    header = np.where((TEN == 3) | (TEN == 7), 0.0, 100.0 + TEN)
    odometry = np.where(TEN == 1, 0.0, 100.0 + TEN)
    stamps, moved, (remark,) = scan_and_odometry_times(times(header, 100.3 + TEN), times(odometry, 100.3 + TEN))
    assert stamps == pytest.approx(100.0 + TEN)
    assert moved == pytest.approx(100.0 + TEN)
    assert remark.count == 3


@given(st.lists(st.floats(0, 100), max_size=12))
def test_stamps_run_forwards_by_what_they_ran_forwards_before(values: list[float]) -> None:
    stamps, remarks = forward(np.array(values))
    assert len(stamps) == len(values)
    expected = values[:1]
    for a, b in pairwise(values):
        expected.append(expected[-1] + max(b - a, 0.0))
    assert stamps == pytest.approx(expected)
    back = sum(b < a for a, b in pairwise(values))
    assert [remark.count for remark in remarks] == ([back] if back else [])


@pytest.mark.parametrize(
    ("usual", "pause", "is_gap"), [(0.1, 0.9, False), (0.1, 1.1, True), (0.5, 2.4, False), (0.5, 2.6, True)]
)
def test_a_gap_is_a_second_and_five_times_the_usual_step(usual: float, pause: float, is_gap: bool) -> None:
    stamps = np.concatenate((usual * TEN, usual * 9 + pause + usual * TEN))
    gaps = find_gaps(stamps)
    assert len(gaps) == is_gap
    if is_gap:
        assert gaps[0] == pytest.approx([usual * 9, pause])
    assert find_gaps(stamps[:1]).shape == find_gaps(np.zeros(0)).shape == (0, 2)
