"""Bags that unpack to more than they should."""

from pathlib import Path
from typing import Any

import pytest

from closedrooms.core.errors import InvalidInputError
from closedrooms.mapping.logs import read_run
from closedrooms.mapping.logs.bags import bag_limits

rosbags = pytest.importorskip("rosbags", reason="the optional extra 'bags' is not installed")


@pytest.fixture(params=["ros1-bz2", "ros1-lz4", "sqlite3-file", "sqlite3-message", "mcap-file", "mcap-storage"])
def packed(request: pytest.FixtureRequest, bag_maker: Any, tmp_path: Path) -> Path:
    storage, how = request.param.split("-")
    bag = bag_maker(tmp_path / "bag", storage).drive().transform("base_link", "laser")
    path: Path = bag.write(how)
    return path


def test_a_compressed_bag_is_read(packed: Path) -> None:
    assert len(read_run(packed).scans) == 11


def test_what_unpacks_to_too_much_is_one_line(packed: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bag_limits, "MAX_CHUNK", 200)
    monkeypatch.setattr(bag_limits, "MAX_UNPACKED", 2000)
    with pytest.raises(InvalidInputError, match=r"unpacks to more than 200|File too large") as caught:
        read_run(packed)
    assert str(packed) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_metadata_without_end_is_refused_before_it_is_parsed(bag_maker: Any, tmp_path: Path) -> None:
    path = bag_maker(tmp_path / "bag", "mcap").drive().write()
    (path / "metadata.yaml").write_text(f"rosbag2_bagfile_information: [{'1,' * 1_000_000}1]")
    with pytest.raises(InvalidInputError, match=r"a file of 20000\d\d bytes"):
        read_run(path)


def test_a_file_out_of_a_compressed_bag_is_named(bag_maker: Any, tmp_path: Path) -> None:
    path = bag_maker(tmp_path / "bag", "mcap").drive().transform("base_link", "laser").write("file")
    (file,) = path.glob("*.zstd")
    with pytest.raises(
        InvalidInputError, match=r"a file packed by zstd; expected .*the folder with its metadata\.yaml"
    ):
        read_run(file)
