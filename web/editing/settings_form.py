"""Settings of a method as rows of a form: plain numbers, switches and choices, each with its docstring."""

import ast
import functools
import inspect
import itertools
import math
import textwrap
import types
from collections.abc import Hashable, Iterator
from dataclasses import dataclass, fields, is_dataclass, replace
from typing import Any, Literal, Union, cast, get_args, get_origin, get_type_hints

from closedrooms.core.errors import InvalidInputError
from closedrooms.core.nearest import unknown

# Not for people on a page: what it keeps is drawn in recordings only.
HIDDEN = {"keep_trace"}


@dataclass(frozen=True, slots=True)
class SettingRow:
    """One setting.

    Attributes:
        name: With the group that it is in, ``lines.max_gap``.
        about: What it means, in one paragraph.
        kind: ``number``, ``whole``, ``switch`` or ``choice``.
        shown: Its value as a form shows it; ``None`` for one that is measured or off.
        standard: Its default, likewise.
        choices: Of a choice.
        optional: It may be left empty.
    """

    name: str
    about: str
    kind: str
    shown: Any
    standard: Any
    choices: tuple[str, ...] = ()
    optional: bool = False


def setting_rows(settings: Any) -> list[SettingRow]:
    """List the settings of a method that a form can change.

    Args:
        settings: A frozen dataclass, with others in it; of any package. Fields of other types are left out.
    """
    return list(_rows(settings, type(settings)(), ""))


def with_setting(settings: Any, name: str, value: Any) -> Any:
    """Change one setting.

    Args:
        settings: As for :func:`setting_rows`.
        name: Of a row.
        value: Plain, as a form or JSON gives it.

    Raises:
        InvalidInputError: No such setting, another kind of value, or one that the settings refuse.
    """
    rows = {row.name: row for row in setting_rows(settings)}
    if name not in rows:
        raise InvalidInputError(unknown("setting", name, list(rows)))
    value = _checked(rows[name], value)
    *groups, last = name.split(".")
    owners = [settings]
    for group in groups:
        owners.append(getattr(owners[-1], group))
    changed: Any = value
    for owner, key in zip(reversed(owners), (last, *reversed(groups)), strict=True):
        changed = replace(owner, **{key: changed})
    return changed


def _rows(settings: Any, standard: Any, group: str) -> Iterator[SettingRow]:
    """List the settings of a class and of those within it, with what is usual."""
    hints, texts = get_type_hints(type(settings)), _docstrings(cast("Hashable", type(settings)))
    for item in fields(settings):
        value, usual, name = getattr(settings, item.name), getattr(standard, item.name), f"{group}{item.name}"
        if not item.init or item.name in HIDDEN:
            continue
        if is_dataclass(value) and is_dataclass(usual):
            yield from _rows(value, usual, f"{name}.")
            continue
        hint, optional = _without_none(hints[item.name])
        row = functools.partial(SettingRow, name, texts.get(item.name, ""), optional=optional)
        if hint is bool:
            yield row(kind="switch", shown=value, standard=usual)
        elif hint is float:
            yield row(kind="number", shown=value, standard=usual)
        elif hint is int:
            yield row(kind="whole", shown=value, standard=usual)
        elif get_origin(hint) is Literal and all(isinstance(choice, str) for choice in get_args(hint)):
            yield row(kind="choice", shown=value, standard=usual, choices=get_args(hint))


def _without_none(hint: Any) -> tuple[Any, bool]:
    """Split ``None`` off a type; says whether it had one."""
    if get_origin(hint) not in {Union, types.UnionType}:
        return hint, False
    rest = [part for part in get_args(hint) if part is not type(None)]
    return (rest[0] if len(rest) == 1 else hint), len(rest) < len(get_args(hint))


def _checked(row: SettingRow, value: Any) -> Any:
    """Convert a value to what its field takes.

    Raises:
        InvalidInputError: It is of another kind.
    """
    if value is None and row.optional:
        return None
    number = isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
    if row.kind == "switch" and isinstance(value, bool):
        return value
    if row.kind == "number" and number:
        return float(value)
    if row.kind == "whole" and number and float(value).is_integer():
        return int(value)
    if row.kind == "choice" and value in row.choices:
        return value
    wanted = {"switch": "on or off", "number": "a number", "whole": "a whole number"}
    raise InvalidInputError(f"{row.name}: {value!r}", expected=wanted.get(row.kind, ", ".join(row.choices)))


@functools.cache
def _docstrings(owner: Hashable) -> dict[str, str]:
    """Read the text below each field of a class and of those that it inherits from; none without a source."""
    texts: dict[str, str] = {}
    for base in reversed(inspect.getmro(cast("type[Any]", owner))[:-1]):
        try:
            body = ast.parse(textwrap.dedent(inspect.getsource(base))).body[0]
        except (OSError, TypeError, SyntaxError):
            continue
        lines = body.body if isinstance(body, ast.ClassDef) else []
        for line, below in itertools.pairwise(lines):
            if (
                isinstance(line, ast.AnnAssign)
                and isinstance(line.target, ast.Name)
                and isinstance(below, ast.Expr)
                and isinstance(below.value, ast.Constant)
            ):
                texts[line.target.id] = " ".join(str(below.value.value).split())
    return texts
