import pytest
from shapely.geometry import box

from closedrooms.worlds.plan import FloorPlan, Opening, PlanDoor, PlanRoom, Wall


@pytest.fixture
def flat() -> FloorPlan:
    """A corridor of 12 x 2 m below three rooms of 4 x 3 m: doors of 0.9 m (d0, d1) and 0.7 m (d2), an opening (o0).

    r0 is the corridor, d0 leads to r1, d1 to r2, o0 (1.5 m) to r3, d2 from r2 to r3.
    """
    outer = [((0, 0), (12, 0)), ((12, 0), (12, 5)), ((0, 5), (12, 5)), ((0, 0), (0, 5))]
    inner = [((0, 2), (12, 2)), ((4, 2), (4, 5)), ((8, 2), (8, 5))]
    walls = [Wall(f"w{i}", s, 0.2) for i, s in enumerate([*outer, *inner])]
    return FloorPlan(
        name="flat",
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
            PlanDoor("d2", ((8.0, 3.0), (8.0, 3.7)), ("r2", "r3"), opens_into="r2"),
        ),
        openings=(Opening("o0", ((9.0, 2.0), (10.5, 2.0)), ("r0", "r3")),),
        start=(3.0, 1.0, 0.0),
    )
