"""``closedrooms doors``: what is written, and what is left alone."""

import json
from pathlib import Path

import numpy as np
import pytest

from closedrooms.cli.commands import main
from closedrooms.core.files.geojson import read_doors
from closedrooms.core.files.rosmap import write_map
from closedrooms.core.grid import FREE, OCCUPIED, UNKNOWN, GridFrame, OccupancyGrid


@pytest.fixture
def map_yaml(tmp_path: Path) -> Path:
    """A corridor with a closed room on one side: its leaf stands back by one cell."""
    cells = np.full((120, 200), UNKNOWN, dtype=np.int8)
    cells[20:100, 20:180] = OCCUPIED
    cells[22:60, 22:178] = FREE
    cells[62:98, 22:70] = FREE
    cells[58:64, 40:58] = FREE
    cells[63:, 72:] = UNKNOWN
    cells[60, 100:118] = FREE
    write_map(tmp_path / "map", OccupancyGrid(GridFrame(0.05, -1.0, -2.0, 120, 200), cells))
    return tmp_path / "map.yaml"


def one_line(capsys: pytest.CaptureFixture[str]) -> str:
    (line,) = [line for line in capsys.readouterr().err.splitlines() if not line.endswith(" ...")]
    return line


def test_proposes_the_door_that_predict_then_reads(map_yaml: Path) -> None:
    out = map_yaml.parent / "proposed.geojson"
    assert main(["doors", str(map_yaml), "--out", str(out)]) == 0
    (door,) = read_doors(out)
    assert door.midpoint == pytest.approx((4.45, 1.05), abs=0.06)
    assert door.width == pytest.approx(0.9, abs=0.11)
    properties = json.loads(out.read_text())["features"][0]["properties"]
    assert properties["state"] == "closed"
    assert 0.5 <= properties["score"] <= 1.0
    folder = map_yaml.parent / "predicted"
    assert main(["predict", str(map_yaml), "--doors", str(out), "--out", str(folder)]) == 0
    (room,) = json.loads((folder / "rooms.geojson").read_text())["features"]
    assert room["properties"]["doors"] == ["d00"]


def test_the_same_map_gives_the_same_bytes_and_replaces_a_file_only_when_told(map_yaml: Path) -> None:
    out, picture = map_yaml.parent / "proposed.geojson", map_yaml.parent / "doors.png"
    assert main(["doors", str(map_yaml), "--out", str(out), "--picture", str(picture)]) == 0
    first = out.read_bytes()
    assert main(["doors", str(map_yaml), "--out", str(out)]) == 1
    other = map_yaml.parent / "other.geojson"
    assert main(["doors", str(map_yaml), "--out", str(other), "--picture", str(picture)]) == 1
    assert not other.exists()
    assert main(["doors", str(map_yaml), "--out", str(out), "--force"]) == 0
    assert out.read_bytes() == first
    assert picture.read_bytes().startswith(b"\x89PNG")


def test_a_map_without_doors_is_a_result(map_yaml: Path) -> None:
    out = map_yaml.parent / "proposed.geojson"
    assert main(["doors", str(map_yaml), "--out", str(out), "--proposals.min-width", "1.2"]) == 0
    assert read_doors(out) == []


@pytest.mark.parametrize("content", ["", "not json", "[]", '{"type": "FeatureCollection", "features": [{}]}'])
def test_another_file_is_not_replaced(map_yaml: Path, content: str, capsys: pytest.CaptureFixture[str]) -> None:
    out = map_yaml.parent / "mine.geojson"
    out.write_text(content)
    assert main(["doors", str(map_yaml), "--out", str(out)]) == 1
    assert str(out) in one_line(capsys)
    assert out.read_text() == content


def test_doors_made_by_hand_are_not_replaced(map_yaml: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = map_yaml.parent / "doors.geojson"
    door = {"type": "Feature", "properties": {"id": "a"}, "geometry": {"type": "Point", "coordinates": [4.45, 1.0]}}
    out.write_text(json.dumps({"type": "FeatureCollection", "features": [door]}))
    before = out.read_text()
    assert main(["doors", str(map_yaml), "--out", str(out)]) == 1
    assert "--force" in one_line(capsys)
    assert out.read_text() == before


def test_a_missing_map_leaves_nothing_behind(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["doors", str(tmp_path / "none.yaml"), "--out", str(tmp_path / "x.geojson")]) == 1
    assert "none.yaml" in one_line(capsys)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("out", [".", "missing/x.geojson"])
def test_an_output_that_cannot_be_written_is_said(map_yaml: Path, out: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["doors", str(map_yaml), "--out", str(map_yaml.parent / out)]) == 1
    assert "closedrooms: " in one_line(capsys)
