"""What is dropped, repaired or guessed on reading a plan is printed; a loss is exit status 3."""

import json
from pathlib import Path

import pytest

from closedrooms.cli.commands import main
from closedrooms.worlds.library import PLANS


@pytest.fixture
def plan(tmp_path: Path) -> Path:
    """A bundled plan whose first door has become 0.1 m wide."""
    data = json.loads((PLANS / "office-01.json").read_text())
    (x, y), _ = data["doors"][0]["segment"]
    data["doors"][0]["segment"] = [[x, y], [x + 0.1, y]]
    path = tmp_path / "plan.json"
    path.write_text(json.dumps(data))
    return path


@pytest.mark.parametrize("action", ["show", "convert"])
def test_a_lost_door_is_named_and_the_rest_is_written(
    plan: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], action: str
) -> None:
    out = tmp_path / ("plan.png" if action == "show" else "out.json")
    words = ["--out", str(out)] if action == "show" else [str(out), "--to", "json"]
    assert main(["worlds", action, str(plan), *words]) == 3
    assert out.stat().st_size > 0
    said = capsys.readouterr().out
    assert "dropped 1 doors (d00): door d00 is 0.100 m long" in said


def test_what_is_read_as_it_is_says_nothing(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "out.json"
    assert main(["worlds", "convert", "office-01", str(out), "--to", "json"]) == 0
    said = capsys.readouterr()
    assert "remark" not in said.out
    assert said.out.splitlines()[-1] == f"written to {out}"


def test_a_guess_is_said_and_is_no_loss(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["worlds", "convert", "office-01", str(tmp_path / "map.yaml"), "--to", "rosmap"]) == 0
    (tmp_path / "map.doors.geojson").unlink()
    capsys.readouterr()
    assert main(["worlds", "show", str(tmp_path / "map.yaml"), "--out", str(tmp_path / "map-plan.png")]) == 0
    assert "guessed doors: no list of doors beside the map" in capsys.readouterr().out


@pytest.mark.parametrize("to", ["json", "rosmap", "sdf", "stage", "urdf", "obj"])
def test_what_is_said_to_be_written_is_there_and_is_all_that_is(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], to: str
) -> None:
    assert main(["worlds", "convert", "office-01", str(tmp_path / "office"), "--to", to]) == 0
    written = Path(capsys.readouterr().out.splitlines()[-1].removeprefix("written to "))
    assert written.stat().st_size > 0
    assert main(["worlds", "convert", "office-01", str(tmp_path / "office"), "--to", to, "--force", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)["figures"]["files"]
    assert {str(path) for path in tmp_path.iterdir()} == set(told)
