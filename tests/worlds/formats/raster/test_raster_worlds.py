"""Maps as worlds: plan, true map, rays and the robot's disc agree with the map cell by cell."""

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from closedrooms.core.arrays import BoolArray
from closedrooms.core.door import ClosedDoor
from closedrooms.core.errors import InvalidInputError
from closedrooms.core.files.geojson import write_doors
from closedrooms.core.files.rosmap import write_map
from closedrooms.core.grid import FREE, OCCUPIED, UNKNOWN, GridFrame, OccupancyGrid
from closedrooms.core.pose import Pose2
from closedrooms.sim.building import building_solids
from closedrooms.sim.config import RobotConfig
from closedrooms.sim.contacts import Obstacles, edges_of
from closedrooms.sim.physics_world import PhysicsWorld
from closedrooms.sim.robot.differential_drive import Drive
from closedrooms.sim.solids import upright
from closedrooms.worlds.extrusion import extrude
from closedrooms.worlds.formats.raster import raster_walls, rosmap
from closedrooms.worlds.formats.raster.rosmap import _differences, read_raster
from closedrooms.worlds.geometry import room_interior
from closedrooms.worlds.plan import FloorPlan
from closedrooms.worlds.truth import rasterise
from closedrooms.worlds.ways_out import has_way_out

CELL = 0.05
PILLARS = st.lists(
    st.tuples(st.integers(4, 55), st.integers(4, 75), st.integers(1, 12), st.integers(1, 12)), max_size=8
)


def hall(rows: int = 60, cols: int = 80) -> np.ndarray:
    """A free hall with walls of one cell around it, in unknown surroundings."""
    cells = np.full((rows, cols), UNKNOWN, dtype=np.int8)
    cells[2:-2, 2:-2] = OCCUPIED
    cells[3:-3, 3:-3] = FREE
    return cells


def plan_of(cells: np.ndarray, folder: Path, doors: list[ClosedDoor] | None = None) -> tuple[FloorPlan, OccupancyGrid]:
    grid = OccupancyGrid(GridFrame(CELL, -1.35, 2.4, *cells.shape), cells)
    write_map(folder / "map", grid)
    if doors is not None:
        write_doors(folder / "map.doors.geojson", doors)
    return read_raster(folder / "map.yaml"), grid


def check_cells(plan: FloorPlan, grid: OccupancyGrid) -> None:
    """The true map is the map; rays from each cell of a room end at occupied neighbours' edges, and only there."""
    true = rasterise(plan, grid.frame, Pose2())
    assert np.array_equal(true.occupied & grid.free, np.zeros_like(grid.free))
    assert not (grid.occupied & ~true.occupied).any()
    vertices, triangles = extrude(building_solids(plan))
    with PhysicsWorld() as physics:
        physics.add_static(vertices, upright(vertices, triangles))
        for row, col in np.argwhere(true.free).tolist():
            around = [(row + 1, col), (row - 1, col), (row, col + 1), (row, col - 1)]
            ends = [(*centre(grid.frame, r, c), 0.3) for r, c in around]
            shares, _ = physics.cast(np.array([*centre(grid.frame, row, col), 0.3]), np.array(ends))
            expected = [0.5 if true.occupied[r, c] else 1.0 for r, c in around]
            assert shares == pytest.approx(expected, abs=1e-3), (row, col)


def centre(frame: GridFrame, row: int, col: int) -> tuple[float, float]:
    return frame.origin_x + (col + 0.5) * frame.resolution, frame.origin_y + (row + 0.5) * frame.resolution


@pytest.mark.parametrize("upright_wall", [True, False])
@pytest.mark.simulation
def test_a_partition_of_one_cell_blocks_rays_and_robot(tmp_path: Path, upright_wall: bool) -> None:
    cells = hall()
    if upright_wall:
        cells[3:40, 30] = OCCUPIED
    else:
        cells[30, 3:60] = OCCUPIED
    plan, grid = plan_of(cells, tmp_path)
    check_cells(plan, grid)
    assert not [remark for remark in plan.remarks if remark.loss]
    robot = RobotConfig(radius=0.2)
    obstacles = Obstacles(edges_of(building_solids(plan)), Drive.reach(robot))
    x, y = centre(grid.frame, 15, 15)
    drive = Drive(robot, obstacles, x, y, 0.0 if upright_wall else np.pi / 2)
    for _ in range(100):
        drive.advance(1.0, 0.0, 0.1, lambda _: None)
    assert drive.collided
    limit = centre(grid.frame, 30, 30)[0 if upright_wall else 1] - CELL / 2 - robot.radius
    assert limit - 3e-3 <= (drive.x if upright_wall else drive.y) <= limit


