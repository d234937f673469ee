from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image
from shapely.geometry import Point, box

from closedrooms.core.door import ClosedDoor
from closedrooms.core.errors import InvalidInputError
from closedrooms.core.files.rosmap import read_map, read_ros_map, write_map, write_raw_map
from closedrooms.core.grid import FREE, OCCUPIED, UNKNOWN, GridFrame, OccupancyGrid
from closedrooms.core.room import Room

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


def test_transparent_colours_of_a_palette_are_unknown(tmp_path: Path) -> None:
    save(tmp_path, np.zeros((1, 3), dtype=np.uint8))
    palette = Image.fromarray(np.array([[0, 1, 2]], dtype=np.uint8)).convert("P")
    palette.putpalette([255, 255, 255, 0, 0, 0, 0, 0, 0])
    palette.save(tmp_path / "m.png", transparency=bytes([255, 0, 255]))
    assert read_map(tmp_path / "m.yaml").cells.tolist() == [[0, -1, 100]]


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


def picture_of(folder: Path, image: str) -> tuple[OccupancyGrid, list[str]]:
    path = folder / "m.yaml"
    path.write_text(f"image: {image}\n{HEAD}")
    read = read_ros_map(path)
    return read.grid, [str(remark) for remark in read.remarks]


@pytest.mark.parametrize(
    "image",
    [
        "maps/m.png", "~/m.png", "~nobody-here/m.png", "../maps/m.png", "../../../m.png", "./m.png", "/m.png",
        "file:///home/me/m.png", "file://m.png/m.png", "package://my_maps/maps/m.png", "C:\\\\ws\\\\m.png",
        "C:\\ws\\m.png", "maps\\m.png", "file:///my%20maps/m.png", "file:maps/m.png",
        "'maps/m.png'", '"/home/me/m.png"', "FILE:///m.png", "//server/share/m.png",
    ],
)  # fmt: skip
def test_a_picture_is_found_beside_the_yaml_in_whatever_form_it_is_named(tmp_path: Path, image: str) -> None:
    cv2.imwrite(str(tmp_path / "m.png"), np.zeros((1, 1), dtype=np.uint8))
    grid, remarks = picture_of(tmp_path, image)
    assert grid.occupied.all()
    assert len(remarks) == (image != "./m.png")


def test_a_picture_in_a_folder_below_is_taken_before_one_beside(tmp_path: Path) -> None:
    for folder, grey in ((tmp_path, 0), (tmp_path / "maps", 254)):
        folder.mkdir(exist_ok=True)
        cv2.imwrite(str(folder / "m.png"), np.full((1, 1), grey, dtype=np.uint8))
    for image in (
        "maps/m.png",
        "maps\\m.png",
        "maps//m.png",
        f"{tmp_path}/maps/m.png",
        f"file://{tmp_path}/maps/m.png",
    ):
        grid, remarks = picture_of(tmp_path, image)
        assert grid.free.all(), image
        assert remarks == []


def test_nothing_outside_the_folder_is_opened_unless_told(tmp_path: Path) -> None:
    inside = tmp_path / "maps"
    inside.mkdir()
    cv2.imwrite(str(tmp_path / "other.png"), np.full((1, 1), 254, dtype=np.uint8))
    (inside / "link.png").symlink_to(tmp_path / "other.png")
    path = inside / "m.yaml"
    for image in ("../other.png", str(tmp_path / "other.png"), "link.png", f"file://{tmp_path}/other.png"):
        path.write_text(f"image: {image}\n{HEAD}")
        with pytest.raises(InvalidInputError, match=r"--allow-outside.*m\.yaml$"):
            read_ros_map(path)
        assert read_ros_map(path, allow_outside=True).grid.free.all()
    path.write_text(f"image: /etc/passwd\n{HEAD}")
    with pytest.raises(InvalidInputError, match="allow-outside"):
        read_ros_map(path)
    with pytest.raises(InvalidInputError, match="cannot be read"):
        read_ros_map(path, allow_outside=True)


