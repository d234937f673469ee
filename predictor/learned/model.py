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
from closedrooms.predictor.learned.seen_room import SeenRoom, read_room

SHIPPED = Path(__file__).parent / "model.onnx"
FILE = SHIPPED.name
WHAT = "a model that closedrooms train wrote"
# Larger files are no model of ours [bytes]: ours has less than 5 MB.
MAX_BYTES = 64_000_000
# Behind the network stands its SHA-256, as a field that readers of ONNX pass over (number 2000, 32 bytes): OpenCV reads
# a file that was spoilt without a check, and the process ends there.
SEAL = b"\x82\x7d\x20"
# Of the outputs of the network, the one that is asked for: with how far it says that a room reaches, rectangles were
# chosen less well (``ratings.OVERLAP``).
OUTPUT = "mask"
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
        except (cv2.error, SystemError, IndexError) as error:
            raise InvalidInputError("no network that OpenCV runs", expected=WHAT, where=path) from error
        if answer.shape != (2, SIZE, SIZE):
            raise InvalidInputError("a network with other outputs", expected=WHAT, where=path)

    def ask(self, patches: Any) -> FloatArray:
        """Compute the logits of the cells for patches of shape (n, 5, SIZE, SIZE), float32: shape (n, SIZE, SIZE)."""
        with self._lock:
            self._network.setInput(patches)
            return np.asarray(self._network.forward(OUTPUT), dtype=np.float64)[:, 0]

    def look(self, patches: Sequence[Patch]) -> list[SeenRoom]:
        """Look behind each door: average what the network says of a patch and of its mirror image."""
        rooms: list[SeenRoom] = []
        for first in range(0, len(patches), BATCH):
            some = patches[first : first + BATCH]
            shown = np.stack([patch.channels for patch in some])
            both = np.concatenate((shown, shown[..., ::-1]))
            masks = self.ask(np.ascontiguousarray(both, dtype=np.float32))
            means = (masks[: len(some)] + masks[len(some) :, :, ::-1]) / 2
            rooms += [read_room(patch, mask) for patch, mask in zip(some, means, strict=True)]
        return rooms


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
