"""The trained network, run by OpenCV: no other package is needed to predict."""

import hashlib
import threading
from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from closedrooms.core.arrays import FloatArray
from closedrooms.core.errors import InvalidInputError
from closedrooms.core.files.incoming import is_folder, read_bytes
from closedrooms.predictor.learned.patches import CHANNELS, SIZE, Patch
from closedrooms.predictor.learned.sides import PARTS, SeenRoom, read_room

SHIPPED = Path(__file__).parent / "model.onnx"
FILE = SHIPPED.name
WHAT = "a model that closedrooms train wrote"
# Larger files are no model of ours [bytes]: ours has less than 5 MB.
MAX_BYTES = 64_000_000
# Behind the network stands its SHA-256, as a field that readers of ONNX pass over (number 2000, 32 bytes): OpenCV reads
# a file that was spoilt without a check, and the process ends there.
SEAL = b"\x82\x7d\x20"
OUTPUTS = ("mask", "columns", "rows")
SHAPES = ((1, SIZE, SIZE), (PARTS, SIZE // PARTS), (PARTS, SIZE // PARTS))
# Doors looked at at once, each with its mirror image.
BATCH = 8


class Model:
    """Network of the method ``learned``. Several threads may ask it, one after the other.

    Args:
        path: Its file (ONNX).

    Raises:
        InvalidInputError: No file, or none of a network with our inputs and outputs, or one that has changed since it
            was written.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._lock = threading.Lock()
        content = unseal(path)
        try:
            self._network = cv2.dnn.readNetFromONNX(np.frombuffer(content, dtype=np.uint8))
            answer = self.ask(np.zeros((2, len(CHANNELS), SIZE, SIZE), dtype=np.float32))
        except (cv2.error, SystemError) as error:
            raise InvalidInputError("no network that OpenCV runs", expected=WHAT, where=path) from error
        if any(part.shape != (2, *shape) for part, shape in zip(answer, SHAPES, strict=True)):
            raise InvalidInputError("a network with other outputs", expected=WHAT, where=path)

    def ask(self, patches: Any) -> Sequence[Any]:
        """Compute the outputs for patches of shape (n, 5, SIZE, SIZE), float32: logits by :data:`OUTPUTS`."""
        with self._lock:
            self._network.setInput(patches)
            return self._network.forward(OUTPUTS)

    def look(self, patches: Sequence[Patch]) -> list[SeenRoom]:
        """Look behind each door: average what the network says of a patch and of its mirror image."""
        rooms: list[SeenRoom] = []
        for first in range(0, len(patches), BATCH):
            some = patches[first : first + BATCH]
            shown = np.stack([patch.channels for patch in some])
            both = np.concatenate((shown, shown[..., ::-1]))
            answers = [self._unfold(part) for part in self.ask(np.ascontiguousarray(both, dtype=np.float32))]
            for at, patch in enumerate(some):
                mask, columns, rows = (part[[at, at + len(some)]] for part in answers)
                mask[1], columns[1] = mask[1, :, ::-1].copy(), columns[1, ::-1].copy()
                rooms.append(read_room(patch, mask.mean(axis=0), columns.mean(axis=0), rows.mean(axis=0)))
        return rooms

    @staticmethod
    def _unfold(part: Any) -> FloatArray:
        """Reshape cells to (n, SIZE, SIZE), columns and rows from groups of :data:`PARTS` to (n, SIZE)."""
        if part.ndim == 4:
            return np.asarray(part[:, 0], dtype=np.float64)
        return np.asarray(part.transpose(0, 2, 1).reshape(len(part), SIZE), dtype=np.float64)


def seal(content: bytes) -> bytes:
    """Append its SHA-256 to a network in ONNX: the file of a network as it is written."""
    return content + SEAL + hashlib.sha256(content).digest()


def unseal(path: Path) -> bytes:
    """Read the file of a network.

    Raises:
        InvalidInputError: It is none of ours, or has changed since it was written.
    """
    whole = read_bytes(path, what=WHAT, max_bytes=MAX_BYTES)
    content = whole[: -len(SEAL) - hashlib.sha256().digest_size]
    if whole != seal(content):
        raise InvalidInputError("another file, or one that was spoilt", expected=WHAT, where=path)
    return content


def load_model(path: Path | None) -> Model:
    """Load the network of a folder that ``closedrooms train`` wrote, or of a file; the shipped one for ``None``.

    Raises:
        InvalidInputError: See :class:`Model`.
    """
    if path is None:
        return _load(SHIPPED, 0)
    file = path / FILE if is_folder(path) else path
    try:
        changed = file.stat().st_mtime_ns
    except (OSError, ValueError):
        changed = 0
    return _load(file.absolute(), changed)


@lru_cache(maxsize=4)
def _load(path: Path, changed: int) -> Model:  # noqa: ARG001 (a file that was written anew is read anew)
    """Load a model once for each time that its file was changed."""
    return Model(path)
