from pathlib import Path

import pytest

from closedrooms.core.errors import InvalidInputError
from closedrooms.worlds.formats.native import read_plan, write_plan
from closedrooms.worlds.library import DEFAULT_WORLD, bundled_names, load_world, read_world, world_source
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
