from pathlib import Path

import pytest

from closedrooms.core.errors import InvalidInputError
from closedrooms.worlds.formats.native import read_plan, write_plan
from closedrooms.worlds.library import (
    DEFAULT_WORLD,
    bundled_names,
    distinct_names,
    importer_of,
    load_world,
    read_world,
    split_level,
    world_source,
)
from closedrooms.worlds.plan import FloorPlan, PlanDoor


def test_twenty_worlds_are_bundled() -> None:
    assert len(bundled_names()) == 20
    assert DEFAULT_WORLD in bundled_names()


def test_an_unknown_world_lists_the_valid_ones() -> None:
    with pytest.raises(InvalidInputError, match=r"unknown world 'moon'.*office-01.*school-09"):
        load_world("moon")


def test_formats_are_told_by_content_not_by_name(small: FloorPlan, fixtures: Path, tmp_path: Path) -> None:
    write_plan(tmp_path / "plan.xml", small)
    assert load_world(str(tmp_path / "plan.xml")) == small
    (tmp_path / "floor.json").write_bytes((fixtures / "luperto_small.xml").read_bytes())
    assert load_world(str(tmp_path / "floor.json")).meta["format"] == "luperto"


@pytest.mark.parametrize("content", [b"", b"hello", b"\x00\x01\x02", b"{", b"<x>", b"a: 1\n"])
def test_files_of_no_known_format_are_clear_errors(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "thing.dat"
    path.write_bytes(content)
    with pytest.raises(InvalidInputError) as caught:
        load_world(str(path))
    assert "\n" not in str(caught.value)
    assert str(path) in str(caught.value)


def test_a_folder_is_a_clear_error(tmp_path: Path) -> None:
    with pytest.raises(InvalidInputError, match="a folder; expected a floor plan"):
        load_world(str(tmp_path))


def test_entrances_are_walled_up_for_a_robot_and_kept_for_conversion(small: FloorPlan, tmp_path: Path) -> None:
    from dataclasses import replace

    entrance = PlanDoor("e0", ((5.0, 0.0), (6.0, 0.0)), ("r0", None), opens_into="r0")
    path = tmp_path / "plan.json"
    write_plan(path, replace(small, doors=(*small.doors, entrance)))
    assert load_world(str(path)).doors == small.doors
    assert load_world(str(path)).meta["sealed"] == ["e0"]
    assert read_world(str(path)) == read_plan(path)


def test_a_world_is_named_so_that_any_folder_finds_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "office-01").write_text("a file of the name of a bundled world")
    (tmp_path / "plan.building.yaml").write_text("levels: {}")
    (tmp_path / "noon:12.json").write_text("{}")
    assert world_source("office-01") == "office-01"
    assert world_source("plan.building.yaml:L1") == f"{tmp_path.resolve()}/plan.building.yaml:L1"
    assert world_source("noon:12.json") == f"{tmp_path.resolve()}/noon:12.json"
    with pytest.raises(InvalidInputError, match="unknown world"):
        world_source("nowhere.json")


HEADS = {
    "picture": [b"\x89PNG\r\n\x1a\n...", b"P2\n4 4\n255\n", b"P5\n4 4\n255\n", b"P2 4 4 255 ", b"P5 4 4 255 "],
    "kth": [b"<?xml?><floor><PixelDistance>3</PixelDistance>", b"<a><Contour/></a>", b"\n  <a><contour/></a>"],
    "luperto": [b"<Floor><represented_distance/></Floor>", b"\n<a/>", b"\xef\xbb\xbf<a/>"],
    "houseexpo": [b'{"verts": []}', b' {"id": 1, "verts": []}'],
    "json": [b'{"rooms": []}', b"[1]", b'\n{"name": 1}'],
    "rmf": [b"name: x\nlevels:\n  L1: {}\n", b"'levels': {}", b'"levels" : {}', b"rooms: []\nlevels: {}"],
    "pyrobosim": [b"a: 1\nrooms: []\n", b"rooms:\n", b"image: a.png\nrooms: []"],
    "rosmap": [b"image: a.png\n", b"resolution: 1\nimage : a.png"],
}


@pytest.mark.parametrize(("name", "head"), [(name, head) for name, heads in HEADS.items() for head in heads])
def test_each_format_is_known_by_how_it_begins(tmp_path: Path, name: str, head: bytes) -> None:
    path = tmp_path / "plan.dat"
    path.write_bytes(head)
    found = importer_of(path)
    assert found.name == name
    assert found.levels == (name in {"rmf", "luperto"})


