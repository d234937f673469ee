"""SHA-256 of files: of a sample, to tell one that was changed since; of code, to tell results of older code."""

import hashlib
from collections.abc import Sequence
from pathlib import Path

from closedrooms.core.errors import InvalidInputError
from closedrooms.core.files.incoming import opened, read_json
from closedrooms.core.files.output_folders import MANIFEST

# Recordings of equal runs differ in their bytes (`rerun rrd compare` finds them equal).
NOT_REPEATABLE = {"run.rrd"}


def checksums(folder: Path) -> dict[str, str]:
    """Hash every file in ``folder`` whose bytes are repeatable, without ``run.json``: hexadecimal SHA-256 by name."""
    names = sorted(path.name for path in folder.iterdir() if path.is_file())
    return {name: digest(folder / name) for name in names if name != MANIFEST and name not in NOT_REPEATABLE}


def digest(path: Path) -> str:
    """Hash a file: hexadecimal SHA-256.

    Raises:
        InvalidInputError: It cannot be read.
    """
    with opened(path, "a file of a dataset") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def files_digest(files: Sequence[Path]) -> str:
    """Compute the digest of the names and contents of some files."""
    content = hashlib.sha256()
    for path in sorted(files):
        content.update(path.name.encode() + digest(path).encode())
    return content.hexdigest()


def check(folder: Path) -> None:
    """Check that a folder holds what its ``run.json`` says, byte for byte.

    Raises:
        InvalidInputError: A file is missing, or was changed since it was written; the message names it.
    """
    about = read_json(folder / MANIFEST, what="a sample's run.json")
    try:
        wanted = {str(name): str(value) for name, value in about["checksums"].items()}
    except (KeyError, TypeError, AttributeError) as error:
        raise InvalidInputError("no checksums", expected="a sample's run.json", where=folder / MANIFEST) from error
    for name, value in wanted.items():
        path = folder / name
        if Path(name).name != name or not path.is_file():
            raise InvalidInputError("a file is missing", expected="the sample as it was written", where=path)
        if digest(path) != value:
            raise InvalidInputError("changed since it was written", expected="its SHA-256 in run.json", where=path)
