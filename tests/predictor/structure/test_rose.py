"""Directions and walls in the spectrum of a map, and what follows from given ones."""

import math

import numpy as np
import pytest

from closedrooms.core.grid import FREE, OCCUPIED, UNKNOWN, GridFrame, OccupancyGrid
from closedrooms.predictor.config import LinesConfig
from closedrooms.predictor.structure.clutter import filter_clutter
from closedrooms.predictor.structure.rose import (
    RoseStructure,
    _between,
    _centred,
    _dominant,
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


def rays(*degrees, size=256, weights=None, halves=(1, -1)):
    """A spectrum that is large along some directions, to both sides of its origin, frequency 0 at (0, 0)."""
    fy, fx = np.meshgrid(*[np.fft.fftfreq(size) * size] * 2, indexing="ij")
    magnitude = np.full((size, size), 0.01)
    for number, angle in enumerate(map(math.radians, degrees)):
        along, across = fx * math.cos(angle) + fy * math.sin(angle), fy * math.cos(angle) - fx * math.sin(angle)
        near = (np.abs(across) < 1.5) & np.isin(np.sign(along), halves) & (np.hypot(fx, fy) < size / 2)
        magnitude[near] += 1.0 if weights is None else weights[number]
    # As many as there are occupied cells: it lies in no direction.
    magnitude[0, 0] = 3000.0
    return magnitude.astype(np.complex64)


def test_directions_are_those_along_which_the_magnitude_peaks_the_strongest_first():
    found = np.degrees(_dominant(rays(20.0, 110.0, 65.0, weights=(1.0, 3.0, 2.0))))
    assert found == pytest.approx([110.0, 65.0, 20.0], abs=0.5)
    assert np.degrees(_dominant(rays(0.0, 90.0, weights=(2.0, 1.0)))) == pytest.approx([0.0, 90.0], abs=0.5)
    assert _dominant(np.full((64, 64), 1.0, dtype=np.complex64)).size == 0


def test_a_peak_needs_one_opposite_and_a_fifth_of_the_range():
    assert np.degrees(_dominant(rays(20.0, 110.0) + rays(65.0, halves=(1,)))) == pytest.approx([20.0, 110.0], abs=0.5)
    for weight, counts in ((0.15, False), (0.3, True)):
        found = _dominant(rays(20.0, 110.0, 65.0, weights=(1.0, 1.0, weight)))
        assert len(found) == (3 if counts else 2)


def test_opposite_peaks_may_be_a_tenth_of_a_radian_off_and_what_is_nearer_is_one_direction():
    # 0.1 rad are 5.73 degrees. Ahead at 20, behind at so much more; a second direction that is whole.
    for off, paired in ((5.0, True), (7.0, False)):
        both = rays(20.0, halves=(1,)) + rays(20.0 + off, halves=(-1,)) + rays(110.0, weights=(2.0,))
        assert len(_dominant(both)) == (2 if paired else 1)
    assert len(_dominant(rays(20.0, 25.0))) == 1
    assert len(_dominant(rays(20.0, 27.0))) == 2


@pytest.mark.parametrize("degrees", [0.0, 30.0])
def test_structural_cells_answer_with_a_share_of_the_strongest_to_the_bands_of_the_spectrum(degrees):
    # With clutter, which answers weakly.
    grid = walls(degrees)
    rng = np.random.default_rng(1)
    cells = np.where(rng.random(grid.frame.shape) < 0.01, OCCUPIED, grid.cells).astype(np.int8)
    grid = OccupancyGrid(grid.frame, cells)
    found = find_rose(grid)
    size = 216  # the smallest even size from 201 on with small prime factors
    occupied = np.zeros((size, size))
    occupied[:200, :200] = grid.occupied
    fy, fx = np.meshgrid(*[np.fft.fftfreq(size) * size] * 2, indexing="ij")
    normals = found.angles - np.pi / 2
    band = np.any([np.abs(np.cos(a) * fy - np.sin(a) * fx) <= 2.5 for a in normals], axis=0)
    response = np.abs(np.fft.ifft2(np.fft.fft2(occupied) * band))[:200, :200] * grid.occupied
    expected = grid.occupied & (response >= 0.18 * response.max())
    assert (found.structural != expected).sum() <= 2
    assert 0 < expected.sum() < 0.9 * grid.occupied.sum()


def test_clutter_goes_where_it_does_not_hang_together_with_a_wall():
    grid = walls(0.0)
    cells = grid.cells.copy()
    # A thing far from the walls, one that touches one, and unknown cells, which stay; in a frame with a margin.
    cells[30:32, 30:32] = OCCUPIED
    cells[101:106, 40:44] = OCCUPIED
    cells[190:, :] = UNKNOWN
    grid = OccupancyGrid(grid.frame, cells)
    wide = grid.on(grid.frame.cropped(-5, -7, 220, 230))
    cleared = filter_clutter(wide)
    assert cleared.frame == wide.frame
    expected = wide.cells.copy()
    expected[35:37, 37:39] = FREE
    assert np.array_equal(cleared.cells, expected)
