"""The picture of a ROS map: where its YAML says it is, and its grey values."""

import os
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any, BinaryIO
from urllib.parse import unquote

import numpy as np
import numpy.typing as npt

from closedrooms.core.arrays import BoolArray
from closedrooms.core.errors import InvalidInputError
from closedrooms.core.files.incoming import is_file, opened, reading
from closedrooms.core.names import shown

WHAT = "a PGM or PNG map"
GREYS = "greys or colours of 8 or 16 bits"
MOST_SIXTEEN_BITS = 65_535
# 20,000 x 20,000 cells are 1 km x 1 km at 0.05 m; a larger picture is refused before it is decoded.
MAX_CELLS = 400_000_000
# Pictures above the first number of cells have at most the second number of cells a byte: PNG shrinks blank paper up to
# 1000 times (8000 at one bit a pixel), maps of buildings 20 to 300 times.
UNSUSPICIOUS_CELLS, MAX_CELLS_A_BYTE = 30_000_000, 1000
FORMATS = ("PNG", "PPM", "BMP", "TIFF", "JPEG", "GIF", "WEBP")
# What such files begin with.
JPEG, PNG = b"\xff\xd8\xff", b"\x89PNG\r\n\x1a\n"
# Rows that are converted at once.
STRIP = 256
SCHEME = re.compile(r"(?i)(file|package|model|https?)://")


def picture_path(image: str, path: Path, *, allow_outside: bool = False) -> tuple[Path, bool]:
    """Find the picture that a map's YAML names, in any form that people write.

    Sub-folders, ``~``, ``..``, ``file://``, ``package://`` and backslashes are understood. What the path leads to is
    opened when it lies in the YAML's folder; otherwise the file of the same name beside the YAML is taken.

    Args:
        image: The field ``image``.
        path: The YAML.
        allow_outside: Also open what lies elsewhere, where there is such a file.

    Returns:
        The picture, and whether it is another one than the field names.

    Raises:
        InvalidInputError: It is not there, or lies outside and ``allow_outside`` is not set.
    """
    folder = path.parent
    named = _named(image)
    inside = folder / named
    if is_file(inside) and (allow_outside or _lies_in(inside, folder)):
        return inside, False
    beside = folder / named.name
    if named.name and is_file(beside) and _lies_in(beside, folder):
        return beside, beside != inside
    if is_file(inside):
        raise InvalidInputError(
            f"map image {shown(image, longest=80)!r} lies outside the folder of the YAML",
            expected="a picture in it, or --allow-outside",
            where=path,
        )
    raise InvalidInputError(
        f"map image {shown(image, longest=80)!r} is missing", expected="a PGM or PNG beside the YAML", where=path
    )


def _named(image: str) -> Path:
    """Find the path that ``image`` means; of a package only the part below it can be known."""
    text = image.strip().replace("\\", "/")
    text = re.sub("/{2,}", "/", text) if not SCHEME.match(text) else text
    scheme = SCHEME.match(text)
    if scheme:
        rest = unquote(text[scheme.end() :])
        host, slash, below = rest.partition("/")
        # file://host/path and file:///path; the first word of the others is a package or host.
        text = (f"/{below}" if slash else host) if scheme[1].lower() == "file" else below
    elif text.lower().startswith("file:"):
        text = unquote(text[len("file:") :])
    elif re.match("[A-Za-z]:/", text):
        text = text[2:]
    named = Path(text)
    try:
        return named.expanduser()
    except RuntimeError:  # ~somebody who is not known here
        return named


def _lies_in(path: Path, folder: Path) -> bool:
    """Check whether a file lies in a folder or below it, symbolic links followed."""
    try:
        return path.resolve().is_relative_to(folder.resolve())
    except (OSError, RuntimeError, ValueError):
        return False


def is_jpeg(path: Path) -> bool:
    """Check whether a picture is a JPEG, whose greys are not quite those that were saved.

    Raises:
        InvalidInputError: Missing, or no regular file.
    """
    with opened(path, WHAT) as file:
        return file.read(len(JPEG)) == JPEG


