"""The files of a bag: what the metadata of a rosbag 2 folder names against what lies there."""

import contextlib
import re
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path, PureWindowsPath
from typing import Any

from closedrooms.core.errors import InvalidInputError
from closedrooms.core.files.incoming import is_file, is_folder, opened, read_head
from closedrooms.core.files.yaml_text import parse_yaml
from closedrooms.core.names import shown
from closedrooms.core.remarks import Remark

METADATA = "metadata.yaml"
MAX_METADATA = 300_000
"""Longest ``metadata.yaml`` [bytes]: some hundred for every topic and file; rosbags reads 50 kB a second of it."""
STORED = re.compile(r"(?P<stem>.+?)(?:_(?P<piece>\d+))?(?P<kind>\.(?:mcap|db3|bag)(?:\.zstd)?)")
"""Names of the files of a bag; recorders that split it number the pieces."""
SUFFIXES = {b"#ROSBAG": ".bag", b"\x89MCAP": ".mcap", b"SQLite": ".db3"}
"""What the files of a bag begin with, and how their names should end."""
MCAP_MAGIC = b"\x89MCAP0\r\n"
"""What an MCAP file begins and ends with."""
NOT_IN_ADDRESSES = set("?#%")
"""What rosbags, which opens files by an address, cannot have in their names."""


def is_bag_folder(path: Path) -> bool:
    """Check whether a folder holds a bag: it has metadata, a single file of a bag, or the pieces of one."""
    return is_folder(path) and (is_file(path / METADATA) or bool(_pieces(_stored(path))))


@contextlib.contextmanager
def bag_paths(path: Path, remarks: list[Remark]) -> Iterator[list[Path]]:
    """Find what rosbags has to open for a bag, under names that it understands.

    A folder is read by the files that lie in it: recorders that are killed leave metadata that name some of them or
    none at all. Only of compressed bags the metadata say what else has to be known.

    Args:
        path: A file of a bag, or a folder with its pieces.
        remarks: Told which files are missing, and which were read although the metadata do not name them.

    Raises:
        InvalidInputError: Broken metadata, or none of the files that they name.
    """
    files = _ended(_whole_bag(path, remarks), remarks) if is_folder(path) else [path]
    remarks += _unwritten(files)
    with tempfile.TemporaryDirectory() as folder:
        yield [_named(file, Path(folder) / f"bag{number}") for number, file in enumerate(files)]


def _whole_bag(folder: Path, remarks: list[Remark]) -> list[Path]:
    """List the files of the bag in a folder; the folder itself where it is compressed."""
    there = _stored(folder)
    if not is_file(folder / METADATA):
        found = _pieces(there)
        if len(found) > 1:
            why = f"no {METADATA} in the folder (a recorder that was killed?); its {len(found)} files are one bag"
            remarks.append(Remark(action="guessed", what="pieces of the bag", why=why, count=len(found)))
        return [folder / name for name in found]
    named, compressed = _metadata(folder)
    given = [name for name in named if name in there]
    # Somebody gave the files other names.
    found = given or (there if len(there) == len(named) else [])
    if not found:
        what = f"{METADATA} names {_listed(named)}, which {'is' if len(named) == 1 else 'are'} not there"
        raise InvalidInputError(what, expected="the files of the bag beside it", where=folder)
    beside = [name for name in there if name not in found and _is_one_bag([*found, name])]
    if compressed and (beside or found != named):
        what = f"a compressed bag of {_listed(there)} whose {METADATA} names {_listed(named)}"
        raise InvalidInputError(what, expected="every file that it names, and no other piece", where=folder)
    why = f"{METADATA} does not name them"
    taken = beside if given else found
    if taken:
        remarks.append(_about("repaired", "files", f"{why}; read as pieces of the bag", taken))
    missing = [name for name in named if given and name not in there]
    if missing:
        remarks.append(_about("dropped", "pieces of the bag", f"{METADATA} names them; they are not there", missing))
    others = [name for name in there if name not in {*found, *beside}]
    if others:
        remarks.append(_about("dropped", "files", f"{why}, and they are no pieces of this bag", others))
    return [folder] if compressed else [folder / name for name in sorted([*found, *beside], key=_order)]


