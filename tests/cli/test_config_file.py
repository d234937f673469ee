"""``--config``: an earlier result is repeated, and settings of one's own are laid under the line."""

import json
import math
from dataclasses import asdict

import pytest

from closedrooms.cli.options import configured, load
from closedrooms.cli.settings import field_values, overlaid
from closedrooms.cli.table import COMMANDS, read_line
from closedrooms.core.errors import InvalidInputError
from closedrooms.predictor.config import BestConfig, PaperConfig, RoseConfig
from closedrooms.sim.config import LIDAR_PRESETS, NOISE_LEVELS, SimConfig

REQUIRED = {
    "predict": ("m.yaml", "--doors", "d.geojson", "--out", "o"),
    "cover": ("m.yaml", "--out", "o"),
    "map": ("log", "--out", "o"),
    "doors": ("m.yaml", "--out", "o"),
    "edit": ("m.yaml",),
    "view": ("o",),
    "worlds show": ("office-01", "--out", "o"),
    "worlds generate": ("--kind", "office", "--out", "o"),
    "worlds convert": ("office-01", "o", "--to", "json"),
    "dataset": ("office-01", "--out", "o"),
    "evaluate": ("d", "--out", "o"),
    "robustness": ("office-01", "--out", "o"),
    "train": ("d", "--out", "o"),
}


def read(*words):
    return configured(read_line([str(word) for word in words]))


@pytest.fixture
def settings(tmp_path):
    """Writes a file of settings."""

    def write(content, name="settings.json"):
        path = tmp_path / name
        path.write_text(content if isinstance(content, str) else json.dumps(content))
        return path

    return write


def data_files(folder):
    return {path.name: path.read_bytes() for path in folder.iterdir() if path.suffix not in {".rrd"} and path.is_file()}


def assert_repeated(first, again):
    """All data files are equal, and so is what the manifests say but for times."""
    one, two = data_files(first), data_files(again)
    assert one.keys() == two.keys()
    manifests = [json.loads(files.pop("run.json")) for files in (one, two)]
    for manifest in manifests:
        manifest.pop("durations")
        manifest["sha256"].pop("run.json")
    assert manifests[0] == manifests[1]
    assert one == two


@pytest.mark.parametrize("method", ["paper", "rose", "best", "learned"])
def test_predict_repeats_a_prediction(corridor, call, method):
    words = ("--method", method, "--predictor.door-width", "1.1", "--out", corridor / "a")
    assert call("predict", corridor / "map.yaml", "--doors", corridor / "doors.geojson", *words) == 0
    assert call("predict", "--config", corridor / "a" / "run.json", "--out", corridor / "b") == 0
    assert_repeated(corridor / "a", corridor / "b")
    assert json.loads((corridor / "b" / "run.json").read_text())["configuration"]["predictor"]["door_width"] == 1.1


def test_cover_repeats_a_tour_with_the_files_that_it_had(corridor, call, monkeypatch, tmp_path_factory):
    monkeypatch.chdir(corridor)
    words = ("--start", "1.0", "0.5", "--coverage.parts", "all")
    assert call("cover", "map.yaml", "--doors", "doors.geojson", "--out", "a", *words) == 0
    monkeypatch.chdir(tmp_path_factory.mktemp("elsewhere"))
    assert call("cover", "--config", corridor / "a" / "run.json", "--out", corridor / "b") == 0
    assert_repeated(corridor / "a", corridor / "b")


def test_inputs_on_the_line_win(corridor, call):
    assert call("cover", corridor / "map.yaml", "--out", corridor / "a") == 0
    for name in ("map.yaml", "map.png"):
        (corridor / f"other-{name}").write_bytes((corridor / name).read_bytes())
    assert call("cover", corridor / "other-map.yaml", "--config", corridor / "a/run.json", "--out", corridor / "b") == 0
    assert json.loads((corridor / "b" / "run.json").read_text())["paths"]["map"].endswith("other-map.yaml")


@pytest.mark.slow
def test_run_and_map_repeat_their_results(tmp_path, call):
    words = ("--close", "2", "--noise", "high", "--lidar", "rplidar-a2", "--no-record", "--keep-scans")
    assert call("run", "office-01", *words, "--sim.noise.turn", "0.01", "--out", tmp_path / "a") == 0
    assert call("run", "--config", tmp_path / "a" / "run.json", "--out", tmp_path / "b") == 0
    assert_repeated(tmp_path / "a", tmp_path / "b")
    assert call("map", tmp_path / "a" / "scans.npz", "--no-record", "--out", tmp_path / "m") == 0
    assert call("map", "--config", tmp_path / "m" / "run.json", "--out", tmp_path / "n") == 0
    one, two = data_files(tmp_path / "m"), data_files(tmp_path / "n")
    assert {**one, "run.json": b""} == {**two, "run.json": b""}


