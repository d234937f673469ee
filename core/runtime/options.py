"""What the options of several commands have in common; imports nothing heavy."""

import math
from collections.abc import Iterable
from dataclasses import fields, is_dataclass
from typing import cast

from closedrooms.core.errors import InvalidInputError

MOST = 1e4
"""Largest length, weight or time of a setting [m, s, ...]: buildings have hundreds of metres, runs hours of 3,600 s."""
MOST_WHOLE = 2**63 - 1
"""Largest whole number: a seed's."""


def check_numbers(config: object, *, option: str = "") -> None:
    """Refuse settings of any depth that no honest user sets and that would take all time or memory.

    Args:
        config: Options of a command, the settings of its stages included.
        option: What the names begin with.

    Raises:
        InvalidInputError: A number that is not finite or larger than :data:`MOST`, named as on the command line.
    """
    for item in fields(config):  # type: ignore[arg-type]
        value, name = getattr(config, item.name), f"{option}{item.name.replace('_', '-')}"
        if is_dataclass(value):
            check_numbers(value, option=f"{name}.")
            continue
        for number in value if isinstance(value, tuple) else (value,):
            if isinstance(number, float) and not (math.isfinite(number) and abs(number) <= MOST):
                raise InvalidInputError(f"--{name} {number:g}", expected=f"a number from {-MOST:g} to {MOST:g}")
            if isinstance(number, int) and abs(number) > MOST_WHOLE:
                raise InvalidInputError(f"--{name} of more than 19 digits", expected=f"at most {MOST_WHOLE}")


FACTOR = 20.0
"""How many times its default a setting of a stage may be."""


def check_least(config: object, **least: int) -> None:
    """Check that whole numbers are not smaller than they may be.

    Args:
        config: Options of a command.
        least: Smallest value by the name of the option.

    Raises:
        InvalidInputError: A smaller one, named as on the command line.
    """
    for name, smallest in least.items():
        value = getattr(config, name)
        if value < smallest:
            option = name.replace("_", "-")
            raise InvalidInputError(f"--{option} {value}", expected=f"a whole number of at least {smallest}")


def check_magnitudes(
    config: object, *, owner: str, positive: Iterable[str] = (), **bounds: tuple[float, float]
) -> None:
    """Refuse settings of a stage that are far from what it was made for: memory and time grow with their powers.

    Args:
        config: Settings, each with a default.
        owner: Whose, for the message.
        positive: Names of those that must be above 0.
        bounds: Smallest and largest value of single ones; of the others 0 to :data:`FACTOR` times the default.

    Raises:
        InvalidInputError: A number outside.
    """
    for item in fields(config):  # type: ignore[arg-type]
        value, standard = getattr(config, item.name), cast("float", item.default)
        if isinstance(value, bool) or not isinstance(value, int | float):
            continue
        low, high = bounds.get(item.name, (0.0, FACTOR * standard))
        above = item.name in positive
        if not (low < value <= high if above else low <= value <= high):
            expected = f"a number {'above' if above else 'from'} {low:g} {'and at most' if above else 'to'} {high:g}"
            raise InvalidInputError(f"{owner} {item.name} {value}", expected=expected)
