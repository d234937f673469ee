"""Numbers of files, within bounds that no honest file reaches."""

from pathlib import Path
from typing import TypeGuard

from closedrooms.core.errors import InvalidInputError
from closedrooms.core.names import shown

FARTHEST = 1e8
"""Largest coordinate [m]: northings of UTM reach 1e7; beyond 1e8 a float holds no tenth of a micrometre any more."""
FINEST, COARSEST = 1e-3, 10.0
"""Resolutions [m]: robots map at 0.01 to 0.1, and the truth of buildings is drawn at 0.001 at best."""
WIDEST = 100.0
"""Widest door [m]: a hangar's."""
MAX_DOORS = 10_000
"""Most doors of one map."""
MAX_ROOMS = 100_000
"""Most rooms of one file."""


def is_number(value: object) -> TypeGuard[int | float]:
    """Check whether a value is a finite number (no bool) that a float holds, whatever its number of digits."""
    return isinstance(value, int | float) and not isinstance(value, bool) and -1e308 < value < 1e308


def bounded(value: object, low: float, high: float, *, name: str, unit: str = "", where: str | Path = "") -> float:
    """Check that a number lies between two bounds, both included.

    Args:
        value: Anything.
        low: Smallest.
        high: Largest.
        name: What it is, for the message.
        unit: For the message.
        where: The file, for the message.

    Raises:
        InvalidInputError: Not a number, not finite, or outside.
    """
    if is_number(value) and low <= value <= high:
        return float(value)
    unit = f" {unit}" if unit else ""
    raise InvalidInputError(
        f"{name} {shown(repr_of(value), longest=60)}", expected=f"a number from {low:g} to {high:g}{unit}", where=where
    )


def check_count(count: int, most: int, what: str, where: str | Path = "") -> None:
    """Refuse more things than a file may hold.

    Raises:
        InvalidInputError: ``count`` is larger than ``most``; the message names both.
    """
    if count > most:
        raise InvalidInputError(f"{count} {what}", expected=f"at most {most}", where=where)


def repr_of(value: object) -> str:
    """Write a value as ``repr``, kept short, also of whole numbers longer than Python prints and of deep lists."""
    import reprlib

    short = reprlib.Repr()
    short.maxstring = short.maxother = 60
    try:
        return short.repr(value)
    except ValueError:
        return "with thousands of digits"