@pytest.mark.parametrize(
    "head", [b"P6\n4 4\n", b"verts", b"  levels: {}", b"a: {rooms: []}", b"images: x", b"", b"x<a>"]
)
def test_what_begins_otherwise_is_of_no_known_format(tmp_path: Path, head: bytes) -> None:
    path = tmp_path / "plan.dat"
    path.write_bytes(head)
    with pytest.raises(InvalidInputError, match="no known format"):
        importer_of(path)


@pytest.mark.parametrize(("ending", "name"), [(".xml", "luperto"), (".json", "json")])
def test_an_empty_file_is_told_by_its_ending_for_the_sake_of_the_message(
    tmp_path: Path, ending: str, name: str
) -> None:
    for content in (b"", b" \n"):
        (tmp_path / f"plan{ending}").write_bytes(content)
        assert importer_of(tmp_path / f"plan{ending}").name == name


@pytest.mark.parametrize("filler", ["x", "é"])
def test_the_keys_of_a_large_yaml_file_may_come_late_and_are_sought_in_nothing_else(
    tmp_path: Path, filler: str
) -> None:
    text = f"note: {filler * 70_000}\nlevels: {{}}\n"
    for ending, known in ((".yaml", True), (".YML", True), (".dat", False)):
        path = tmp_path / f"plan{ending}"
        path.write_text(text, encoding="utf-8")
        if known:
            assert importer_of(path).name == "rmf"
        else:
            with pytest.raises(InvalidInputError):
                importer_of(path)


def test_a_floor_is_named_behind_the_file_or_beside_it(tmp_path: Path) -> None:
    plain, odd = tmp_path / "a.yaml", tmp_path / "b:c.yaml"
    plain.write_text("levels: {}")
    odd.write_text("levels: {}")
    assert split_level(str(plain)) == (plain, None)
    assert split_level(str(plain), "L1") == (plain, "L1")
    assert split_level(f"{plain}:L1") == (plain, "L1")
    assert split_level(f"{plain}:L1", "L1") == (plain, "L1")
    assert split_level(f"{odd}:L 2") == (odd, "L 2")
    assert split_level(str(odd)) == (odd, None)
    assert split_level(f"{plain}:x:y") == (plain, "x:y")
    with pytest.raises(InvalidInputError, match="one level"):
        split_level(f"{plain}:L1", "L2")
    for given in (f"{plain}:", ":L1", "", str(tmp_path / "none.yaml:L1")):
        with pytest.raises(InvalidInputError, match="unknown world"):
            split_level(given)


def test_a_level_of_a_world_with_one_floor_is_refused(tmp_path: Path, small: FloorPlan) -> None:
    write_plan(tmp_path / "plan.json", small)
    for world in ("office-01", str(tmp_path / "plan.json")):
        with pytest.raises(InvalidInputError, match="--level L1 of a world with one floor"):
            load_world(world, level="L1")
    with pytest.raises(InvalidInputError, match="--level L1"):
        load_world(f"{tmp_path / 'plan.json'}:L1")


def test_an_unknown_world_is_shown_up_to_a_line_and_the_nearest_one_meant() -> None:
    with pytest.raises(InvalidInputError, match=r"unknown world 'office_01' \(did you mean office-01\?\)"):
        load_world("office_01")
    fits, long = "x" * 80, "y" * 10 + "x" * 71
    with pytest.raises(InvalidInputError, match=f"unknown world '{fits}'"):
        load_world(fits)
    with pytest.raises(InvalidInputError, match=r"unknown world '\.\.\.y{6}x{71}'"):
        load_world(long)


def named(*sources: str) -> tuple[list[FloorPlan], list[str]]:
    return [FloorPlan(Path(source).stem, (), (), ()) for source in sources], list(sources)


@pytest.mark.parametrize(
    ("sources", "names"),
    [
        (("/p/one.json", "/p/two.json"), ["one", "two"]),
        (("/p/x/a.json", "/p/y/a.json", "/p/x/b.json"), ["x-a", "y-a", "b"]),
        (("/p/x/z/a.json", "/p/y/z/a.json"), ["x-z-a", "y-z-a"]),
        (("/p/x/z/a.json", "/p/y/z/a.json", "/p/y/w/a.json"), ["x-z-a", "y-z-a", "y-w-a"]),
        (("/p/a.json", "/p/a.json", "/p/a.json"), ["a", "a-2", "a-3"]),
        (("/a.json", "/p/a.json"), ["a", "p-a"]),
        (("/x/a.json", "/x/b.json", "/y/a.json", "/y/b.json"), ["x-a", "x-b", "y-a", "y-b"]),
    ],
)
def test_plans_of_one_name_are_told_apart_by_as_few_folders_as_it_takes(
    sources: tuple[str, ...], names: list[str]
) -> None:
    assert distinct_names(*named(*sources)) == names
    if len({*sources}) == len(sources):
        assert distinct_names(*named(*sources[::-1])) == names[::-1]
