"""Settings from a file laid over frozen dataclasses: plain JSON or TOML values checked against the types of fields."""

import math
import types
from collections.abc import Mapping
from dataclasses import MISSING, Field, fields, is_dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar, Union, cast, get_args, get_origin, get_type_hints

from closedrooms.core.errors import InvalidInputError
from closedrooms.core.nearest import unknown
from closedrooms.experiments.places import Url, read_place

Config = TypeVar("Config")


def overlaid(config: Config, values: Mapping[str, Any], *, key: str = "") -> Config:
    """Lay values over a configuration; what they do not name stays.

    Args:
        config: A dataclass, the dataclasses in it included.
        values: By name of the field.
        key: Path of the whole in its file, for messages.

    Raises:
        InvalidInputError: A key that no field has, a value of another type, or one that the configuration refuses.
    """
    items = fields(config)  # type: ignore[arg-type]
    current = {item.name: getattr(config, item.name) for item in items}
    changes = field_values(type(config), values, key=key, current=current)
    try:
        return replace(config, **changes)  # type: ignore[type-var]
    except InvalidInputError as error:
        raise InvalidInputError(f"{key}: {error}") if key else error from error


def field_values(owner: type[Any], values: Any, *, key: str = "", current: Mapping[str, Any]) -> dict[str, Any]:
    """Check values against the fields of a dataclass.

    Args:
        owner: The dataclass.
        values: By name of the field; hyphens count as underscores.
        key: Path of the whole in its file, for messages.
        current: What the values are laid over, by name of the field; the field's default where not given.

    Returns:
        The values as the fields take them: tuples, paths, dataclasses.

    Raises:
        InvalidInputError: See :func:`overlaid`.
    """
    if not isinstance(values, Mapping):
        raise _wrong(key, values, "a table of settings")
    known = {item.name: item for item in fields(owner)}
    hints = get_type_hints(owner)
    found = {}
    for given, value in values.items():
        name = str(given).replace("-", "_")
        if name not in known:
            raise InvalidInputError(unknown("setting", _join(key, str(given)), [_join(key, other) for other in known]))
        before = current[name] if name in current else _default(known[name])
        if not known[name].init:
            if value != before:
                raise _wrong(_join(key, name), value, f"{before}, which cannot be changed")
            continue
        found[name] = _converted(hints[name], value, _join(key, name), before)
    return found


def _default(item: "Field[Any]") -> Any:
    if item.default_factory is not MISSING:
        return item.default_factory()
    return None if item.default is MISSING else item.default


def _converted(hint: Any, value: Any, key: str, current: Any) -> Any:
    """Convert one value to what its field takes."""
    if get_origin(hint) is Annotated:
        hint = get_args(hint)[0]
    options = get_args(hint) if isinstance(hint, types.UnionType) or get_origin(hint) is Union else (hint,)
    if value is None:
        if type(None) in options:
            return None
        raise _wrong(key, value, _named(hint))
    plain: Any = next(option for option in options if option is not type(None))
    if is_dataclass(plain):
        start = current if is_dataclass(current) else cast("type[Any]", plain)()
        if not isinstance(value, Mapping):
            raise _wrong(key, value, "a table of settings")
        return overlaid(start, value, key=key)
    if Url in options and isinstance(value, str) and value:
        return read_place(value)
    if get_origin(plain) is tuple:
        return _sequence(plain, value, key)
    if get_origin(plain) is Literal:
        if value in get_args(plain) and not isinstance(value, bool):
            return value
        raise _wrong(key, value, f"one of {', '.join(map(str, get_args(plain)))}")
    return _scalar(plain, value, key)


def _sequence(hint: Any, value: Any, key: str) -> tuple[Any, ...]:
    """Convert a list of a file to a tuple of the types that a field wants."""
    items = get_args(hint)
    endless = items[-1] is Ellipsis
    if not isinstance(value, list | tuple) or not (endless or len(value) == len(items)):
        raise _wrong(key, value, _named(hint))
    kinds = [items[0]] * len(value) if endless else list(items)
    return tuple(
        _converted(kind, item, f"{key}[{number}]", None)
        for number, (kind, item) in enumerate(zip(kinds, value, strict=True))
    )


def _scalar(kind: Any, value: Any, key: str) -> Any:
    """Convert a single value of a file to the type that a field wants.

    Raises:
        InvalidInputError: It is of another type, or no finite number.
    """
    if kind is float and isinstance(value, int | float) and not isinstance(value, bool):
        if not math.isfinite(value):
            raise _wrong(key, value, "a finite number")
        return float(value)
    if kind is Path and isinstance(value, str) and value:
        return Path(value)
    if kind in {int, bool, str} and type(value) is kind:
        return value
    raise _wrong(key, value, _named(kind))


def _named(hint: Any) -> str:
    """Describe a type in words."""
    words = {float: "a number", int: "a whole number", bool: "true or false", str: "a text", Path: "a path"}
    if hint in words:
        return words[hint]
    if get_origin(hint) is tuple:
        items = get_args(hint)
        return "a list" if items[-1] is Ellipsis else f"a list of {len(items)}"
    options = [option for option in get_args(hint) if option is not type(None)]
    return _named(options[0]) if options else str(hint)


def _wrong(key: str, value: Any, expected: str) -> InvalidInputError:
    text = repr(value)
    shown = text if len(text) <= 80 else f"{text[:77]}..."
    return InvalidInputError(f"{key or 'the file'} is {shown}", expected=expected)


def _join(key: str, name: str) -> str:
    return f"{key}.{name}" if key else name
