"""The space that a map does not show, as its true map has it, and how much of that a method predicts."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from closedrooms.core.arrays import BoolArray
from closedrooms.core.grid import OccupancyGrid
from closedrooms.experiments.evaluation.scoring.scores import (
    Scores,
    hidden_area,
    iou,
    matched_iou,
    split_hidden_area,
    union_of,
)


@dataclass(frozen=True, slots=True, eq=False)
class HiddenSpace:
    """Free space of a true map that is unknown in the observed one: the same for every method.

    Attributes:
        area: Its cells, of the shape of the map.
        rooms: The same split into rooms, one mask a room.
        share: Its part of all that is free in the true map, 0..1.
    """

    area: BoolArray
    rooms: list[BoolArray]
    share: float

    def score(self, masks: Sequence[BoolArray]) -> Scores:
        """Score predicted rooms against the hidden ones.

        Args:
            masks: Cells of each predicted room that are unknown in the observed map, of the shape of the map.

        Returns:
            ``matched``, the IoU of each hidden room with the predicted one matched to it, and ``area``, the IoU of all.
        """
        return {
            "matched": [round(float(figure), 6) for figure in matched_iou(self.rooms, masks)],
            "area": round(iou(self.area, union_of(masks, self.area.shape)), 6),
        }


def find_hidden_space(observed: OccupancyGrid, truth: OccupancyGrid) -> HiddenSpace:
    """Find the free space of ``truth`` that is unknown in ``observed``, on the same frame."""
    area = hidden_area(observed, truth)
    rooms = split_hidden_area(area, observed.frame.resolution)
    free = int(np.count_nonzero(truth.free))
    return HiddenSpace(area, rooms, int(np.count_nonzero(area)) / max(free, 1))
