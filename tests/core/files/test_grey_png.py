import io

import cv2
import numpy as np
import pytest
from PIL import Image

from closedrooms.core.files.grey_png import STRIP, encode_greys

AS_THEY_ARE = np.arange(256, dtype=np.uint8)


def framed(rows: int, cols: int, first: int, last: int) -> np.ndarray:
    """Blank paper of 205 with noise in the rows from ``first`` to ``last``."""
    values = np.full((rows, cols), 205, dtype=np.uint8)
    values[first:last, cols // 3 :] = np.random.default_rng(rows).integers(0, 256, (last - first, cols - cols // 3))
    return values


@pytest.mark.parametrize(
    "values",
    [
        framed(1, 1, 0, 0),
        framed(1, 3, 0, 1),
        framed(7, 5, 3, 4),
        framed(STRIP, 9, 0, 0),
        framed(3 * STRIP, 40, 0, 0),
        framed(3 * STRIP + 1, 40, STRIP - 1, 2 * STRIP + 1),
        framed(4 * STRIP + 17, 300, 2 * STRIP + 5, 2 * STRIP + 9),
        framed(700, 1200, 0, 700),
        framed(700, 1200, 699, 700),
        framed(3000, 3000, 1400, 1500),
    ],
    ids=lambda values: f"{values.shape}",
)
@pytest.mark.filterwarnings("error")
def test_two_readers_find_what_was_written(values: np.ndarray) -> None:
    data = encode_greys(values, AS_THEY_ARE)
    with Image.open(io.BytesIO(data)) as image:
        image.verify()
    with Image.open(io.BytesIO(data)) as image:
        assert image.mode == "L"
        assert np.array_equal(np.asarray(image), values)
    assert np.array_equal(cv2.imdecode(np.frombuffer(data, dtype=np.uint8), cv2.IMREAD_UNCHANGED), values)


def test_shades_stand_for_values_and_rows_may_run_upwards() -> None:
    values = framed(600, 50, 10, 300)
    shades = AS_THEY_ARE[::-1].copy()
    data = encode_greys(values[::-1], shades)
    assert np.array_equal(cv2.imdecode(np.frombuffer(data, dtype=np.uint8), cv2.IMREAD_UNCHANGED), 255 - values[::-1])


def test_the_checksum_of_joined_pieces_is_that_of_the_whole() -> None:
    # Pillow's and OpenCV's readers overlook a wrong one.
    import struct
    import zlib

    values = framed(5 * STRIP + 3, 777, STRIP + 1, STRIP + 90)
    data = encode_greys(values, AS_THEY_ARE)
    start = data.index(b"IDAT")
    size = struct.unpack(">I", data[start - 4 : start])[0]
    raw = zlib.decompress(data[start + 4 : start + 4 + size])
    assert np.array_equal(np.frombuffer(raw, dtype=np.uint8).reshape(len(values), -1)[:, 1:], values)


def test_blank_paper_takes_few_bytes_but_not_fewer_than_a_reader_allows() -> None:
    values = np.full((6000, 6000), 205, dtype=np.uint8)
    data = encode_greys(values, AS_THEY_ARE)
    # core.files.map_picture refuses more than 1000 cells a byte.
    assert values.size / 1000 < len(data) < values.size / 800
