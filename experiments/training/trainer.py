"""The training itself: epochs over doors, early stopping by buildings, a checkpoint after each."""

import io
import math
import pickle
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor

from closedrooms.core.arrays import FloatArray, IntArray
from closedrooms.core.files.incoming import read_bytes
from closedrooms.core.files.outgoing import write_bytes
from closedrooms.core.random import stream
from closedrooms.experiments.training.batches import Batch, draw_batches, still_batches
from closedrooms.experiments.training.config import TrainConfig
from closedrooms.experiments.training.examples import ASIDE_CELLS, DOOR_ROW, Examples
from closedrooms.experiments.training.network import RoomNetwork

# What the cells count beside the sides in the loss: about as much.
CELLS = 20.0
# Cells that the map knows count so much beside the unknown ones: they are seldom in doubt.
KNOWN = 0.1
# Share of all steps over which the rate of learning grows to its largest.
WARM_UP = 0.1
LARGEST_GRADIENT = 1.0
# A checkpoint holds the weights four times, 19 MB [bytes].
WHAT, MAX_BYTES = "a checkpoint of closedrooms train", 500_000_000
# What reading one raises that is of another version, or cut off.
UNUSABLE = (RuntimeError, pickle.UnpicklingError, KeyError, TypeError, ValueError, EOFError)


@dataclass(frozen=True, slots=True)
class Epoch:
    """Figures of one pass.

    Attributes:
        number: From 1 on.
        rate: Of learning, at its end.
        loss: On what is learned from.
        held_loss: On the buildings held out.
        held_cells: The part of the cells in it.
        held_sides: That of the sides.
        held_iou: Overlap of the most probable rectangle with the rectangle of the true room, mean over the doors held
            out.
    """

    number: int
    rate: float
    loss: float
    held_loss: float
    held_cells: float
    held_sides: float
    held_iou: float


@dataclass(frozen=True, slots=True, eq=False)
class Trained:
    """Outcome of a training.

    Attributes:
        network: With the weights of the best epoch.
        epochs: Figures of all.
        best: Number of the best one.
    """

    network: RoomNetwork
    epochs: tuple[Epoch, ...]
    best: int