@pytest.mark.slow
def test_dataset_and_evaluate_repeat_their_results(tmp_path, call):
    words = ("--repetitions", "1", "--max-closed", "1", "--noise", "low", "--workers", "1")
    assert call("dataset", "office-01", *words, "--out", tmp_path / "a") == 0
    assert call("dataset", "--config", tmp_path / "a" / "manifest.json", "--out", tmp_path / "b") == 0
    assert (tmp_path / "a" / "SHA256SUMS").read_bytes() == (tmp_path / "b" / "SHA256SUMS").read_bytes()
    assert call("evaluate", tmp_path / "a", "--methods", "geometric", "--out", tmp_path / "e") == 0
    assert call("evaluate", "--config", tmp_path / "e" / "run.json", "--out", tmp_path / "f") == 0
    tables = [{p.name: p.read_bytes() for p in (tmp_path / x).glob("*.csv")} for x in "ef"]
    assert tables[0]
    assert tables[0] == tables[1]


@pytest.mark.parametrize("name", [command.name for command in COMMANDS])
def test_every_configuration_is_read_back_as_it_was_written(name, settings):
    from closedrooms.pipeline.reporting.manifest import resolved

    words = REQUIRED.get(name, ())
    config = read(*name.split(), *words)
    path = settings({"command": name, "configuration": resolved(config)})
    assert read(*name.split(), *words, "--config", path) == config


def test_where_a_result_was_written_is_not_taken_over(settings):
    paths = {"world": "office-02"}
    path = settings({"command": "run", "configuration": {"seed": 3, "out": "precious"}, "paths": paths})
    config = read("run", "--config", path)
    assert (config.seed, config.world, config.out) == (3, "office-02", None)


def test_options_on_the_line_win_over_the_file(settings):
    path = settings("seed = 3\nclose = 2\n[sim.noise]\nturn = 0.5\nrange-sd = 0.2\n", "settings.toml")
    config = read("run", "office-01", "--config", path, "--seed", "4", "--sim.noise.turn", "0.25")
    assert (config.seed, config.close) == (4, 2)
    assert (config.sim.noise.turn, config.sim.noise.range_sd) == (0.25, 0.2)
    assert config.sim.noise.distance == NOISE_LEVELS["medium"].distance


def test_the_line_names_doors_where_the_file_counts_rooms(settings):
    path = settings({"close": 2})
    assert read("run", "--config", path, "--close-doors", "d01").close is None
    path = settings({"close_doors": "d01"})
    assert read("run", "--config", path, "--close", "2").close_doors is None


def test_a_level_on_the_line_wins_over_the_numbers_of_the_file(settings):
    saved = asdict(SimConfig(noise=NOISE_LEVELS["low"], lidar=LIDAR_PRESETS["sick-lms111"]))
    path = settings({"noise": "low", "lidar": "sick-lms111", "sim": saved | {"door_seconds": 0.0}})
    config = read("run", "--config", path, "--noise", "high")
    assert config.sim.noise == NOISE_LEVELS["high"]
    assert config.sim.lidar == LIDAR_PRESETS["sick-lms111"]
    assert config.sim.door_seconds == 0.0
    config = read("run", "--config", path, "--lidar=rplidar-a2")
    assert config.sim.lidar == LIDAR_PRESETS["rplidar-a2"]
    assert config.sim.noise == NOISE_LEVELS["low"]
    assert read("dataset", "w", "--out", "o", "--config", settings({"noise": "low"})).sim.noise == NOISE_LEVELS["low"]


def test_a_level_in_the_file_stands_for_its_numbers(settings):
    config = read("run", "--config", settings('noise = "high"\n[sim.noise]\nturn = 0.5\n', "s.toml"))
    assert config.sim.noise.turn == 0.5
    assert config.sim.noise.range_sd == NOISE_LEVELS["high"].range_sd


def test_a_method_on_the_line_wins_over_the_settings_of_the_file(settings):
    path = settings({"method": "paper", "predictor": {"phi": "as-printed", "door_width": 0.9}})
    assert read("run", "--config", path).predictor == PaperConfig(phi="as-printed", door_width=0.9)
    assert read("run", "--config", path, "--method", "best").predictor == BestConfig()
    assert read("run", "--config", path, "--method", "rose").predictor == RoseConfig()
    assert read("run", "--config", path, "--predictor.phi", "as-run").predictor == PaperConfig(door_width=0.9)


