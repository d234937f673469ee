"""Where a dataset is: a folder of this machine, or an address in an object store; nothing heavy is imported."""

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

from tyro.constructors import PrimitiveConstructorSpec

ADDRESS = re.compile(r"[A-Za-z][A-Za-z0-9+.-]*://.*", re.DOTALL)
LOCAL = "file://"


class Url(str):
    """Address of a folder as fsspec reads it, ``s3://bucket/folder``, ``gs://``, ``memory://``; no slash at the end.

    Not a path: :class:`pathlib.Path` makes one slash of two.
    """

    __slots__ = ()

    @property
    def name(self) -> str:
        """Last part of the address."""
        return self.rpartition("/")[2]


def read_place(text: str) -> Path | Url:
    """Read what was typed: ``scheme://`` begins an address; ``file://``, and all else, is a path of this machine."""
    if text.startswith(LOCAL):
        return Path(text.removeprefix(LOCAL))
    return Url(text.rstrip("/")) if ADDRESS.fullmatch(text) else Path(text)


def _is_place(value: object) -> bool:
    return isinstance(value, Path | Url)


def _typed(value: Path | Url) -> list[str]:
    return [str(value)]


def _read(words: Sequence[str]) -> Path | Url:
    return read_place(words[0])


Place = Annotated[
    Path | Url,
    PrimitiveConstructorSpec(
        nargs=1, metavar="DIR|URL", instance_from_str=_read, is_instance=_is_place, str_from_instance=_typed
    ),
]
"""A folder or an address, as an option of the command line."""