@settings(max_examples=8, deadline=None)
@given(pillars=PILLARS, seed=st.integers(0, 1000))
@pytest.mark.simulation
def test_truth_rays_and_map_agree_cell_by_cell(
    tmp_path_factory: pytest.TempPathFactory, pillars: list[tuple[int, int, int, int]], seed: int
) -> None:
    cells = hall()
    for row, col, height, width in pillars:
        cells[row : row + height, col : col + width] = OCCUPIED
    # Single cells, touching at corners too.
    specks = np.random.default_rng(seed).integers((3, 3), (57, 77), size=(40, 2))
    cells[specks[:, 0], specks[:, 1]] = OCCUPIED
    cells[0], cells[-1], cells[:, 0], cells[:, -1] = UNKNOWN, UNKNOWN, UNKNOWN, UNKNOWN
    plan, grid = plan_of(cells, tmp_path_factory.mktemp("map"))
    check_cells(plan, grid)
    assert not has_way_out(plan)


@pytest.mark.simulation
def test_a_slanted_wall_of_cells_that_touch_at_corners_parts_two_rooms(tmp_path: Path) -> None:
    cells = hall()
    for k in range(54):
        cells[3 + k, 10 + k] = OCCUPIED
    plan, grid = plan_of(cells, tmp_path)
    assert len(plan.rooms) == 2
    check_cells(plan, grid)


def test_free_space_that_ends_in_the_unknown_or_at_the_edge_is_walled_and_said(tmp_path: Path) -> None:
    cells = hall()
    cells[2, 20:40] = UNKNOWN
    cells[:, -3:] = FREE
    plan, grid = plan_of(cells, tmp_path)
    assert not has_way_out(plan)
    (remark,) = [remark for remark in plan.remarks if remark.what == "cells"]
    assert remark.action == "guessed"
    assert remark.count > 20
    true = rasterise(plan, grid.frame, Pose2())
    assert not (true.occupied & grid.free).any()


def test_rooms_are_the_free_cells_and_doors_stand_between_them(tmp_path: Path) -> None:
    cells = hall()
    cells[3:-3, 40:42] = OCCUPIED
    cells[20:38, 40:42] = FREE
    x, y = centre(GridFrame(CELL, -1.35, 2.4, *cells.shape), 28, 40)
    door = ClosedDoor("d", (x + CELL / 2, y + CELL / 2), ((x + CELL / 2, y - 0.4), (x + CELL / 2, y + 0.45)))
    plan, grid = plan_of(cells, tmp_path, [door])
    assert [made.rooms for made in plan.doors] == [("r00", "r01")]
    assert room_interior(plan, "r00").area == pytest.approx(54 * 37 * CELL**2, rel=0.03)
    assert not has_way_out(plan)
    check_truth_but_jambs(plan, grid)


def check_truth_but_jambs(plan: FloorPlan, grid: OccupancyGrid) -> None:
    true = rasterise(plan, grid.frame, Pose2())
    assert not (grid.occupied & ~true.occupied).any()
    beside: BoolArray = grid.free & true.occupied
    assert beside.sum() <= 4
    assert not (grid.free & ~true.free & ~beside).any()


def test_a_bad_door_is_left_open_and_named(tmp_path: Path) -> None:
    cells = hall()
    cells[3:-3, 40:42] = OCCUPIED
    cells[20:38, 40:42] = FREE
    x, y = centre(GridFrame(CELL, -1.35, 2.4, *cells.shape), 28, 40)
    good = ClosedDoor("good", (x + CELL / 2, y), ((x + CELL / 2, y - 0.45), (x + CELL / 2, y + 0.45)))
    into_wall = ClosedDoor("wall", (centre(GridFrame(CELL, -1.35, 2.4, 60, 80), 2, 20)), None, 0.9)
    wide = ClosedDoor("wide", (0.0, 3.4), None, 60.0)
    plan, _ = plan_of(cells, tmp_path, [good, into_wall, wide])
    assert [door.id for door in plan.doors] == ["good"]
    assert sorted(name for remark in plan.remarks if remark.loss for name in remark.names) == ["wall", "wide"]


