"""The YAML of a ROS map: where the picture is, the size of a cell, the origin; numbers as yaml-cpp reads them."""

import math
from pathlib import Path
from typing import Any

from closedrooms.core.errors import InvalidInputError
from closedrooms.core.files.yaml_text import parse_yaml
from closedrooms.core.numbers import FARTHEST, bounded, repr_of
from closedrooms.core.pose import wrap_angle
from closedrooms.core.remarks import Remark

WHAT = "a ROS map (image, resolution, origin)"
MAX_YAML = 1_000_000
"""Longest description of a map that is read [bytes]."""
LARGEST_YAW = 2.0 * math.pi + 0.1
"""No yaw in radians is larger, but one in degrees is."""
SAME_YAW = 1e-9
"""A turn below this is none [rad]: 1 km away it moves a point by a micrometre."""


def read_fields(path: Path) -> dict[str, Any]:
    """Read the YAML of a map, every scalar as the text that stands there.

    map_server's reader (yaml-cpp) reads numbers by other rules than PyYAML, so they are parsed by :func:`number` and
    :func:`read_origin`.

    Raises:
        InvalidInputError: A missing or broken file, or one that names no picture.
    """
    # The safe loader reads it first: a file that it refuses is broken.
    parse_yaml(path, what=WHAT, max_bytes=MAX_YAML)
    fields = parse_yaml(path, what=WHAT, max_bytes=MAX_YAML, plain=True)
    if not isinstance(fields.get("image"), str):
        raise InvalidInputError("a YAML without 'image'", expected=WHAT, where=path)
    return fields


def number(fields: dict[str, Any], key: str) -> Any:
    """Parse the number of a field; ``None`` where the field is missing, its text where that is no number.

    A check of the result (:func:`~closedrooms.core.numbers.bounded`) can thus say what stands in the file.
    """
    if key not in fields:
        return None
    value = _as_number(fields[key])
    return fields[key] if value is None else value


def read_origin(value: Any, path: Path, remarks: list[Remark]) -> tuple[float, float, float]:
    """Read the pose of the map's lower left corner.

    Args:
        value: The field ``origin``.
        path: The YAML, for messages.
        remarks: What was guessed of the yaw is added here.

    Returns:
        ``x, y`` [m] and yaw [rad]; the yaw is 0 where the file has none, no number, or whole turns.

    Raises:
        InvalidInputError: No list of two or three numbers, or one out of bounds.
    """
    numbers = [_as_number(v) for v in value] if isinstance(value, list) else []
    if len(numbers) not in {2, 3} or None in numbers:
        raise InvalidInputError(
            f"map origin {repr_of(value)}", expected="[x, y, yaw] in metres and radians", where=path
        )
    x, y, yaw = (float(v) for v in (*numbers, 0.0)[:3] if v is not None)
    for name, coordinate in (("x", x), ("y", y)):
        bounded(coordinate, -FARTHEST, FARTHEST, name=f"map origin {name}", unit="m", where=path)
    if len(numbers) == 2 or math.isnan(yaw):
        remarks.append(Remark(action="guessed", what="yaw of the map", why="no number in the file, 0 was taken"))
        return x, y, 0.0
    turned = wrap_angle(bounded(yaw, -1e6, 1e6, name="map origin yaw", unit="rad", where=path))
    turned = turned if abs(turned) > SAME_YAW else 0.0
    if abs(yaw) > LARGEST_YAW and turned:
        why = f"{yaw:g} is more than a turn (degrees?); read as radians, as map_server does"
        remarks.append(Remark(action="guessed", what="yaw of the map", why=why))
    return x, y, turned


def _as_number(text: object) -> float | None:
    """Parse a number as yaml-cpp does (``5e-2``, ``-5e-05``, ``.5``, ``.nan``, quoted or not), ``None`` for none."""
    if not isinstance(text, str) or "_" in text:
        return None
    word = text.strip().lower()
    try:
        return float(word.replace(".", "") if word.lstrip("+-") in {".nan", ".inf"} else word)
    except ValueError:
        return None
