"""What a slim installation says when a command needs more."""

from pathlib import Path

import pytest

from closedrooms.cli.table import COMMANDS
from closedrooms.core.runtime import packages


def absent(monkeypatch, *names):
    monkeypatch.setattr(packages, "find_spec", lambda name: None if name in names else object())


@pytest.mark.parametrize("command", [command for command in COMMANDS if command.needs], ids=lambda c: c.name)
def test_a_command_names_all_that_is_missing_before_it_begins(monkeypatch, tmp_path, call, one_line, command):
    absent(monkeypatch, *packages.BROUGHT_BY)
    monkeypatch.chdir(tmp_path)
    inputs = {"cover": ["map.yaml"], "worlds show": ["office-01"], "dataset": ["all"], "evaluate": ["data"]}
    words = inputs.get(command.name, ["office-01"])
    assert call(*command.name.split(), *words, "--out", tmp_path / "out") == 1
    line = one_line()
    assert line.startswith(f"closedrooms: closedrooms {command.name} needs {', '.join(dict.fromkeys(command.needs))}")
    assert "pip install" in line
    assert not list(tmp_path.iterdir())


def test_a_run_without_rerun_says_how_to_do_without(monkeypatch, tmp_path, call, one_line):
    absent(monkeypatch, "rerun")
    assert call("run", "office-01", "--out", tmp_path / "out") == 1
    line = "closedrooms: closedrooms run needs rerun, which is not installed here: pip install rerun-sdk"
    assert one_line() == f"{line} (or --no-record)"


def test_a_package_that_nobody_thought_of_is_named_when_its_import_fails(monkeypatch, corridor, call, one_line):
    def fails(*_args, **_kwargs):
        raise ModuleNotFoundError("No module named 'networkx'", name="networkx")

    monkeypatch.setattr("closedrooms.pipeline.predict.predict", fails)
    out = corridor / "out"
    assert call("predict", corridor / "map.yaml", "--doors", corridor / "doors.geojson", "--out", out) == 1
    assert "closedrooms predict needs networkx, which is not installed here: pip install networkx" in one_line()
    assert not Path(out).exists()
