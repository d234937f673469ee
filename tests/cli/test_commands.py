"""The command line: what a user types, what comes back, and what is left on disk."""

import json
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from closedrooms.cli.commands import main
from closedrooms.cli.table import COMMANDS
from closedrooms.core.files.rosmap import read_map, write_map
from closedrooms.core.grid import FREE, OCCUPIED, UNKNOWN, GridFrame, OccupancyGrid


def call(*words: str | Path) -> int:
    try:
        return main([str(word) for word in words])
    except SystemExit as stop:
        return int(stop.code or 0)


def one_line(capsys: pytest.CaptureFixture[str]) -> str:
    error = capsys.readouterr().err
    lines = [line for line in error.splitlines() if not line.endswith(" ...")]
    assert len(lines) == 1, error
    assert "Traceback" not in error
    return lines[0]


def test_predict_completes_a_map(corridor: Path) -> None:
    out = corridor / "out"
    assert call("predict", corridor / "map.yaml", "--doors", corridor / "doors.geojson", "--out", out) == 0
    names = {"map.yaml", "map.png", "predicted.yaml", "predicted.png", "doors.geojson", "rooms.geojson"}
    assert names | {"run.json", "summary.png", "probability.yaml", "probability.png"} == {
        path.name for path in out.iterdir()
    }
    before, after = read_map(out / "map.yaml"), read_map(out / "predicted.yaml")
    assert before.frame == after.frame
    centre = after.frame.to_cells(np.array([6.6, 2.0]))
    assert after.free[tuple(centre)]
    assert before.unknown[tuple(centre)]
    (room,) = json.loads((out / "rooms.geojson").read_text())["features"]
    assert room["properties"]["doors"] == ["d1"]
    assert 0.0 < room["properties"]["confidence"] < 1.0
    assert len(room["properties"]["alternatives"]) in {1, 2, 3}
    probability = read_map(out / "probability.yaml")
    assert probability.frame == before.frame
    assert (probability.cells[before.known] == -1).all()
    assert probability.cells[tuple(centre)] > 50