def _about(action: Any, what: str, why: str, names: Sequence[str]) -> Remark:
    """Say what was done with files; a piece that is missing is a loss."""
    loss = what.startswith("pieces")
    told = tuple(shown(name, longest=60) for name in names)
    return Remark(action=action, what=what, why=why, names=told, count=len(told), loss=loss)


def _listed(names: Sequence[str]) -> str:
    """Name the first few of several files."""
    told = ", ".join(shown(name, longest=60) for name in names[:3])
    return f"{told} and {len(names) - 3} more" if len(names) > 3 else told or "no file"


def _metadata(folder: Path) -> tuple[list[str], bool]:
    """Read which files the metadata name, and whether they are compressed."""
    what = "the metadata of a rosbag 2"
    told = parse_yaml(folder / METADATA, what=what, max_bytes=MAX_METADATA).get("rosbag2_bagfile_information")
    paths = told.get("relative_file_paths") if isinstance(told, dict) else None
    if not (isinstance(told, dict) and isinstance(paths, list) and all(isinstance(name, str) for name in paths)):
        raise InvalidInputError("no list of files", expected=what, where=folder / METADATA)
    mode = str(told.get("compression_mode") or "none").lower()
    # Some writers put whole paths; a Windows path knows both kinds of slashes.
    return [PureWindowsPath(name).name for name in paths], mode != "none"


def _stored(folder: Path) -> list[str]:
    """List the names of a folder's files that a bag may consist of, pieces in their order."""
    return sorted((entry.name for entry in folder.iterdir() if STORED.fullmatch(entry.name)), key=_order)


def _order(name: str) -> tuple[int, str]:
    """Sort pieces by their number."""
    match = STORED.fullmatch(name)
    return (int(match["piece"] or 0) if match else 0), name


def _pieces(names: Sequence[str]) -> list[str]:
    """List the files of a bag without metadata: none where they are not one bag, or compressed."""
    return [*names] if _is_one_bag(names) and not any(name.endswith(".zstd") for name in names) else []


def _is_one_bag(names: Sequence[str]) -> bool:
    """Check that there is a single file, or pieces whose names differ by their number (and the time)."""
    matches = [match for match in map(STORED.fullmatch, names) if match]
    kinds = {(re.sub(r"\d", "0", match["stem"]), match["kind"]) for match in matches}
    numbers = {match["piece"] for match in matches}
    return len(names) == 1 or (len(kinds) == 1 and None not in numbers and len(numbers) == len(names))


def _unwritten(files: Sequence[Path]) -> list[Remark]:
    """Find messages that a recorder with SQLite had not yet written into the bag when it was killed."""
    logs = [file.with_name(f"{file.name}-wal") for file in files]
    names = [log.name for log in logs if is_file(log) and log.stat().st_size > 0]
    why = "it holds messages that are not yet in the bag; sqlite3's VACUUM puts them in"
    return [_about("dropped", "pieces of the bag", why, names)] if names else []


def _ended(files: list[Path], remarks: list[Remark]) -> list[Path]:
    """Leave out the piece that a recorder which was killed did not finish: MCAP has its index at the end."""
    pieces = [file for file in files if file.suffix == ".mcap"] if len(files) > 1 else []
    unfinished = [file for file in pieces if not _has_end(file)]
    if not unfinished or len(unfinished) == len(files):
        return files
    why = "they end without an index (a recorder that was killed?); 'mcap recover' makes one"
    remarks.append(_about("dropped", "pieces of the bag", why, [file.name for file in unfinished]))
    return [file for file in files if file not in unfinished]


def _has_end(file: Path) -> bool:
    with opened(file, "a rosbag") as content:
        if content.seek(0, 2) < len(MCAP_MAGIC):
            return False
        content.seek(-len(MCAP_MAGIC), 2)
        return content.read() == MCAP_MAGIC


def _named(path: Path, link: Path) -> Path:
    """Link to a bag by a name that ends as rosbags expects it, which tells the kinds by their names."""
    suffix = path.suffix
    if is_file(path):
        start = read_head(path, what="a rosbag", size=8)
        suffix = next((suffix for magic, suffix in SUFFIXES.items() if start.startswith(magic)), suffix)
    if suffix == path.suffix and not NOT_IN_ADDRESSES & {*str(path.absolute())}:
        return path
    named = link.with_suffix(suffix)
    named.symlink_to(path.absolute())
    return named
