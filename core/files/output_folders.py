"""The one writer of folders: they appear complete, and nothing of anybody else's is touched.

A folder is replaced only when every file in it, at every depth, is one that the same command wrote and that has not
changed since: its ``run.json`` holds the checksums. Two processes never write one folder: a lock beside it says so.
Folders that fill bit by bit over hours (``evaluate``, ``robustness``, ``train``) are claimed otherwise, by
``experiments.claimed_folder.claim_folder``.
"""

import contextlib
import errno
import fcntl
import hashlib
import json
import os
import stat
import tempfile
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from closedrooms.core.errors import InvalidInputError, OutputError
from closedrooms.core.files.incoming import read_json
from closedrooms.core.files.outgoing import check_name, clear_errors, json_text, write_json
from closedrooms.core.files.schema import KEY, SCHEMA, check_schema
from closedrooms.core.files.unfinished import clear_folders, part_of_folder, unfinished
from closedrooms.core.names import short_name

MANIFEST = "run.json"
PROGRAM = "closedrooms"
SUMS = "sha256"
"""Key of the manifest: SHA-256 of every file by its path in the folder; of the manifest itself without its entry."""
MAX_MANIFEST = 50_000_000


def _find_foreign_file(folder: Path, command: object) -> str:
    """Find something in a folder that the same command did not write, or was changed since; empty for nothing.

    Raises:
        OutputError: A newer version of the same command wrote it.
    """
    manifest = _read_own_manifest(folder)
    if manifest is None:
        return f"no {MANIFEST} of ours"
    if manifest.get("command") != command:
        return MANIFEST
    try:
        check_schema(manifest, folder / MANIFEST)
    except InvalidInputError as error:
        raise OutputError(str(error)) from error
    try:
        return _find_changed_file(folder, manifest)
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return f"no {MANIFEST} of ours"


def _find_changed_file(folder: Path, manifest: dict[str, Any]) -> str:
    """Find a file that a manifest does not list or whose checksum is another one; empty for none."""
    sums = dict(manifest.get(SUMS) or manifest["checksums"])
    listed = {MANIFEST, *sums, *manifest["files"]}
    for path in _walk(folder):
        name = path.relative_to(folder).as_posix()
        if name not in listed or not stat.S_ISREG(path.lstat().st_mode):
            return name
        # A file without a checksum is a recording of a sample: its bytes differ from run to run.
        if name in sums and sums[name] != (_own_sum(manifest) if name == MANIFEST else _digest(path)):
            return name
        if name == MANIFEST and path.read_bytes() != json_text(manifest).encode():
            return name
    return ""


def _read_own_manifest(folder: Path) -> dict[str, Any] | None:
    """Read the manifest of a folder that a command of ours wrote, ``None`` of any other."""
    try:
        manifest = read_json(folder / MANIFEST, what="a manifest", max_bytes=MAX_MANIFEST)
    except (OSError, ValueError, InvalidInputError):
        return None
    return manifest if isinstance(manifest, dict) and manifest.get("program") == PROGRAM else None


def _walk(folder: Path) -> Iterator[Path]:
    """List everything in a folder but its folders, at every depth; an empty one counts as somebody else's file."""
    for path in sorted(folder.iterdir()):
        if path.is_dir() and not path.is_symlink() and any(path.iterdir()):
            yield from _walk(path)
        else:
            yield path


def _digest(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _own_sum(manifest: dict[str, Any]) -> str:
    """Hash a manifest without the entry of its own checksum."""
    sums = {name: value for name, value in manifest[SUMS].items() if name != MANIFEST}
    return hashlib.sha256(json_text({**manifest, SUMS: sums}).encode()).hexdigest()


def check_output_folder(folder: Path, command: object = None, *, sources: Iterable[Path | None] = ()) -> None:
    """Fail early when ``folder`` could not be written at the end: something not ours, no right to write, a writer.

    Args:
        folder: The output.
        command: As the manifest names it.
        sources: Files and folders that the command reads: the output replaces none of them.

    Raises:
        OutputError: It is a file, holds anything that the same command did not write or that was changed since, or a
            source; a newer version wrote it; its parent cannot be written, or another process writes it.
    """
    for source in sources:
        if source is not None and _holds(folder, source):
            raise OutputError(f"the output folder holds what is read ({source.name}); expected another one: {folder}")
    check_name(folder)
    with clear_errors(folder):
        folder = _real(folder)
        _check_replaceable(folder, command)
        folder.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder.parent):
            pass
    with only_writer(folder):
        pass


def real_path(path: Path) -> Path:
    """Follow an output to the whole path that it leads to, for processes that stand in other folders.

    Raises:
        OutputError: A circle of symbolic links.
    """
    try:
        return path.resolve()
    except RuntimeError as error:
        raise OutputError(f"cannot write (a circle of symbolic links): {path}") from error