def test_cells_too_small_for_a_wall_are_refused(tmp_path: Path) -> None:
    write_map(tmp_path / "map", OccupancyGrid(GridFrame(0.001, 0.0, 0.0, 60, 80), hall()))
    with pytest.raises(InvalidInputError, match=r"cells of 0\.001 m; expected at least 0\.01 m"):
        read_raster(tmp_path / "map.yaml")


def test_a_picture_without_a_yaml_says_what_resolution_was_taken(tmp_path: Path) -> None:
    plan_of(hall(), tmp_path)
    (tmp_path / "map.yaml").unlink()
    plan = read_raster(tmp_path / "map.png")
    assert "guessed resolution: no YAML of a map beside the picture: 0.05 m a pixel" in [str(r) for r in plan.remarks]


def test_a_wall_taken_away_from_the_plan_is_noticed(tmp_path: Path) -> None:
    cells = hall()
    cells[3:40, 30] = OCCUPIED
    plan, grid = plan_of(cells, tmp_path)
    thin = min(plan.walls, key=lambda wall: abs(wall.segment[0][0] - centre(grid.frame, 3, 30)[0]))
    with pytest.raises(AssertionError):
        check_cells(replace(plan, walls=tuple(wall for wall in plan.walls if wall is not thin)), grid)


def test_cells_that_the_plan_shows_otherwise_are_told_with_the_side_that_lost(tmp_path: Path) -> None:
    plan, grid = plan_of(hall(), tmp_path)
    assert _differences(plan, grid) == []
    row, col = np.argwhere(grid.free)[grid.free.sum() // 2]
    cells = grid.cells.copy()
    cells[row, col] = OCCUPIED
    (more,) = _differences(plan, OccupancyGrid(grid.frame, cells))
    assert (more.what, more.why, more.count, more.loss) == ("occupied cells", "free in the plan", 1, True)
    cells = grid.cells.copy()
    cells[grid.occupied] = FREE
    (less,) = _differences(plan, OccupancyGrid(grid.frame, cells))
    assert (less.what, less.count, less.loss) == ("free cells", grid.occupied.sum(), False)
    assert less.why.startswith("wall in the plan")


@pytest.mark.parametrize("wide", [14, 15, 18, 19])
def test_a_door_given_as_a_point_takes_no_cell_of_its_jambs(tmp_path: Path, wide: int) -> None:
    cells = hall()
    cells[3:-3, 40] = OCCUPIED
    cells[20 : 20 + wide, 40] = FREE
    x, y = centre(GridFrame(CELL, -1.35, 2.4, *cells.shape), 20, 40)
    doors = [ClosedDoor("d", (x, y - CELL / 2 + wide * CELL / 2), None, None)]
    plan, _ = plan_of(cells, tmp_path, doors)
    assert plan.doors[0].width == pytest.approx(wide * CELL, abs=CELL / 2)
    assert not [remark for remark in plan.remarks if remark.loss]


def test_a_map_of_noise_is_refused_before_its_rooms_are_shaped(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def shaped(*_: object) -> None:
        raise AssertionError("the rooms were shaped")

    monkeypatch.setattr(rosmap, "find_rooms_and_doors", shaped)
    cells = np.where(np.random.default_rng(0).random((1200, 1200)) < 0.65, 254, 0).astype(np.uint8)
    cv2.imwrite(str(tmp_path / "noise.png"), cells)
    with pytest.raises(InvalidInputError, match=r"walls fall into at least \d{6} pieces; expected at most 60000"):
        read_raster(tmp_path / "noise.png")


@pytest.mark.parametrize("seed", range(5))
def test_a_map_is_not_refused_for_fewer_pieces_than_it_has(seed: int) -> None:
    cells = np.random.default_rng(seed).choice([FREE, OCCUPIED, UNKNOWN], (40, 50), p=(0.7, 0.2, 0.1)).astype(np.int8)
    grid = OccupancyGrid(GridFrame(0.05, 0.0, 0.0, 40, 50), cells)
    pieces = len(raster_walls.trace_walls(grid, np.zeros((40, 50), dtype=np.bool_), Path("m"), []))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(raster_walls, "MAX_PIECES", pieces)
        raster_walls.check_pieces(grid, Path("m"))
