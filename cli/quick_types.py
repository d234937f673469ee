"""Types that tyro asks typeguard about, told without it: loading typeguard takes a third of a quick command's time."""

import types
from collections.abc import Callable
from typing import Any, Union, get_args, get_origin

from tyro import _resolver as resolver

Check = Callable[[Any, Any], bool]


def tell_quickly() -> None:
    """Let tyro know ``X | None`` and ``tuple[X, ...]`` by itself, as it knows ``Union`` already.

    The function is private to tyro, whose version pyproject.toml bounds; without it all works as before, only later.
    """
    theirs: Check | None = getattr(resolver, "is_instance", None)
    if theirs is not None and not hasattr(theirs, "before"):
        resolver.is_instance = _quick(theirs)  # type: ignore[assignment]


def _quick(theirs: Check) -> Check:
    """Make a check of types that takes typeguard only where a plain comparison does not do."""

    def is_instance(kind: Any, value: Any) -> bool:
        if isinstance(kind, types.UnionType) or get_origin(kind) is Union:
            return any(is_instance(option, value) for option in get_args(kind))
        items = get_args(kind)
        if get_origin(kind) is tuple and items[1:] == (Ellipsis,):
            return isinstance(value, tuple) and all(is_instance(items[0], item) for item in value)
        if get_origin(kind) is tuple and Ellipsis not in items:
            return (
                isinstance(value, tuple)
                and len(value) == len(items)
                and all(is_instance(item, part) for item, part in zip(items, value, strict=True))
            )
        return theirs(kind, value)

    is_instance.before = theirs  # type: ignore[attr-defined]
    return is_instance
