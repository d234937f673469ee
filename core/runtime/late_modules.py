"""Modules that another package imports and that our use of it does not need: loaded when first used, or never.

Only in a process that is all ours: a user's own program finds every package whole.
"""

import contextlib
import importlib
import sys
from collections.abc import Iterator, Sequence
from types import ModuleType
from typing import Any

_OURS: list[bool] = []


def process_is_ours() -> None:
    """Say that this process runs one of our commands and nothing else."""
    _OURS.append(True)


@contextlib.contextmanager
def importing_less(late: Sequence[str], absent: Sequence[str] = ()) -> Iterator[None]:
    """Import packages inside the block without some of what they import; nothing happens where users import too.

    Args:
        late: Modules whose functions and instances are loaded by who calls them. Their parents are loaded already.
        absent: Packages that those imported can do without; they count as not installed.
    """
    wanted = [name for name in late if name not in sys.modules] if _OURS else []
    hidden = [name for name in absent if name not in sys.modules] if _OURS else []
    for name in wanted:
        parent, _, own = name.rpartition(".")
        sys.modules[name] = _LateModule(name)
        setattr(sys.modules[parent], own, sys.modules[name])
    # The interpreter's own mark of what is not there.
    sys.modules.update(dict.fromkeys(hidden))  # type: ignore[arg-type]
    try:
        yield
    finally:
        for name in wanted:
            _give_way(name)
        for name in hidden:
            del sys.modules[name]


def _give_way(module: str) -> None:
    """Remove a stand-in, so that the next import finds the module itself."""
    if isinstance(sys.modules.get(module), _LateModule):
        parent, _, own = module.rpartition(".")
        del sys.modules[module]
        delattr(sys.modules[parent], own)


class _LateModule(ModuleType):
    """Stand-in of a module: hands out stand-ins of what is in it."""

    def __getattr__(self, name: str) -> "_Late":
        if name.startswith("__"):
            raise AttributeError(name)
        return _Late(self.__name__, name)


class _Late:
    """Stand-in of a function or an instance, or of a submodule: the real one is looked up on every use."""

    def __init__(self, module: str, name: str) -> None:
        self._place = (module, name)

    def _load(self) -> Any:
        module, name = self._place
        _give_way(module)
        return getattr(importlib.import_module(module), name)

    def __call__(self, *arguments: Any, **named: Any) -> Any:
        return self._load()(*arguments, **named)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._load(), name)
