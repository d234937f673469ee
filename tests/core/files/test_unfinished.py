import os
import subprocess
import time
from pathlib import Path

import pytest

from closedrooms.core.files.unfinished import (
    ABANDONED,
    clear_files,
    clear_folders,
    part_of_file,
    part_of_folder,
    remove_unfinished,
    unfinished,
)


def gone_process() -> int:
    process = subprocess.Popen(["true"])
    process.wait()
    return process.pid


def age(path: Path) -> None:
    past = time.time() - ABANDONED - 60
    os.utime(path, (past, past))


def test_what_is_under_way_is_removed_at_the_end_of_its_block(tmp_path: Path) -> None:
    part = part_of_file(tmp_path / "a")
    with unfinished(part, tmp_path / "a"):
        part.write_text("half")
    assert not list(tmp_path.iterdir())


def test_a_process_that_ends_at_once_removes_all_it_has_under_way(tmp_path: Path) -> None:
    folder, file = part_of_folder(tmp_path / "out"), part_of_file(tmp_path / "a")
    with unfinished(folder, tmp_path / "out"), unfinished(file, tmp_path / "a"):
        (folder / "deep").mkdir(parents=True)
        (folder / "deep" / "x").write_text("x")
        file.write_text("half")
        remove_unfinished()
        assert not list(tmp_path.iterdir())


def test_what_was_there_before_goes_back_where_nothing_took_its_place(tmp_path: Path) -> None:
    target = tmp_path / "out"
    target.mkdir()
    (target / "result").write_text("of before")
    old = part_of_folder(target, "old")
    with unfinished(old, target):
        target.replace(old)
    assert (target / "result").read_text() == "of before"
    # After a kill -9 between the two moves it is the next command that puts it back.
    target.replace(old)
    clear_folders(target)
    assert (target / "result").read_text() == "of before"
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


def test_leftovers_of_processes_that_are_gone_are_removed_and_of_living_ones_kept(tmp_path: Path) -> None:
    path, machine = tmp_path / "a", part_of_file(tmp_path / "a").name.split(".")[2].split("-")[0]
    gone = tmp_path / f".a.{machine}-{gone_process()}.part"
    living = tmp_path / f".a.{machine}-{os.getppid()}.part"
    for other in (gone, living):
        other.write_text("half")
    clear_files(path)
    assert list(tmp_path.iterdir()) == [living]


def test_leftovers_of_other_machines_are_removed_after_a_day(tmp_path: Path) -> None:
    fresh, stale = tmp_path / f".a.0123abcd-{gone_process()}.part", tmp_path / ".a.0123abcd-1.part"
    for other in (fresh, stale):
        other.write_text("half")
    age(stale)
    clear_files(tmp_path / "a")
    assert list(tmp_path.iterdir()) == [fresh]


def test_without_a_lock_only_old_leftovers_of_a_folder_are_removed(tmp_path: Path) -> None:
    fresh, stale = tmp_path / ".out.0123abcd.part", tmp_path / ".out.89abcdef.part"
    for other in (fresh, stale):
        other.mkdir()
    age(stale)
    clear_folders(tmp_path / "out", alone=False)
    assert list(tmp_path.iterdir()) == [fresh]
    clear_folders(tmp_path / "out")
    assert not list(tmp_path.iterdir())


def test_files_of_other_people_and_other_names_are_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    names = [".outer.0123abcd.part", ".out.0123abcd.partly", "out.0123abcd.part", ".out.0123.part"]
    for name in names:
        (tmp_path / name).mkdir()
    clear_folders(tmp_path / "out")
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(names)
    (tmp_path / ".out.0123abcd.part").mkdir()
    monkeypatch.setattr(os, "getuid", lambda: os.geteuid() + 1)
    clear_folders(tmp_path / "out")
    assert (tmp_path / ".out.0123abcd.part").is_dir()
