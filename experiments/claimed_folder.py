"""An output folder that a command fills bit by bit and goes on with."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from closedrooms.core.errors import InvalidInputError, OutputError
from closedrooms.core.files.incoming import read_json
from closedrooms.core.files.outgoing import write_json
from closedrooms.core.files.output_folders import MANIFEST, PROGRAM
from closedrooms.core.files.schema import KEY, SCHEMA, check_schema


def claim_folder(folder: Path, command: str) -> None:
    """Make the folder ours, or make sure that it is of the same command, which goes on where it stopped.

    Args:
        folder: To write into.
        command: As its run.json names it.

    Raises:
        OutputError: The folder cannot be written, or holds something else.
        InvalidInputError: A newer version began it.
    """
    manifest = folder / MANIFEST
    if folder.exists() and not folder.is_dir():
        raise OutputError(f"the output is a file; expected a folder: {folder}")
    if folder.is_dir() and any(folder.iterdir()):
        try:
            about = read_json(manifest, what="a manifest")
            ours = about["command"] == command
        except (InvalidInputError, KeyError, TypeError):
            ours = False
        if not ours:
            raise OutputError(f"the output folder holds files of something else; expected an empty one: {folder}")
        check_schema(about, manifest)
        return
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"cannot write ({error.strerror}): {folder}") from error
    write_manifest(folder, command, {"files": []})


def write_manifest(folder: Path, command: str, about: Mapping[str, Any]) -> None:
    """Write the folder's ``run.json``.

    Args:
        folder: Claimed by :func:`claim_folder`.
        command: As the manifest names it.
        about: What else there is to say.
    """
    write_json(folder / MANIFEST, {"program": PROGRAM, KEY: SCHEMA, "command": command, **about})
