"""Colours that the recording and the pictures share, so that a door has one colour everywhere."""

from collections.abc import Iterable

Colour = tuple[int, int, int]

# Okabe and Ito, "Color Universal Design" (2008), without black and yellow, then darker neighbours of the same hues:
# told apart by people with any colour vision, readable on white.
ROOM_COLOURS: tuple[Colour, ...] = (
    (0, 114, 178),
    (230, 159, 0),
    (0, 158, 115),
    (204, 121, 167),
    (213, 94, 0),
    (86, 180, 233),
    (117, 90, 170),
    (120, 160, 40),
    (160, 60, 90),
    (60, 110, 110),
)
FREE, UNKNOWN, OCCUPIED = 255, 222, 40
"""Grey values of a map's cells; unknown is the background of every view."""

ESTIMATE: Colour = (0, 114, 178)
TRUTH: Colour = (0, 158, 115)
ODOMETRY: Colour = (213, 94, 0)
FRONTIER: Colour = (204, 121, 167)
GOAL: Colour = (230, 159, 0)
SCAN: Colour = (86, 180, 233)
DOOR_CLOSED: Colour = (200, 40, 40)
DOOR_OPEN: Colour = (150, 110, 70)
FURNITURE: Colour = (176, 160, 134)
WALL: Colour = (188, 184, 176)
FLOOR: Colour = (238, 236, 230)
INK: Colour = (60, 60, 70)
PAPER: Colour = (255, 255, 255)
GLASS: Colour = (120, 190, 225)
MOVER: Colour = (190, 130, 20)
CONTACT: Colour = (160, 0, 60)
LOOP: Colour = (150, 60, 190)
TOURS: dict[str, Colour] = {
    "closed": (117, 90, 170),
    "predicted": (0, 114, 178),
    "truth": (0, 158, 115),
    "driven": (213, 94, 0),
}


def room_colours(doors: Iterable[str]) -> dict[str, Colour]:
    """Choose a colour for each door id, by its place in the sorted list."""
    return {door: ROOM_COLOURS[place % len(ROOM_COLOURS)] for place, door in enumerate(sorted(set(doors)))}
