"""Untrusted archives: NumPy's and gzip, bounded in the size and the ratio of what they unpack to."""

import gzip
import io
import math
import zipfile
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from closedrooms.core.errors import InvalidInputError
from closedrooms.core.files.incoming import opened, reading

MAX_UNPACKED = 2_000_000_000
"""Most bytes that are unpacked: scans of 720 beams as float32 at 10 Hz for 19 hours."""
MAX_RATIO = 200
"""Most that anything large may shrink by: scans shrink 1.5 to 5 times, text logs 4 to 12 times, bombs 1000 times."""
UNSUSPICIOUS, UNSUSPICIOUS_LOG = 20_000_000, 2_000_000
"""What unpacks to less is read whatever its ratio [bytes]: scans of a robot that stands still and sees no noise are all
alike, lines of a log have stamps."""


def read_arrays(path: Path, *, what: str, max_bytes: int = MAX_UNPACKED) -> dict[str, np.ndarray[Any, Any]]:
    """Read the arrays of an untrusted ``.npz``, without pickles.

    The size that an array's head claims is compared with what is there before memory is taken.

    Args:
        path: The file.
        what: What it should be, for the message.
        max_bytes: Archives that unpack to more are refused.

    Raises:
        InvalidInputError: Missing, broken, encrypted, too large, shrunk too much, or with objects inside.
    """
    with opened(path, what) as file, reading(path, what), zipfile.ZipFile(file) as archive:
        entries = archive.infolist()
        _check_size(sum(e.file_size for e in entries), sum(e.compress_size for e in entries), path, what, max_bytes)
        arrays = {}
        for entry in entries:
            with archive.open(entry) as member:
                # The directory of an archive may lie about the size.
                content = member.read(entry.file_size + 1)
            arrays[entry.filename.removesuffix(".npy")] = _array(content, entry.filename, path, what)
        return arrays


def _check_size(
    unpacked: int, packed: int, path: Path, what: str, max_bytes: int, *, unsuspicious: int = UNSUSPICIOUS
) -> None:
    """Refuse an archive that is too large, or that unpacks to far more than it takes."""
    if unpacked > max_bytes:
        raise InvalidInputError(f"an archive of {unpacked} bytes", expected=f"{what}, at most {max_bytes}", where=path)
    if unpacked > unsuspicious and unpacked > MAX_RATIO * max(packed, 1):
        raise InvalidInputError(
            f"an archive of {packed} bytes that unpacks to {unpacked}",
            expected=f"{what}, packed {MAX_RATIO} to 1 at most",
            where=path,
        )


def _array(content: bytes, name: str, path: Path, what: str) -> np.ndarray[Any, Any]:
    """Build one array from its bytes (NumPy enhancement proposal 1)."""
    stream = io.BytesIO(content)
    version = np.lib.format.read_magic(stream)
    read_head = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
    shape, column_major, dtype = read_head(stream)
    if dtype.hasobject:
        raise InvalidInputError(f"array {name} of Python objects", expected=what, where=path)
    size = math.prod(shape) * dtype.itemsize
    start = stream.tell()
    if min((*shape, 0)) < 0 or size != len(content) - start:
        raise InvalidInputError(
            f"array {name} of {size} bytes, {len(content) - start} are there", expected=what, where=path
        )
    flat = np.frombuffer(content, dtype=dtype, offset=start) if size else np.zeros(0, dtype)
    return flat.reshape(shape, order="F" if column_major else "C")


class TruncatedError(InvalidInputError):
    """An archive that ends too early; what came before it was given."""


def log_lines(path: Path, *, gzipped: bool, what: str, longest: int, max_bytes: int = MAX_UNPACKED) -> Iterator[bytes]:
    """Read the lines of a text log and unpack them on the way.

    Args:
        path: The file.
        gzipped: Whether to unpack it.
        what: What it should be, for the message.
        longest: Longer lines are given in pieces [bytes].
        max_bytes: More than this is refused.

    Raises:
        InvalidInputError: See :func:`closedrooms.core.files.incoming.opened`; too large, shrunk too much.
        TruncatedError: The archive is cut off or damaged, after the lines before.
    """
    damage: Exception | None = None
    with opened(path, what) as file:
        source = gzip.GzipFile(fileobj=file) if gzipped else file
        unpacked = 0
        try:
            while line := source.readline(longest):
                unpacked += len(line)
                packed = file.tell() if gzipped else unpacked
                _check_size(unpacked, packed, path, what, max_bytes, unsuspicious=UNSUSPICIOUS_LOG)
                yield line
        except (EOFError, zlib.error, gzip.BadGzipFile) as error:
            damage = error
    if damage is not None:
        raise TruncatedError("a truncated archive", expected=what, where=path) from damage
