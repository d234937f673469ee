"""Floor plans in the formats of others: one file a format, each reads into a :class:`~closedrooms.worlds.FloorPlan`.

The names below are loaded when they are first used.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from closedrooms.worlds.formats.houseexpo import read_houseexpo
    from closedrooms.worlds.formats.kth import read_kth
    from closedrooms.worlds.formats.luperto import read_luperto
    from closedrooms.worlds.formats.native import plan_from, plan_text, read_plan, write_plan
    from closedrooms.worlds.formats.pyrobosim import read_pyrobosim
    from closedrooms.worlds.formats.rmf import read_rmf
    from closedrooms.worlds.formats.rosmap import read_raster
    from closedrooms.worlds.formats.sdf import write_sdf
    from closedrooms.worlds.formats.settlement import Source, settle
    from closedrooms.worlds.formats.stage import write_stage

_HOMES = {
    "houseexpo": ("read_houseexpo",),
    "kth": ("read_kth",),
    "luperto": ("read_luperto",),
    "native": ("plan_from", "plan_text", "read_plan", "write_plan"),
    "pyrobosim": ("read_pyrobosim",),
    "rmf": ("read_rmf",),
    "rosmap": ("read_raster",),
    "sdf": ("write_sdf",),
    "settlement": ("Source", "settle"),
    "stage": ("write_stage",),
}
_HOME_OF = {name: home for home, names in _HOMES.items() for name in names}

__all__ = [
    "Source", "plan_from", "plan_text", "read_houseexpo", "read_kth", "read_luperto", "read_plan", "read_pyrobosim",
    "read_raster", "read_rmf", "settle", "write_plan", "write_sdf", "write_stage",
]  # fmt: skip


def __getattr__(name: str) -> Any:
    if name in _HOME_OF:
        return getattr(import_module(f"{__name__}.{_HOME_OF[name]}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
