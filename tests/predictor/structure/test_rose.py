"""Directions and walls in the spectrum of a map, and what follows from given ones."""

import math

import numpy as np
import pytest

from closedrooms.core.grid import FREE, OCCUPIED, GridFrame, OccupancyGrid
from closedrooms.predictor.config import LinesConfig
from closedrooms.predictor.structure.clutter import filter_clutter
from closedrooms.predictor.structure.rose import (
    RoseStructure,
    _between,
    _centred,
    _keep_bands,
    find_rose,
    rose_directions,
)


def walls(degrees, size=200):
    """Two long walls across each other, turned."""
    frame = GridFrame(0.05, -size * 0.025, -size * 0.025, size, size)
    points = frame.to_points(np.stack(np.indices(frame.shape), axis=-1))
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    u, v = points @ np.array([c, s]), points @ np.array([-s, c])
    near = ((np.abs(v) < 0.05) & (np.abs(u) < 4.0)) | ((np.abs(u - 1.0) < 0.05) & (np.abs(v) < 2.5))
    return OccupancyGrid(frame, np.where(near, OCCUPIED, FREE).astype(np.int8))


@pytest.mark.parametrize("degrees", [0.0, 10.0, 30.0, 75.0])
def test_two_directions_are_found_the_one_with_more_wall_first(degrees):
    found = find_rose(walls(degrees))
    assert found is not None
    assert len(found.angles) == 2
    for angle, expected in zip(np.degrees(found.angles), (degrees, degrees + 90.0), strict=True):
        assert abs((angle - expected + 90.0) % 180.0 - 90.0) < 0.6
    grid = walls(degrees)
    assert (found.structural <= grid.occupied).all()
    assert found.structural.sum() > 0.8 * grid.occupied.sum()


def test_a_map_without_two_directions_has_no_structure_and_keeps_its_clutter():
    frame = GridFrame(0.05, 0.0, 0.0, 100, 100)
    cells = np.full(frame.shape, FREE, dtype=np.int8)
    cells[50, 50] = OCCUPIED
    assert find_rose(OccupancyGrid(frame, cells)) is None
    single = OccupancyGrid(frame, cells)
    assert filter_clutter(single) is single
    unknown = OccupancyGrid(frame, np.full(frame.shape, -1, dtype=np.int8))
    assert filter_clutter(unknown) is unknown


def test_the_magnitude_has_frequency_zero_in_its_middle():
    picture = np.random.default_rng(0).random((64, 64)).astype(np.float32)
    spectrum = np.fft.fft2(picture).astype(np.complex64)
    assert _centred(spectrum) == pytest.approx(np.abs(np.fft.fftshift(spectrum)), rel=1e-5)


def test_bands_keep_what_lies_within_two_and_a_half_bins_of_a_line():
    for angles in ([0.0], [math.pi / 2], [0.3, 1.2]):
        spectrum = np.ones((64, 64), dtype=np.complex64)
        _keep_bands(spectrum, np.array(angles))
        fy, fx = np.meshgrid(*[np.fft.fftfreq(64) * 64] * 2, indexing="ij")
        near = [np.abs(math.cos(a) * fy - math.sin(a) * fx) <= 2.5 for a in angles]
        assert ((spectrum != 0) == np.any(near, axis=0)).all()


def test_a_peak_lies_at_the_top_of_the_parabola_through_it_and_its_neighbours():
    x = np.arange(20.0)
    for top in (7.0, 7.3, 6.6):
        assert _between(5.0 - (x - top) ** 2, 7) == pytest.approx(top)
    # Around the seam, and where it is flat.
    seam = np.array([4.0, 1.0, 0.0, 0.0, 1.0, 3.0])
    assert _between(seam, 0) == pytest.approx(0.5 * (3.0 - 1.0) / (3.0 - 8.0 + 1.0))
    assert _between(np.ones(6), 3) == 3.0


def segment(degrees, length, x=0.0):
    angle = math.radians(degrees)
    return [x, 0.0, x + length * math.cos(angle), length * math.sin(angle)]


def test_segments_follow_the_nearest_direction_and_directions_are_ordered_by_their_walls():
    structure = RoseStructure(np.radians([0.0, 45.0, 90.0]), np.zeros((1, 1), dtype=np.bool_))
    width = math.degrees(LinesConfig().angle_bandwidth)
    segments = np.array([
        segment(0.5, 2.0), segment(179.5, 1.0), segment(90.0 - 0.9 * width, 4.0), segment(90.0 - 1.1 * width, 9.0),
        segment(90.0 + 0.9 * width, 1.0),
    ])  # fmt: skip
    found = rose_directions(segments, structure, LinesConfig())
    assert np.degrees(found.angles) == pytest.approx([90.0, 0.0])
    assert found.labels.tolist() == [1, 1, 0, -1, 0]
    # Of two with as much wall the smaller angle goes first.
    tied = rose_directions(np.array([segment(90.0, 2.0), segment(0.0, 2.0)]), structure, LinesConfig())
    assert np.degrees(tied.angles) == pytest.approx([0.0, 90.0])