def read_picture(path: Path) -> tuple[npt.NDArray[np.uint8], BoolArray | None]:
    """Read grey values and, where some may be transparent, which pixels are not; check the size before decoding.

    Returns:
        Grey values, shape (rows, cols), the first row at the top, and opaque pixels of the same shape or ``None``.

    Raises:
        InvalidInputError: Missing, no picture, broken, or too large.
    """
    from PIL import Image

    # Our own bound comes before decoding, and its message names the file.
    Image.MAX_IMAGE_PIXELS = None
    with opened(path, WHAT) as file, reading(path, WHAT):
        try:
            with _opened_picture(file) as image:
                _check_size(image.size, os.fstat(file.fileno()).st_size, path)
                if image.mode == "F":
                    raise InvalidInputError("a picture of floating-point greys", expected=GREYS, where=path)
                return _greys(image, path)
        except (OSError, SyntaxError, EOFError) as error:
            raise InvalidInputError("a picture that cannot be read", expected=WHAT, where=path) from error


def _opened_picture(file: BinaryIO) -> Any:
    """Open a picture of a kind that maps come in."""
    from PIL import Image
    from PIL.PngImagePlugin import PngImageFile

    begin = file.read(len(PNG))
    file.seek(0)
    # Most are PNG; for the others Pillow loads five kinds first.
    if begin == PNG:
        return PngImageFile(file)
    # The other formats that Pillow knows start other programs (EPS) or hold no maps.
    return Image.open(file, formats=FORMATS)


def _check_size(size: tuple[int, int], file_bytes: int, path: Path) -> None:
    """Refuse a picture of more cells than a map has, or than its bytes can hold."""
    width, height = size
    most = min(MAX_CELLS, max(file_bytes * MAX_CELLS_A_BYTE, UNSUSPICIOUS_CELLS))
    if width * height > most:
        raise InvalidInputError(
            f"a picture of {width} x {height}", expected=f"at most {most} cells in {file_bytes} bytes", where=path
        )


def _greys(image: Any, path: Path) -> tuple[npt.NDArray[np.uint8], BoolArray | None]:
    """Convert a picture to greys, 0 to 255, and where it is not transparent (``None`` where it cannot be)."""
    if "A" in image.getbands() or "transparency" in image.info:
        # By way of RGBA: of a palette with transparent colours Pillow makes no greys without a warning.
        opaque = _by_strips(image, lambda part: np.asarray(part.convert("RGBA").getchannel("A")))
        return _by_strips(image, lambda part: _mean_of_colours(part.convert("RGBA"))), opaque > 0
    if image.mode in {"I", "I;16", "I;16B", "I;16L"}:
        return _sixteen_bits(image, path), None
    if image.mode in {"L", "1"}:
        return _by_strips(image, lambda part: np.asarray(part.convert("L"))), None
    return _by_strips(image, lambda part: _mean_of_colours(part.convert("RGB"))), None


def _by_strips(image: Any, convert: Callable[[Any], npt.NDArray[np.uint8]]) -> npt.NDArray[np.uint8]:
    """Convert a picture some rows at a time: at once Pillow holds the whole three times, colours even more often."""
    width, height = image.size
    # From the bottom up, as the cells of a grid lie.
    values = np.empty((height, width), dtype=np.uint8)
    for top in range(0, height, STRIP):
        low = min(top + STRIP, height)
        values[height - low : height - top] = convert(image.crop((0, top, width, low)))[::-1]
    return values[::-1]


def _mean_of_colours(image: Any) -> npt.NDArray[np.uint8]:
    """Average red, green and blue as map_server does: how bright eyes find a colour does not count."""
    total = np.asarray(image)[..., :3].sum(axis=-1, dtype=np.uint16)
    # Rounded: thirds are never halves.
    return np.asarray((2 * total + 3) // 6, dtype=np.uint8)


def _sixteen_bits(image: Any, path: Path) -> npt.NDArray[np.uint8]:
    """Convert greys of 16 bits to 8; values up to 255 are taken as they are."""
    values = np.asarray(image).astype(np.int64)
    if values.max() > MOST_SIXTEEN_BITS or values.min() < 0:
        raise InvalidInputError("a picture of greys beyond 16 bits", expected=GREYS, where=path)
    return (values >> 8 if values.max() > 255 else values).clip(0, 255).astype(np.uint8)
