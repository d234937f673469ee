"""Floor plans in the formats of others: one file a format, each reads into a :class:`~closedrooms.worlds.FloorPlan`.

Read: ``luperto``, ``kth``, ``houseexpo``, ``rmf`` (by ``rmf_level``), ``pyrobosim``, ``native`` and the maps of
``raster/``; written: ``native`` and the formats of ``exports/``. Every importer ends with ``import_checks``; those
whose format lists rooms but no walls share ``rooms_only/``. ``xml_text`` reads and writes XML.
"""

from typing import TYPE_CHECKING

from closedrooms.core.runtime.lazy import lazy_face

if TYPE_CHECKING:
    from closedrooms.worlds.formats.exports.sdf import write_sdf as write_sdf
    from closedrooms.worlds.formats.exports.stage import write_stage as write_stage
    from closedrooms.worlds.formats.houseexpo import read_houseexpo as read_houseexpo
    from closedrooms.worlds.formats.import_checks import Source as Source
    from closedrooms.worlds.formats.import_checks import settle as settle
    from closedrooms.worlds.formats.kth import read_kth as read_kth
    from closedrooms.worlds.formats.luperto import read_luperto as read_luperto
    from closedrooms.worlds.formats.native import plan_from as plan_from
    from closedrooms.worlds.formats.native import plan_text as plan_text
    from closedrooms.worlds.formats.native import read_plan as read_plan
    from closedrooms.worlds.formats.native import write_plan as write_plan
    from closedrooms.worlds.formats.pyrobosim import read_pyrobosim as read_pyrobosim
    from closedrooms.worlds.formats.raster.rosmap import read_raster as read_raster
    from closedrooms.worlds.formats.rmf import read_rmf as read_rmf

__getattr__, __dir__, __all__ = lazy_face(
    __name__,
    {
        "exports.sdf": ("write_sdf",),
        "exports.stage": ("write_stage",),
        "houseexpo": ("read_houseexpo",),
        "import_checks": ("Source", "settle"),
        "kth": ("read_kth",),
        "luperto": ("read_luperto",),
        "native": ("plan_from", "plan_text", "read_plan", "write_plan"),
        "pyrobosim": ("read_pyrobosim",),
        "raster.rosmap": ("read_raster",),
        "rmf": ("read_rmf",),
    },
)
