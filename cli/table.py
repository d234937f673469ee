"""The table of commands, and how tyro reads a line with it."""

import contextlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, Union

import tyro

# Private to tyro, and the only way to say wrong usage in one line. pyproject.toml bounds the version; a kind of error
# that is not known here is told in tyro's own words.
from tyro._errors import on_parse_error

from closedrooms.cli.command_list import ABOUT, COMMANDS, GROUPS, HELP, HELP_ALL, Command
from closedrooms.cli.options import option_names, options_class
from closedrooms.cli.quick_types import tell_quickly
from closedrooms.cli.usage import LinePosition, UsageError, explain
from closedrooms.core.errors import InvalidInputError

MARKERS = (
    tyro.conf.OmitSubcommandPrefixes,
    tyro.conf.AvoidSubcommands,
    tyro.conf.PositionalMetavarFromFieldName,
)


def read_line(words: Sequence[str]) -> Any:
    """Read one line.

    Returns:
        The options of a command, see :func:`closedrooms.cli.options.options_class`.

    Raises:
        UsageError: No such command, option or value.
        InvalidInputError: A value that a configuration refuses, a file of settings that cannot be used.
        SystemExit: The help or a completion script was printed.
    """
    tell_quickly()
    command = named_command(words)
    rest = list(words) if command is None else list(words[len(command.name.split()) :])
    brief = bool(HELP & set(rest)) and HELP_ALL not in rest
    options = None if command is None else options_class(command, rest, brief=brief)

    def complain(event: Any) -> None:
        line = explain(event, _place(words, command, options))
        if line is not None:
            raise UsageError(line)

    completing = bool(words) and words[0].startswith("--tyro-")
    with on_parse_error(complain), _naming_the_file(rest, options):
        return tyro.cli(
            _table(command, options, completing=completing),
            prog="closedrooms",
            description=ABOUT,
            args=["--help" if word == HELP_ALL else word for word in words],
            config=MARKERS,
        )


@contextlib.contextmanager
def _naming_the_file(words: Sequence[str], options: type[Any] | None) -> Iterator[None]:
    """Say which file a value that is refused comes from, where it does not stand on the line."""
    try:
        yield
    except InvalidInputError as error:
        option = str(error).split(" ", 1)[0]
        if options is None or options.about["file"] is None or any(word.split("=")[0] == option for word in words):
            raise
        raise InvalidInputError(str(error), where=options.about["file"]) from error


def named_command(words: Sequence[str]) -> Command | None:
    """Find the command that a line begins with."""
    for command in COMMANDS:
        parts = command.name.split()
        if list(words[: len(parts)]) == parts:
            return command
    return None


@dataclass(frozen=True)
class _NotAsked:
    """Stand-in for the options of the commands that a line does not name, which nobody looks at."""


def _table(chosen: Command | None, options: type[Any] | None, *, completing: bool) -> Any:
    """Unite all commands, as tyro takes them.

    Args:
        chosen: The command that the line names.
        options: Its options as resolved.
        completing: The options of all the others are wanted too.
    """
    rows: dict[str, Any] = {}
    groups: dict[str, dict[str, Any]] = {name: {} for name in GROUPS}
    for command in COMMANDS:
        *group, name = command.name.split()
        own = options if command is chosen else options_class(command) if completing else _NotAsked
        row = _row(name, _description(command, options if command is chosen else None), own)
        if group:
            groups[group[0]][name] = row
            rows[group[0]] = _row(group[0], GROUPS[group[0]], Union[tuple(groups[group[0]].values())])  # noqa: UP007
        else:
            rows[name] = row
    return Union[tuple(rows.values())]  # noqa: UP007


def _row(name: str, description: str, options: Any) -> Any:
    """Make a row of tyro's table of subcommands."""
    about = tyro.conf.subcommand(
        name=name, description=description, prefix_name=False, constructor_factory=lambda: options
    )
    return Annotated[Any, about]


def _description(command: Command, options: type[Any] | None) -> str:
    """Write what ``--help`` says of a command, and which settings it hides."""
    if options is None or not options.about["hidden"]:
        return command.summary
    groups = ", ".join(f"--{name}.*" for name in options.about["hidden"])
    return f"{command.summary} --help-all shows the settings of each stage too: {groups}."


def _place(words: Sequence[str], command: Command | None, options: type[Any] | None) -> LinePosition:
    """Find where on the line tyro stopped: before a command, or among its options."""
    if command is not None and options is not None:
        method = options.about["method"]
        return LinePosition(
            tuple(words), f"closedrooms {command.name}", options=tuple(option_names(options)), method=method
        )
    group = words[0] if words and words[0] in GROUPS else None
    if group is not None:
        names = [c.name.split()[1] for c in COMMANDS if c.name.split()[0] == group]
        return LinePosition(tuple(words), f"closedrooms {group}", commands=tuple(names))
    names = list(dict.fromkeys(c.name.split()[0] for c in COMMANDS))
    return LinePosition(tuple(words), "closedrooms", commands=tuple(names))
