"""The floor plan: model, geometry, validation, closing, start pose, true map, library.

The names below are loaded when they are first used, so that importing this package stays quick.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from closedrooms.worlds.closing import check_closed, closable_rooms, draw_closed
    from closedrooms.worlds.formats.native import read_plan, write_plan
    from closedrooms.worlds.generation.generator import generate
    from closedrooms.worlds.library import DEFAULT_WORLD, bundled_names, distinct_names, load_world, read_world
    from closedrooms.worlds.plan import FloorPlan, Furniture, Opening, PlanDoor, PlanRoom, Wall
    from closedrooms.worlds.start_pose import start_pose
    from closedrooms.worlds.truth import rasterise, reachable, true_rooms, truth_bounds
    from closedrooms.worlds.validation import validate

_HOMES = {
    "closing": ("check_closed", "closable_rooms", "draw_closed"),
    "formats.native": ("read_plan", "write_plan"),
    "generation.generator": ("generate",),
    "library": ("DEFAULT_WORLD", "bundled_names", "distinct_names", "load_world", "read_world"),
    "plan": ("FloorPlan", "Furniture", "Opening", "PlanDoor", "PlanRoom", "Wall"),
    "start_pose": ("start_pose",),
    "truth": ("rasterise", "reachable", "true_rooms", "truth_bounds"),
    "validation": ("validate",),
}
_HOME_OF = {name: home for home, names in _HOMES.items() for name in names}

__all__ = [
    "DEFAULT_WORLD", "FloorPlan", "Furniture", "Opening", "PlanDoor", "PlanRoom", "Wall", "bundled_names",
    "check_closed", "closable_rooms", "distinct_names", "draw_closed", "generate", "load_world", "rasterise",
    "reachable", "read_plan", "read_world", "start_pose", "true_rooms", "truth_bounds", "validate", "write_plan",
]  # fmt: skip


def __getattr__(name: str) -> Any:
    if name in _HOME_OF:
        return getattr(import_module(f"{__name__}.{_HOME_OF[name]}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
