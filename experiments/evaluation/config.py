"""Options of ``closedrooms evaluate``."""

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import tyro

from closedrooms.core.errors import InvalidInputError
from closedrooms.core.runtime.options import check_least
from closedrooms.experiments.places import Place
from closedrooms.experiments.scheduler_address import check_scheduler
from closedrooms.pipeline.options.cover import check_completions
from closedrooms.predictor.methods import find_method

COMPARED = ("paper", "best", "rose", "line-of-sight", "geometric")


def sort_methods(names: Iterable[str]) -> list[str]:
    """Sort names of methods as in the tables: ours first, then the rest by name."""
    return sorted(set(names), key=lambda name: (COMPARED.index(name) if name in COMPARED else len(COMPARED), name))


@dataclass(frozen=True, kw_only=True)
class EvaluateConfig:
    """Options of an evaluation: what is compared with what."""

    datasets: tyro.conf.Positional[tuple[Place, ...]]
    """Folders that ``closedrooms dataset`` wrote (with manifest.json), or the address of shards; in any other folder, a
    sample is any folder below that holds map.yaml, doors.geojson and truth.yaml."""

    out: Path
    """Folder to write; the same command again goes on where it stopped."""

    methods: tuple[str, ...] = COMPARED
    """Methods to compare; ``learned`` can be named too."""

    workers: int = 2
    """Local processes."""

    scheduler: str | None = None
    """A Dask scheduler, ``tcp://host:port``, that does the work instead; its workers must see the same folders."""

    tours: bool = True
    """Plan coverage tours too (paper, section 5), on every sample whose run.json says how many rooms the robot saw."""

    probability: bool = False
    """Write each sample's probability of every cell too (``probability.yaml`` and ``.png``), about 20 kB a map."""

    completions: int = 0
    """Also estimate the cost of coverage of every sample as a distribution, from so many draws of what the rooms may
    be, and how often the true cost lies in its interval; 0 leaves it out. Works with ``--no-tours`` too."""

    worst: int = 12
    """Samples on the contact sheet of the worst cases."""

    resamples: int = 2000
    """Resamples of the bootstrap intervals."""

    subset_worlds: int = 15
    """Environments in the subset of section 5.3, spread evenly over all in the order of their names."""

    subset_repetitions: int = 10
    """Repetitions of each environment in that subset: the first ones."""

    def __post_init__(self) -> None:
        if not self.datasets:
            raise InvalidInputError("no dataset", expected="at least one folder")
        if not self.methods or len(set(self.methods)) != len(self.methods):
            raise InvalidInputError(f"methods {self.methods}", expected="each once")
        for name in self.methods:
            find_method(name)
        check_least(self, workers=1, resamples=1, subset_worlds=1, subset_repetitions=1)
        check_completions(self.completions)
        check_scheduler(self.scheduler)
