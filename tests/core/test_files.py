import json
from pathlib import Path

import pytest

from closedrooms.core.errors import OutputError
from closedrooms.core.files import is_ours, output_folder, write_bytes


def test_an_output_folder_appears_whole_and_lists_its_files(tmp_path: Path) -> None:
    with output_folder(tmp_path / "out", {"seed": 3}) as folder:
        write_bytes(folder / "a.txt", b"a")
        assert not (tmp_path / "out").exists()
    manifest = json.loads((tmp_path / "out" / "run.json").read_text())
    assert manifest.pop("sha256").keys() == {"a.txt", "run.json"}
    assert manifest == {"seed": 3, "program": "closedrooms", "files": ["a.txt"]}
    assert is_ours(tmp_path / "out")
    assert [p.name for p in tmp_path.iterdir()] == ["out"]


def write_and_fail(out: Path, error: type[BaseException]) -> None:
    with output_folder(out, {}) as folder:
        write_bytes(folder / "new.txt", b"new")
        raise error


@pytest.mark.parametrize("error", [KeyboardInterrupt, ValueError])
def test_an_interrupted_run_leaves_the_folder_as_it_was(tmp_path: Path, error: type[BaseException]) -> None:
    with output_folder(tmp_path / "out", {}) as folder:
        write_bytes(folder / "old.txt", b"old")
    with pytest.raises(error):
        write_and_fail(tmp_path / "out", error)
    assert [p.name for p in tmp_path.iterdir()] == ["out"]
    assert (tmp_path / "out" / "old.txt").read_bytes() == b"old"


def test_a_folder_of_ours_is_replaced_whole(tmp_path: Path) -> None:
    for name in ("first", "second"):
        with output_folder(tmp_path / "out", {}) as folder:
            write_bytes(folder / name, b"")
    assert sorted(p.name for p in (tmp_path / "out").iterdir()) == ["run.json", "second"]


def test_a_folder_with_anything_else_is_refused_and_kept(tmp_path: Path) -> None:
    with output_folder(tmp_path / "out", {}) as folder:
        write_bytes(folder / "a", b"")
    (tmp_path / "out" / "notes.txt").write_text("mine")
    with pytest.raises(OutputError, match="did not write"), output_folder(tmp_path / "out", {}):
        pytest.fail("never entered")
    assert (tmp_path / "out" / "notes.txt").read_text() == "mine"


def test_an_empty_folder_is_used_and_a_file_is_refused(tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    with output_folder(tmp_path / "empty", {}):
        pass
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match="a file"), output_folder(tmp_path / "file", {}):
        pytest.fail("never entered")


def test_a_file_that_cannot_be_written_is_one_line_and_leaves_nothing(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match="cannot write"):
        write_bytes(tmp_path / "missing" / "a", b"")
    (tmp_path / "taken").mkdir()
    with pytest.raises(OutputError, match="cannot write"):
        write_bytes(tmp_path / "taken", b"")
    assert [p.name for p in tmp_path.iterdir()] == ["taken"]
