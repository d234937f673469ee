"""Hide a package from another one that would import it only to ask whether it is there."""

import contextlib
import sys
from collections.abc import Iterator
from importlib.abc import MetaPathFinder


@contextlib.contextmanager
def hidden(package: str) -> Iterator[None]:
    """Let the package be missing while the block runs, unless it is loaded by then."""
    finder = _Hidden(package)
    sys.meta_path.insert(0, finder)
    try:
        yield
    finally:
        sys.meta_path.remove(finder)


class _Hidden(MetaPathFinder):
    """Finder that says of one package that there is none."""

    def __init__(self, package: str) -> None:
        self._package = package

    def find_spec(self, name: str, *_: object) -> None:
        if name == self._package:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)
