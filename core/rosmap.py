"""Maps as ROS map_server keeps them: a YAML beside a picture."""

from pathlib import Path
from typing import Any

import numpy as np
import yaml

from closedrooms.core.arrays import BoolArray, CellArray, handed_over
from closedrooms.core.errors import InvalidInputError
from closedrooms.core.files import read_text, write_bytes
from closedrooms.core.grid import FREE, OCCUPIED, UNKNOWN, GridFrame, OccupancyGrid, is_free, is_occupied

# 205 is p = 0.196078: a free_thresh of 0.196 keeps it unknown, 0.25 would reload it as free.
FREE_THRESH, OCCUPIED_THRESH = 0.196, 0.65
PIXEL_FREE, PIXEL_UNKNOWN, PIXEL_OCCUPIED = 254, 205, 0
# 20,000 x 20,000 cells are 1 km x 1 km at 0.05 m; a larger picture is refused before it is decoded.
MAX_CELLS = 400_000_000


def write_map(stem: Path, grid: OccupancyGrid) -> None:
    """Write ``<stem>.png`` and ``<stem>.yaml``, trinary (0.65 / 0.196), each whole or not at all.

    Args:
        stem: Path without suffix, e.g. ``out/map``.
        grid: Written with row 0 at the bottom of the picture.

    Raises:
        OutputError: The folder cannot be written.
    """
    import cv2

    values = np.arange(256).astype(np.uint8).view(np.int8)  # every cell value, at its place as a byte without sign
    shades = np.full(256, PIXEL_UNKNOWN, dtype=np.uint8)
    shades[is_free(values)] = PIXEL_FREE
    shades[is_occupied(values)] = PIXEL_OCCUPIED
    picture = stem.with_name(stem.name + ".png")
    write_bytes(picture, cv2.imencode(".png", shades[grid.cells[::-1].view(np.uint8)])[1].tobytes())
    frame = grid.frame
    text = (
        f"image: {picture.name}\n"
        "mode: trinary\n"
        f"resolution: {round(frame.resolution, 9)!r}\n"
        f"origin: [{round(frame.origin_x, 9)!r}, {round(frame.origin_y, 9)!r}, 0.0]\n"
        "negate: 0\n"
        f"occupied_thresh: {OCCUPIED_THRESH}\n"
        f"free_thresh: {FREE_THRESH}\n"
    )
    write_bytes(stem.with_name(stem.name + ".yaml"), text.encode())


def read_map(path: Path) -> OccupancyGrid:
    """Read a ROS map (map_server of ROS 1 and 2): PGM or PNG; trinary, scale or raw.

    In trinary maps, a grey value one off the usual unknown (205) still counts as unknown.

    Args:
        path: The YAML file. ``image:`` is relative to it; an absolute path that does not exist is looked for beside
            the YAML by its name.

    Returns:
        The grid in the map frame.

    Raises:
        InvalidInputError: A missing or broken file, a rotated origin, a picture that is too large.
    """
    fields = _read_yaml(path)
    resolution = _number(fields, "resolution", path)
    origin = fields.get("origin")
    if not isinstance(origin, list | tuple) or len(origin) not in {2, 3} or not all(map(_is_number, origin)):
        raise InvalidInputError(f"map origin {origin!r}", expected="[x, y, yaw] in metres and radians", where=path)
    if len(origin) == 3 and abs(float(origin[2])) > 1e-9:
        raise InvalidInputError(
            f"map origin with yaw {origin[2]}", expected="yaw 0 (rotated maps are not read)", where=path
        )
    mode = str(fields.get("mode", "trinary"))
    if mode not in {"trinary", "scale", "raw"}:
        raise InvalidInputError(f"map mode {mode!r}", expected="trinary, scale or raw", where=path)
    pixels, opaque = _read_picture(_picture_path(fields, path))
    if mode == "raw":
        levels = np.arange(256)
        table = np.where(levels <= 100, levels, UNKNOWN).astype(np.int8)
    else:
        table = _meanings(fields, mode, path)
    cells: CellArray = table[pixels[::-1]]
    if opaque is not None:
        cells[~opaque[::-1]] = UNKNOWN
    try:
        frame = GridFrame(resolution, float(origin[0]), float(origin[1]), *pixels.shape)
    except InvalidInputError as error:
        raise InvalidInputError(str(error), where=path) from error
    return OccupancyGrid(frame, handed_over(cells))