@pytest.mark.parametrize(
    ("written", "number"),
    [("5e-2", 0.05), ("'0.05'", 0.05), ('"5e-2"', 0.05), (".05", 0.05), ("+0.05", 0.05), ("5.0E-02", 0.05), ("1", 1.0)],
)
def test_numbers_are_read_as_yaml_cpp_reads_them(tmp_path: Path, written: str, number: float) -> None:
    path = save(tmp_path, np.zeros((2, 2), dtype=np.uint8), HEAD.replace("0.05", written))
    assert read_map(path).frame.resolution == number
    path = save(tmp_path, np.zeros((2, 2), dtype=np.uint8), HEAD.replace("-1.0, 2.0, 0.0", f"-5e-05, {written}, '0'"))
    assert read_map(path).frame.origin_x == -5e-05
    assert read_map(path).frame.origin_y == number


@pytest.mark.parametrize(
    "written", ["1_000", "0x1", "1:30", "yes", "five", "[1]", "", "~", "1e9", "-1", ".nan", ".inf", "0"]
)
def test_what_is_no_resolution_is_refused(tmp_path: Path, written: str) -> None:
    path = save(tmp_path, np.zeros((2, 2), dtype=np.uint8), HEAD.replace("0.05", written))
    with pytest.raises(InvalidInputError, match="map resolution"):
        read_map(path)


@pytest.mark.parametrize("yaw", ["0", "0.0", "6.283185307179586", "-6.283185307179586", "12.566370614359172", "1e-12"])
def test_whole_turns_are_no_yaw(tmp_path: Path, yaw: str) -> None:
    read = read_ros_map(save(tmp_path, np.zeros((2, 2), dtype=np.uint8), HEAD.replace("2.0, 0.0]", f"2.0, {yaw}]")))
    assert not read.turned
    assert (read.grid.frame.origin_x, read.grid.frame.origin_y) == (-1.0, 2.0)
    assert not read.remarks


@pytest.mark.parametrize("yaw", ["nan", ".nan", ".NaN", "'nan'"])
def test_a_yaw_that_is_no_number_is_taken_as_zero_and_told(tmp_path: Path, yaw: str) -> None:
    read = read_ros_map(save(tmp_path, np.zeros((2, 2), dtype=np.uint8), HEAD.replace("2.0, 0.0]", f"2.0, {yaw}]")))
    assert not read.turned
    assert [remark.action for remark in read.remarks] == ["guessed"]


@pytest.mark.parametrize("yaw", [0.3, -2.5, 3.141592653589793, 7.0])
def test_a_turned_map_keeps_its_axes_and_is_written_back_as_it_was(tmp_path: Path, yaw: float) -> None:
    pixels = np.full((3, 4), 205, dtype=np.uint8)
    pixels[2, 0] = 0  # the lower left cell
    pixels[0, 3] = 254  # the upper right one
    path = save(tmp_path, pixels, HEAD.replace("2.0, 0.0]", f"2.0, {yaw}]"))
    read = read_ros_map(path)
    assert read.turned
    assert (read.grid.cells[0, 0], read.grid.cells[2, 3]) == (OCCUPIED, FREE)
    # As map_server places it: the lower left corner of the picture at the origin, the picture turned about it.
    corner = read.map_T_grid.transform(np.array([[0.0, 0.0], [0.2, 0.0]]))
    assert corner == pytest.approx(np.array([[-1.0, 2.0], [-1.0 + 0.2 * np.cos(yaw), 2.0 + 0.2 * np.sin(yaw)]]))
    with pytest.raises(InvalidInputError, match=r"yaw.*m\.yaml$"):
        read_map(path)
    # What is written of a larger grid with the same axes lies where it was.
    larger = read.grid.frame.covering(-0.5, -0.25, 0.5, 0.5)
    write_map(tmp_path / "again", read.grid.on(larger), map_T_grid=read.map_T_grid)
    again = read_ros_map(tmp_path / "again.yaml")
    (row, col), (there,) = (
        np.argwhere(again.grid.occupied)[0],
        again.grid.frame.to_points(np.argwhere(again.grid.occupied)),
    )
    assert again.map_T_grid.transform(there) == pytest.approx(read.map_T_grid.transform(np.array([0.025, 0.025])))
    assert (row, col) == (5, 10)


