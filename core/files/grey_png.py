"""Maps as greyscale PNG, written quickly: most of a large map is blank, and equal blank rows are compressed once."""

import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Greys = npt.NDArray[np.uint8]

SIGNATURE = b"\x89PNG\r\n\x1a\n"
# Rows that are compressed at once: of 4000 cells 1 MB, twice that while they are.
STRIP = 256
# Largest prime below 2 ** 16 (RFC 1950, section 8.2).
ADLER_BASE = 65521
# A deflate stream of the quickest level and its empty last block (RFC 1950, 2.2; RFC 1951, 3.2.6).
HEAD, LAST_BLOCK = b"\x78\x01", b"\x03\x00"


@dataclass(frozen=True, slots=True)
class _Piece:
    """Some rows as whole blocks of a deflate stream, which stand for themselves wherever they are put.

    Attributes:
        packed: The blocks.
        adler: Checksum of the bytes that they unpack to.
        size: How many these are.
    """

    packed: bytes
    adler: int
    size: int


def encode_greys(values: Greys, shades: Greys) -> bytes:
    """Encode a picture as PNG (ISO/IEC 15948), 8 bits of grey a pixel, no row filtered.

    Args:
        values: Shape (rows, cols), the first row at the top; any strides.
        shades: The grey of each value, shape (256,).
    """
    rows, cols = values.shape
    packed, adler = [HEAD], 1
    for piece in _pieces(values, shades):
        packed.append(piece.packed)
        adler = _joined(adler, piece)
    packed += [LAST_BLOCK, struct.pack(">I", adler)]
    head = struct.pack(">IIBBBBB", cols, rows, 8, 0, 0, 0, 0)
    return SIGNATURE + _chunk(b"IHDR", head) + _chunk(b"IDAT", b"".join(packed)) + _chunk(b"IEND", b"")


def _pieces(values: Greys, shades: Greys) -> Iterator[_Piece]:
    """Compress the rows from the top to the bottom; what is blank above and below the drawing repeats one piece."""
    # Without a sign for every cell, which a large map has sixteen million of.
    inked = np.flatnonzero((values.max(axis=1) != values[0, 0]) | (values.min(axis=1) != values[0, 0]))
    first, last = (int(inked[0]), int(inked[-1]) + 1) if inked.size else (len(values), len(values))
    yield from _blank_pieces(values[:first], shades)
    for row in range(first, last, STRIP):
        yield _pack(values[row : min(row + STRIP, last)], shades)
    yield from _blank_pieces(values[last:], shades)


def _blank_pieces(values: Greys, shades: Greys) -> Iterator[_Piece]:
    """Compress rows that are all alike."""
    times, rest = divmod(len(values), STRIP)
    if times:
        yield from [_pack(values[:STRIP], shades)] * times
    if rest:
        yield _pack(values[:rest], shades)


def _pack(values: Greys, shades: Greys) -> _Piece:
    """Compress some rows, each after the byte that says it is not filtered."""
    import cv2

    raw = np.zeros((len(values), values.shape[1] + 1), dtype=np.uint8)
    raw[:, 1:] = cv2.LUT(np.ascontiguousarray(values), shades)
    # Runs of one grey are what a map is made of; a full flush ends the last block at a byte, and nothing after it
    # refers to what was before.
    packer = zlib.compressobj(1, zlib.DEFLATED, -zlib.MAX_WBITS, zlib.DEF_MEM_LEVEL, zlib.Z_RLE)
    return _Piece(packer.compress(raw.data) + packer.flush(zlib.Z_FULL_FLUSH), zlib.adler32(raw.data), raw.size)


def _joined(before: int, piece: _Piece) -> int:
    """Continue the checksum of what comes before with a piece, from the piece's own checksum."""
    low, high = before & 0xFFFF, before >> 16
    own_low, own_high = piece.adler & 0xFFFF, piece.adler >> 16
    high += own_high + piece.size * (low - 1)
    return (high % ADLER_BASE) << 16 | (low + own_low - 1) % ADLER_BASE


def _chunk(kind: bytes, content: bytes) -> bytes:
    """Wrap the content of a chunk in its length, kind and checksum."""
    return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))
