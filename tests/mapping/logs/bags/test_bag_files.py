"""Folders whose files and metadata do not agree: what lies there is read, what is missing is said."""

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from closedrooms.core.errors import InvalidInputError
from closedrooms.mapping.logs import RecordedRun, read_run
from closedrooms.mapping.logs.bags.bag_files import _pieces

rosbags = pytest.importorskip("rosbags", reason="the optional extra 'bags' is not installed")

METADATA = "metadata.yaml"


def told(run: RecordedRun) -> list[tuple[str, str, tuple[str, ...], bool]]:
    return [(remark.action, remark.what, remark.names, remark.loss) for remark in run.remarks]


@pytest.fixture(params=["mcap", "sqlite3", "ros1"])
def split(request: pytest.FixtureRequest, bag_maker: Any, tmp_path: Path) -> Callable[..., tuple[Path, list[str]]]:
    """Writes a drive of 11 scans as a folder of three pieces; the mounting is in the first alone, as recorders do."""

    def make(named: list[int]) -> tuple[Path, list[str]]:
        folder = tmp_path / "run"
        folder.mkdir()
        names, metadata = [], ""
        for piece, (first, last) in enumerate(((0, 4), (4, 8), (8, 11))):
            bag = bag_maker(tmp_path / f"part{piece}", request.param)
            for i in range(first, last):
                bag.odometry(100.0 + 0.1 * i, 0.05 * i).scan(100.0 + 0.1 * i)
            if piece == 0:
                bag.transform("base_link", "laser", (0.3, 0.0, 0.0))
            written: Path = bag.write()
            (file,) = [written] if written.is_file() else [f for f in written.iterdir() if f.name != METADATA]
            if written.is_dir():
                metadata = (written / METADATA).read_text()
            names.append(f"run_{piece}{file.suffix}")
            file.rename(folder / names[-1])
        if named and metadata:
            lists = "\n".join(f"    - {names[i]}" for i in named)
            pattern = r"relative_file_paths:\n\s+- \S+"
            (folder / METADATA).write_text(re.sub(pattern, f"relative_file_paths:\n{lists}", metadata))
        return folder, names

    return make


def test_pieces_that_the_metadata_do_not_name_are_read(split: Any) -> None:
    folder, names = split([0, 1])
    run = read_run(folder)
    assert len(run.scans) == 11
    assert run.scans[0].robot_T_sensor == pytest.approx((0.3, 0.0, 0.0))
    if names[0].endswith(".bag"):  # ROS 1 has no metadata
        assert [remark[:2] for remark in told(run)] == [("guessed", "pieces of the bag")]
    else:
        assert told(run) == [("repaired", "files", (names[2],), False)]


def test_pieces_without_metadata_are_one_bag(split: Any) -> None:
    folder, _ = split([])
    run = read_run(folder)
    assert len(run.scans) == 11
    assert [(r.action, r.what, r.count) for r in run.remarks] == [("guessed", "pieces of the bag", 3)]


def test_pieces_that_are_missing_are_a_loss(split: Any) -> None:
    folder, names = split([0, 1, 2])
    (folder / names[1]).unlink()
    run = read_run(folder)
    assert len(run.scans) == 7
    if not names[0].endswith(".bag"):
        assert ("dropped", "pieces of the bag", (names[1],), True) in told(run)


@pytest.mark.parametrize("left", [0.0, 0.6])
def test_a_last_piece_that_was_not_finished_costs_itself(split: Any, left: float) -> None:
    folder, names = split([])
    if not names[0].endswith(".mcap"):
        pytest.skip("MCAP has its index at the end")
    last = folder / names[2]
    last.write_bytes(last.read_bytes()[: int(left * last.stat().st_size)])
    run = read_run(folder)
    assert len(run.scans) == 8
    assert ("dropped", "pieces of the bag", (names[2],), True) in told(run)


def test_whole_pieces_say_nothing(split: Any) -> None:
    folder, names = split([0, 1, 2])
    if not names[0].endswith(".bag"):
        assert told(read_run(folder)) == []


@pytest.fixture
def folder(bag_maker: Any, tmp_path: Path) -> Path:
    written: Path = bag_maker(tmp_path / "bag", "mcap").drive().transform("base_link", "laser").write()
    return written


def test_a_file_that_was_given_another_name_is_found(folder: Path) -> None:
    (file,) = folder.glob("*.mcap")
    file.rename(folder / "kitchen.mcap")
    run = read_run(folder)
    assert len(run.scans) == 11
    assert told(run) == [("repaired", "files", ("kitchen.mcap",), False)]


def test_metadata_whose_files_are_all_gone_are_refused_with_their_names(folder: Path) -> None:
    (file,) = folder.glob("*.mcap")
    file.unlink()
    with pytest.raises(InvalidInputError, match=rf"names {file.name}, which is not there"):
        read_run(folder)


def test_another_bag_in_the_folder_is_named_and_left_out(folder: Path) -> None:
    (file,) = folder.glob("*.mcap")
    (folder / "filtered.mcap").write_bytes(file.read_bytes())
    run = read_run(folder)
    assert len(run.scans) == 11
    assert told(run) == [("dropped", "files", ("filtered.mcap",), False)]


@pytest.mark.parametrize("how", ["file", "message"])
def test_a_compressed_bag_is_read_whole_or_refused(bag_maker: Any, tmp_path: Path, how: str) -> None:
    path = bag_maker(tmp_path / "bag", "sqlite3").drive().transform("base_link", "laser").write(how)
    (file,) = [entry for entry in path.iterdir() if entry.name != METADATA]
    (path / file.name.replace("bag", "bag_1", 1)).write_bytes(file.read_bytes())
    file.rename(path / file.name.replace("bag", "bag_0", 1))
    metadata = path / METADATA
    metadata.write_text(metadata.read_text().replace(file.name, file.name.replace("bag", "bag_0", 1)))
    with pytest.raises(InvalidInputError, match=r"a compressed bag of bag_0.*whose metadata\.yaml names bag_0"):
        read_run(path)


def test_a_log_that_sqlite_left_beside_the_bag_is_a_loss(bag_maker: Any, tmp_path: Path) -> None:
    path = bag_maker(tmp_path / "bag", "sqlite3").drive().transform("base_link", "laser").write()
    (file,) = path.glob("*.db3")
    (path / f"{file.name}-wal").write_bytes(b"x")
    assert told(read_run(path)) == [("dropped", "pieces of the bag", (f"{file.name}-wal",), True)]


def test_names_that_no_address_may_hold_are_read(folder: Path) -> None:
    assert len(read_run(folder.rename(folder.parent / "run #3 100% ?")).scans) == 11


@pytest.mark.parametrize(
    ("names", "one_bag"),
    [
        (["a.mcap"], True),
        (["a_0.mcap", "a_1.mcap"], True),
        (["r_2024-01-01-10-00-00_0.bag", "r_2024-01-01-10-05-00_1.bag"], True),
        (["a_0.mcap", "b_1.mcap"], False),
        (["a_0.mcap", "a.mcap"], False),
        (["a_0.mcap", "a_1.db3"], False),
        (["r_2024-01-01_0.bag", "r_2024-01-02_0.bag"], False),
        (["a_0.db3.zstd"], False),
        ([], False),
    ],
)
def test_what_is_one_bag(names: list[str], one_bag: bool) -> None:
    assert bool(_pieces(names)) == one_bag
