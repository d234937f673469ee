"""Whole files or none: atomic writes, and output folders that appear complete."""

import contextlib
import json
import os
import shutil
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from closedrooms.core.errors import InvalidInputError, OutputError

MANIFEST = "run.json"
PROGRAM = "closedrooms"


def write_bytes(path: Path, data: bytes) -> None:
    """Write ``data`` under a temporary name beside ``path`` and move it into place.

    Raises:
        OutputError: The folder is missing, read-only or full.
    """
    temporary = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        try:
            with temporary.open("wb") as file:
                file.write(data)
                file.flush()
                os.fsync(file.fileno())
            temporary.replace(path)
        except BaseException:
            temporary.unlink(missing_ok=True)
            raise
    except OSError as error:
        raise OutputError(f"cannot write ({error.strerror}): {path}") from error


def write_json(path: Path, value: Any) -> None:
    """Write ``value`` as readable JSON (UTF-8, sorted as given, one trailing newline), whole or not at all."""
    write_bytes(path, (json.dumps(value, indent=2, allow_nan=False) + "\n").encode())


def read_json(path: Path, *, what: str, max_bytes: int = 200_000_000) -> Any:
    """Parse an untrusted JSON file.

    Args:
        path: The file.
        what: What it should be, for the message ("a floor plan").
        max_bytes: Larger files are refused before they are read.

    Raises:
        InvalidInputError: Missing, unreadable, too large or not JSON.
    """
    text = read_text(path, what=what, max_bytes=max_bytes)
    try:
        return json.loads(text, parse_constant=_refuse_constant)
    except (ValueError, RecursionError) as error:
        raise InvalidInputError(f"broken JSON ({error})", expected=what, where=path) from error


def _refuse_constant(name: str) -> float:
    raise ValueError(f"{name} is no number of JSON")


def read_text(path: Path, *, what: str, max_bytes: int = 200_000_000) -> str:
    """Read an untrusted UTF-8 text file of bounded size.

    Raises:
        InvalidInputError: Missing, a folder, unreadable, too large or not text.
    """
    try:
        size = path.stat().st_size
        if size > max_bytes:
            raise InvalidInputError(
                f"a file of {size} bytes", expected=f"{what} of at most {max_bytes} bytes", where=path
            )
        return path.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise InvalidInputError(f"cannot read ({error.strerror})", expected=what, where=path) from error
    except UnicodeDecodeError as error:
        raise InvalidInputError("not a text file", expected=what, where=path) from error


def is_ours(folder: Path) -> bool:
    """Whether everything in ``folder`` was written by closedrooms: its manifest lists every entry."""
    try:
        manifest = json.loads((folder / MANIFEST).read_text())
        listed = {MANIFEST, *manifest["files"]}
        return manifest["program"] == PROGRAM and all(entry.name in listed for entry in folder.iterdir())
    except (OSError, ValueError, KeyError, TypeError):
        return False


def check_output_folder(folder: Path) -> None:
    """Fail early when ``folder`` could not be written at the end: something not ours, or no right to write.

    Raises:
        OutputError: It is a file, holds anything that we did not write, or its parent cannot be written.
    """
    if folder.exists() and not folder.is_dir():
        raise OutputError(f"the output is a file; expected a folder: {folder}")
    with _clear_errors(folder):
        if folder.exists() and any(folder.iterdir()) and not is_ours(folder):
            raise OutputError(
                f"the output folder holds files that closedrooms did not write; expected an empty one: {folder}"
            )
        folder.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder.parent):
            pass


@contextlib.contextmanager
def output_folder(folder: Path, manifest: dict[str, Any]) -> Iterator[Path]:
    """A fresh folder to write into, that takes the place of ``folder`` when the block ends well.

    The manifest ``run.json`` is completed on leaving with ``program`` and ``files``; the caller may still add to
    the dictionary inside the block. A folder of ours is replaced whole. On any error, Ctrl-C included, ``folder``
    is left as it was.

    Args:
        folder: Where the result shall be.
        manifest: Content of ``run.json``.

    Yields:
        The temporary folder.

    Raises:
        OutputError: See :func:`check_output_folder`; a full disk.
    """
    check_output_folder(folder)
    with _clear_errors(folder):
        staging = Path(tempfile.mkdtemp(prefix=f".{folder.name}.", suffix=".part", dir=folder.parent))
    try:
        with _clear_errors(folder):
            yield staging
            manifest["program"] = PROGRAM
            manifest["files"] = sorted(entry.name for entry in staging.iterdir())
            write_json(staging / MANIFEST, manifest)
            staging.chmod(0o755)
            _swap(staging, folder)
    finally:
        shutil.rmtree(staging, ignore_errors=True)


def _swap(staging: Path, folder: Path) -> None:
    if folder.exists():
        old = Path(tempfile.mkdtemp(prefix=f".{folder.name}.", suffix=".old", dir=folder.parent))
        folder.replace(old)
        staging.replace(folder)
        shutil.rmtree(old, ignore_errors=True)
    else:
        staging.replace(folder)


@contextlib.contextmanager
def _clear_errors(folder: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise OutputError(f"cannot write ({error.strerror}): {error.filename or folder}") from error
