from pathlib import Path
from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
import pytest
from shapely.geometry import Polygon, box

from closedrooms.core.door import ClosedDoor
from closedrooms.core.errors import OutputError
from closedrooms.core.grid import FREE, OCCUPIED, UNKNOWN, GridFrame, OccupancyGrid
from closedrooms.core.room import Alternative, Room
from closedrooms.predictor.prediction import Prediction
from closedrooms.visualization import colours
from closedrooms.visualization.canvas import Canvas
from closedrooms.visualization.summary import draw_cover, draw_summary

FRAME = GridFrame(0.05, -1.0, -1.0, 160, 240)
DOOR = ClosedDoor("d07", (5.0, 3.0), ((4.55, 3.0), (5.45, 3.0)), 0.9)


def a_map() -> OccupancyGrid:
    """A free corridor of 10 x 3 m with walls around, everything above unknown."""
    cells = np.full(FRAME.shape, UNKNOWN, dtype=np.int8)
    (r0, c0), (r1, c1) = FRAME.to_cells(np.array([[0.0, 0.0], [10.0, 3.0]])).tolist()
    cells[r0 - 2 : r1 + 2, c0 - 2 : c1 + 2] = OCCUPIED
    cells[r0:r1, c0:c1] = FREE
    return OccupancyGrid(FRAME, cells)


def a_prediction(grid: OccupancyGrid) -> Prediction:
    return Prediction(grid, (Room(box(3.0, 3.1, 7.0, 6.0), ("d07",), "independent", 4.2),))


def a_tour() -> Any:
    vertices = np.array([[1.0, 1.5], [5.0, 1.5], [9.0, 1.5]])
    graph = SimpleNamespace(vertices=vertices, pairs=np.array([[0, 1], [1, 2]]), door_vertices={})
    return SimpleNamespace(graph=graph, path=vertices[[0, 1, 2, 1, 0]], length=16.0)


def test_y_points_up_and_x_to_the_right() -> None:
    cells = np.full((40, 60), FREE, dtype=np.int8)
    cells[30:, :10] = OCCUPIED
    canvas = Canvas((0.0, 0.0, 6.0, 4.0), 20.0)
    canvas.grid(OccupancyGrid(GridFrame(0.1, 0.0, 0.0, 40, 60), cells))
    assert canvas.pixels.shape == (80, 120, 3)
    assert (canvas.pixels[2:16, 2:16] == colours.OCCUPIED).all()
    assert (canvas.pixels[25:75, 25:115] == colours.FREE).all()


@pytest.mark.parametrize("scale", [6.0, 20.0, 57.0])
def test_polygons_and_cells_coincide_at_every_scale(scale: float) -> None:
    frame = GridFrame(0.05, -3.0, -2.0, 120, 160)
    cells = np.full(frame.shape, FREE, dtype=np.int8)
    cells[40:80, 60:120] = OCCUPIED
    low, high = frame.to_points(np.array([[40, 60], [79, 119]])) + np.array([[-0.025, -0.025], [0.025, 0.025]])
    cell_canvas, shape_canvas = Canvas((-4.0, -3.0, 6.0, 5.0), scale), Canvas((-4.0, -3.0, 6.0, 5.0), scale)
    cell_canvas.grid(OccupancyGrid(frame, cells))
    shape_canvas.fill(box(*low, *high), (0, 0, 0), opacity=1.0)
    dark, filled = cell_canvas.pixels[..., 0] < 128, shape_canvas.pixels[..., 0] < 111
    # OpenCV fills the pixels on the outline too: one pixel more around 12 x 18 at the smallest scale.
    assert (dark & filled).sum() / (dark | filled).sum() > 0.8


def test_a_hole_of_a_polygon_stays_free() -> None:
    canvas = Canvas((0.0, 0.0, 4.0, 4.0), 25.0)
    canvas.fill(Polygon(box(0, 0, 4, 4).exterior, [box(1, 1, 3, 3).exterior]), (0, 0, 0), opacity=1.0)
    assert (canvas.pixels[5, 5] == 0).all()
    assert (canvas.pixels[50, 50] == colours.UNKNOWN).all()


def test_the_same_run_gives_the_same_bytes(tmp_path: Path) -> None:
    grid = a_map()
    for name in ("a.png", "b.png"):
        draw_summary(
            tmp_path / name, grid, a_prediction(grid), [DOOR], truth=grid,
            truth_rooms=[Room(box(3.0, 3.1, 7.0, 7.0), ("d07",))], tours={"predicted": a_tour()},
            trajectory=np.array([[1.0, 1.0, 0.0], [9.0, 2.0, 0.0]]),
        )  # fmt: skip
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()


