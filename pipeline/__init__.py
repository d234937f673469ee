"""Whole jobs: a run in a simulated building, and each of its stages on anybody's files.

- One command a file: ``run``, ``predict``, ``map``, ``cover``, ``propose_doors``, ``edit``, ``view``, ``world_files``.
  Their options: ``config``, ``map_config``, ``worlds_config``, ``propose_doors_config``, ``view_config``. Doors
  given: ``given_doors``.
- Parts of a run: ``survey`` (explore and map), ``bounds``, ``drive``; several runs: ``runs``.
- ``reporting/``: progress, figures, tables, ``run.json``.

The main job is ``closedrooms.pipeline.run.run``: it is named like its module and so stands there.
"""

from typing import TYPE_CHECKING

from closedrooms.core.runtime.lazy import lazy_face

if TYPE_CHECKING:
    from closedrooms.pipeline.config import MapConfig as MapConfig
    from closedrooms.pipeline.config import RunConfig as RunConfig
    from closedrooms.pipeline.cover import cover_map as cover_map
    from closedrooms.pipeline.map import map_log as map_log
    from closedrooms.pipeline.map_config import CoverConfig as CoverConfig
    from closedrooms.pipeline.map_config import PredictConfig as PredictConfig
    from closedrooms.pipeline.predict import predict_map as predict_map
    from closedrooms.pipeline.propose_doors import doors_map as doors_map
    from closedrooms.pipeline.propose_doors_config import DoorsConfig as DoorsConfig

__getattr__, __dir__, __all__ = lazy_face(
    __name__,
    {
        "config": ("MapConfig", "RunConfig"),
        "cover": ("cover_map",),
        "map": ("map_log",),
        "map_config": ("CoverConfig", "PredictConfig"),
        "predict": ("predict_map",),
        "propose_doors": ("doors_map",),
        "propose_doors_config": ("DoorsConfig",),
    },
)
