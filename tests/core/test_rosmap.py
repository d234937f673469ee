from pathlib import Path

import cv2
import numpy as np
import pytest

from closedrooms.core.errors import InvalidInputError
from closedrooms.core.grid import FREE, OCCUPIED, UNKNOWN, GridFrame, OccupancyGrid
from closedrooms.core.rosmap import read_map, write_map

HEAD = "resolution: 0.05\norigin: [-1.0, 2.0, 0.0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n"


def save(folder: Path, pixels: np.ndarray, head: str = HEAD, image: str = "m.png", mode: str = "trinary") -> Path:
    cv2.imwrite(str(folder / Path(image).name), pixels)
    path = folder / "m.yaml"
    path.write_text(f"image: {image}\nmode: {mode}\n{head}")
    return path


def test_what_is_written_is_read_back(tmp_path: Path) -> None:
    cells = np.random.default_rng(0).choice([UNKNOWN, FREE, OCCUPIED], (7, 9)).astype(np.int8)
    grid = OccupancyGrid(GridFrame(0.05, -1.25, 3.5, 7, 9), cells)
    write_map(tmp_path / "map", grid)
    again = read_map(tmp_path / "map.yaml")
    assert again.frame == grid.frame
    assert (again.cells == cells).all()
    assert sorted(p.name for p in tmp_path.iterdir()) == ["map.png", "map.yaml"]


def test_the_top_row_of_the_picture_is_the_last_row_of_the_grid(tmp_path: Path) -> None:
    pixels = np.full((3, 2), 254, dtype=np.uint8)
    pixels[0, 0] = 0
    grid = read_map(save(tmp_path, pixels))
    assert grid.cells.tolist() == [[0, 0], [0, 0], [100, 0]]


@pytest.mark.parametrize("grey", [204, 205, 206])
def test_grey_one_off_is_still_unknown_even_with_a_generous_threshold(tmp_path: Path, grey: int) -> None:
    path = save(tmp_path, np.full((2, 2), grey, dtype=np.uint8), HEAD.replace("0.196", "0.25"))
    assert read_map(path).unknown.all()


def test_reads_pgm_scale_raw_and_negated_maps(tmp_path: Path) -> None:
    pixels = np.array([[0, 128, 254]], dtype=np.uint8)
    assert read_map(save(tmp_path, pixels, image="m.pgm")).cells.tolist() == [[100, -1, 0]]
    assert read_map(save(tmp_path, pixels, HEAD.replace("negate: 0", "negate: 1"))).cells.tolist() == [[0, -1, 100]]
    scaled = read_map(save(tmp_path, pixels, mode="scale")).cells[0]
    assert scaled[0] == 100
    assert 1 <= scaled[1] <= 99
    assert scaled[2] == 0
    raw = np.array([[0, 100, 255]], dtype=np.uint8)
    assert read_map(save(tmp_path, raw, mode="raw")).cells.tolist() == [[0, 100, -1]]


def test_transparent_pixels_are_unknown(tmp_path: Path) -> None:
    rgba = np.zeros((1, 2, 4), dtype=np.uint8)
    rgba[0, 0] = 255
    assert read_map(save(tmp_path, rgba)).cells.tolist() == [[0, -1]]


def test_finds_the_picture_of_a_foreign_absolute_path_beside_the_yaml(tmp_path: Path) -> None:
    path = save(tmp_path, np.zeros((2, 2), dtype=np.uint8), image="/nowhere/at/all/m.png")
    assert read_map(path).occupied.all()


@pytest.mark.parametrize(
    ("head", "message"),
    [
        (HEAD.replace("[-1.0, 2.0, 0.0]", "5"), "origin"),
        (HEAD.replace("0.05", "-1"), "resolution"),
        (HEAD.replace("0.05", "fine"), "resolution"),
        (HEAD.replace("0.65", "0.1"), "thresholds"),
        (HEAD.replace("negate: 0", "negate: maybe"), "negate 'maybe'"),
        (HEAD.replace("negate: 0", "negate: [1]"), r"negate \['1'\]"),
    ],
)
def test_a_wrong_field_is_named_in_one_line_with_the_path_last(tmp_path: Path, head: str, message: str) -> None:
    path = save(tmp_path, np.zeros((2, 2), dtype=np.uint8), head)
    with pytest.raises(InvalidInputError, match=message) as error:
        read_map(path)
    assert str(error.value).endswith(str(path))
    assert "\n" not in str(error.value)


def test_rejects_missing_and_broken_files(tmp_path: Path) -> None:
    with pytest.raises(InvalidInputError, match="No such file"):
        read_map(tmp_path / "none.yaml")
    path = tmp_path / "m.yaml"
    path.write_text("image: gone.png\n" + HEAD)
    with pytest.raises(InvalidInputError, match="missing"):
        read_map(path)
    path.write_text(f"image: {'a' * 5000}\n" + HEAD)  # longer than any name of a file
    with pytest.raises(InvalidInputError, match="missing"):
        read_map(path)
    (tmp_path / "m.png").write_bytes(b"\x89PNG\r\n\x1a\nbroken")
    path.write_text("image: m.png\n" + HEAD)
    with pytest.raises(InvalidInputError, match="cannot be read"):
        read_map(path)
    path.write_text("image: [\n")
    with pytest.raises(InvalidInputError, match="YAML"):
        read_map(path)
