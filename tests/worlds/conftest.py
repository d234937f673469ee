from pathlib import Path

import pytest
from shapely.geometry import box

from closedrooms.worlds.plan import FloorPlan, Opening, PlanDoor, PlanRoom, Wall

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
def small() -> FloorPlan:
    """A corridor of 12 x 2 m below three rooms of 4 x 3 m; the second also has a door to the third.

    r0 corridor, r1 (door d0), r2 (doors d1 and d2 to r3), r3 (opening o0); outer walls 0.3 m, inner ones 0.2 m.
    """
    outer = [((0, 0), (12, 0)), ((12, 0), (12, 5)), ((0, 5), (12, 5)), ((0, 0), (0, 5))]
    inner = [((0, 2), (12, 2)), ((4, 2), (4, 5)), ((8, 2), (8, 5))]
    walls = [Wall(f"w{i}", s, 0.3) for i, s in enumerate(outer)] + [
        Wall(f"w{i + 4}", s, 0.2) for i, s in enumerate(inner)
    ]
    return FloorPlan(
        name="small",
        rooms=(
            PlanRoom("r0", "corridor", box(0, 0, 12, 2)),
            PlanRoom("r1", "office", box(0, 2, 4, 5)),
            PlanRoom("r2", "office", box(4, 2, 8, 5)),
            PlanRoom("r3", "office", box(8, 2, 12, 5)),
        ),
        walls=tuple(walls),
        doors=(
            PlanDoor("d0", ((1.5, 2.0), (2.4, 2.0)), ("r0", "r1"), opens_into="r1"),
            PlanDoor("d1", ((5.5, 2.0), (6.4, 2.0)), ("r0", "r2"), opens_into="r2"),
            PlanDoor("d2", ((8.0, 3.0), (8.0, 3.9)), ("r2", "r3"), opens_into="r2"),
        ),
        openings=(Opening("o0", ((9.0, 2.0), (10.5, 2.0)), ("r0", "r3")),),
        start=(3.0, 1.0, 0.0),
    )
