"""SLAM and nothing else: scans and odometry in, poses, the map and closed doors out.

The names below are loaded when they are first asked for: importing the package is quick.
"""

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from closedrooms.mapping.config import LoopConfig, MapperConfig, MatcherConfig, RecoveryConfig
    from closedrooms.mapping.graph.keyframe import Keyframe
    from closedrooms.mapping.mapper import Mapper
    from closedrooms.mapping.scan_preparation import Sweep, sweeps
    from closedrooms.mapping.trajectory import align, ate

__all__ = [
    "Keyframe",
    "LoopConfig",
    "Mapper",
    "MapperConfig",
    "MatcherConfig",
    "RecoveryConfig",
    "Sweep",
    "align",
    "ate",
    "sweeps",
]

_MODULES = {
    "Keyframe": "graph.keyframe",
    "LoopConfig": "config",
    "Mapper": "mapper",
    "MapperConfig": "config",
    "MatcherConfig": "config",
    "RecoveryConfig": "config",
    "Sweep": "scan_preparation",
    "align": "trajectory",
    "ate": "trajectory",
    "sweeps": "scan_preparation",
}


def __getattr__(name: str) -> Any:
    """Load a public name from its module (PEP 562)."""
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(f"{__name__}.{_MODULES[name]}"), name)


def __dir__() -> list[str]:
    return __all__
