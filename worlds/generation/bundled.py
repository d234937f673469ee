"""The 20 bundled worlds: which kind, shape and seed of the generator each one is.

Their largest numbers of closed doors follow the paper's table 1 (7, 9, 10, 11 twice, 12 twice, 13 four times, 15
nine times, where 15 is the limit of its experiments and the building may have more).
"""

from dataclasses import dataclass

from closedrooms.worlds.generation.generator import generate
from closedrooms.worlds.plan import FloorPlan

# Table 1 of the paper: the most doors that are closed at once.
MOST_CLOSED = 15


@dataclass(frozen=True, slots=True)
class Recipe:
    """Request to the generator.

    Attributes:
        kind: ``office`` or ``school``.
        shape: See :func:`closedrooms.worlds.generation.generator.generate`.
        size: ``small``, ``medium`` or ``large``.
        angle: Degrees.
        seed: Of the generator.
        closed: Largest number of closed doors, at most ``MOST_CLOSED``.
        version: Of the generator; never changed for a world that is published.
    """

    kind: str
    shape: str
    size: str
    angle: float
    seed: int
    closed: int
    version: int = 1


RECIPES: dict[str, Recipe] = {
    "office-01": Recipe("office", "bar", "small", 0.0, 16, 7),
    "office-02": Recipe("office", "L", "small", 0.0, 46, 10),
    "office-03": Recipe("office", "slant", "small", 0.0, 9, 11),
    "office-04": Recipe("office", "U", "small", 0.0, 1, 12),
    "office-05": Recipe("office", "T", "small", 22.0, 38, 13),
    "office-06": Recipe("office", "bar", "medium", 0.0, 42, 13),
    "office-07": Recipe("office", "L", "medium", 0.0, 41, 15),
    "office-08": Recipe("office", "ring", "medium", 0.0, 0, 15),
    "office-09": Recipe("office", "T", "medium", 0.0, 6, 15),
    "office-10": Recipe("office", "U", "medium", 40.0, 1, 15),
    "office-11": Recipe("office", "slant", "medium", 0.0, 3, 15),
    "school-01": Recipe("school", "bar", "small", 0.0, 14, 9),
    "school-02": Recipe("school", "T", "small", 0.0, 1, 11),
    "school-03": Recipe("school", "L", "small", 30.0, 20, 12),
    "school-04": Recipe("school", "slant", "small", 0.0, 8, 13),
    "school-05": Recipe("school", "U", "small", 0.0, 18, 13),
    "school-06": Recipe("school", "bar", "medium", 15.0, 7, 15),
    "school-07": Recipe("school", "ring", "small", 0.0, 4, 15),
    "school-08": Recipe("school", "L", "small", 0.0, 7, 15),
    "school-09": Recipe("school", "T", "medium", 0.0, 1, 15),
}


def bundled_plan(name: str) -> FloorPlan:
    """Generate a bundled world anew: its file is this plan's JSON text, byte for byte."""
    recipe = RECIPES[name]
    return generate(
        recipe.kind,
        recipe.seed,
        shape=recipe.shape,
        size=recipe.size,
        angle=recipe.angle,
        name=name,
        version=recipe.version,
    )
