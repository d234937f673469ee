"""Archives are bounded in the size and the ratio of what they unpack to."""

import gzip
import io
import struct
import zipfile
from pathlib import Path

import numpy as np
import pytest

from closedrooms.core.errors import InvalidInputError
from closedrooms.core.files import archives
from closedrooms.core.files.archives import TruncatedError, log_lines, read_arrays


def npz(path: Path, members: dict[str, bytes], *, compression: int = zipfile.ZIP_DEFLATED) -> Path:
    with zipfile.ZipFile(path, "w", compression) as archive:
        for name, content in members.items():
            archive.writestr(name, content)
    return path


def npy(array: np.ndarray) -> bytes:
    buffer = io.BytesIO()
    np.lib.format.write_array(buffer, array, allow_pickle=True)
    return buffer.getvalue()


@pytest.mark.parametrize(
    "array",
    [
        np.arange(6.0).reshape(2, 3),
        np.asfortranarray(np.arange(6.0).reshape(2, 3)),
        np.float64(3.5),
        np.zeros((0, 3)),
        np.array(["a", "bc"]),
        np.arange(4, dtype=">u2"),
        np.zeros(3, dtype=[("a", "i4"), ("b", "f8")]),
    ],
)
def test_arrays_are_read_as_numpy_reads_them(tmp_path: Path, array: np.ndarray) -> None:
    np.savez_compressed(tmp_path / "a.npz", array=array)
    ours = read_arrays(tmp_path / "a.npz", what="scans")["array"]
    with np.load(tmp_path / "a.npz") as archive:
        theirs = archive["array"]
    assert ours.dtype == theirs.dtype
    assert ours.shape == theirs.shape
    assert (ours == theirs).all()


def test_a_head_that_claims_more_than_is_there_takes_no_memory(tmp_path: Path) -> None:
    head = b"{'descr': '<f8', 'fortran_order': False, 'shape': (1000000000000,), }"
    claim = b"\x93NUMPY\x01\x00" + struct.pack("<H", len(head) + 1) + head + b"\n" + b"\0" * 16
    with pytest.raises(InvalidInputError, match="16 are there"):
        read_arrays(npz(tmp_path / "a.npz", {"x.npy": claim}), what="scans")


@pytest.mark.parametrize("shape", ["(-2, -1)", "(2, -1)", "(1e3,)", "('a',)", "(True,)", "[2]", "2"])
def test_shapes_that_are_none_are_refused(tmp_path: Path, shape: str) -> None:
    head = f"{{'descr': '<f8', 'fortran_order': False, 'shape': {shape}, }}".encode()
    claim = b"\x93NUMPY\x01\x00" + struct.pack("<H", len(head) + 1) + head + b"\n" + b"\0" * 16
    with pytest.raises(InvalidInputError, match=r"a\.npz$"):
        read_arrays(npz(tmp_path / "a.npz", {"x.npy": claim}), what="scans")


def test_pickles_and_strange_members_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InvalidInputError, match="Python objects"):
        read_arrays(npz(tmp_path / "a.npz", {"x.npy": npy(np.array([{}], dtype=object))}), what="scans")
    for content in (b"", b"\x93NUMPY\x01\x00", b"text"):
        with pytest.raises(InvalidInputError, match=r"a\.npz$"):
            read_arrays(npz(tmp_path / "a.npz", {"x.npy": content}), what="scans")
    (tmp_path / "a.npz").write_bytes(b"PK\x03\x04broken")
    with pytest.raises(InvalidInputError, match=r"a\.npz$"):
        read_arrays(tmp_path / "a.npz", what="scans")


def test_what_shrinks_too_much_or_is_too_large_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(archives, "UNSUSPICIOUS_LOG", 10_000)
    bomb = npz(tmp_path / "a.npz", {"x.npy": npy(np.zeros(3_000_000))})
    with pytest.raises(InvalidInputError, match="unpacks to"):
        read_arrays(bomb, what="scans")
    with pytest.raises(InvalidInputError, match="at most 5000"):
        read_arrays(bomb, what="scans", max_bytes=5000)
    with gzip.open(tmp_path / "log.gz", "wb") as file:
        file.write(b"FLASER 0 0\n" * 100_000)
    with pytest.raises(InvalidInputError, match="unpacks to"):
        list(log_lines(tmp_path / "log.gz", gzipped=True, what="a log", longest=100))
    (tmp_path / "log").write_bytes(b"x" * 6000)
    with pytest.raises(InvalidInputError, match="at most 5000"):
        list(log_lines(tmp_path / "log", gzipped=False, what="a log", longest=100, max_bytes=5000))


def test_what_is_large_and_shrinks_as_honest_logs_do_is_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(archives, "UNSUSPICIOUS_LOG", 10_000)
    lines = [f"FLASER {n} {n * n * 7919 % 10007}\n".encode() for n in range(20_000)]
    with gzip.open(tmp_path / "log.gz", "wb") as file:
        file.writelines(lines)
    assert list(log_lines(tmp_path / "log.gz", gzipped=True, what="a log", longest=100)) == lines
    assert list(log_lines(tmp_path / "log.gz", gzipped=True, what="a log", longest=100, max_bytes=sum(map(len, lines))))
    honest = np.random.default_rng(0).random(3_000_000)
    assert len(read_arrays(npz(tmp_path / "a.npz", {"x.npy": npy(honest)}), what="scans")["x"]) == len(honest)


@pytest.mark.parametrize("damage", ["cut", "flipped"])
def test_a_damaged_log_gives_what_came_before(tmp_path: Path, damage: str) -> None:
    lines = [f"FLASER {n} {n * n * 7919 % 10007}\n".encode() for n in range(20_000)]
    content = bytearray(gzip.compress(b"".join(lines)))
    content = content[: len(content) // 2] if damage == "cut" else content
    if damage == "flipped":
        content[-6] ^= 0xFF
    (tmp_path / "log.gz").write_bytes(content)
    read = []
    with pytest.raises(TruncatedError, match=r"log\.gz$"):
        read.extend(log_lines(tmp_path / "log.gz", gzipped=True, what="a log", longest=100))
    # extend() keeps what it was given before the error.
    assert len(read) > 5000
    assert read == lines[: len(read)] or read[:-1] == lines[: len(read) - 1]
