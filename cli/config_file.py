"""What ``--config`` reads: settings that somebody wrote, or the manifest of an earlier result."""

from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any

from closedrooms.core.errors import InvalidInputError
from closedrooms.core.files.incoming import read_json, read_text
from closedrooms.core.files.schema import check_schema

# A configuration has some hundred numbers, a manifest a few for each door or sample.
MOST_BYTES = 50_000_000


def read_settings(path: Path, command: str, config: type[Any]) -> dict[str, Any]:
    """Read settings of a command as plain values by field.

    A manifest (``run.json``; ``manifest.json`` of a dataset) gives the configuration of its result and the inputs
    that it was made from, never where it was written. Any other file gives what it names.

    Args:
        path: TOML where it ends so, else JSON.
        command: Whose settings are wanted.
        config: Its configuration class.

    Raises:
        InvalidInputError: The file cannot be read, holds no table, or is the manifest of another command or of a newer
            version.
    """
    data = _parsed(path)
    if not isinstance(data, dict):
        raise InvalidInputError("no table of settings", expected=f"settings of closedrooms {command}", where=path)
    configuration = data.get("configuration")
    if not isinstance(configuration, dict):
        return data
    check_schema(data, path)
    maker = data.get("command", command)
    if maker != command:
        raise InvalidInputError(
            f"settings of closedrooms {maker}", expected=f"those of closedrooms {command}", where=path
        )
    values = {**_inputs(data), **configuration}
    known = {item.name for item in fields(config)}
    values = {name: value for name, value in values.items() if name in known or name in configuration}
    values.pop("out", None)
    return values


def _inputs(manifest: Mapping[str, Any]) -> dict[str, Any]:
    """List what a result was made from: its paths; of a dataset its worlds, how many samples and which files."""
    paths = manifest.get("paths")
    inputs = {name: value for name, value in paths.items() if value is not None} if isinstance(paths, dict) else {}
    if isinstance(manifest.get("worlds"), dict):
        inputs.setdefault("worlds", list(manifest["worlds"]))
    if manifest.get("layout") == "shards":
        inputs |= {"format": "shards", "shard_mb": manifest.get("shard_mb")}
    return inputs | {name: manifest[name] for name in ("repetitions", "max_closed") if name in manifest}


def _parsed(path: Path) -> Any:
    if path.suffix.lower() != ".toml":
        return read_json(path, what="settings (JSON or TOML)", max_bytes=MOST_BYTES)
    import tomllib

    try:
        return tomllib.loads(read_text(path, what="settings (TOML)", max_bytes=MOST_BYTES))
    except (ValueError, RecursionError) as error:
        raise InvalidInputError(f"broken TOML ({error})", expected="settings", where=path) from error