def test_doors_go_to_the_grid_and_rooms_come_back(tmp_path: Path) -> None:
    read = read_ros_map(save(tmp_path, np.zeros((2, 2), dtype=np.uint8), HEAD.replace("2.0, 0.0]", "2.0, 0.7]")))
    door = ClosedDoor("a", (1.5, -0.5), ((1.0, -0.5), (2.0, -0.5)), 1.0)
    (there,) = read.doors_on_grid([door])
    assert there.midpoint == pytest.approx(read.map_T_grid.inverse().transform(np.array(door.midpoint)))
    (room,) = read.rooms_on_map([Room(box(0, 0, 1, 2), ("a",))])
    assert room.polygon.area == pytest.approx(2.0)
    assert room.polygon.distance(Point(read.map_T_grid.x, read.map_T_grid.y)) < 1e-9


@pytest.mark.parametrize("mode", ["trinary", "TRINARY"])
@pytest.mark.parametrize("thresholds", [(0.196, 0.65), (0.25, 0.65), (0.9, 0.95), (0.1, 0.15), (0.0, 0.0), (1.0, 1.0)])
@pytest.mark.parametrize(("negate", "unknown"), [("0", 205), ("1", 50), ("true", 50), ("'1'", 50)])
def test_unknown_stays_unknown(
    tmp_path: Path, negate: str, unknown: int, thresholds: tuple[float, float], mode: str
) -> None:
    head = HEAD.replace("0.196", str(thresholds[0])).replace("0.65", str(thresholds[1]))
    pixels = np.array([[unknown, unknown - 1, unknown + 1, 0, 255]], dtype=np.uint8)
    grid = read_map(save(tmp_path, pixels, head.replace("negate: 0", f"negate: {negate}"), mode=mode))
    assert grid.cells[0, :3].tolist() == [UNKNOWN] * 3
    free, occupied = (4, 3) if unknown == 205 else (3, 4)
    if thresholds[0] > 0.0:
        assert grid.cells[0, free] == FREE
    if thresholds[1] < 1.0:
        assert grid.cells[0, occupied] == OCCUPIED


def test_one_threshold_without_the_other_is_enough(tmp_path: Path) -> None:
    pixels = np.array([[0, 205, 254]], dtype=np.uint8)
    for line in ("occupied_thresh: 0.65\n", "free_thresh: 0.196\n"):
        for value in ("0.1", "0.5", "0.8"):
            head = HEAD.replace(line, "").replace("0.196", value).replace("0.65", value)
            assert read_map(save(tmp_path, pixels, head)).cells.tolist() == [[OCCUPIED, UNKNOWN, FREE]], head


def test_a_small_file_does_not_become_a_huge_map(tmp_path: Path) -> None:
    bomb = np.full((9000, 9000), 255, dtype=np.uint8)
    path = save(tmp_path, bomb)
    Image.fromarray(bomb).convert("1").save(tmp_path / "m.png")
    with pytest.raises(InvalidInputError, match=r"9000 x 9000.*m\.png$"):
        read_map(path)


def test_a_raw_map_keeps_every_value(tmp_path: Path) -> None:
    cells = np.arange(-1, 101, dtype=np.int8).reshape(6, 17)
    grid = OccupancyGrid(GridFrame(0.05, 1.0, -2.0, 6, 17), cells)
    write_raw_map(tmp_path / "probability", grid)
    assert "mode: raw" in (tmp_path / "probability.yaml").read_text()
    read = read_map(tmp_path / "probability.yaml")
    assert np.array_equal(read.cells, cells)
    assert read.frame == grid.frame


def test_addresses_of_files_are_decoded(tmp_path: Path) -> None:
    cv2.imwrite(str(tmp_path / "a b.png"), np.zeros((1, 1), dtype=np.uint8))
    for image in ("file:///home/me/a%20b.png", "file:a%20b.png", "file://a%20b.png", "a b.png"):
        assert picture_of(tmp_path, image)[0].occupied.all(), image