BROKEN = {
    "a key that is none": ({"seeed": 3}, "unknown setting 'seeed'; did you mean seed?"),
    "a key deep inside": (
        {"sim": {"noise": {"trun": 1.0}}},
        "unknown setting 'sim.noise.trun'; did you mean sim.noise.turn",
    ),
    "a text for a number": ({"seed": "3"}, "seed is '3'; expected a whole number"),
    "a number for a switch": ({"drive": 1}, "drive is 1; expected true or false"),
    "a switch for a number": ({"seed": True}, "seed is True; expected a whole number"),
    "a number for a table": ({"sim": 3}, "sim is 3; expected a table of settings"),
    "a wrong number deep inside": (
        {"sim": {"lidar": {"beams": 1.5}}},
        "sim.lidar.beams is 1.5; expected a whole number",
    ),
    "a list too short": ({"sim": {"lidar": {"mount": [0.0]}}}, "sim.lidar.mount is [0.0]; expected a list of 3"),
    "no level": ({"noise": "deafening"}, "noise is 'deafening'; expected one of none, low, medium, high"),
    "nothing": ({"seed": None}, "seed is None; expected a whole number"),
    "a value that is refused": (
        {"sim": {"noise": {"turn": -1.0}}},
        "sim.noise: noise turn -1; expected a finite number",
    ),
    "a value refused with the rest": ({"seed": -1}, "--seed -1; expected a whole number of at least 0"),
    "a method that is none": ({"method": "papre"}, "unknown method 'papre' (did you mean paper?)"),
    "settings of another method": (
        {"method": "best", "predictor": {"phi": "as-run"}},
        "unknown setting 'predictor.phi'",
    ),
    "what cannot be set": ({"method": "rose", "predictor": {"directions": 3}}, "predictor.directions"),
    "another command's": (
        {"command": "cover", "configuration": {}},
        "settings of closedrooms cover; expected those of closedrooms run",
    ),
    "no table": ([1, 2], "no table of settings"),
    "no JSON": ("{", "broken JSON"),
    "not a number": ('{"sim": {"swing": NaN}}', "NaN is no number of JSON"),
}


@pytest.mark.parametrize(("content", "message"), BROKEN.values(), ids=BROKEN)
def test_a_mistake_in_the_file_is_one_line_with_key_and_file(content, message, settings, call, one_line):
    path = settings(content)
    assert call("run", "office-01", "--config", path) == 1
    line = one_line()
    assert message in line
    assert line.endswith(str(path))


@pytest.mark.parametrize("content", ["seed = ", "seed = 1\nseed = 2", "[sim.noise]\nturn = inf", "[sim\n"])
def test_a_mistake_in_toml_is_one_line(content, settings, call, one_line):
    path = settings(content, "settings.toml")
    assert call("run", "office-01", "--config", path) == 1
    assert one_line().endswith(str(path))


def test_a_mistake_on_the_line_does_not_name_the_file(settings, call, one_line):
    assert call("run", "office-01", "--config", settings({"close": 1}), "--seed", "-1") == 1
    assert one_line() == "closedrooms: --seed -1; expected a whole number of at least 0"


def test_a_file_that_is_not_there_or_too_large_is_one_line(tmp_path, call, one_line):
    assert call("run", "--config", tmp_path / "none.json") == 1
    assert "cannot read" in one_line()
    assert call("run", "--config", tmp_path) == 1
    assert "a folder; expected settings (JSON or TOML)" in one_line()


def test_settings_that_are_missing_are_asked_for(settings, call, one_line):
    assert call("predict", "--config", settings({"doors": "d.geojson"})) == 2
    assert "missing MAP, --out" in one_line()


def test_values_are_laid_over_what_is_there():
    start = SimConfig(noise=NOISE_LEVELS["high"])
    assert overlaid(start, {"noise": {"turn": 0}}).noise.distance == start.noise.distance
    assert overlaid(start, {}) == start
    assert overlaid(PaperConfig(), {"directions": None}).directions is None
    assert overlaid(PaperConfig(directions=None), {"directions": {"min_share": 0.5}}).directions.min_share == 0.5
    with pytest.raises(InvalidInputError, match="finite"):
        overlaid(start, {"swing": math.inf})


def test_plain_values_become_what_fields_take():
    config = load("pipeline.options.cover:CoverConfig")
    values = field_values(config, {"start": [1, 2.5], "map": "m.yaml"}, current={})
    assert values["start"] == (1.0, 2.5)
    assert values["map"].name == "m.yaml"
