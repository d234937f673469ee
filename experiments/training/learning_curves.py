"""How a training went, as a table and a picture."""

import csv
import io
from collections.abc import Sequence
from dataclasses import asdict, fields
from pathlib import Path

from closedrooms.core.files.outgoing import write_bytes
from closedrooms.experiments.training.trainer import Epoch

TABLE, PICTURE = "curves.csv", "curves.png"


def write_curves(folder: Path, epochs: Sequence[Epoch], best: int) -> None:
    """Write the figures of every epoch.

    Args:
        folder: To write into.
        epochs: In order.
        best: Number of the one that was kept.

    Raises:
        OutputError: They cannot be written.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    text = io.StringIO()
    writer = csv.DictWriter(text, [item.name for item in fields(Epoch)], lineterminator="\n")
    writer.writeheader()
    for epoch in epochs:
        writer.writerow({name: round(value, 6) for name, value in asdict(epoch).items()})
    write_bytes(folder / TABLE, text.getvalue().encode())
    numbers = [epoch.number for epoch in epochs]
    figure = Figure(figsize=(9.0, 3.6), layout="constrained")
    FigureCanvasAgg(figure)
    loss, overlap = figure.subplots(1, 2)
    loss.plot(numbers, [epoch.loss for epoch in epochs], "o-", label="learned from")
    loss.plot(numbers, [epoch.held_loss for epoch in epochs], "o-", label="buildings held out")
    loss.axvline(best, color="grey", linestyle=":", label="kept")
    loss.set(xlabel="epoch", ylabel="loss")
    loss.legend()
    overlap.plot(numbers, [epoch.held_iou for epoch in epochs], "o-", color="C1")
    overlap.axvline(best, color="grey", linestyle=":")
    overlap.set(xlabel="epoch", ylabel="IoU of the most probable rectangle, held out")
    picture = io.BytesIO()
    figure.savefig(picture, format="png", dpi=110, metadata={"Software": None})
    write_bytes(folder / PICTURE, picture.getvalue())
