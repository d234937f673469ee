"""Options of ``closedrooms train``."""

from dataclasses import dataclass
from pathlib import Path

import tyro

from closedrooms.core.errors import InvalidInputError
from closedrooms.core.runtime.options import check_least


@dataclass(frozen=True, kw_only=True)
class TrainConfig:
    """Options of a training: what the network of the method ``learned`` is trained on, and how."""

    datasets: tyro.conf.Positional[tuple[Path, ...]]
    """Folders written by ``closedrooms dataset``, or any with samples that hold truth_rooms.geojson."""

    out: Path
    """Folder to write: the model, its card and curves; the same command again goes on where it stopped."""

    epochs: int = 6
    """Passes over all doors; over them the learning rate falls to zero."""

    patience: int = 3
    """The training ends after so many passes in a row without a gain on the buildings held out."""

    held_out: float = 0.2
    """Share of the buildings that are not learned from and say when to stop."""

    batch: int = 32
    """Batch size [doors]."""

    rate: float = 0.003
    """Largest learning rate."""

    decay: float = 0.05
    """Weight decay."""

    threads: int = 2
    """Threads of torch; results repeat for the same number of them."""

    seed: int = 0
    """The one seed: which buildings are held out, first weights, order, mirror images."""

    def __post_init__(self) -> None:
        if not self.datasets:
            raise InvalidInputError("no dataset", expected="at least one folder")
        check_least(self, epochs=1, patience=1, batch=2, threads=1, seed=0)
        if not 0.0 < self.held_out < 1.0:
            raise InvalidInputError(f"held_out {self.held_out}", expected="a share between 0 and 1")
        for name in ("rate", "decay"):
            if not 0.0 <= getattr(self, name) <= 1.0:
                raise InvalidInputError(f"{name} {getattr(self, name)}", expected="a number from 0 to 1")
