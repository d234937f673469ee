"""Which files make a map a plan, and which maps are refused."""

from pathlib import Path

import numpy as np
import pytest

from closedrooms.core.door import ClosedDoor
from closedrooms.core.errors import InvalidInputError
from closedrooms.core.files.geojson import write_doors
from closedrooms.core.files.rosmap import write_map
from closedrooms.core.grid import FREE, OCCUPIED, UNKNOWN, GridFrame, OccupancyGrid
from closedrooms.worlds.formats.raster import rosmap
from closedrooms.worlds.formats.raster.rosmap import _bordered, _checked, _differences, read_raster
from closedrooms.worlds.geometry import wall_area

DOOR = ClosedDoor("beside", (1.55, 1.0), ((1.55, 0.5), (1.55, 1.4)))


def two_rooms() -> OccupancyGrid:
    """Two rooms of 1.5 x 2 m, a wall of one cell with a gap of 0.9 m between them."""
    cells = np.full((22, 33), OCCUPIED, dtype=np.int8)
    cells[1:21, 1:32] = FREE
    cells[1:21, 16] = OCCUPIED
    cells[6:15, 16] = FREE
    return OccupancyGrid(GridFrame(0.1, -0.1, -0.1, 22, 33), cells)


def test_the_list_of_doors_of_the_maps_own_name_comes_first(tmp_path: Path) -> None:
    write_map(tmp_path / "map", two_rooms())
    assert not read_raster(tmp_path / "map.yaml").doors
    write_doors(tmp_path / "doors.geojson", [ClosedDoor("any", DOOR.midpoint, DOOR.segment)])
    assert [door.id for door in read_raster(tmp_path / "map.yaml").doors] == ["any"]
    write_doors(tmp_path / "map.doors.geojson", [DOOR])
    plan = read_raster(tmp_path / "map.png")
    assert [door.id for door in plan.doors] == ["beside"]
    assert "no list of doors" not in " ".join(remark.why for remark in plan.remarks)
    write_doors(tmp_path / "other.geojson", [ClosedDoor("given", DOOR.midpoint, DOOR.segment)])
    assert [door.id for door in read_raster(tmp_path / "map.yaml", tmp_path / "other.geojson").doors] == ["given"]


def test_a_plan_of_a_map_is_named_after_it_and_its_walls_are_counted(tmp_path: Path) -> None:
    write_map(tmp_path / "map", two_rooms())
    write_doors(tmp_path / "map.doors.geojson", [DOOR])
    plan = read_raster(tmp_path / "map.yaml")
    assert (plan.name, plan.meta) == ("map", {"source": "map.yaml", "format": "rosmap"})
    assert [wall.id for wall in plan.walls] == [f"w{number:04d}" for number in range(len(plan.walls))]
    assert not [remark for remark in plan.remarks if remark.loss]
    # The wall of the door is its own; jambs and lintels of the map are cells.
    assert wall_area(plan).bounds == pytest.approx((-0.1, -0.1, 3.2, 2.1))


def test_maps_of_too_many_or_too_fine_cells_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    grid = two_rooms()
    for resolution, fine in ((0.01, True), (0.0099, False)):
        checked = OccupancyGrid(GridFrame(resolution, 0.0, 0.0, 22, 33), grid.cells)
        if fine:
            assert _checked(checked, Path("m")) is checked
        else:
            with pytest.raises(InvalidInputError, match=r"cells of 0\.0099 m"):
                _checked(checked, Path("m"))
    monkeypatch.setattr(rosmap, "MAX_CELLS", 22 * 33)
    assert _checked(grid, Path("m")) is grid
    monkeypatch.setattr(rosmap, "MAX_CELLS", 22 * 33 - 1)
    with pytest.raises(InvalidInputError, match="a map of 22 x 33 cells; expected at most 725"):
        _checked(grid, Path("m"))


def test_a_ring_of_unknown_cells_surrounds_a_map() -> None:
    grid = two_rooms()
    around = _bordered(grid)
    assert around.frame.shape == (24, 35)
    assert (around.frame.origin_x, around.frame.origin_y) == pytest.approx((-0.2, -0.2))
    assert np.array_equal(around.cells[1:-1, 1:-1], grid.cells)
    assert {*around.cells[0], *around.cells[-1], *around.cells[:, 0], *around.cells[:, -1]} == {UNKNOWN}


def test_a_map_without_free_space_is_refused(tmp_path: Path) -> None:
    write_map(tmp_path / "map", OccupancyGrid(GridFrame(0.1, 0.0, 0.0, 9, 9), np.full((9, 9), OCCUPIED, dtype=np.int8)))
    with pytest.raises(InvalidInputError, match="a plan without rooms; expected free areas in the map"):
        read_raster(tmp_path / "map.yaml")


def test_cells_in_doorways_are_no_difference(tmp_path: Path) -> None:
    grid = two_rooms()
    write_map(tmp_path / "map", grid)
    write_doors(tmp_path / "map.doors.geojson", [DOOR])
    plan = read_raster(tmp_path / "map.yaml")
    shut = grid.cells.copy()
    shut[6:15, 16] = OCCUPIED
    assert not [r for r in _differences(plan, OccupancyGrid(grid.frame, shut)) if r.what == "occupied cells"]
    shut[3, 5] = OCCUPIED
    (remark,) = [r for r in _differences(plan, OccupancyGrid(grid.frame, shut)) if r.what == "occupied cells"]
    assert (remark.count, remark.loss) == (1, True)
