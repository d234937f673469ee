"""The options of one command: its configuration, the settings of its method, and what all commands share."""

import importlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, is_dataclass, make_dataclass
from functools import partial
from itertools import zip_longest
from pathlib import Path
from typing import Annotated, Any, get_args, get_type_hints

import tyro

from closedrooms.cli.command_list import Command
from closedrooms.cli.config_file import read_settings
from closedrooms.cli.settings import field_values
from closedrooms.cli.usage import UsageError
from closedrooms.core.errors import InvalidInputError
from closedrooms.core.nearest import unknown
from closedrooms.core.runtime.options import check_numbers

# Of these a command takes one; the line's takes the place of another one in the file.
ALTERNATIVES = ({"close", "close_doors"},)

Switch = tyro.conf.FlagCreatePairsOff[bool]


@dataclass(frozen=True, kw_only=True)
class SharedOptions:
    """Options of every command."""

    config: Annotated[Path | None, tyro.conf.arg(metavar="FILE")] = None
    """Settings, JSON or TOML, or the ``run.json`` of a result to repeat; options on the line win."""

    json: Switch = False
    """Print the result as one JSON object."""

    verbose: Annotated[Switch, tyro.conf.arg(aliases=["-v"])] = False
    """Print every step and every failure."""

    quiet: Annotated[Switch, tyro.conf.arg(aliases=["-q"])] = False
    """Print nothing but errors."""

    help_all: Switch = False
    """Show every option, the settings of each stage included."""


def load(place: str) -> Any:
    """Load what stands at ``module:name``, the module relative to ``closedrooms``.

    It is imported only now, so that a command imports no more than it needs.
    """
    module, name = place.split(":")
    return getattr(importlib.import_module(f"closedrooms.{module}"), name)


@dataclass(frozen=True, kw_only=True)
class _Named:
    """Options that decide which others there are and what their defaults are; read ahead of the rest."""

    config: Path | None = None
    method: str | None = None
    noise: str | None = None
    lidar: str | None = None
    close: str | None = None
    close_doors: str | None = None


def _read_named(words: Sequence[str]) -> _Named:
    """Find these few options on a line, as tyro will: ``--name value`` or ``--name=value``, the last one wins.

    Tyro itself would take 0.1 s of processor time more for them, most of it to load typeguard.
    """
    words = words[: words.index("--")] if "--" in words else words
    known = {item.name for item in fields(_Named)}
    found: dict[str, Any] = {}
    for word, behind in zip_longest(words, words[1:]):
        option, equals, value = word.partition("=")
        name = option.removeprefix("--").replace("-", "_")
        if option.startswith("--") and name in known:
            given = value if equals else behind
            if given is not None and (equals or not given.startswith("--")):
                found[name] = Path(given) if name == "config" else given
    return _Named(**found)


def options_class(command: Command, words: Sequence[str] = (), *, brief: bool = False) -> type[Any]:
    """Make the class that tyro turns into the options of a command.

    Defaults are resolved here, once: the numbers of the level of noise and of the lidar that are named, the settings
    of the method that is named, and over them what a file says.

    Args:
        command: The command.
        words: Its arguments and options as they were typed.
        brief: Leave out the settings of stages, as ``--help`` does.

    Raises:
        InvalidInputError: The file cannot be used.
        UsageError: The line names a method that does not exist.
    """
    config = load(command.config)
    names = {item.name for item in fields(config)}
    line = _read_named(words)
    saved = {} if line.config is None else read_settings(line.config, command.name, config)
    saved = _without_what_the_line_names(saved, line)
    try:
        starts = _starts(config, line, saved)
        defaults = starts | field_values(config, saved, current=starts)
    except InvalidInputError as error:
        if line.config is None:
            raise
        raise InvalidInputError(str(error), where=line.config) from error
    hints = get_type_hints(config, include_extras=True)
    method = _method(line, saved, config) if "predictor" in names else None
    made: list[tuple[str, Any, Any]] = []
    hidden: list[str] = []
    for name in sorted(names & defaults.keys()):
        kind, value = hints[name], defaults[name]
        if name == "predictor":
            kind = Annotated[type(value), tyro.conf.arg(help=f"The method {method}.")]
        if brief and is_dataclass(value):
            kind = Annotated[kind, tyro.conf.Suppress]
            hidden.append(name)
        made.append((name, kind, field(default_factory=partial(_same, value))))
    about = {"command": command, "method": method, "hidden": tuple(hidden), "file": line.config}
    bases = (SharedOptions, config)
    return make_dataclass("Options", made, bases=bases, frozen=True, kw_only=True, namespace={"about": about})


def _same(value: Any) -> Any:
    return value


def configured(options: Any) -> Any:
    """Build the configuration from the options of a command.

    Raises:
        InvalidInputError: A setting that no honest user sets (:func:`closedrooms.core.runtime.options.check_numbers`).
    """
    config = load(options.about["command"].config)
    made = config(**{item.name: getattr(options, item.name) for item in fields(config) if item.init})
    try:
        check_numbers(made)
    except InvalidInputError as error:
        raise InvalidInputError(str(error), where=options.about["file"] or "") from error
    return made


def option_names(options: type[Any]) -> list[str]:
    """List every option of a class of options, as it is typed."""
    names = []
    hints = get_type_hints(options)
    for item in fields(options):
        option = item.name.replace("_", "-")
        start = item.default_factory() if callable(item.default_factory) else hints[item.name]
        if is_dataclass(start):
            names += [f"{option}.{name}" for name in option_names(start if isinstance(start, type) else type(start))]
        elif item.init:
            names.append(option)
    return names


def _starts(config: type[Any], line: _Named, saved: Mapping[str, Any]) -> dict[str, Any]:
    """List what nested settings begin with: defaults, with the numbers that a name stands for."""
    hints = get_type_hints(config)
    starts = {
        item.name: item.default_factory()
        for item in fields(config)
        if callable(item.default_factory) and is_dataclass(hints[item.name])
    }
    if "sim" in hints and "noise" in hints:
        from closedrooms.pipeline.options.run import named_sim
        from closedrooms.sim.config import Body

        named = {
            name: next((v for v in (getattr(line, name), saved.get(name)) if v in get_args(hints[name])), None)
            for name in ("noise", "lidar")
            if name in hints
        }
        body: Body = getattr(config, "BODY", "kinematic")
        starts["sim"] = named_sim(**{name: value for name, value in named.items() if value is not None}, body=body)
    if "method" in hints:
        from closedrooms.predictor.methods import METHODS, find_method

        method = _method(line, saved, config)
        if line.method is not None and line.method not in METHODS:
            raise UsageError(unknown("method", line.method, METHODS))
        if "predictor" in hints and isinstance(method, str):
            starts["predictor"] = find_method(method).config()
    return starts


def _method(line: _Named, saved: Mapping[str, Any], config: type[Any]) -> Any:
    """Find the method of a command: the line's, the file's, or the usual one."""
    standard = next(item.default for item in fields(config) if item.name == "method")
    return line.method or saved.get("method", standard)


def _without_what_the_line_names(saved: Mapping[str, Any], line: _Named) -> dict[str, Any]:
    """Drop a file's numbers of a level, a lidar or a method that the line names instead."""
    kept = dict(saved)
    if line.method is not None:
        kept.pop("predictor", None)
    if isinstance(kept.get("sim"), Mapping):
        kept["sim"] = {name: v for name, v in kept["sim"].items() if getattr(line, name, None) is None}
    for group in ALTERNATIVES:
        if any(getattr(line, name) is not None for name in group):
            kept = {name: value for name, value in kept.items() if name not in group}
    return kept
