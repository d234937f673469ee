import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from closedrooms.cli.commands import main
from closedrooms.core.files.rosmap import write_map
from closedrooms.core.grid import FREE, OCCUPIED, UNKNOWN, GridFrame, OccupancyGrid

Call = Callable[..., int]
OneLine = Callable[[], str]


@pytest.fixture
def call() -> Call:
    """Types a line; the exit status."""

    def typed(*words: str | Path) -> int:
        try:
            return main([str(word) for word in words])
        except SystemExit as stop:
            return int(stop.code or 0)

    return typed


@pytest.fixture
def one_line(capsys: pytest.CaptureFixture[str]) -> OneLine:
    """The one line on standard error, progress aside."""

    def read() -> str:
        error = capsys.readouterr().err
        lines = [line for line in error.splitlines() if not line.endswith(" ...")]
        assert len(lines) == 1, error
        assert "Traceback" not in error
        return lines[0]

    return read


@pytest.fixture
def corridor(tmp_path: Path) -> Path:
    """A corridor with a known room on each side of an unknown one, and the door of that one."""
    cells = np.full((200, 400), UNKNOWN, dtype=np.int8)

    def room(x0: int, y0: int, x1: int, y1: int) -> None:
        cells[y0 - 2 : y1 + 2, x0 - 2 : x1 + 2] = OCCUPIED
        cells[y0:y1, x0:x1] = FREE

    room(20, 62, 120, 140)
    room(224, 62, 330, 140)
    room(20, 20, 330, 60)
    cells[58:64, 60:78] = FREE
    cells[58:64, 260:278] = FREE
    write_map(tmp_path / "map", OccupancyGrid(GridFrame(0.05, -2.0, -3.0, 200, 400), cells))
    door = {"type": "Feature", "properties": {"id": "d1"}, "geometry": {"type": "Point", "coordinates": [6.6, 0.0]}}
    (tmp_path / "doors.geojson").write_text(json.dumps({"type": "FeatureCollection", "features": [door]}))
    return tmp_path


@pytest.fixture
def third_party(install_round: Callable[..., None]) -> None:
    """A package installed beside us that brings a method."""
    install_round("third_party_rooms_cli")
