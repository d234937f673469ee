"""Wrong usage in one line each, told from what tyro could not parse."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from closedrooms.core.nearest import nearest, unknown

# Options of old, and what takes their place.
GONE = {
    "preset": "--method paper, rose or best",
    "structure": "--method rose, or --method paper",
    "phi": "--method paper --predictor.phi as-printed",
}


class UsageError(Exception):
    """A command line that cannot be understood: exit status 2."""


@dataclass(frozen=True, slots=True)
class LinePosition:
    """Place on a command line where something was not understood.

    Attributes:
        words: The whole line.
        prog: The program and the command, as far as it was named.
        commands: The names that could stand next, where the command is not complete.
        options: The options of the command, without their dashes.
        method: The method of prediction, where the command has one.
    """

    words: tuple[str, ...]
    prog: str
    commands: tuple[str, ...] = ()
    options: tuple[str, ...] = ()
    method: str | None = None


def explain(event: Any, place: LinePosition) -> str | None:
    """Explain a failure to parse in one line; ``None`` where tyro's own words have to do.

    Args:
        event: A ``ParseErrorEvent`` of tyro; its module is private, so nothing but the fields read here is relied on.
        place: Where it happened.
    """
    kind = type(event).__name__
    strange = event.tokens if kind == "UnrecognizedArgs" else _strange(place)
    if strange and kind in {"UnrecognizedArgs", "MissingArgs", "BadValue", "MissingSubcommand"}:
        return _unknown_word(strange[0], place)
    tell = _TOLD.get(kind)
    return None if tell is None else tell(event, place)


def _missing_command(event: Any, place: LinePosition) -> str:  # noqa: ARG001
    return f"no command after {place.prog}; expected one of {', '.join(place.commands)}"


def _missing_arguments(event: Any, place: LinePosition) -> str:
    names = ", ".join(_shown(missing.arg) for missing in event.missing_arguments)
    return f"missing {names}; see {place.prog} --help"


def _wrong_choice(event: Any, place: LinePosition) -> str:  # noqa: ARG001
    return f"{_shown(event.argument)}: {unknown('value', event.value, event.choices)}"


def _missing_value(event: Any, place: LinePosition) -> str:  # noqa: ARG001
    return f"{_shown(event.argument)} lacks a value"


def _wrong_value(event: Any, place: LinePosition) -> str:  # noqa: ARG001
    return str(event.message) if event.argument is None else f"{_shown(event.argument)}: {event.message}"


_TOLD: dict[str, Callable[[Any, LinePosition], str]] = {
    "MissingSubcommand": _missing_command,
    "MissingArgs": _missing_arguments,
    "InvalidChoice": _wrong_choice,
    "BadValue": _missing_value,
    "InstantiationFailure": _wrong_value,
}


def _unknown_word(word: str, place: LinePosition) -> str:
    """Say that a word has no meaning there, and what was meant."""
    if not word.startswith("-"):
        return unknown("command", word, place.commands) if place.commands else f"unexpected argument {word!r}"
    option = _option(word)
    if option in GONE:
        return f"--{option} is gone; use {GONE[option]}"
    if place.commands:
        return f"{word} before a command; expected one of {', '.join(place.commands)} first"
    what, near = f"unknown option {word.partition('=')[0]}", _nearest_option(option, place.options)
    if place.method is not None and option.startswith("predictor."):
        what = f"the method {place.method} does not read --{option}"
        near = _nearest_option(option, [name for name in place.options if name.startswith("predictor.")])
    return f"{what}; did you mean --{near}?" if near else f"{what}; {place.prog} --help-all lists what there is"


def _nearest_option(option: str, known: Sequence[str]) -> str:
    """Find the option that was meant; empty where none is near.

    Names are compared without the groups that they share: all options of a method would be near each other by
    ``predictor.``. ``--radius`` means ``--sim.robot.radius``, and so does ``--radios``.
    """
    shared = option[: option.rfind(".") + 1]
    group = [name.removeprefix(shared) for name in known if name.startswith(shared)]
    near = nearest(option.removeprefix(shared), group)
    if near:
        return shared + near
    by_end = {name.rpartition(".")[2]: name for name in reversed(known)}
    by_name = "" if group else nearest(option, known)
    return by_name or by_end.get(nearest(option.rpartition(".")[2], by_end), "")


def _strange(place: LinePosition) -> list[str]:
    """List words that look like options of the command and are none; what follows ``--`` is an argument."""
    words = place.words[: place.words.index("--")] if "--" in place.words else place.words
    known = {*place.options, *(f"no-{option}" for option in place.options), "help", "help-all"}
    return [word for word in words if word.startswith("--") and _option(word) not in known]


def _option(word: str) -> str:
    """Write a word of the line as options are spelled: no dashes ahead, no value, dashes for underscores."""
    return word.lstrip("-").partition("=")[0].replace("_", "-")


def _shown(argument: Any) -> str:
    """Write an argument as the help shows it."""
    name = str(argument.display_name())
    return name if name.startswith("-") else name.upper()
