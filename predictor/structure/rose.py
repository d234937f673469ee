"""Dominant directions and structural cells from the spectrum of a map (ROSE; paper, section 4.2)."""

import itertools
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from closedrooms.core.arrays import BoolArray, FloatArray
from closedrooms.core.grid import OccupancyGrid
from closedrooms.predictor.config import LinesConfig
from closedrooms.predictor.paper.directions import Directions, angle_between
from closedrooms.predictor.paper.segments import angles_of, lengths_of
from closedrooms.predictor.structure.fourier import Spectrum, quick_size, transform, transform_back
from closedrooms.predictor.structure.peaks import find_circular_peaks

# As published: a peak's prominence in the range of the profile; how far from pi apart a pair of opposite peaks may
# be [rad]; half width of the spectral band [bins]; the share of the largest response that makes a cell structural.
PROMINENCE, PAIR_TOLERANCE, BAND, STRUCTURAL = 0.2, 0.1, 2.5, 0.18
# Directions sampled around the circle: half a degree, finer than the width of any peak.
BINS = 720
# A profile that varies less than this share of its largest value has no direction: a map of single cells.
FLAT = 0.05


@dataclass(frozen=True, slots=True, eq=False)
class RoseStructure:
    """Directions and structure that the spectrum shows of a map.

    Attributes:
        angles: Dominant directions of walls in [0, pi) [rad], strongest first, shape (k,), k >= 2.
        structural: Occupied cells that belong to straight walls of these directions, shape of the grid.
    """

    angles: FloatArray
    structural: BoolArray


def find_rose(grid: OccupancyGrid) -> RoseStructure | None:
    """Find the dominant directions and structural cells of a map.

    A straight wall is a line through the centre of the spectrum, perpendicular to the wall: the magnitude summed
    along each direction peaks there. Keeping a narrow band around these lines and going back leaves the walls.

    Args:
        grid: The map, cropped to what is known.

    Returns:
        ``None`` where fewer than two directions stand out: nothing can then be told from clutter.
    """
    occupied = grid.occupied
    size = quick_size(max(max(occupied.shape) + 1, 64))
    size += size % 2
    padded = np.zeros((size, size), dtype=np.float32)
    padded[: occupied.shape[0], : occupied.shape[1]] = occupied
    spectrum = transform(padded)
    del padded
    normals = _dominant(spectrum)
    if normals.size < 2:
        return None
    _keep_bands(spectrum, normals)
    kept = transform_back(spectrum)
    del spectrum
    response = np.abs(kept[: occupied.shape[0], : occupied.shape[1]][occupied])
    structural = occupied.copy()
    structural[occupied] = response >= STRUCTURAL * response.max(initial=0.0)
    return RoseStructure((normals + np.pi / 2) % np.pi, structural)


def _keep_bands(spectrum: Spectrum, normals: FloatArray) -> None:
    """Clear a spectrum but for a narrow band around the lines through its origin along some normals."""
    size = spectrum.shape[0]
    frequencies = np.roll(np.arange(size) - size // 2, -(size // 2))
    for row, frequency in enumerate(frequencies):
        outside = np.ones(size, dtype=np.bool_)
        for normal in normals:  # distance of (fy, fx) from the line
            outside &= np.abs(np.cos(normal) * frequency - np.sin(normal) * frequencies) > BAND
        spectrum[row, outside] = 0.0


def _centred(spectrum: Spectrum) -> npt.NDArray[np.float32]:
    """Compute the magnitude, frequency 0 in the middle."""
    size, middle = spectrum.shape[0], spectrum.shape[0] // 2
    magnitude = np.empty((size, size), dtype=np.float32)
    halves = (slice(None, middle), slice(middle, None))
    for rows, cols in itertools.product((0, 1), (0, 1)):
        np.abs(spectrum[halves[rows], halves[cols]], out=magnitude[halves[1 - rows], halves[1 - cols]])
    return magnitude


def _dominant(spectrum: Spectrum) -> FloatArray:
    """Find directions in [0, pi) [rad] along which the magnitude sums to a peak, strongest first, shape (k,)."""
    import cv2

    size = spectrum.shape[0]
    centre = float(size // 2)
    polar = cv2.warpPolar(_centred(spectrum), (size // 2, BINS), (centre, centre), centre, cv2.WARP_POLAR_LINEAR)
    profile = polar[:, 2:].sum(axis=1).astype(np.float64)  # (BINS,); the centre itself has no direction
    if np.ptp(profile) < FLAT * profile.max():
        return np.zeros(0)
    peaks = find_circular_peaks(profile, PROMINENCE * float(np.ptp(profile)))
    refined = np.array([_between(profile, int(p)) for p in peaks]) * 2 * np.pi / BINS
    directions: list[float] = []
    for i in np.argsort(-profile[peaks], kind="stable"):
        opposite = np.abs(refined % (2 * np.pi) - (refined[i] + np.pi) % (2 * np.pi))
        paired = np.minimum(opposite, 2 * np.pi - opposite).min() <= PAIR_TOLERANCE
        known = any(abs(float(angle_between(refined[i], other))) <= PAIR_TOLERANCE for other in directions)
        if paired and not known:
            directions.append(float(refined[i] % np.pi))
    return np.array(directions)


def _between(profile: FloatArray, peak: int) -> float:
    """Find the place of a peak between its bins, by the parabola through it and its neighbours."""
    left, middle, right = (float(profile[(peak + step) % profile.size]) for step in (-1, 0, 1))
    curve = left - 2.0 * middle + right
    return peak if curve >= 0.0 else peak + 0.5 * (left - right) / curve


def rose_directions(segments: FloatArray, structure: RoseStructure, config: LinesConfig) -> Directions:
    """Assign each segment the dominant direction that it follows (section 4.2: lines are aligned to them).

    Args:
        segments: Ends [m] of segments found in the structural cells, shape (n, 4).
        structure: Of the same map.
        config: The kernel of the directions.
    """
    angles, lengths = angles_of(segments), lengths_of(segments)
    apart = np.abs(angle_between(angles[:, None], structure.angles[None, :]))  # (n, k)
    labels = np.where(apart.min(axis=1) <= config.angle_bandwidth, apart.argmin(axis=1), -1)
    strengths = np.zeros(structure.angles.size)
    np.add.at(strengths, labels[labels >= 0], lengths[labels >= 0])
    order = np.lexsort((structure.angles, -strengths))
    order = order[strengths[order] > 0.0]
    rank = np.full(structure.angles.size + 1, -1, dtype=np.int64)
    rank[order] = np.arange(order.size)
    return Directions(structure.angles[order], rank[labels])
