"""Ground-truth datasets, evaluation, robustness and training, and the workers that they share.

``dataset.dataset.dataset`` and ``robustness.sweep.robustness`` are named like their packages and so stand there.

- Work: ``workers`` (local processes or a Dask cluster), ``local_workers``, ``worker_process`` (the set-up of each),
  ``scheduler_address`` (of the cluster).
- Files: ``places`` (a folder or an address, as typed), ``stores`` (reading and writing files at either),
  ``claimed_folder`` (an output that a command goes on with).
- Results: ``statistics``, ``tables`` (CSV and Parquet), ``html_page``.
"""

from typing import TYPE_CHECKING

from closedrooms.core.runtime.lazy import lazy_face

if TYPE_CHECKING:
    from closedrooms.experiments.dataset.config import DatasetConfig as DatasetConfig
    from closedrooms.experiments.evaluation.config import EvaluateConfig as EvaluateConfig
    from closedrooms.experiments.evaluation.evaluate import evaluate as evaluate
    from closedrooms.experiments.robustness.config import RobustnessConfig as RobustnessConfig

__getattr__, __dir__, __all__ = lazy_face(
    __name__,
    {
        "dataset.config": ("DatasetConfig",),
        "evaluation.config": ("EvaluateConfig",),
        "evaluation.evaluate": ("evaluate",),
        "robustness.config": ("RobustnessConfig",),
    },
)
