from collections.abc import Callable
from pathlib import Path

import pytest

from closedrooms.worlds.plan import FloorPlan

FIXTURES = Path(__file__).parents[1] / "fixtures"
SHARED = Path(__file__).parents[2].parent / "shared" / "data"


@pytest.fixture
def fixtures() -> Path:
    return FIXTURES


@pytest.fixture
def shared() -> Path:
    if not SHARED.is_dir():
        pytest.skip(f"the shared data are not at {SHARED}")
    return SHARED


@pytest.fixture
def small(three_rooms: Callable[..., FloorPlan]) -> FloorPlan:
    """Three rooms at a corridor, outer walls 0.3 m thick; d2 has 0.9 m."""
    return three_rooms("small", outer_walls=0.3, d2=0.9)
