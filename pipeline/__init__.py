"""Whole jobs: a run in a simulated building, and each of its stages on anybody's files.

- One command a file: ``run``, ``predict``, ``map``, ``cover``, ``propose_doors``, ``edit``, ``view``, ``world_files``.
  Their options: ``options/``. Doors given: ``given_doors``.
- Parts of a run: ``survey`` (explore and map), ``bounds``, ``drive``; several runs: ``runs``.
- ``reporting/``: progress, figures, tables, ``run.json``.

The main job is ``closedrooms.pipeline.run.run``: it is named like its module and so stands there.
"""

from typing import TYPE_CHECKING

from closedrooms.core.runtime.lazy import lazy_face

if TYPE_CHECKING:
    from closedrooms.pipeline.cover import cover_map as cover_map
    from closedrooms.pipeline.map import map_log as map_log
    from closedrooms.pipeline.options.cover import CoverConfig as CoverConfig
    from closedrooms.pipeline.options.doors import DoorsConfig as DoorsConfig
    from closedrooms.pipeline.options.map import MapConfig as MapConfig
    from closedrooms.pipeline.options.predict import PredictConfig as PredictConfig
    from closedrooms.pipeline.options.run import RunConfig as RunConfig
    from closedrooms.pipeline.predict import predict_map as predict_map
    from closedrooms.pipeline.propose_doors import doors_map as doors_map

__getattr__, __dir__, __all__ = lazy_face(
    __name__,
    {
        "cover": ("cover_map",),
        "map": ("map_log",),
        "options.cover": ("CoverConfig",),
        "options.doors": ("DoorsConfig",),
        "options.map": ("MapConfig",),
        "options.predict": ("PredictConfig",),
        "options.run": ("RunConfig",),
        "predict": ("predict_map",),
        "propose_doors": ("doors_map",),
    },
)
