"""From a trained network to a file that OpenCV runs."""

import contextlib
import io
import logging
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import torch

from closedrooms.core.errors import InvalidInputError
from closedrooms.core.files.outgoing import write_bytes
from closedrooms.experiments.training.batches import still_batches
from closedrooms.experiments.training.examples import Examples
from closedrooms.experiments.training.network import RoomNetwork
from closedrooms.predictor.learned.model import OUTPUT, Model, seal

# Logits of torch and of OpenCV may differ by this: both add up in 32 bits, in another order.
SAME = 1e-2
# Doors at a time, each with its mirror image, and doors that both are asked for.
SHAPE, COMPARED = 2, 16


def write_model(path: Path, network: RoomNetwork, examples: Examples) -> float:
    """Write a network as ONNX and make sure that OpenCV says the same of some doors as torch does.

    Args:
        path: To write.
        network: In evaluation mode.
        examples: Some of these are compared.

    Returns:
        Largest difference of a logit.

    Raises:
        InvalidInputError: OpenCV says something else.
        OutputError: The file cannot be written.
    """
    plain = network.to(memory_format=torch.contiguous_format)
    batch = next(still_batches(examples, np.arange(min(COMPARED, len(examples))), COMPARED))
    patches = torch.from_numpy(np.ascontiguousarray(batch.patches))
    with _quiet():
        program = torch.onnx.export(
            plain,
            (patches.repeat(SHAPE, 1, 1, 1)[:SHAPE],),
            input_names=["patches"],
            output_names=[OUTPUT, "columns", "rows"],
            dynamic_shapes={"patches": {0: torch.export.Dim("doors", min=1, max=1024)}},
            dynamo=True,
            verbose=False,
        )
    write_bytes(path, seal(_without_notes(program.model_proto).SerializeToString()))
    with torch.no_grad():
        expected = plain(patches)[0][:, 0].numpy()
    apart = float(np.abs(Model(path).ask(batch.patches) - expected).max())
    if not apart <= SAME:
        raise InvalidInputError(f"OpenCV and torch differ by {apart:.3g}", expected=f"at most {SAME:g}", where=path)
    return apart


def _without_notes(model: Any) -> Any:
    """Take what the exporter notes beside a network out of it: where the code stood on this machine, line by line."""
    graph = model.graph
    parts = (graph.node, graph.input, graph.output, graph.value_info, graph.initializer)
    for part in (model, graph, *(item for items in parts for item in items)):
        part.ClearField("metadata_props")
        part.ClearField("doc_string")
    return model


@contextlib.contextmanager
def _quiet() -> Iterator[None]:
    """Keep what the exporter prints to itself."""
    before = logging.root.manager.disable
    logging.disable(logging.WARNING)
    try:
        with warnings.catch_warnings(), contextlib.redirect_stdout(io.StringIO()):
            warnings.simplefilter("ignore")
            yield
    finally:
        logging.disable(before)