@pytest.mark.parametrize("mode", ["RGB", "RGBA", "P"])
def test_colours_are_averaged_as_map_server_does(tmp_path: Path, mode: str) -> None:
    # Red, green and blue have the mean 85: p is 0.67 and above 0.65. Yellow has 170: neither free nor occupied.
    picture = Image.fromarray(np.array([[[255, 0, 0], [0, 255, 0], [0, 0, 255], [255, 255, 0]]], dtype=np.uint8))
    picture.convert(mode).save(tmp_path / "m.png")
    (tmp_path / "m.yaml").write_text("image: m.png\nresolution: 0.05\norigin: [0, 0, 0]\n")
    assert read_map(tmp_path / "m.yaml").cells.tolist() == [[OCCUPIED, OCCUPIED, OCCUPIED, UNKNOWN]]


@pytest.mark.parametrize("values", [np.array([[0.0, 1.0]], dtype=np.float32), np.array([[0, 1 << 20]], dtype=np.int32)])
def test_greys_that_no_map_server_writes_are_refused(tmp_path: Path, values: np.ndarray) -> None:
    Image.fromarray(values).save(tmp_path / "m.tif")
    (tmp_path / "m.yaml").write_text("image: m.tif\nresolution: 0.05\norigin: [0, 0, 0]\n")
    with pytest.raises(InvalidInputError, match="expected greys or colours of 8 or 16 bits"):
        read_map(tmp_path / "m.yaml")


def test_greys_of_sixteen_bits_are_those_of_eight(tmp_path: Path) -> None:
    eight = np.array([[0, 60, 205, 254, 255], [89, 90, 150, 206, 204]], dtype=np.uint8)
    wanted = read_map(save(tmp_path, eight)).cells
    assert len(np.unique(wanted)) == 3
    for sixteen in (eight.astype(np.uint16) * 257, (eight.astype(np.uint16) << 8), eight.astype(np.uint16)):
        Image.fromarray(sixteen).save(tmp_path / "m.png")
        assert (read_map(tmp_path / "m.yaml").cells == wanted).all()


@pytest.mark.parametrize(("origin", "name"), [("[1.1e8, 0, 0]", "x"), ("[0, -1.1e8, 0]", "y"), ("[0, .inf, 0]", "y")])
def test_an_origin_beyond_any_map_is_refused_by_its_axis(tmp_path: Path, origin: str, name: str) -> None:
    path = save(tmp_path, np.zeros((1, 1), dtype=np.uint8), f"resolution: 0.05\norigin: {origin}\n")
    with pytest.raises(InvalidInputError, match=rf"^map origin {name} .* from -1e\+08 to 1e\+08 m: .*m\.yaml$"):
        read_map(path)


@pytest.mark.parametrize(("resolution", "read"), [("0.001", True), ("10", True), ("0.00099", False), ("10.1", False)])
def test_cells_measure_a_millimetre_to_ten_metres(tmp_path: Path, resolution: str, read: bool) -> None:
    path = save(tmp_path, np.zeros((1, 1), dtype=np.uint8), f"resolution: {resolution}\norigin: [0, 0, 0]\n")
    if read:
        assert read_map(path).frame.resolution == float(resolution)
    else:
        with pytest.raises(InvalidInputError, match=r"^map resolution .* from 0.001 to 10 m"):
            read_map(path)


@pytest.mark.parametrize("quality", [50, 75, 95])
def test_a_jpeg_keeps_its_unknown_space_and_says_so(tmp_path: Path, quality: int) -> None:
    saved = np.full((80, 120), 205, dtype=np.uint8)
    saved[10:70, 10:100] = 0
    saved[13:67, 13:97] = 254
    saved[30:32, 13:60] = 0
    Image.fromarray(saved).save(tmp_path / "map.jpg", quality=quality)
    (tmp_path / "map.yaml").write_text(f"image: map.jpg\n{HEAD}")
    read = read_ros_map(tmp_path / "map.yaml")
    cells = read.grid.cells[::-1]
    assert (cells[saved == 205] == UNKNOWN).mean() > 0.98
    assert (cells[saved == 254] == FREE).mean() > 0.97
    assert (cells[saved == 0] == OCCUPIED).all()
    assert [(remark.action, remark.names) for remark in read.remarks] == [("guessed", ("map.jpg",))]
    Image.fromarray(saved).save(tmp_path / "map.png")
    (tmp_path / "map.yaml").write_text(f"image: map.png\n{HEAD}")
    assert not read_ros_map(tmp_path / "map.yaml").remarks


