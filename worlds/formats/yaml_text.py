"""Untrusted YAML, read by the safe loader."""

from pathlib import Path
from typing import Any

from closedrooms.core.errors import InvalidInputError
from closedrooms.core.files import read_text

MAX_BYTES = 20_000_000


def parse_yaml(path: Path, *, what: str) -> dict[str, Any]:
    """The mapping that a YAML file holds.

    Raises:
        InvalidInputError: Missing, too large, broken, or no mapping.
    """
    import yaml

    content = read_text(path, what=what, max_bytes=MAX_BYTES)
    # The same safe loader in C is ten times faster; not every build has it.
    loader = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
    try:
        data = yaml.load(content, Loader=loader)
    except (yaml.YAMLError, RecursionError, ValueError) as error:
        raise InvalidInputError("broken YAML", expected=what, where=path) from error
    if not isinstance(data, dict):
        raise InvalidInputError("a YAML without fields", expected=what, where=path)
    return data
