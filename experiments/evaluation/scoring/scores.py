"""How far a prediction is from the truth: per hidden room and for the hidden area as a whole."""

import importlib
from collections.abc import Callable, Sequence
from functools import cache
from typing import Any

import numpy as np
import numpy.typing as npt

from closedrooms.core.arrays import BoolArray, FloatArray, IntArray
from closedrooms.core.grid import GridFrame, OccupancyGrid
from closedrooms.core.room import Room
from closedrooms.core.runtime.compiled import load_compiled
from closedrooms.core.shapes import cells_inside
from closedrooms.experiments.evaluation.scoring.watershed import flood

# Figures of one sample and one method by their names, as ``scores.json`` holds them.
Scores = dict[str, Any]
# How hidden rooms are told apart on a true map, as measured on the authors' maps (cells of 0.05 m there): closing of
# the hidden area, least distance of a seed from its edge, least area of a room.
CLOSING, SEED_DEPTH, MIN_AREA = 0.10, 0.45, 1.0
# Smallest piece of a completed map that counts as one of its rooms [m2].
MIN_PIECE = 0.25


def hidden_area(observed: OccupancyGrid, truth: OccupancyGrid) -> BoolArray:
    """Find cells free in ``truth``, unknown in ``observed`` (same frame), closed with a 0.1 m disc; walls stay walls.

    Closing alone joins rooms through thin walls.
    """
    import cv2

    radius = max(1, round(CLOSING / observed.frame.resolution))
    y, x = np.ogrid[-radius : radius + 1, -radius : radius + 1]
    disc = (x * x + y * y <= radius * radius).astype(np.uint8)
    area = (truth.free & observed.unknown).astype(np.uint8)
    return np.asarray(cv2.morphologyEx(area, cv2.MORPH_CLOSE, disc) > 0) & ~truth.occupied


def split_hidden_area(area: BoolArray, resolution: float) -> list[BoolArray]:
    """Split a hidden area into rooms: watershed of its distance transform, a seed for each part deeper than 0.45 m.

    Args:
        area: Hidden cells, shape (rows, cols).
        resolution: Metres per cell.

    Returns:
        One mask a room of at least 1 m2, each of the shape of ``area``.
    """
    import cv2

    if not area.any():
        return []
    distance = cv2.distanceTransform(area.astype(np.uint8), cv2.DIST_L2, 5)
    _, seeds = cv2.connectedComponents((distance > SEED_DEPTH / resolution).astype(np.uint8), connectivity=8)
    return _pieces(flood(-distance, seeds, area), MIN_AREA / resolution**2)


def added_rooms(observed: OccupancyGrid, completed: OccupancyGrid) -> list[BoolArray]:
    """Find the rooms of somebody's completed map: connected cells (4 neighbours) free there and unknown before."""
    import cv2

    _, labels = cv2.connectedComponents((completed.free & observed.unknown).astype(np.uint8), connectivity=4)
    return _pieces(np.asarray(labels), MIN_PIECE / observed.frame.resolution**2)


def _pieces(labels: npt.NDArray[Any], least: float) -> list[BoolArray]:
    """List the masks of labels from 1 with at least so many cells."""
    sizes = np.bincount(labels.ravel())
    return [labels == number for number in range(1, sizes.size) if sizes[number] >= least]


def room_masks(rooms: Sequence[Room], frame: GridFrame) -> list[BoolArray]:
    """Find the cells whose centre lies in each room, one mask a room, shape ``frame.shape``."""
    return [cells_inside(room.polygon, frame) for room in rooms]


def matched_iou(truth: Sequence[BoolArray], predicted: Sequence[BoolArray]) -> FloatArray:
    """Measure the IoU of each true room with the predicted room matched to it, 0 without one.

    One-to-one, so that the sum of the IoU is largest (Hungarian method).

    Args:
        truth: Masks of the hidden rooms.
        predicted: Masks of the predicted rooms, restricted to cells unknown in the map.
    """
    figures = np.zeros(len(truth))
    if not len(truth) or not len(predicted):
        return figures
    sizes = [np.array([np.count_nonzero(mask) for mask in masks]) for masks in (truth, predicted)]
    common = np.array([[np.count_nonzero(room & other) for other in predicted] for room in truth])
    union = sizes[0][:, None] + sizes[1][None] - common
    table = np.where(union > 0, common / np.maximum(union, 1), 1.0)
    rows, cols = _assignment()(-table)
    figures[rows] = table[rows, cols]
    return figures


@cache
def _assignment() -> Callable[[FloatArray], tuple[IntArray, IntArray]]:
    """Load the assignment of least cost without the rest of scipy.optimize, which takes 0.2 s to be imported."""
    compiled = load_compiled("scipy.optimize._lsap", "linear_sum_assignment")
    if compiled is None:
        compiled = importlib.import_module("scipy.optimize")
    assign: Callable[[FloatArray], tuple[IntArray, IntArray]] = compiled.linear_sum_assignment
    return assign


def iou(a: BoolArray, b: BoolArray) -> float:
    """Measure the intersection over union of two masks, 1 when both are empty."""
    union = np.count_nonzero(a | b)
    return float(np.count_nonzero(a & b) / union) if union else 1.0


def union_of(masks: Sequence[BoolArray], shape: tuple[int, int]) -> BoolArray:
    """Join masks into all cells of any of them."""
    total = np.zeros(shape, dtype=np.bool_)
    for mask in masks:
        total |= mask
    return total
