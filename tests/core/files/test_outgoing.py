import errno
import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from closedrooms.core.errors import OutputError
from closedrooms.core.files.incoming import read_bytes
from closedrooms.core.files.outgoing import check_new_files, new_files, write_bytes
from closedrooms.core.files.output_folders import check_output_folder, output_folder


def test_an_output_folder_appears_whole_and_lists_its_files(tmp_path: Path) -> None:
    with output_folder(tmp_path / "out", {"seed": 3}) as folder:
        write_bytes(folder / "a.txt", b"a")
        assert not (tmp_path / "out").exists()
    manifest = json.loads((tmp_path / "out" / "run.json").read_text())
    assert manifest.pop("sha256").keys() == {"a.txt", "run.json"}
    assert manifest == {"seed": 3, "program": "closedrooms", "schema": 1, "files": ["a.txt"]}
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


def make(out: Path, command: str | None = "predict", **files: bytes) -> None:
    with output_folder(out, {"command": command, "values": (1, {2: "three"})}) as folder:
        for name, content in (files or {"a": b"a"}).items():
            path = folder / name.replace("__", "/")
            path.parent.mkdir(parents=True, exist_ok=True)
            write_bytes(path, content)


def tree(folder: Path) -> dict[str, bytes]:
    return {p.relative_to(folder).as_posix(): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


def test_the_same_command_replaces_its_folder_at_every_depth(tmp_path: Path) -> None:
    make(tmp_path / "out", a=b"a", deep__er__b=b"b")
    make(tmp_path / "out", c=b"c")
    assert tree(tmp_path / "out").keys() == {"c", "run.json"}


def changed(out: Path) -> None:
    (out / "deep" / "b").write_bytes(b"B")


def added(out: Path) -> None:
    (out / "deep" / "mine.txt").write_text("mine")


def added_empty(out: Path) -> None:
    (out / "deep" / "empty").mkdir()


def linked(out: Path) -> None:
    (out / "deep" / "b").rename(out.parent / "elsewhere")
    (out / "deep" / "b").symlink_to(out.parent / "elsewhere")


def noted(out: Path) -> None:
    manifest = json.loads((out / "run.json").read_text())
    (out / "run.json").write_text(json.dumps(manifest | {"note": "mine"}, indent=2) + "\n")


def reformatted(out: Path) -> None:
    (out / "run.json").write_text(json.dumps(json.loads((out / "run.json").read_text())))


def taken_over(out: Path) -> None:
    (out / "run.json").write_text('{"program": "closedrooms", "files": ["a", "deep/b"], "command": "predict"}')


def broken(out: Path) -> None:
    (out / "run.json").write_text("{" * 1000)


def lost(out: Path) -> None:
    (out / "run.json").unlink()


@pytest.mark.parametrize("touch", [changed, added, added_empty, linked, noted, reformatted, taken_over, broken, lost])
def test_a_folder_that_somebody_touched_is_kept(tmp_path: Path, touch: Callable[[Path], None]) -> None:
    out = tmp_path / "out"
    make(out, a=b"a", deep__b=b"b")
    touch(out)
    before = tree(tmp_path)
    with pytest.raises(OutputError, match="did not write, or that was changed"):
        make(out)
    assert tree(tmp_path) == before


def test_another_command_does_not_replace_it(tmp_path: Path) -> None:
    make(tmp_path / "out", "evaluate")
    with pytest.raises(OutputError, match="closedrooms predict did not write"):
        make(tmp_path / "out", "predict")
    make(tmp_path / "out", "evaluate")


def test_what_was_put_there_while_we_worked_is_kept(tmp_path: Path) -> None:
    out = tmp_path / "out"
    make(out)

    def work() -> None:
        with output_folder(out, {"command": "predict"}) as folder:
            write_bytes(folder / "b", b"b")
            (out / "mine.txt").write_text("mine")

    with pytest.raises(OutputError, match="did not write"):
        work()
    assert tree(out).keys() == {"a", "mine.txt", "run.json"}
    assert [p.name for p in tmp_path.iterdir()] == ["out"]


def test_a_link_to_a_folder_stays_a_link(tmp_path: Path) -> None:
    (tmp_path / "far").mkdir()
    (tmp_path / "out").symlink_to(tmp_path / "far")
    for _ in range(2):
        make(tmp_path / "out")
    assert (tmp_path / "out").is_symlink()
    assert tree(tmp_path / "far").keys() == {"a", "run.json"}
    (tmp_path / "nowhere").symlink_to(tmp_path / "gone")
    with pytest.raises(OutputError, match="a file"):
        make(tmp_path / "nowhere")


def test_the_second_writer_of_a_folder_says_so_and_stops(tmp_path: Path) -> None:
    def second() -> None:
        with output_folder(tmp_path / "out", {}):
            make(tmp_path / "out")

    with pytest.raises(OutputError, match="another closedrooms writes"):
        second()
    assert list(tmp_path.iterdir()) == []


def test_two_folders_side_by_side_are_written_at_once(tmp_path: Path) -> None:
    with output_folder(tmp_path / "one", {}), output_folder(tmp_path / "two", {}):
        pass
    assert sorted(p.name for p in tmp_path.iterdir()) == ["one", "two"]


KILLED = """
import os, signal, sys
from pathlib import Path
from closedrooms.core.files.outgoing import write_bytes
from closedrooms.core.files.output_folders import output_folder
with output_folder(Path(sys.argv[1]), {"command": "predict"}) as folder:
    write_bytes(folder / "a", b"half")
    os.kill(os.getpid(), signal.SIGKILL)
"""


def test_what_a_killed_process_left_is_removed_by_the_next_and_nothing_else(tmp_path: Path) -> None:
    subprocess.run([sys.executable, "-c", KILLED, str(tmp_path / "out")], check=False)
    assert any(p.name.endswith(".part") for p in tmp_path.iterdir())
    others = (".out.mine.part", ".outer.abcdefgh.part", ".out.abcdefgh.keep", "out.abcdefgh.part")
    for name in others:
        (tmp_path / name).mkdir()
    make(tmp_path / "out")
    assert sorted(p.name for p in tmp_path.iterdir()) == sorted(["out", *others])


def test_what_a_killed_process_left_of_a_file_is_removed(tmp_path: Path) -> None:
    gone = subprocess.Popen([sys.executable, "-c", ""])
    gone.wait()
    (tmp_path / f".a.{gone.pid}.part").write_bytes(b"half")
    (tmp_path / ".a.1.part").write_bytes(b"of a process that lives")
    write_bytes(tmp_path / "a", b"whole")
    assert sorted(p.name for p in tmp_path.iterdir()) == [".a.1.part", "a"]


@pytest.mark.parametrize("name", ["x" * 200, "x" * 255, "ä" * 120])
def test_long_names_are_written_where_the_system_takes_them(tmp_path: Path, name: str) -> None:
    make(tmp_path / name)
    make(tmp_path / name)
    write_bytes(tmp_path / name / name, b"x")
    assert [p.name for p in tmp_path.iterdir()] == [name]


@pytest.mark.parametrize("name", ["x" * 256, "a\0b", "\ud800"])
def test_names_that_no_system_takes_are_one_line(tmp_path: Path, name: str) -> None:
    with pytest.raises(OutputError, match="cannot write"):
        make(tmp_path / name)
    with pytest.raises(OutputError):
        write_bytes(tmp_path / name, b"")
    with pytest.raises(OutputError):
        check_new_files([tmp_path / name])
    assert list(tmp_path.iterdir()) == []


def test_a_full_disk_at_any_write_leaves_everything_as_it_was(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    make(tmp_path / "out", a=b"old")
    before = tree(tmp_path)
    real = os.fsync

    def full(descriptor: int) -> None:
        nonlocal left
        left -= 1
        if left < 0:
            raise OSError(errno.ENOSPC, "No space left on device")
        real(descriptor)

    monkeypatch.setattr(os, "fsync", full)
    for writes in range(3):
        left = writes
        with pytest.raises(OutputError, match="No space left"):
            make(tmp_path / "out", a=b"new", b=b"new")
        assert tree(tmp_path) == before
    left = 3
    make(tmp_path / "out", a=b"new", b=b"new")


@pytest.mark.skipif(os.getuid() == 0, reason="root writes everywhere")
def test_a_closed_folder_is_one_line(tmp_path: Path) -> None:
    (tmp_path / "closed").mkdir(mode=0o000)
    with pytest.raises(OutputError, match="Permission denied"):
        make(tmp_path / "closed" / "out")


def test_single_files_are_new_unless_told_and_never_the_source(tmp_path: Path) -> None:
    source, other = tmp_path / "source", tmp_path / "other"
    source.write_text("s")
    other.write_text("o")
    (tmp_path / "hard").hardlink_to(source)
    (tmp_path / "soft").symlink_to(source)
    check_new_files([tmp_path / "new"], sources=[source, tmp_path / "missing"])
    check_new_files([other], force=True, sources=[source])
    with pytest.raises(OutputError, match="--force"):
        check_new_files([tmp_path / "new", other], sources=[source])
    for same in (source, tmp_path / "hard", tmp_path / "soft"):
        with pytest.raises(OutputError, match="is read"):
            check_new_files([same], force=True, sources=[source])
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(OutputError, match="no regular file"):
        check_new_files([tmp_path / "pipe"], force=True)
    with pytest.raises(OutputError, match="a folder"):
        check_new_files([tmp_path], force=True)
    with pytest.raises(OutputError, match="cannot write"):
        check_new_files([tmp_path / "no" / "where"], force=True)


@pytest.mark.parametrize("name", ["read", "hard", "soft"])
def test_what_is_read_on_the_way_is_not_replaced_either(tmp_path: Path, name: str) -> None:
    (tmp_path / "read").write_text("theirs")
    (tmp_path / "hard").hardlink_to(tmp_path / "read")
    (tmp_path / "soft").symlink_to(tmp_path / "read")

    def overwrite(read: str) -> None:
        with new_files([tmp_path / "new", tmp_path / name], force=True, sources=[]):
            for path in (tmp_path / "new", tmp_path / name):
                write_bytes(path, b"ours")
            read_bytes(tmp_path / read, what="a picture")

    with pytest.raises(OutputError, match="a file that was read"):
        overwrite("read")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["hard", "read", "soft"]
    assert (tmp_path / "read").read_text() == "theirs"
    (tmp_path / "another").write_text("theirs too")
    read_bytes(tmp_path / "read", what="a picture")
    overwrite("another")
    assert (tmp_path / name).read_text() == (tmp_path / "new").read_text() == "ours"


def write_after(path: Path, text: str, *, force: bool) -> None:
    """Somebody else writes the file while ours is computed."""
    with new_files([path], force=force):
        path.write_text(text)
        write_bytes(path, b"ours")


@pytest.mark.parametrize("force", [False, True])
def test_a_file_that_appears_while_it_is_computed_is_not_replaced(tmp_path: Path, force: bool) -> None:
    path = tmp_path / "a"
    with pytest.raises(OutputError, match="appeared"):
        write_after(path, "of somebody else", force=force)
    assert tree(tmp_path) == {"a": b"of somebody else"}


def test_a_file_that_is_changed_while_its_successor_is_computed_is_not_replaced(tmp_path: Path) -> None:
    path = tmp_path / "a"
    path.write_text("before")
    with pytest.raises(OutputError, match="changed meanwhile"):
        write_after(path, "edited meanwhile", force=True)
    assert tree(tmp_path) == {"a": b"edited meanwhile"}
    with new_files([path], force=True):
        write_bytes(path, b"ours")
    assert tree(tmp_path) == {"a": b"ours"}


def test_a_file_of_a_claim_is_written_and_others_as_ever(tmp_path: Path) -> None:
    (tmp_path / "other").write_text("before")
    with new_files([tmp_path / "a"]):
        write_bytes(tmp_path / "a", b"1")
        write_bytes(tmp_path / "other", b"2")
        # Once written it is ours.
        write_bytes(tmp_path / "a", b"3")
    assert tree(tmp_path) == {"a": b"3", "other": b"2"}


def test_of_several_files_all_appear_or_none(tmp_path: Path) -> None:
    (tmp_path / "b").write_text("before")
    paths = [tmp_path / "a", tmp_path / "b"]

    def write(then: Callable[[], object]) -> None:
        with new_files(paths, force=True):
            write_bytes(paths[0], b"1")
            write_bytes(paths[1], b"2")
            assert not paths[0].exists()
            then()

    with pytest.raises(ZeroDivisionError):
        write(lambda: 1 / 0)
    assert tree(tmp_path) == {"b": b"before"}
    with pytest.raises(OutputError, match="changed meanwhile"):
        write(lambda: paths[1].write_text("of somebody else"))
    assert tree(tmp_path) == {"b": b"of somebody else"}
    write(lambda: None)
    assert tree(tmp_path) == {"a": b"1", "b": b"2"}


def test_a_message_names_the_output_not_where_it_is_written_meanwhile(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(_: int) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(OutputError) as caught:
        make(tmp_path / "out", a=b"new")
    assert str(caught.value).endswith(f": {tmp_path / 'out' / 'a'}")


@pytest.mark.parametrize("source", ["out/a", "out", "link"])
def test_a_folder_that_is_read_is_not_replaced(tmp_path: Path, source: str) -> None:
    make(tmp_path / "out")
    (tmp_path / "link").symlink_to(tmp_path / "out" / "a")
    with pytest.raises(OutputError, match="holds what is read"):
        check_output_folder(tmp_path / "out", "predict", sources=[None, tmp_path / source])
    check_output_folder(tmp_path / "out", "predict", sources=[tmp_path, tmp_path / "missing"])


@pytest.mark.parametrize("name", ["circle", "circle/below"])
def test_a_circle_of_links_is_one_line(tmp_path: Path, name: str) -> None:
    (tmp_path / "circle").symlink_to(tmp_path / "circle")
    with pytest.raises(OutputError, match=r"a file; expected a folder|cannot write"):
        check_output_folder(tmp_path / name, "predict", sources=[tmp_path])
    check_output_folder(tmp_path / "out", "predict", sources=[tmp_path / name])


def test_an_interrupted_swap_puts_the_old_folder_back(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    make(tmp_path / "out", a=b"old")
    replace, calls = Path.replace, []

    def stop_between(self: Path, target: Path) -> Path:
        if self.is_dir():
            calls.append(self)
            if len(calls) == 2:
                raise KeyboardInterrupt
        return replace(self, target)

    monkeypatch.setattr(Path, "replace", stop_between)
    with pytest.raises(KeyboardInterrupt):
        make(tmp_path / "out", a=b"new")
    assert tree(tmp_path)["out/a"] == b"old"
    assert [path.name for path in tmp_path.iterdir()] == ["out"]
