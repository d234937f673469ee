import numpy as np
import pytest
from shapely import affinity
from shapely.geometry import box

from closedrooms.core.grid import FREE, GridFrame, OccupancyGrid
from closedrooms.core.room import Room
from closedrooms.predictor.absurd_rooms import LONGEST, NARROWEST, leave_absurd

# A map of 200 m2 of floor.
FLOOR = OccupancyGrid(GridFrame(0.5, 0.0, 0.0, 20, 40), np.full((20, 40), FREE, dtype=np.int8))


@pytest.mark.parametrize(
    ("width", "length", "word"),
    [
        (NARROWEST - 0.02, 3.0, "less than 0.6 m wide"),
        (NARROWEST + 0.02, 3.0, None),
        (3.0, LONGEST + 1.0, "a strip of 25 x 3.0 m"),
        (3.0, LONGEST - 1.0, None),
        (7.0, LONGEST + 1.0, None),
        (14.0, 14.2, None),
        (14.2, 14.2, "larger than all floor"),
    ],
)
@pytest.mark.parametrize("angle", [0.0, 33.0])
def test_rooms_that_no_building_has_are_left_out_with_a_reason(width, length, word, angle):
    odd = Room(affinity.rotate(box(0.0, 0.0, width, length), angle), ("odd",), "independent", 1.0)
    usual = Room(box(0.0, 0.0, 4.0, 3.0), ("usual", "other"), "independent", 1.0)
    kept, reasons = leave_absurd([odd, usual], FLOOR)
    assert kept == ([usual] if word else [odd, usual])
    assert list(reasons) == (["odd"] if word else [])
    assert word is None or word in reasons["odd"]


def test_behind_a_small_map_there_may_be_more_than_it_shows():
    begun = OccupancyGrid(GridFrame(0.5, 0.0, 0.0, 2, 20), np.full((2, 20), FREE, dtype=np.int8))
    hall = Room(box(0.0, 0.0, 10.0, 9.0), ("hall",), "independent", 1.0)
    assert leave_absurd([hall], begun) == ([hall], {})