def _meanings(fields: dict[str, Any], mode: str, path: Path) -> CellArray:
    """The cell that each grey value stands for, shape (256,)."""
    negate = fields.get("negate", 0)
    if negate not in (0, 1, "0", "1"):  # True and False are 1 and 0
        raise InvalidInputError(f"map negate {_short(repr(negate))}", expected="0 or 1", where=path)
    negate = negate in (1, "1")
    occupied_above = _number(fields, "occupied_thresh", path, default=OCCUPIED_THRESH)
    free_below = _number(fields, "free_thresh", path, default=FREE_THRESH)
    if not 0.0 <= free_below < occupied_above <= 1.0:
        raise InvalidInputError(
            f"map thresholds free {free_below}, occupied {occupied_above}",
            expected="0 <= free < occupied <= 1",
            where=path,
        )
    levels = np.arange(256)
    p = (levels if negate else 255 - levels) / 255.0
    table = np.full(256, UNKNOWN, dtype=np.int8)
    if mode == "scale":
        between = (p - free_below) / (occupied_above - free_below) * 98.0 + 1.0
        table = np.clip(np.rint(between), 1, 99).astype(np.int8)
    table[p > occupied_above] = OCCUPIED
    table[p < free_below] = FREE
    if mode == "trinary" and not negate:
        # Others write 204 or 206 for unknown, or a free_thresh (0.25) that turns 205 into free.
        table[PIXEL_UNKNOWN - 1 : PIXEL_UNKNOWN + 2] = UNKNOWN
    return table


def _read_yaml(path: Path) -> dict[str, Any]:
    text = read_text(path, what="a ROS map (YAML)", max_bytes=1_000_000)
    try:
        fields = yaml.safe_load(text)
    except (yaml.YAMLError, RecursionError) as error:
        raise InvalidInputError("broken YAML", expected="a ROS map (YAML)", where=path) from error
    if not isinstance(fields, dict) or "image" not in fields:
        raise InvalidInputError("a YAML without 'image'", expected="a ROS map (image, resolution, origin)", where=path)
    return fields


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and bool(np.isfinite(value))


def _number(fields: dict[str, Any], key: str, path: Path, default: float | None = None) -> float:
    value = fields.get(key, default)
    if not _is_number(value):
        raise InvalidInputError(f"map {key} {value!r}", expected="a number", where=path)
    return float(value)  # type: ignore[arg-type]


def _picture_path(fields: dict[str, Any], path: Path) -> Path:
    """The picture that the YAML names: beside or below it; of an absolute path only where it exists, else its name."""
    named = Path(str(fields["image"]))
    folder = path.parent
    if named.is_absolute():
        if _exists(named):
            return named
        named = Path(named.name)
    elif ".." in named.parts:
        raise InvalidInputError(f"map image {str(named)!r}", expected="a picture in the folder of the YAML", where=path)
    if not _exists(folder / named):
        raise InvalidInputError(
            f"map image {_short(str(named))!r} is missing", expected="a PGM or PNG beside the YAML", where=path
        )
    return folder / named


def _exists(path: Path) -> bool:
    """Whether there is such a file; none has a name that the system refuses."""
    try:
        return path.exists()
    except OSError:
        return False


def _short(text: str, *, longest: int = 80) -> str:
    """A text for a message of one line."""
    return text if len(text) <= longest else f"{text[: longest - 3]}..."


def _read_picture(path: Path) -> tuple[np.ndarray[Any, np.dtype[np.uint8]], BoolArray | None]:
    """Grey values and, where some may be transparent, which pixels are not; the size is checked before decoding."""
    from PIL import Image

    Image.MAX_IMAGE_PIXELS = None
    try:
        with Image.open(path) as image:
            width, height = image.size
            if width * height > MAX_CELLS:
                raise InvalidInputError(
                    f"a picture of {width} x {height}", expected=f"at most {MAX_CELLS} cells", where=path
                )
            has_alpha = "A" in image.getbands() or "transparency" in image.info
            if has_alpha:
                rgba = np.asarray(image.convert("RGBA"))
                return np.asarray(image.convert("L")), rgba[..., 3] > 0
            if image.mode in {"I", "I;16"}:
                return _sixteen_bits(image), None
            return np.asarray(image if image.mode == "L" else image.convert("L")), None
    except InvalidInputError:
        raise
    except (OSError, ValueError, SyntaxError, EOFError) as error:
        raise InvalidInputError("a picture that cannot be read", expected="a PGM or PNG map", where=path) from error


def _sixteen_bits(image: Any) -> np.ndarray[Any, np.dtype[np.uint8]]:
    values = np.asarray(image).astype(np.int64)
    return (values >> 8 if values.max() > 255 else values).astype(np.uint8)
