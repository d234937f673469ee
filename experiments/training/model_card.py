"""The card of a model: what it is, what it was trained on, how good it was there, what it is not for."""

from collections.abc import Sequence

from closedrooms.core.names import shown
from closedrooms.experiments.training.config import TrainConfig
from closedrooms.experiments.training.trainer import Trained
from closedrooms.predictor.learned.patches import BEHIND, CELL, CHANNELS, SIZE

FILE = "MODEL.md"


def write_card(
    config: TrainConfig, trained: Trained, *, doors: tuple[int, int], fit: Sequence[str], held: Sequence[str]
) -> str:
    """Write the card as Markdown.

    Args:
        config: Of the training.
        trained: Its outcome.
        doors: How many were learned from, and how many held out.
        fit: Buildings learned from.
        held: Buildings held out.
    """
    best = trained.epochs[trained.best - 1]
    size = sum(weights.numel() for weights in trained.network.parameters())
    side = SIZE * CELL
    return f"""# The network of the method `learned`

**What it does.** Given the map around one closed door, it says how far the room behind the door reaches to the left, to
the right and back (a distribution each), and for each cell the probability that it lies in the room.

**In.** {len(CHANNELS)} channels ({", ".join(CHANNELS)}) of {SIZE} x {SIZE} cells of {CELL:g} m, {side:g} x {side:g} m,
turned so that the room lies ahead and the door {BEHIND:g} m from the near edge. **Out.** Logits `mask`, `columns` and
`rows` (`experiments/training/network.py`). A convolutional network of {size:,} weights, ONNX, run by OpenCV's `dnn`.

**Trained** by `closedrooms train` on {doors[0]:,} doors of {len(fit)} buildings (each door mirrored half of the time),
{trained.best} of {len(trained.epochs)} epochs kept: the one with the smallest loss on {doors[1]:,} doors of {len(held)}
other buildings, which were not learned from. Seed {config.seed}, batches of {config.batch}, rate {config.rate:g}.

| buildings held out | |
| --- | ---: |
| loss (cells, sides) | {best.held_loss:.3f} ({best.held_cells:.3f}, {best.held_sides:.3f}) |
| IoU of the most probable rectangle with that of the true room | {best.held_iou:.3f} |

**Not for.** Rooms that reach more than {side / 2:g} m to one side of their door or {side - BEHIND:g} m back; buildings
unlike those below; deciding anything where a wrong guess does harm. It has seen maps with closed doors drawn or made by
simulation only.

**Licence.** MIT, as closedrooms.

Learned from: {_join(fit)}.

Held out: {_join(held)}.
"""


def _join(names: Sequence[str]) -> str:
    return ", ".join(f"`{shown(name)}`" for name in names) or "none"
