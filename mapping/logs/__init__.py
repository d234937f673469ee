"""Recorded runs of robots: CARMEN logs, ROS bags, NumPy archives."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from closedrooms.mapping.logs.reader import read_run
    from closedrooms.mapping.logs.recorded_run import RecordedRun

__all__ = ["RecordedRun", "read_run"]

_OWNERS = {"RecordedRun": "recorded_run", "read_run": "reader"}


def __getattr__(name: str) -> Any:
    """Import a public name when it is asked for."""
    if name not in _OWNERS:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_OWNERS[name]}"), name)
