"""What rooms offices and schools have, and how they share the length of a corridor (generator version 1)."""

from dataclasses import dataclass

import numpy as np

from closedrooms.worlds.generation.corridors import Measures


@dataclass(frozen=True, slots=True)
class Bay:
    """A kind of room, or of a few rooms that belong together, along a corridor.

    Attributes:
        label: Of the room.
        widths: Shortest and longest along the corridor [m].
        weight: How often it is drawn.
        layout: ``room`` (one door), ``two doors``, ``pair`` (two halves side by side), ``suite`` (a front room that
            leads to a back one), ``store`` (a small store cut out at the back), ``open`` (no door but an opening).
        shallow: Smallest part of the usual depth.
        deep: Largest part of the usual depth.
        at_most: How many a building has.
        at_least: How many a building has, if there is room.
        corner: May fill the outer corner of a bend.
    """

    label: str
    widths: tuple[float, float]
    weight: float
    layout: str = "room"
    shallow: float = 1.0
    deep: float = 1.0
    at_most: int = 99
    at_least: int = 0
    corner: bool = False


OFFICE = (
    Bay("office", (2.7, 4.0), 46),
    Bay("shared office", (4.4, 6.4), 20, corner=True),
    Bay("meeting room", (4.4, 7.2), 9, deep=1.2, corner=True),
    Bay("office suite", (3.4, 5.0), 6, "suite", at_most=3),
    Bay("office", (5.0, 7.0), 4, "two doors", at_most=2),
    Bay("toilet", (4.4, 5.6), 3, "pair", at_most=2, at_least=1),
    Bay("store", (1.8, 2.8), 7, at_most=4),
    Bay("kitchen", (2.8, 4.2), 3, "open", at_most=1),
    Bay("stairs", (2.8, 3.4), 2, at_most=2, at_least=1),
    Bay("open-plan office", (8.0, 13.0), 5, "open", deep=1.3, at_most=2, corner=True),
    Bay("lobby", (4.5, 7.0), 3, "open", at_most=1),
    Bay("server room", (2.6, 3.6), 3, at_most=1),
)
SCHOOL = (
    Bay("classroom", (6.8, 9.2), 44, corner=True),
    Bay("classroom", (7.4, 9.6), 8, "two doors", at_most=4),
    Bay("classroom", (7.6, 9.8), 7, "store", at_most=3),
    Bay("laboratory", (8.0, 11.0), 7, deep=1.2, at_most=3, corner=True),
    Bay("staff room", (5.0, 7.5), 5, at_most=1),
    Bay("office", (3.0, 4.4), 12, at_most=5),
    Bay("toilet", (5.4, 7.0), 4, "pair", shallow=0.75, at_most=2, at_least=1),
    Bay("store", (2.0, 3.2), 8, at_most=4),
    Bay("stairs", (3.2, 4.2), 2, at_most=2, at_least=1),
    Bay("library", (9.0, 14.0), 3, "open", deep=1.3, at_most=1),
    Bay("entrance hall", (6.0, 10.0), 4, "open", at_most=1),
    Bay("principal", (3.6, 4.6), 3, "suite", at_most=1),
)
BAYS = {"office": OFFICE, "school": SCHOOL}
END_ROOMS = {
    "office": (("conference room", (6.0, 9.0), (6.0, 8.5)), ("stairs", (2.6, 3.2), (4.0, 5.5))),
    "school": (("gym", (11.0, 15.0), (13.0, 18.0)), ("stairs", (3.2, 4.0), (5.0, 6.0)),
               ("hall", (9.0, 12.0), (9.0, 13.0))),
}  # fmt: skip
# Lengths of the main corridor by size [m].
LENGTHS = {
    "office": {"small": (13.0, 19.0), "medium": (28.0, 36.0), "large": (42.0, 56.0)},
    "school": {"small": (22.0, 30.0), "medium": (38.0, 48.0), "large": (52.0, 66.0)},
}


def measures(rng: np.random.Generator, kind: str, size: str) -> Measures:
    """Draw widths, depths and lengths of one building."""
    low, high = LENGTHS[kind][size]
    if kind == "office":
        width, depths = rng.uniform(1.6, 2.4), rng.uniform(4.4, 6.2, size=2)
    else:
        width, depths = rng.uniform(2.4, 3.6), rng.uniform(6.4, 8.2, size=2)
    legs = (rng.uniform(low, high), rng.uniform(low, high) * 0.8, rng.uniform(low, high) * 0.7)
    first, second, third = (round(float(leg), 1) for leg in legs)
    return Measures(
        round(float(width), 1), (round(float(depths[0]), 1), round(float(depths[1]), 1)), (first, second, third)
    )


def draw_bays(rng: np.random.Generator, kind: str, length: float, counts: dict[str, int]) -> list[tuple[Bay, float]]:
    """Draw bays whose widths add up to ``length``.

    Args:
        rng: Draws kinds and widths.
        kind: ``office`` or ``school``.
        length: Of the run [m].
        counts: How many of each bay (by label and layout) the building has already; updated.
    """
    bays = BAYS[kind]
    chosen: list[tuple[Bay, float]] = []
    left = length
    previous = 0.0
    while left > min(bay.widths[0] for bay in bays):
        bay = _draw(rng, bays, left, counts)
        if bay is None:
            break
        width = float(rng.uniform(*bay.widths))
        # Neighbours of one kind are mostly of one width, as on a regular grid.
        if chosen and chosen[-1][0] is bay and rng.random() < 0.7:
            width = previous
        width = min(width, left)
        chosen.append((bay, width))
        counts[_key(bay)] = counts.get(_key(bay), 0) + 1
        previous, left = width, left - width
    total = sum(width for _, width in chosen)
    if not chosen:
        return []
    widths = [round(width * length / total / 0.05) * 0.05 for _, width in chosen]
    widths[-1] += length - sum(widths)
    return [(bay, width) for (bay, _), width in zip(chosen, widths, strict=True)]


def _key(bay: Bay) -> str:
    """Name a kind of bay, as they are counted."""
    return f"{bay.label}/{bay.layout}"


def _draw(rng: np.random.Generator, bays: tuple[Bay, ...], left: float, counts: dict[str, int]) -> Bay | None:
    """Draw a bay that fits into what is left [m] and that the building may still have, ``None`` without one."""
    possible = [bay for bay in bays if bay.widths[0] <= left and counts.get(_key(bay), 0) < bay.at_most]
    if not possible:
        return None
    # What the building still must have becomes likelier by this factor.
    weights = np.array([b.weight * (6.0 if counts.get(_key(b), 0) < b.at_least else 1.0) for b in possible])
    return possible[int(rng.choice(len(possible), p=weights / weights.sum()))]
