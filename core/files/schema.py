"""The version of what result folders hold, so that no program takes a newer folder for one that it knows."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from closedrooms.core.errors import InvalidInputError
from closedrooms.core.numbers import repr_of

SCHEMA = 1
"""Rises when a reader of before would misread a run directory or a dataset; what is only added leaves it."""
KEY = "schema"


def check_schema(manifest: Mapping[str, Any], path: Path | str) -> None:
    """Refuse the manifest of a newer closedrooms; one that names no version was written before there were any.

    Args:
        manifest: What ``run.json`` or ``manifest.json`` holds.
        path: That file or its address, for the message.

    Raises:
        InvalidInputError: A newer version, or none that there can be.
    """
    found = manifest.get(KEY, SCHEMA)
    if isinstance(found, bool) or not isinstance(found, int) or found < 1:
        raise InvalidInputError(f"schema version {repr_of(found)}", expected="a whole number from 1", where=path)
    if found > SCHEMA:
        raise InvalidInputError(
            f"schema version {found}, written by a newer closedrooms",
            expected=f"at most {SCHEMA}, which this version reads",
            where=path,
        )