def _holds(folder: Path, source: Path) -> bool:
    """Check whether an output folder holds something that is read."""
    try:
        return source.exists() and source.resolve().is_relative_to(folder.resolve())
    except (OSError, RuntimeError, ValueError):  # a name that the system refuses, a circle of links: said elsewhere
        return False


def _check_replaceable(folder: Path, command: object) -> None:
    """Refuse a folder with anything in it that the same command did not write."""
    if os.path.lexists(folder) and not folder.is_dir():
        raise OutputError(f"the output is a file; expected a folder: {folder}")
    if folder.is_dir() and any(folder.iterdir()):
        foreign = _find_foreign_file(folder, command)
        if foreign:
            by = f"closedrooms {command}" if command else "closedrooms"
            raise OutputError(
                f"the output folder holds something that {by} did not write, or that was changed since ({foreign}); "
                f"expected an empty or new one: {folder}"
            )


def _real(folder: Path) -> Path:
    """Follow ``folder`` to the folder itself where it is a symbolic link to one; the link stays as it is."""
    return folder.resolve() if folder.is_symlink() and folder.exists() else folder


@contextlib.contextmanager
def output_folder(folder: Path, manifest: dict[str, Any]) -> Iterator[Path]:
    """Make a fresh folder to write into that takes the place of ``folder`` when the block ends well.

    The manifest ``run.json`` is completed on leaving with ``program``, ``schema``, ``files`` and checksums; the caller
    may still add to the dictionary inside the block. A folder of the same ``manifest["command"]`` is replaced whole. On
    any error, Ctrl-C included, ``folder`` is left as it was. What killed processes left half-written beside it is
    removed.

    Args:
        folder: Where the result shall be.
        manifest: Content of ``run.json``; ``command`` names who may replace it.

    Yields:
        The temporary folder.

    Raises:
        OutputError: See :func:`check_output_folder`; a full disk.
    """
    command = manifest.get("command")
    check_output_folder(folder, command)
    folder = _real(folder)
    with only_writer(folder) as alone:
        staging = part_of_folder(folder)
        with unfinished(staging, folder), clear_errors(folder):
            clear_folders(folder, alone=alone)
            staging.mkdir(0o700)
            yield staging
            _finish(staging, manifest)
            # Hours may have passed: what was put there in the meantime is not ours.
            _check_replaceable(folder, command)
            _swap(staging, folder)


def _finish(staging: Path, manifest: dict[str, Any]) -> None:
    """Complete the manifest with what was written, and write it last."""
    names = [path.relative_to(staging).as_posix() for path in _walk(staging)]
    manifest["program"] = PROGRAM
    manifest[KEY] = SCHEMA
    manifest["files"] = names
    if "checksums" not in manifest:
        manifest[SUMS] = {name: _digest(staging / name) for name in names}
        # As it will be read again: tuples are lists then, keys are texts.
        manifest[SUMS][MANIFEST] = _own_sum(json.loads(json_text(manifest)))
    write_json(staging / MANIFEST, manifest)
    staging.chmod(0o755)


def _swap(staging: Path, folder: Path) -> None:
    """Put the finished folder in the place of the old one, which goes when that is done."""
    old = part_of_folder(folder, "old")
    with unfinished(old, folder):
        if folder.exists():
            folder.replace(old)
        staging.replace(folder)


@contextlib.contextmanager
def only_writer(folder: Path) -> Iterator[bool]:
    """Hold the lock of an output folder; the kernel lets go of it when the process ends, however it ends.

    Yields:
        Whether the lock is one: not every file system knows locks.

    Raises:
        OutputError: Another process holds it, or the parent cannot be written.
    """
    path = folder.with_name(f".{short_name(folder.name)}.lock")
    with clear_errors(folder):
        lock, locked = _locked(path, folder)
    try:
        with unfinished(path, folder):
            yield locked
    finally:
        os.close(lock)


def _locked(path: Path, folder: Path) -> tuple[int, bool]:
    """Open the file which now has this name, and try to lock it: its descriptor, and whether it holds the lock."""
    while True:
        lock = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW, 0o600)
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            # The one before may have removed the file between our opening and our locking.
            if path.exists() and os.fstat(lock).st_ino == path.stat().st_ino:
                return lock, True
        except OSError as error:
            if error.errno in {errno.ENOLCK, errno.ENOTSUP, errno.ENOSYS}:  # a file system without locks
                return lock, False
            os.close(lock)
            if error.errno in {errno.EWOULDBLOCK, errno.EACCES}:
                raise OutputError(f"another closedrooms writes this folder; expected to be alone: {folder}") from error
            raise
        except BaseException:
            os.close(lock)
            path.unlink(missing_ok=True)
            raise
        os.close(lock)
