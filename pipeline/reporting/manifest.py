"""What ``run.json`` says of how a result came about."""

import contextlib
import dataclasses
import functools
import sys
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
    found, folders = {}, _named_by_folders()
    for name in LIBRARIES:
        if name in folders:
            found[name] = folders[name]
            continue
        from importlib.metadata import PackageNotFoundError, version

        with contextlib.suppress(PackageNotFoundError):
            found[name] = version(name)
    return found


def _named_by_folders() -> dict[str, str]:
    """List the versions of installed packages as the names of their ``.dist-info`` folders say them.

    The standard library reads each package's whole description with a parser of mails: 0.05 s for ours.
    """
    found: dict[str, str] = {}
    for place in sys.path:
        with contextlib.suppress(OSError):
            for folder in Path(place).glob("*.dist-info"):
                name, _, version = folder.stem.partition("-")
                if version:
                    found.setdefault(name.replace("_", "-").lower(), version)
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
