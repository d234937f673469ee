"""Files of a dataset by their names, in a folder of this machine or behind an address (fsspec): whole ones or none."""

import contextlib
import functools
import hashlib
import os
import tempfile
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any, BinaryIO, Protocol

from closedrooms.core.errors import ClosedroomsError, InvalidInputError, OutputError
from closedrooms.core.files.incoming import opened
from closedrooms.core.files.outgoing import clear_errors
from closedrooms.core.files.unfinished import part_of_file, unfinished
from closedrooms.core.runtime.packages import MissingPackageError, require
from closedrooms.experiments.places import Url

BLOCK = 1 << 20
"""Bytes that are hashed or sent at a time."""
WHAT = "a file of a dataset"
DATASET_MANIFEST = "manifest.json"


class Store(Protocol):
    """Place where files are kept; names have ``/`` between their parts and are relative to the dataset."""

    def where(self, name: str) -> str:
        """Name a file as messages do."""

    def names(self) -> set[str]:
        """List what stands at the root, files and folders."""

    def sizes(self, folder: str) -> dict[str, int]:
        """List the files of one folder with their bytes; none where there is no such folder."""

    def opened(self, name: str) -> contextlib.AbstractContextManager[Any]:
        """Open a file for reading bytes at any place; an :class:`InvalidInputError` where it cannot be read."""

    def read_all(self, names: Sequence[str]) -> list[bytes]:
        """Read some files whole, in their order; an :class:`InvalidInputError` where one cannot be read."""

    def new(self, name: str) -> contextlib.AbstractContextManager[Any]:
        """Open a file that is there as a whole when the block ends well; an :class:`OutputError` if it cannot."""

    def remove(self, names: Iterable[str]) -> None:
        """Remove files, those that are there."""


def open_store(place: Path | Url) -> Store:
    """Open the files at a place.

    Raises:
        InvalidInputError: An address that fsspec cannot read.
        MissingPackageError: What reads such an address is not installed.
    """
    return _remote(str(place)) if isinstance(place, Url) else Folder(place)


class Folder:
    """A folder of this machine."""

    def __init__(self, root: Path) -> None:
        self._root = root

    def where(self, name: str) -> str:
        """Name a file by its path."""
        return str(self._root / name)

    def names(self) -> set[str]:
        """List the root."""
        return {path.name for path in self._root.iterdir()} if self._root.is_dir() else set()

    def sizes(self, folder: str) -> dict[str, int]:
        """List a folder; what is being written, or was left half-written, has hidden names and is not in it."""
        path = self._root / folder
        if not path.is_dir():
            return {}
        files = (file for file in path.iterdir() if not file.name.startswith(".") and file.is_file())
        return {f"{folder}/{file.name}": file.stat().st_size for file in files}

    def opened(self, name: str) -> contextlib.AbstractContextManager[Any]:
        """Open a file."""
        return opened(self._root / name, WHAT)

    def read_all(self, names: Sequence[str]) -> list[bytes]:
        """Read files."""
        return [read_file(self, name) for name in names]

    @contextlib.contextmanager
    def new(self, name: str) -> Iterator[BinaryIO]:
        """Write a file beside its place and move it there.

        Unlike ``core.files.new_file`` it does not look for what others left there, which takes longer the more files
        there are: who works on a dataset clears that away once.
        """
        path = self._root / name
        temporary = part_of_file(path)
        with clear_errors(path), unfinished(temporary, path):
            path.parent.mkdir(parents=True, exist_ok=True)
            with temporary.open("wb") as file:
                yield file
                file.flush()
                os.fsync(file.fileno())
            temporary.replace(path)

    def remove(self, names: Iterable[str]) -> None:
        """Remove files."""
        for name in names:
            with clear_errors(self._root / name):
                (self._root / name).unlink(missing_ok=True)