def test_rooms_that_are_not_sure_enough_stay_out_of_the_map(corridor: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ("predict", corridor / "map.yaml", "--doors", corridor / "doors.geojson")
    assert call(*words, "--min-confidence", "1", "--out", corridor / "out") == 0
    assert "not drawn" in capsys.readouterr().out
    before, after = (read_map(corridor / "out" / f"{name}.yaml") for name in ("map", "predicted"))
    assert np.array_equal(before.cells, after.cells)
    assert len(json.loads((corridor / "out" / "rooms.geojson").read_text())["features"]) == 1
    assert call(*words, "--min-confidence", "1.5", "--out", corridor / "never") == 1
    assert not (corridor / "never").exists()


def test_a_door_that_cannot_be_predicted_is_said_and_the_others_are_written(corridor: Path) -> None:
    doors = json.loads((corridor / "doors.geojson").read_text())
    far = {"type": "Feature", "properties": {"id": "far"}, "geometry": {"type": "Point", "coordinates": [500, 0]}}
    doors["features"].append(far)
    (corridor / "doors.geojson").write_text(json.dumps(doors))
    out = corridor / "out"
    assert call("predict", corridor / "map.yaml", "--doors", corridor / "doors.geojson", "--out", out) == 3
    assert list(json.loads((out / "run.json").read_text())["doors"]["failures"]) == ["far"]
    assert len(json.loads((out / "rooms.geojson").read_text())["features"]) == 1


def test_cover_plans_a_tour_on_any_map(corridor: Path) -> None:
    out = corridor / "out"
    assert call("cover", corridor / "map.yaml", "--doors", corridor / "doors.geojson", "--out", out) == 0
    features = json.loads((out / "tour.geojson").read_text())["features"]
    assert features
    assert {feature["properties"]["map"] for feature in features} == {"closed"}


def test_the_same_command_writes_the_same_bytes(corridor: Path) -> None:
    written = []
    for name in ("a", "b"):
        call("predict", corridor / "map.yaml", "--doors", corridor / "doors.geojson", "--out", corridor / name)
        files = sorted(path for path in (corridor / name).iterdir() if path.name != "run.json")
        written.append({path.name: path.read_bytes() for path in files})
    assert written[0] == written[1]


def test_doors_far_off_in_free_space_and_twice_the_same_are_named_and_the_others_predicted(
    corridor: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    places = {"free": (1.5, 2.0), "twin": (6.65, 0.0), "far": (60.0, 60.0), "sea": (9.9e7, -9.9e7)}
    content = json.loads((corridor / "doors.geojson").read_text())
    for name, place in places.items():
        geometry = {"type": "Point", "coordinates": place}
        content["features"].append({"type": "Feature", "properties": {"id": name}, "geometry": geometry})
    (corridor / "doors.geojson").write_text(json.dumps(content))
    for method in ("paper", "best"):
        out = corridor / method
        words = ("predict", corridor / "map.yaml", "--doors", corridor / "doors.geojson", "--method", method)
        assert call(*words, "--out", out) == 3
        said = capsys.readouterr()
        assert "1 of 5 doors predicted" in said.out
        assert "Warning" not in said.err
        assert json.loads((out / "run.json").read_text())["doors"]["failures"].keys() == places.keys()
        rooms = json.loads((out / "rooms.geojson").read_text())["features"]
        assert [room["properties"]["doors"] for room in rooms] == [["d1"]]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"image": "gone.png"}, "map image 'gone.png' is missing; expected a PGM or PNG beside the YAML"),
        ({"image": "map.yaml"}, "a picture that cannot be read"),
        ({"image": "absurd.pgm"}, "a picture of 200000 x 200000; expected at most"),
        ({"image": "short.pgm"}, "a picture that cannot be read"),
        ({"resolution": "0.0"}, "map resolution 0.0; expected a number from 0.001 to 10 m"),
        ({"resolution": "90.0"}, "map resolution 90.0; expected a number from 0.001 to 10 m"),
        ({"resolution": "10.0"}, "in cells of 10 m; expected at most "),
        ({"resolution": "0.0000000000010"}, "map resolution 1e-12; expected a number from 0.001 to 10 m"),
    ],
)
@pytest.mark.parametrize("method", ["paper", "best"])
def test_a_map_that_cannot_be_used_is_one_line_and_leaves_nothing(
    corridor: Path, method: str, change: dict[str, str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    (corridor / "absurd.pgm").write_bytes(b"P5\n200000 200000\n255\n\0")
    (corridor / "short.pgm").write_bytes(b"P5\n400 400\n255\n\0")
    lines = (line.split(":", 1) for line in (corridor / "map.yaml").read_text().splitlines())
    fields = {key: value.strip() for key, value in lines} | change
    (corridor / "map.yaml").write_text("\n".join(f"{key}: {value}" for key, value in fields.items()))
    out = corridor / "out"
    words = ("predict", corridor / "map.yaml", "--doors", corridor / "doors.geojson", "--method", method)
    assert call(*words, "--out", out) == 1
    line = one_line(capsys)
    assert message in line
    assert str(corridor) in line.rpartition(": ")[2]
    assert not out.exists()


@pytest.mark.parametrize("method", ["paper", "best"])
@pytest.mark.parametrize("fill", [UNKNOWN, FREE, OCCUPIED])
def test_a_map_of_one_kind_is_written_as_it_is_with_the_reason_for_every_door(
    tmp_path: Path, corridor: Path, method: str, fill: int
) -> None:
    frame = GridFrame(0.05, 0.0, -3.0, 200, 200)
    write_map(tmp_path / "plain", OccupancyGrid(frame, np.full(frame.shape, fill, dtype=np.int8)))
    out = tmp_path / "out"
    words = ("predict", tmp_path / "plain.yaml", "--doors", corridor / "doors.geojson", "--method", method)
    assert call(*words, "--out", out) == 3
    assert set(json.loads((out / "run.json").read_text())["doors"]["failures"]) == {"d1"}
    assert (read_map(out / "predicted.yaml").cells == fill).all()


@pytest.mark.parametrize("method", ["paper", "best"])
@pytest.mark.parametrize("resolution", [0.001])
def test_a_map_in_a_wrong_unit_is_written_as_it_is_with_the_reason_for_every_door(
    corridor: Path, method: str, resolution: float
) -> None:
    text = (corridor / "map.yaml").read_text().replace("resolution: 0.05", f"resolution: {resolution:.13f}")
    (corridor / "map.yaml").write_text(text)
    out = corridor / "out"
    words = ("predict", corridor / "map.yaml", "--doors", corridor / "doors.geojson", "--method", method)
    assert call(*words, "--out", out) == 3
    assert set(json.loads((out / "run.json").read_text())["doors"]["failures"]) == {"d1"}


@pytest.mark.parametrize("command", ["predict", "cover"])
def test_a_missing_map_is_one_line_and_status_1(
    tmp_path: Path, command: str, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "doors.geojson").write_text('{"type": "FeatureCollection", "features": []}')
    doors = ("--doors", tmp_path / "doors.geojson")
    assert call(command, tmp_path / "none.yaml", *doors, "--out", tmp_path / "out") == 1
    assert "none.yaml" in one_line(capsys)
    assert not (tmp_path / "out").exists()


def test_an_output_folder_with_other_files_is_refused_and_kept(
    corridor: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = corridor / "mine"
    out.mkdir()
    (out / "thesis.tex").write_text("precious")
    assert call("predict", corridor / "map.yaml", "--doors", corridor / "doors.geojson", "--out", out) == 1
    assert "did not write" in one_line(capsys)
    assert [path.name for path in out.iterdir()] == ["thesis.tex"]


@pytest.mark.parametrize(
    ("words", "part"),
    [
        (("run", "no-such-world"), "no-such-world"),
        (("run", "ofice-01"), "unknown world 'ofice-01' (did you mean office-01?)"),
        (("run", "office-01", "--close", "99"), "99 rooms"),
        (("run", "office-01", "--close-doors", "zz"), "unknown door 'zz'"),
        (("run", "office-01", "--close", "-1"), "--close"),
        (("run", "office-01", "--close", "2", "--close-doors", "d01"), "one of them"),
        (("worlds", "show", "no-such-world", "--out", "x.png"), "no-such-world"),
        (("dataset", "office-01", "--max-closed", "0", "--out", "x"), "--max-closed 0; expected a whole number of at"),
        (("robustness", "office-01", "--workers", "0", "--out", "x"), "--workers 0; expected a whole number of at"),
        (("evaluate", "x", "--subset-worlds", "0", "--out", "x"), "--subset-worlds 0; expected a whole number of at"),
    ],
)
@pytest.mark.simulation
def test_a_wrong_world_or_door_is_one_line_and_status_1(
    tmp_path: Path,
    words: tuple[str, ...],
    part: str,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    assert call(*words) == 1
    assert part in one_line(capsys)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    "words",
    [
        (),
        ("teleport",),
        ("run", "--no-such-option"),
        ("run", "--noise", "deafening"),
        ("predict",),
        ("worlds",),
        ("worlds", "burn"),
        ("worlds", "generate", "--kind", "castle", "--out", "x.json"),
    ],
)
def test_wrong_usage_is_status_2(words: tuple[str, ...]) -> None:
    assert call(*words) == 2


@pytest.mark.parametrize("module", ["closedrooms.cli", "closedrooms.cli.commands"])
def test_the_module_runs_as_the_program_does(module: str, tmp_path: Path) -> None:
    words = [sys.executable, "-m", module, "teleport"]
    done = subprocess.run(words, capture_output=True, text=True, check=False, cwd=tmp_path)
    assert done.returncode == 2
    assert "unknown command 'teleport'" in done.stderr


@pytest.mark.parametrize("command", [command.name for command in COMMANDS])
@pytest.mark.parametrize("help_option", ["-h", "--help", "--help-all"])
def test_every_command_explains_itself(command: str, help_option: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert call(*command.split(), help_option) == 0
    assert f"usage: closedrooms {command}" in capsys.readouterr().out


def test_help_shows_what_people_set_and_help_all_everything(capsys: pytest.CaptureFixture[str]) -> None:
    shown = {}
    for option in ("--help", "--help-all"):
        assert call("run", option) == 0
        shown[option] = set(re.findall(r"(?<!\S)--[a-z][a-z.-]+(?=[ ,])", capsys.readouterr().out))
    assert 15 <= len({name for name in shown["--help"] if not name.startswith("--no-")}) <= 25
    assert len(shown["--help-all"]) > 100
    assert "--predictor.door-reach" in shown["--help-all"]
    assert not any("." in name for name in shown["--help"] if not name.endswith("."))


def test_lists_twenty_worlds_one_a_line_name_first(capsys: pytest.CaptureFixture[str]) -> None:
    assert call("worlds", "list") == 0
    names = [line.split()[0] for line in capsys.readouterr().out.splitlines()]
    assert len(names) == len(set(names)) == 20
    assert "office-01" in names


def test_the_top_level_help_imports_no_configuration() -> None:
    script = (
        "import sys; from closedrooms.cli.commands import main; main(['--help'])\n"
        "ours = sorted(n for n in sys.modules if n.startswith('closedrooms') and n.endswith('config'))\n"
        "assert not ours, ours\n"
    )
    subprocess.run([sys.executable, "-c", script], check=True, capture_output=True, timeout=60)


def test_help_imports_nothing_heavy() -> None:
    script = (
        "import sys; from closedrooms.cli.commands import main\n"
        "try: main(['run', '--help'])\n"
        "except SystemExit: pass\n"
        "heavy = {'cv2', 'pybullet', 'rerun', 'sklearn', 'shapely', 'scipy', 'ortools', 'matplotlib', 'skimage'}\n"
        "loaded = sorted(heavy & set(sys.modules)); assert not loaded, loaded\n"
    )
    subprocess.run([sys.executable, "-c", script], check=True, capture_output=True, timeout=60)


@pytest.mark.parametrize("how", ["line", "json", "toml"])
def test_a_setting_that_would_take_all_memory_is_refused(
    corridor: Path, capsys: pytest.CaptureFixture[str], how: str
) -> None:
    words: list[str | Path] = ["predict", corridor / "map.yaml", "--doors", corridor / "doors.geojson"]
    words += ["--out", corridor / "out"]
    if how == "line":
        words += ["--predictor.door-reach", "1e9"]
    else:
        text = "[predictor]\ndoor_reach = 1e9\n" if how == "toml" else '{"predictor": {"door_reach": 1e9}}'
        (corridor / f"set.{how}").write_text(text)
        words += ["--config", corridor / f"set.{how}"]
    assert call(*words) == 1
    line = one_line(capsys)
    assert "--predictor.door-reach 1e+09; expected a number from -10000 to 10000" in line
    assert how == "line" or line.endswith(f"set.{how}")
    assert not (corridor / "out").exists()


DEFECT = """
import sys
from closedrooms.cli import commands
def broken(*_):
    raise {error}
commands._main = broken
sys.exit(commands.main())
"""


@pytest.mark.parametrize(
    ("error", "said"),
    [
        ("ValueError('of ours')", "internal error, please report it: ValueError: of ours (<string>:5); -v shows where"),
        ("MemoryError", "more memory than there is; expected smaller input, or settings that ask for less"),
    ],
)
def test_a_defect_of_ours_is_one_line_and_a_traceback_for_those_who_ask(error: str, said: str) -> None:
    words = [sys.executable, "-c", DEFECT.format(error=error), "worlds", "list"]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (1, f"closedrooms: {said}\n")
    if error != "MemoryError":
        done = subprocess.run([*words, "-v"], capture_output=True, text=True, check=False)
        assert done.returncode == 1
        assert "Traceback" in done.stderr
