"""The floor plan: ``plan`` is the model, ``library`` finds worlds by name or file.

- Right or not: ``validation``, ``connectivity``.
- Walls and doors: ``geometry``, ``wall_assembly``, ``door_hinges``, ``boxes``, ``extrusion``.
- For a run: ``ways_out`` (walled up), ``closing``, ``start_pose``, ``truth`` (the true map and rooms).
- ``formats/`` reads and writes other people's plans, ``generation/`` makes new ones, ``plans/`` holds the bundled.

``start_pose.start_pose`` is named like its module and so stands there.
"""

from typing import TYPE_CHECKING

from closedrooms.core.runtime.lazy import lazy_face

if TYPE_CHECKING:
    from closedrooms.worlds.closing import check_closed as check_closed
    from closedrooms.worlds.closing import closable_rooms as closable_rooms
    from closedrooms.worlds.closing import draw_closed as draw_closed
    from closedrooms.worlds.formats.native import read_plan as read_plan
    from closedrooms.worlds.formats.native import write_plan as write_plan
    from closedrooms.worlds.generation.generator import generate as generate
    from closedrooms.worlds.library import DEFAULT_WORLD as DEFAULT_WORLD
    from closedrooms.worlds.library import bundled_names as bundled_names
    from closedrooms.worlds.library import distinct_names as distinct_names
    from closedrooms.worlds.library import load_world as load_world
    from closedrooms.worlds.library import read_world as read_world
    from closedrooms.worlds.plan import FloorPlan as FloorPlan
    from closedrooms.worlds.plan import Furniture as Furniture
    from closedrooms.worlds.plan import Opening as Opening
    from closedrooms.worlds.plan import PlanDoor as PlanDoor
    from closedrooms.worlds.plan import PlanRoom as PlanRoom
    from closedrooms.worlds.plan import Wall as Wall
    from closedrooms.worlds.truth import rasterise as rasterise
    from closedrooms.worlds.truth import reachable as reachable
    from closedrooms.worlds.truth import true_rooms as true_rooms
    from closedrooms.worlds.truth import truth_bounds as truth_bounds
    from closedrooms.worlds.validation import validate as validate

__getattr__, __dir__, __all__ = lazy_face(
    __name__,
    {
        "closing": ("check_closed", "closable_rooms", "draw_closed"),
        "formats.native": ("read_plan", "write_plan"),
        "generation.generator": ("generate",),
        "library": ("DEFAULT_WORLD", "bundled_names", "distinct_names", "load_world", "read_world"),
        "plan": ("FloorPlan", "Furniture", "Opening", "PlanDoor", "PlanRoom", "Wall"),
        "truth": ("rasterise", "reachable", "true_rooms", "truth_bounds"),
        "validation": ("validate",),
    },
)
