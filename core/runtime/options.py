"""What the options of several commands have in common; imports nothing heavy."""

from closedrooms.core.errors import InvalidInputError


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