def test_a_summary_shows_a_panel_for_everything_that_is_known(tmp_path: Path) -> None:
    grid = a_map()
    draw_summary(tmp_path / "two.png", grid, a_prediction(grid), [DOOR])
    draw_summary(tmp_path / "four.png", grid, a_prediction(grid), [DOOR], truth=grid, tours={"predicted": a_tour()})
    two, four = cv2.imread(str(tmp_path / "two.png")), cv2.imread(str(tmp_path / "four.png"))
    assert two is not None
    assert four is not None
    assert four.size > 1.8 * two.size


def test_the_predicted_room_and_the_door_have_their_colours(tmp_path: Path) -> None:
    grid = a_map()
    draw_summary(tmp_path / "summary.png", grid, a_prediction(grid), [DOOR])
    picture = cv2.imread(str(tmp_path / "summary.png"))
    assert picture is not None
    rgb = picture[..., ::-1].reshape(-1, 3).astype(int)
    for colour in (colours.DOOR_CLOSED, colours.room_colours(["d07"])["d07"]):
        assert (np.abs(rgb - colour).max(axis=1) < 12).sum() > 50


def test_a_room_is_the_fainter_the_less_sure_and_what_else_it_could_be_is_dashed(tmp_path: Path) -> None:
    grid, other = a_map(), Alternative(box(3.0, 3.1, 9.0, 6.0), 0.3)
    middles, edges = [], []
    for confidence in (0.2, 0.9):
        room = Room(box(3.0, 3.1, 7.0, 6.0), ("d07",), "independent", 4.2, False, confidence, (other,))
        draw_summary(tmp_path / "summary.png", grid, Prediction(grid, (room,)), [DOOR])
        pixels = cv2.imread(str(tmp_path / "summary.png")).astype(int)
        panel = pixels[:, pixels.shape[1] // 2 :] if pixels.shape[1] > pixels.shape[0] else pixels[len(pixels) // 2 :]
        colour = np.array(colours.room_colours(["d07"])["d07"][::-1])
        middles.append(np.abs(panel - colour).sum(axis=2))
        edges.append((middles[-1] < 60).sum())
    # The surer room comes nearer to its colour over its whole floor.
    assert (middles[1] < middles[0] - 10).mean() > 0.02
    # A dashed ring adds about half the outline of the larger shape.
    without = Room(box(3.0, 3.1, 7.0, 6.0), ("d07",), "independent", 4.2, False, 0.2)
    draw_summary(tmp_path / "summary.png", grid, Prediction(grid, (without,)), [DOOR])
    pixels = cv2.imread(str(tmp_path / "summary.png")).astype(int)
    panel = pixels[:, pixels.shape[1] // 2 :] if pixels.shape[1] > pixels.shape[0] else pixels[len(pixels) // 2 :]
    assert edges[0] > 1.1 * (np.abs(panel - colour).sum(axis=2) < 60).sum()


def test_a_map_without_anything_known_or_any_door_is_still_a_picture(tmp_path: Path) -> None:
    grid = OccupancyGrid(FRAME, np.full(FRAME.shape, UNKNOWN, dtype=np.int8))
    draw_summary(tmp_path / "summary.png", grid, Prediction(grid, ()), [])
    assert cv2.imread(str(tmp_path / "summary.png")) is not None


def test_a_huge_map_is_drawn_as_small_as_what_is_known(tmp_path: Path) -> None:
    known = a_map()
    frame = FRAME.cropped(-1900, -1900, 4000, 4000)
    grid = known.on(frame)
    draw_cover(tmp_path / "huge.png", grid, [DOOR], a_tour())
    draw_cover(tmp_path / "small.png", known, [DOOR], a_tour())
    assert (tmp_path / "huge.png").read_bytes() == (tmp_path / "small.png").read_bytes()


def test_a_missing_folder_is_one_clear_error(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match="cannot write"):
        draw_cover(tmp_path / "missing" / "cover.png", a_map(), [], a_tour())


@pytest.mark.parametrize(("rows", "cols"), [(1200, 12), (160, 240), (12, 1200)])
def test_titles_are_never_cut(tmp_path: Path, rows: int, cols: int) -> None:
    cells = np.full((rows, cols), FREE, dtype=np.int8)
    cells[0] = cells[-1] = cells[:, 0] = cells[:, -1] = OCCUPIED
    grid = OccupancyGrid(GridFrame(0.05, 0.0, 0.0, rows, cols), cells)
    draw_cover(tmp_path / "cover.png", grid, [], a_tour())
    picture = cv2.imread(str(tmp_path / "cover.png"))
    assert (picture[:, -5:] == 255).all()
