"""Small worlds for whole datasets."""

from collections.abc import Callable
from pathlib import Path

import pytest
from shapely.geometry import box

from closedrooms.worlds.formats.native import write_plan
from closedrooms.worlds.plan import FloorPlan, PlanDoor, PlanRoom, Wall


def _write_world(folder: Path, name: str, width: float) -> Path:
    """A corridor with two rooms of ``width`` [m]."""
    w = width
    rooms = (
        PlanRoom("corridor", "corridor", box(0, 0, 2 * w, 2)),
        PlanRoom("left", "office", box(0, 2, w, 5)),
        PlanRoom("right", "office", box(w, 2, 2 * w, 5)),
    )
    lines = [
        ((0, 0), (2 * w, 0)), ((2 * w, 0), (2 * w, 5)), ((2 * w, 5), (0, 5)), ((0, 5), (0, 0)), ((0, 2), (2 * w, 2)),
        ((w, 2), (w, 5)),
    ]  # fmt: skip
    walls = tuple(
        Wall(f"w{i}", ((float(a[0]), float(a[1])), (float(b[0]), float(b[1]))), 0.12) for i, (a, b) in enumerate(lines)
    )
    doors = (
        PlanDoor("d1", ((w / 2, 2.0), (w / 2 + 0.9, 2.0)), ("corridor", "left"), opens_into="left"),
        PlanDoor("d2", ((1.5 * w, 2.0), (1.5 * w + 0.9, 2.0)), ("corridor", "right"), opens_into="right"),
    )
    path = folder / f"{name}.json"
    write_plan(path, FloorPlan(name, rooms, walls, doors, (), (w, 1.0, 0.0)))
    return path


@pytest.fixture(scope="session")
def write_world() -> Callable[[Path, str, float], Path]:
    return _write_world


@pytest.fixture(scope="session")
def worlds(tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    folder = tmp_path_factory.mktemp("worlds")
    return [str(_write_world(folder, name, width)) for name, width in (("a", 3.0), ("b", 3.4), ("c", 3.8))]
