"""Doors that lie where no door can be."""

import math

import numpy as np
import pytest

from closedrooms.core.door import ClosedDoor
from closedrooms.core.files.rosmap import RosMap
from closedrooms.core.grid import FREE, OCCUPIED, UNKNOWN, GridFrame, OccupancyGrid
from closedrooms.core.pose import IDENTITY, Pose2
from closedrooms.pipeline.given_doors import misplaced_doors


def hall(map_T_grid: Pose2 = IDENTITY) -> RosMap:
    """A hall of 8 x 4 m, its walls seen but for 2 m of the upper one."""
    cells = np.full((100, 180), UNKNOWN, dtype=np.int8)
    cells[9:91, 9:171] = OCCUPIED
    cells[10:90, 10:170] = FREE
    cells[90, 50:90] = UNKNOWN
    return RosMap(OccupancyGrid(GridFrame(0.05, -0.5, -0.5, 100, 180), cells), map_T_grid)


@pytest.mark.parametrize("place", [(0.0, 2.0), (3.0, 4.0), (4.0, -0.3), (0.3, 1.0), (7.6, 2.0), (-0.49, 4.4)])
def test_doors_at_walls_and_unknown_space_are_not_spoken_of(place: tuple[float, float]) -> None:
    assert misplaced_doors(hall(), [ClosedDoor("d", place)]) == []


def test_doors_in_the_middle_of_free_space_are_told_with_their_distance() -> None:
    doors = [ClosedDoor("near", (0.1, 2.0)), ClosedDoor("far", (4.0, 0.7)), ClosedDoor("middle", (4.0, 1.2))]
    (remark,) = misplaced_doors(hall(), doors)
    assert (remark.action, remark.names, remark.loss) == ("guessed", ("far", "middle"), False)
    assert remark.why.startswith("up to 1.2 m from any wall")


@pytest.mark.parametrize("place", [(80.0, 20.0), (2.0, 4.6), (7.0, -45.0), (-0.6, 1.0), (1e6, 1e6)])
def test_doors_beside_the_map_are_told_with_its_bounds(place: tuple[float, float]) -> None:
    (remark,) = misplaced_doors(hall(), [ClosedDoor("in", (0.0, 2.0)), ClosedDoor("out", place)])
    assert remark.names == ("out",)
    assert "x is -0.5 to 8.5 m and y -0.5 to 4.5 m" in remark.why


def test_the_bounds_are_those_of_the_map_frame() -> None:
    (remark,) = misplaced_doors(hall(Pose2(10.0, 20.0, math.pi / 2)), [ClosedDoor("out", (50.0, 2.0))])
    assert "x is 5.5 to 10.5 m and y 19.5 to 28.5 m" in remark.why