class Remote:
    """Files behind an address. An object store shows an object when all of it has come, and knows no locks.

    Args:
        url: The address.

    Raises:
        InvalidInputError: No file system for it.
        MissingPackageError: Its driver is not installed.
    """

    def __init__(self, url: Url) -> None:
        require("fsspec", by=str(url).partition("://")[0] + "://")
        import fsspec

        try:
            # Other machines write there too: what was listed before says nothing.
            self._files, self._root = fsspec.core.url_to_fs(str(url), use_listings_cache=False)
        except ImportError as error:
            raise MissingPackageError(
                f"{' '.join(str(error).split())} (pip install 'closedrooms[s3]'): {url}"
            ) from error
        except Exception as error:
            raise InvalidInputError(_line(error), expected="an address that fsspec reads", where=str(url)) from error
        self._root, self._url = str(self._root).rstrip("/"), url

    def where(self, name: str) -> str:
        """Name a file by its address."""
        return f"{self._url}/{name}"

    def names(self) -> set[str]:
        """List the root."""
        return {name for name, _ in self._list("")}

    def sizes(self, folder: str) -> dict[str, int]:
        """List a folder."""
        return {f"{folder}/{name}": int(size) for name, size in self._list(folder) if size is not None}

    def _list(self, folder: str) -> list[tuple[str, int | None]]:
        """List the names in a folder with their bytes, ``None`` for folders."""
        with _reading(self.where(folder)):
            self._files.invalidate_cache()
            try:
                found = self._files.ls(f"{self._root}/{folder}".rstrip("/"), detail=True)
            except FileNotFoundError:
                return []
            entries = [(entry["name"].rstrip("/").rpartition("/")[2], entry) for entry in found]
            return [(name, entry["size"] if entry["type"] == "file" else None) for name, entry in entries]

    @contextlib.contextmanager
    def opened(self, name: str) -> Iterator[Any]:
        """Open a file; parts of it are fetched as they are read."""
        with _reading(self.where(name)), self._files.open(f"{self._root}/{name}", "rb", block_size=BLOCK) as file:
            yield file

    def read_all(self, names: Sequence[str]) -> list[bytes]:
        """Read files, several at a time."""
        paths = [f"{self._root}/{name}" for name in names]
        with _reading(self.where(names[0] if names else "")):
            found = self._files.cat(paths) if paths else {}
            return [found[path] for path in paths]

    @contextlib.contextmanager
    def new(self, name: str) -> Iterator[Any]:
        """Write to a file of this machine, then send it."""
        path = f"{self._root}/{name}"
        with tempfile.NamedTemporaryFile(prefix="closedrooms-") as file:
            yield file
            with _writing(self.where(name)):
                file.flush()
                self._files.makedirs(path.rpartition("/")[0], exist_ok=True)
                self._files.put_file(file.name, path)

    def remove(self, names: Iterable[str]) -> None:
        """Remove files."""
        paths = [f"{self._root}/{name}" for name in names]
        with _writing(str(self._url)), contextlib.suppress(FileNotFoundError):
            if paths:
                self._files.rm(paths)


@functools.lru_cache(maxsize=4)
def _remote(url: str) -> Remote:
    """Open an address once."""
    return Remote(Url(url))


def read_file(store: Store, name: str) -> bytes:
    """Read a whole file.

    Raises:
        InvalidInputError: It cannot be read.
    """
    with store.opened(name) as file:
        content: bytes = file.read()
        return content


def write_file(store: Store, name: str, content: bytes) -> None:
    """Write a whole file.

    Raises:
        OutputError: It cannot be written.
    """
    with store.new(name) as file:
        file.write(content)


def file_digest(store: Store, name: str) -> str:
    """Hash a file: hexadecimal SHA-256.

    Raises:
        InvalidInputError: It cannot be read.
    """
    found = hashlib.sha256()
    with store.opened(name) as file:
        while block := file.read(BLOCK):
            found.update(block)
    return found.hexdigest()


class HashingWriter:
    """Writer into a file that counts the bytes and hashes them (SHA-256)."""

    closed = False

    def __init__(self, file: BinaryIO) -> None:
        self._file, self._sum, self.size = file, hashlib.sha256(), 0

    def write(self, data: Any) -> int:
        """Write some bytes, and count and hash them."""
        self._sum.update(data)
        self.size += len(data)
        return self._file.write(data)

    def flush(self) -> None:
        """Flush the file."""
        self._file.flush()

    def close(self) -> None:
        """Leave the file open: it is its owner's."""

    def tell(self) -> int:
        """Count the bytes that were written."""
        return self.size

    @property
    def digest(self) -> str:
        """Hexadecimal SHA-256 of what was written so far."""
        return self._sum.hexdigest()


@contextlib.contextmanager
def _reading(where: str) -> Iterator[None]:
    """Turn errors of a driver into one line on what cannot be read."""
    try:
        yield
    except ClosedroomsError:
        raise
    except FileNotFoundError as error:
        raise InvalidInputError("no such file", expected=WHAT, where=where) from error
    except Exception as error:  # every driver has kinds of its own
        raise InvalidInputError(f"cannot read ({_line(error)})", expected=WHAT, where=where) from error


@contextlib.contextmanager
def _writing(where: str) -> Iterator[None]:
    """Turn errors of a driver into one line on what cannot be written."""
    try:
        yield
    except FileNotFoundError:
        raise
    except Exception as error:
        raise OutputError(f"cannot write ({_line(error)}): {where}") from error


def _line(error: Exception) -> str:
    """Shorten the text of an error to one line."""
    return " ".join(str(error).split())[:160] or type(error).__name__