class Training:
    """Training in progress and its state.

    Args:
        config: Options.
        examples: All.
        fit: Which of them are learned from.
        held: Which of them say when to stop.
    """

    def __init__(self, config: TrainConfig, examples: Examples, fit: IntArray, held: IntArray) -> None:
        self.config, self.examples, self.fit, self.held = config, examples, fit, held
        torch.set_num_threads(config.threads)
        torch.use_deterministic_algorithms(True)
        torch.manual_seed(int(stream(config.seed, "weights").integers(2**31)))
        self.network = RoomNetwork().to(memory_format=torch.channels_last)
        self.optimizer = torch.optim.AdamW(self.network.parameters(), lr=config.rate, weight_decay=config.decay)
        self.epochs: list[Epoch] = []
        self.best: dict[str, Any] = {}
        self.steps = max(len(fit) // config.batch, 1)

    @property
    def best_epoch(self) -> Epoch:
        """Epoch with the smallest loss on the buildings held out, the first of several."""
        return min(self.epochs, key=lambda epoch: epoch.held_loss)

    @property
    def done(self) -> bool:
        """Whether all epochs are over, or nothing got better for long."""
        late = bool(self.epochs) and len(self.epochs) - self.best_epoch.number >= self.config.patience
        return late or len(self.epochs) >= self.config.epochs

    def resume(self, path: Path, key: str) -> bool:
        """Load a checkpoint of the same training to go on from; tell whether there was one."""
        if not path.is_file():
            return False
        try:
            kept = torch.load(io.BytesIO(read_bytes(path, what=WHAT, max_bytes=MAX_BYTES)), weights_only=True)
            if kept["key"] != key:
                return False
            self.network.load_state_dict(kept["network"])
            self.optimizer.load_state_dict(kept["optimizer"])
            self.best = kept["best"]
            self.epochs = [Epoch(**epoch) for epoch in kept["epochs"]]
        except UNUSABLE:
            return False
        return True

    def keep(self, path: Path, key: str) -> None:
        """Write a checkpoint.

        Raises:
            OutputError: It cannot be written.
        """
        data = io.BytesIO()
        torch.save(
            {
                "key": key,
                "network": self.network.state_dict(),
                "optimizer": self.optimizer.state_dict(),
                "best": self.best,
                "epochs": [asdict(epoch) for epoch in self.epochs],
            },
            data,
        )
        write_bytes(path, data.getvalue())

    def run_epoch(self, advance: Callable[[int], None]) -> Epoch:
        """Learn from every door once, then look at those held out."""
        number = len(self.epochs) + 1
        self.network.train()
        total, done, rate = 0.0, 0, 0.0
        for batch in draw_batches(self.examples, self.fit, self.config.batch, self.config.seed, number):
            rate = self._rate_at((number - 1) * self.steps + done)
            for group in self.optimizer.param_groups:
                group["lr"] = rate
            loss = sum(measure_loss(self._answer(batch), batch))
            self.optimizer.zero_grad(set_to_none=True)
            loss.backward()
            torch.nn.utils.clip_grad_norm_(self.network.parameters(), LARGEST_GRADIENT)
            self.optimizer.step()
            total, done = total + float(loss.detach()), done + 1
            advance((number - 1) * self.steps + done)
        cells, sides, iou = self._look_at_held()
        epoch = Epoch(number, rate, total / max(done, 1), cells + sides, cells, sides, iou)
        self.epochs.append(epoch)
        if self.best_epoch is epoch:
            self.best = {name: value.clone() for name, value in self.network.state_dict().items()}
        return epoch

    def finish(self) -> Trained:
        """Restore the network of the best epoch."""
        self.network.load_state_dict(self.best)
        self.network.eval()
        return Trained(self.network, tuple(self.epochs), self.best_epoch.number)

    def _rate_at(self, step: int) -> float:
        """Compute the rate of learning: straight up, then down along a cosine."""
        share = step / (self.steps * self.config.epochs)
        if share < WARM_UP:
            return self.config.rate * (share + 1 / (self.steps * self.config.epochs)) / WARM_UP
        return self.config.rate * 0.5 * (1.0 + math.cos(math.pi * (share - WARM_UP) / (1.0 - WARM_UP)))

    def _answer(self, batch: Batch) -> tuple[Tensor, Tensor, Tensor]:
        """Let the network rate a batch: mask, columns and rows, as logits."""
        patches = torch.from_numpy(batch.patches).contiguous(memory_format=torch.channels_last)
        with torch.autocast("cpu", torch.bfloat16, enabled=has_bfloat16()):
            mask, columns, rows = self.network(patches)
        return mask.float(), columns.float(), rows.float()

    def _look_at_held(self) -> tuple[float, float, float]:
        """Measure losses and the overlap of the most probable rectangle over all that is held out."""
        self.network.eval()
        totals = np.zeros(3)
        with torch.no_grad():
            for batch in still_batches(self.examples, self.held, 2 * self.config.batch):
                answer = self._answer(batch)
                cells, sides = measure_loss(answer, batch)
                overlap = _overlap([side.argmax(dim=1).numpy() for side in read_sides(*answer[1:])], batch)
                totals += np.array([float(cells), float(sides), overlap]) * len(batch.patches)
        cells_mean, sides_mean, iou = (totals / max(len(self.held), 1)).tolist()
        return cells_mean, sides_mean, iou


def has_bfloat16() -> bool:
    """Check whether this processor multiplies in bfloat16 itself: twice as quick there, slower elsewhere."""
    return bool(torch.cpu._is_avx512_bf16_supported())


def read_sides(columns: Tensor, rows: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """Split logits into left, right and back by cell, from the door outward."""
    across, ahead = (part.transpose(1, 2).flatten(1) for part in (columns, rows))
    return across[:, :ASIDE_CELLS].flip(1), across[:, ASIDE_CELLS:], ahead[:, DOOR_ROW:]


def measure_loss(answer: tuple[Tensor, Tensor, Tensor], batch: Batch) -> tuple[Tensor, Tensor]:
    """Measure how far an answer is from the truth: of the cells, and of the sides."""
    mask, columns, rows = answer
    weight = torch.from_numpy(KNOWN + (1.0 - KNOWN) * batch.patches[:, 2])
    wrong = torch.nn.functional.binary_cross_entropy_with_logits(
        mask[:, 0], torch.from_numpy(batch.masks), weight=weight
    )
    sides = [
        torch.nn.functional.cross_entropy(logits, torch.from_numpy(true))
        for logits, true in zip(read_sides(columns, rows), batch.sides, strict=True)
    ]
    return CELLS * wrong, sum(sides, torch.zeros(()))


def _overlap(sides: Sequence[IntArray], batch: Batch) -> float:
    """Measure the mean IoU of rectangles with the true ones, the door's wall as the front of both."""
    found = np.stack(sides) + 0.5
    true = np.stack([side.argmax(axis=1) for side in batch.sides]) + 0.5
    low: FloatArray = np.minimum(found, true)
    shared, areas = (low[0] + low[1]) * low[2], [(s[0] + s[1]) * s[2] for s in (found, true)]
    return float((shared / (areas[0] + areas[1] - shared)).mean())