def test_a_jpeg_may_be_as_large_as_any_map(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    Image.fromarray(np.full((80, 120), 254, dtype=np.uint8)).save(tmp_path / "map.jpg")
    (tmp_path / "map.yaml").write_text("image: map.jpg\nresolution: 0.05\norigin: [0, 0, 0]\n")
    monkeypatch.setattr(Image, "MAX_IMAGE_PIXELS", 100)  # Pillow's own bound is below ours
    assert read_ros_map(tmp_path / "map.yaml").grid.free.all()


def test_a_yaw_in_degrees_and_an_inverted_picture_are_told(tmp_path: Path) -> None:
    cells = np.full((60, 80), FREE, dtype=np.int8)
    cells[[0, 1, -1, -2]] = cells[:, [0, 1, -1, -2]] = OCCUPIED
    write_map(tmp_path / "m", OccupancyGrid(GridFrame(0.05, 0.0, 0.0, 60, 80), cells))
    text = (tmp_path / "m.yaml").read_text()

    def told(*changes: tuple[str, str]) -> list[tuple[str, str]]:
        changed = text
        for old, new in changes:
            assert old in changed
            changed = changed.replace(old, new)
        (tmp_path / "n.yaml").write_text(changed)
        return [(remark.action, remark.what) for remark in read_ros_map(tmp_path / "n.yaml").remarks]

    assert told() == []
    assert told(("0.0, 0.0, 0.0", "0.0, 0.0, 90.0")) == [("guessed", "yaw of the map")]
    assert told(("0.0, 0.0, 0.0", "0.0, 0.0, 6.283185307179586")) == []
    assert told(("negate: 0", "negate: 1")) == [("guessed", "cells")]


@pytest.mark.parametrize(
    ("left_out", "taken"),
    [
        (("occupied_thresh",), "occupied_thresh 0.65"),
        (("free_thresh",), "free_thresh 0.196"),
        (("negate",), "negate 0"),
        (("negate", "free_thresh", "occupied_thresh"), "negate 0, free_thresh 0.196, occupied_thresh 0.65"),
    ],
)
def test_meanings_of_greys_that_a_file_leaves_open_are_said(
    tmp_path: Path, left_out: tuple[str, ...], taken: str
) -> None:
    head = "".join(line for line in HEAD.splitlines(keepends=True) if not line.startswith(left_out))
    read = read_ros_map(save(tmp_path, np.array([[0, 205, 254]], dtype=np.uint8), head))
    assert [str(remark) for remark in read.remarks] == [f"guessed meaning of greys: not in the file; taken: {taken}"]
    assert not any(remark.loss for remark in read.remarks)
    assert read.grid.cells.tolist() == [[OCCUPIED, UNKNOWN, FREE]]


def test_a_whole_description_and_a_raw_one_leave_nothing_to_guess(tmp_path: Path) -> None:
    pixels = np.array([[0, 205, 254]], dtype=np.uint8)
    assert read_ros_map(save(tmp_path, pixels, HEAD)).remarks == ()
    pixels = np.array([[0, 100, 255]], dtype=np.uint8)
    raw = "resolution: 0.05\norigin: [-1.0, 2.0, 0.0]\n"
    assert read_ros_map(save(tmp_path, pixels, raw, mode="raw")).remarks == ()


@pytest.mark.parametrize("origin", ["[-1.0, 2.0]", "[-1.0, 2.0, .nan]"])
def test_a_yaw_that_a_file_leaves_open_is_said(tmp_path: Path, origin: str) -> None:
    head = HEAD.replace("[-1.0, 2.0, 0.0]", origin)
    read = read_ros_map(save(tmp_path, np.array([[0, 205, 254]], dtype=np.uint8), head))
    assert [str(remark) for remark in read.remarks] == ["guessed yaw of the map: no number in the file, 0 was taken"]
    assert not read.turned


@pytest.mark.parametrize(
    ("mode", "free_thresh", "negate", "grey", "said", "loss"),
    [
        ("trinary", "0.25", "0", 205, "205 means unknown, though free_thresh 0.25 makes it free", False),
        ("trinary", "0.25", "1", 50, "50 means unknown, though free_thresh 0.25 makes it free", False),
        ("trinary", "0.25", "0", 204, None, False),
        ("trinary", "0.19", "0", 205, None, False),
        ("scale", "0.196", "0", 205, "205, unknown in the mode trinary, is nearly free in the mode scale", False),
        ("scale", "0.196", "0", 128, None, False),
        ("raw", "0.196", "0", 205, "greys from 101 to 254 mean nothing in the mode raw (trinary?); unknown", True),
        ("raw", "0.196", "0", 255, None, False),
    ],
)
def test_greys_that_other_programs_take_for_something_else_are_counted_and_said(
    tmp_path: Path, mode: str, free_thresh: str, negate: str, grey: int, said: str | None, loss: bool
) -> None:
    pixels = np.full((4, 6), 100, dtype=np.uint8)
    pixels[1, :3] = grey
    head = HEAD.replace("0.196", free_thresh).replace("negate: 0", f"negate: {negate}")
    remarks = read_ros_map(save(tmp_path, pixels, head, mode=mode)).remarks
    assert [(said in remark.why, remark.count, remark.loss) for remark in remarks if said] == (
        [(True, 3, loss)] if said else []
    )
    assert said or not remarks


def test_greys_under_transparent_pixels_are_not_counted(tmp_path: Path) -> None:
    pixels = np.full((4, 6, 4), 205, dtype=np.uint8)
    pixels[..., 3] = 0
    pixels[0] = (254, 254, 254, 255)
    assert read_ros_map(save(tmp_path, pixels, HEAD, mode="scale")).remarks == ()


@pytest.mark.parametrize(("resolution", "said"), [("0.5", False), ("0.6", True), ("5", True)])
def test_cells_too_coarse_for_a_door_are_said(tmp_path: Path, resolution: str, said: bool) -> None:
    head = HEAD.replace("resolution: 0.05", f"resolution: {resolution}")
    read = read_ros_map(save(tmp_path, np.full((4, 6), 254, dtype=np.uint8), head))
    assert ["centimetres?" in remark.why for remark in read.remarks] == ([True] if said else [])


@pytest.mark.parametrize(
    ("greys", "said"),
    [
        ((254, 220, 0), "greys 220, 254 are all free"),
        ((254, 60, 0), "greys 0, 60 are all occupied"),
        ((254, 255, 0), None),
        ((254, 205, 0), None),
        ((254, 127, 0), None),
    ],
)
def test_two_greys_of_one_meaning_are_said(tmp_path: Path, greys: tuple[int, ...], said: str | None) -> None:
    pixels = np.repeat(np.array(greys, dtype=np.uint8), 20).reshape(6, 10)
    why = [remark.why for remark in read_ros_map(save(tmp_path, pixels)).remarks]
    assert len(why) == (said is not None)
    assert said is None or said in why[0]
    pixels[pixels == greys[1]] = 254
    pixels[0, 0] = greys[1]  # some noise is nobody's grey
    assert read_ros_map(save(tmp_path, pixels)).remarks == ()


def test_a_picture_whose_floor_is_transparent_has_no_free_cell_and_says_so(tmp_path: Path) -> None:
    pixels = np.zeros((6, 10, 4), dtype=np.uint8)
    pixels[2, :, 3] = 255
    read = read_ros_map(save(tmp_path, pixels))
    assert (read.grid.free.any(), int(read.grid.occupied.sum())) == (False, 10)
    assert [remark.why for remark in read.remarks] == ["no opaque pixel is free; transparent ones are unknown"]
