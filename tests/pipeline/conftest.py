from collections.abc import Callable

import pytest

from closedrooms.worlds.plan import FloorPlan


@pytest.fixture
def flat(three_rooms: Callable[..., FloorPlan]) -> FloorPlan:
    """Three rooms at a corridor, every wall 0.2 m thick; d2 has 0.7 m."""
    return three_rooms("flat", outer_walls=0.2, d2=0.7)
