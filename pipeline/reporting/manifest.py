"""What ``run.json`` says of how a result came about."""

import contextlib
import dataclasses
import functools
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from closedrooms.core.files.incoming import is_there

# The libraries whose version can change a result.
LIBRARIES = (
    "closedrooms", "pybullet", "numpy", "scipy", "opencv-python-headless", "shapely", "scikit-learn", "scikit-image",
    "networkx", "ortools", "trimesh", "rerun-sdk",
)  # fmt: skip


def versions() -> dict[str, str]:
    """Look up the version of every library that can change a result."""
    return dict(_versions())


@functools.cache
def _versions() -> dict[str, str]:
    found = {}
    for name in LIBRARIES:
        with contextlib.suppress(PackageNotFoundError):
            found[name] = version(name)
    return found


def resolved(config: Any, *, leave_out: tuple[str, ...] = ("out",)) -> dict[str, Any]:
    """Write a configuration as plain JSON values, without the fields (``leave_out``) that hold paths of this run."""
    values = dataclasses.asdict(config)
    return {name: _plain(value) for name, value in values.items() if name not in leave_out}


def input_path(given: str | Path) -> str:
    """Write an input as a run elsewhere finds it again: a file by its whole path, a name as it is."""
    return str(Path(given).resolve()) if isinstance(given, Path) or is_there(Path(given)) else given


def _plain(value: Any) -> Any:
    """Turn a value into what JSON holds: paths as text, tuples as lists."""
    if isinstance(value, dict):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, Path):
        return str(value)
    return value
