"""Bounds on what a bag unpacks to: rosbags itself takes whatever a chunk, a message or a whole file holds."""

import bz2
import contextlib
import resource
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from closedrooms.core.errors import InvalidInputError
from closedrooms.core.files.archives import MAX_UNPACKED

WHAT = "a rosbag"
MAX_CHUNK = 200_000_000
"""Most that one chunk or message unpacks to [bytes]: recorders begin a new chunk after 0.75 to 10 MB."""


@contextlib.contextmanager
def limited(path: Path) -> Iterator[None]:
    """Open a bag inside: chunks bounded, copies of whole files bounded.

    Raises:
        InvalidInputError: A chunk that unpacks to too much.
    """
    _limit_chunks(path)
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    soft = MAX_UNPACKED if before[0] == resource.RLIM_INFINITY else min(MAX_UNPACKED, before[0])
    # Files that were compressed whole are unpacked into a temporary one; writing more than this is an error.
    resource.setrlimit(resource.RLIMIT_FSIZE, (soft, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


def _limit_chunks(path: Path) -> None:
    """Put decompressors with a bound in the place of those of rosbags."""
    from lz4.frame import LZ4FrameDecompressor
    from rosbags.rosbag1 import reader as ros1
    from rosbags.rosbag2 import reader as ros2
    from rosbags.rosbag2 import storage_mcap as mcap

    # Of the standard library or its backport, by the version of Python.
    zstd: Any = vars(ros2)["zstd"]
    unpack_zstd = _unpacking(zstd.ZstdDecompressor, path)
    unpack_lz4 = _unpacking(LZ4FrameDecompressor, path)
    ros1.decompressors.update({"bz2": _unpacking(bz2.BZ2Decompressor, path), "lz4": unpack_lz4})
    mcap.DECOMPRESSORS.update(lz4=lambda data, _: unpack_lz4(data), zstd=lambda data, _: unpack_zstd(data))
    bounded = {"open": zstd.open, "decompress": unpack_zstd, "ZstdDecompressor": zstd.ZstdDecompressor}
    vars(ros2)["zstd"] = SimpleNamespace(**bounded)


def _unpacking(decompressor: Callable[[], Any], path: Path) -> Callable[[bytes], bytes]:
    """Make a function that unpacks one chunk and refuses what would not fit into memory."""

    def unpack(data: bytes) -> bytes:
        unpacker = decompressor()
        content: bytes = unpacker.decompress(data, MAX_CHUNK)
        if len(content) == MAX_CHUNK and not unpacker.eof:
            raise InvalidInputError(
                f"a chunk of {len(data)} bytes that unpacks to more than {MAX_CHUNK}", expected=WHAT, where=path
            )
        return content

    return unpack
