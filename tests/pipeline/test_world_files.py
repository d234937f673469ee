import math
from pathlib import Path

import pytest
from PIL import Image

from closedrooms.core.errors import InvalidInputError, OutputError
from closedrooms.core.files.rosmap import read_map
from closedrooms.pipeline.world_files import (
    convert_world,
    describe_bundled,
    describe_world,
    exporters,
    generate_world,
    list_worlds,
    show_world,
)
from closedrooms.worlds.formats.native import read_plan
from closedrooms.worlds.library import bundled_names, load_world

FIXTURES = Path(__file__).parents[1] / "fixtures"


def test_the_list_of_bundled_worlds_is_that_of_their_plans() -> None:
    # python -c "from closedrooms.pipeline.world_files import *; print(*describe_bundled(), sep='\\n')" writes it anew.
    assert list_worlds() == describe_bundled()


def test_the_list_has_a_line_a_world_with_its_name_first() -> None:
    lines = list_worlds()
    assert [line.split()[0] for line in lines] == bundled_names()
    assert all("\x1b" not in line for line in lines)


def test_show_writes_a_picture(tmp_path: Path) -> None:
    show_world("school-04", tmp_path / "a.png")
    with Image.open(tmp_path / "a.png") as image:
        assert image.size[0] > 600
        assert len(image.convert("RGB").getcolors(1_000_000) or []) > 20


def test_a_picture_into_a_missing_folder_is_a_clear_error(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match="cannot write"):
        show_world("office-01", tmp_path / "none" / "a.png")


def test_generate_writes_a_plan(tmp_path: Path) -> None:
    plan = generate_world("office", 7, tmp_path / "a.json")
    assert read_plan(tmp_path / "a.json").rooms == plan.rooms


def test_generate_glazes_a_share_of_the_walls_on_demand(tmp_path: Path) -> None:
    generate_world("office", 7, tmp_path / "a.json", glass=0.3)
    walls = read_plan(tmp_path / "a.json").walls
    length = {kind: sum(math.dist(*w.segment) for w in walls if w.material == kind) for kind in ("glass", "solid")}
    assert length["glass"] / sum(length.values()) == pytest.approx(0.3, abs=0.1)
    plain = generate_world("office", 7, tmp_path / "b.json")
    assert {wall.material for wall in plain.walls} == {"solid"}
    assert sum(length.values()) == pytest.approx(sum(math.dist(*wall.segment) for wall in plain.walls))


@pytest.mark.parametrize("share", [-0.1, 1.5, float("nan")])
def test_a_share_of_glass_that_is_none_is_refused_and_nothing_is_written(tmp_path: Path, share: float) -> None:
    with pytest.raises(InvalidInputError, match="expected a share from 0 to 1"):
        generate_world("office", 7, tmp_path / "a.json", glass=share)
    assert not list(tmp_path.iterdir())


def test_convert_to_a_ros_map_gives_the_true_map_of_the_building(tmp_path: Path) -> None:
    convert_world("office-01", tmp_path / "m.yaml", "rosmap")
    grid = read_map(tmp_path / "m.yaml")
    interior = sum(room.polygon.area for room in load_world("office-01").rooms)
    known = grid.free.sum() * grid.frame.resolution**2
    assert 0.8 * interior < known < interior
    assert grid.occupied.any()


def test_an_unknown_format_lists_the_valid_ones(tmp_path: Path) -> None:
    with pytest.raises(
        InvalidInputError, match="unknown format 'dwg'; expected one of json, obj, rosmap, sdf, stage, urdf"
    ):
        convert_world("office-01", tmp_path / "m", "dwg")
    assert {"json", "rosmap"} <= set(exporters())
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("form", ["json", "rosmap", "sdf", "stage"])
def test_a_folder_is_no_file_to_convert_to(tmp_path: Path, form: str) -> None:
    with pytest.raises(OutputError, match="the output is a folder"):
        convert_world("office-01", tmp_path, form)
    assert not list(tmp_path.iterdir())


def test_a_level_of_a_world_with_one_floor_is_refused() -> None:
    with pytest.raises(InvalidInputError, match="--level L1 of a world with one floor"):
        load_world("office-01", level="L1")
    with pytest.raises(InvalidInputError, match="--level L1 of a world with one floor"):
        load_world(str(FIXTURES / "kth_small.xml"), level="L1")


def test_more_lines_name_the_kinds_of_rooms_and_the_doors_that_can_be_closed() -> None:
    lines = list_worlds(verbose=True)
    assert len(lines) == 3 * len(list_worlds())
    at = next(number for number, line in enumerate(lines) if line.startswith("office-01"))
    assert "3 shared office" in lines[at + 1]
    assert lines[at + 2].split(": ")[1].split(", ") == [f"d{number:02d}" for number in range(7)]


def test_a_plan_in_words_has_every_room_and_door() -> None:
    plan = load_world("office-07")
    lines = describe_world(plan)
    for thing in (*plan.rooms, *plan.doors):
        assert sum(line.startswith(f"{thing.id} ") for line in lines) == 1
    # Columns stand below each other, whatever the longest label.
    assert len({line.index(" m2  ") for line in lines if " m2  " in line}) == 1
    assert not next(line for line in lines if line.startswith("d09 ")).endswith("(closable)")
    assert next(line for line in lines if line.startswith("d10 ")).endswith("(closable)")
