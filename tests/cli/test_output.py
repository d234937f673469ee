"""What comes back: one JSON object, more or less on the terminal, exit statuses."""

import io
import json
import os
import signal
import subprocess
import sys
import time

import pytest

from closedrooms.cli import commands
from closedrooms.core.remarks import Remark
from closedrooms.core.report import Report
from closedrooms.pipeline.reporting import progress


def predict(corridor, *options):
    doors = corridor / "doors.geojson"
    return ("predict", corridor / "map.yaml", "--doors", doors, "--out", corridor / "out", *options)


def test_json_is_one_object_with_numbers(corridor, call, capsys):
    assert call(*predict(corridor, "--json")) == 0
    result = json.loads(capsys.readouterr().out)
    assert result["command"] == "predict"
    assert result["written"] == str(corridor / "out")
    assert result["partial"] is False
    (room,) = result["figures"]["rooms"]
    assert room["doors"] == ["d1"]
    assert 10.0 < room["area_m2"] < 40.0


def test_json_of_a_partial_result_says_what_failed(corridor, call, capsys):
    content = json.loads((corridor / "doors.geojson").read_text())
    content["features"][0]["geometry"]["coordinates"] = [500, 0]
    (corridor / "doors.geojson").write_text(json.dumps(content))
    assert call(*predict(corridor, "--json")) == 3
    said = capsys.readouterr()
    result = json.loads(said.out)
    assert result["partial"] is True
    assert list(result["failures"]) == ["d1"]
    assert "closedrooms: d1: " in said.err


def test_json_of_worlds_lists_their_lines(call, capsys):
    assert call("worlds", "list", "--json") == 0
    assert len(json.loads(capsys.readouterr().out)["lines"]) == 20


def test_quiet_prints_nothing(corridor, call, capsys):
    assert call(*predict(corridor, "-q")) == 0
    said = capsys.readouterr()
    assert said.out == said.err == ""


def test_verbose_prints_every_step(capsys):
    with progress.Terminal(verbose=True) as terminal:
        terminal.stage("sweep", 3)
        terminal.advance(1)
        terminal.advance(2)
    assert capsys.readouterr().err.splitlines()[:2] == ["sweep ...", "sweep: 1 of 3"]


class _Screen(io.StringIO):
    def isatty(self) -> bool:
        return True


@pytest.mark.parametrize(("total", "left"), [(100.0, True), (None, False)])
def test_on_a_terminal_a_bar_says_what_remains_where_that_is_known(total, left, monkeypatch):
    screen = _Screen()
    monkeypatch.setattr("sys.stderr", screen)
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("COLUMNS", "120")
    now = 0.0
    with progress.Terminal() as terminal:
        terminal._bars.get_time = lambda: now
        terminal.stage("samples", total)
        for done in (10, 20, 30):
            now += 5.0
            terminal.advance(done, f"{done} done")
        terminal._bars.refresh()
    said = screen.getvalue()
    assert "30 done" in said
    assert ("0:00:35 left" in said) == left
    assert ("left" in said) == left


def test_off_a_terminal_a_line_every_30_seconds_says_what_remains(monkeypatch, capsys):
    now = 0.0
    monkeypatch.setattr(progress.time, "monotonic", lambda: now)
    with progress.Terminal() as terminal:
        terminal.stage("samples", 100)
        for done in range(10, 101, 10):
            now += 10.0
            terminal.advance(done, f"{done} of 100")
    assert capsys.readouterr().err.splitlines() == [
        "samples ...",
        "samples: 30 of 100, 1 min 10 s left",
        "samples: 60 of 100, 40 s left",
        "samples: 90 of 100, 10 s left",
    ]


def test_what_was_there_before_tells_nothing_of_the_speed():
    pace = progress.Pace("samples", 1000, 0.0)
    assert pace.line(900, "", 0.0) == "samples: 900 of 1000"
    assert pace.line(910, "", 60.0) == "samples: 910 of 1000, 9 min 0 s left"
    assert progress.Pace("x", 1e6, 0.0).line(0, "", 0.0) == "x: 0 of 1e+06"
    slow = progress.Pace("slow", 100, 0.0)
    slow.remaining(0, 0.0)
    assert slow.line(1, "", 7200.0) == "slow: 1 of 100, 198 h 0 min left"


@pytest.mark.parametrize(("loss", "status"), [(True, 3), (False, 0)])
def test_a_remark_is_shown_and_one_of_a_loss_is_status_3(loss, status, corridor, call, capsys, monkeypatch):
    remark = Remark(action="dropped", what="doors", why="they are no points", names=("d7",), loss=loss)
    report = Report(folder=corridor, title="t", rows=[("a", "b", "c"), ("1", "2", "3")], remarks=[remark])
    monkeypatch.setattr("closedrooms.pipeline.predict.predict_map", lambda *_, **__: report)
    assert call(*predict(corridor)) == status
    assert "they are no points" in capsys.readouterr().out


@pytest.mark.parametrize(("error", "status"), [(KeyboardInterrupt, 130), (commands.Terminated, 143)])
def test_an_interruption_is_one_line_and_its_status(error, status, corridor, call, one_line, monkeypatch):
    def stop(*_, **__):
        raise error

    monkeypatch.setattr("closedrooms.pipeline.predict.predict_map", stop)
    assert call(*predict(corridor)) == status
    assert "nothing half-written was left behind" in one_line()


@pytest.mark.parametrize(("number", "status"), [(signal.SIGTERM, 143), (signal.SIGINT, 130)])
@pytest.mark.simulation
def test_a_signal_leaves_nothing_half_written(number, status, tmp_path):
    out = tmp_path / "out"
    words = [sys.executable, "-m", "closedrooms.cli", "run", "office-07", "--no-record", "--out", str(out)]
    running = subprocess.Popen(words, cwd=tmp_path, stderr=subprocess.PIPE, text=True)
    assert running.stderr is not None
    while "explore" not in running.stderr.readline():
        assert running.poll() is None
    time.sleep(0.5)
    os.kill(running.pid, number)
    _, said = running.communicate(timeout=60)
    assert running.returncode == status
    assert "nothing half-written was left behind" in said
    assert "Traceback" not in said
    assert not list(tmp_path.iterdir())


def test_handlers_of_signals_are_put_back(call):
    before = signal.getsignal(signal.SIGTERM)
    call("--version")
    assert signal.getsignal(signal.SIGTERM) is before


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_completion_is_printed_for_every_shell(shell, call, capsys):
    assert call("--tyro-print-completion", shell) == 0
    script = capsys.readouterr().out
    for word in ("robustness", "generate", "--close-doors", "--sim.robot.radius", "--predictor.door-width"):
        assert word.lstrip("-") in script


def test_bash_completes_commands_and_options(tmp_path, call, capsys):
    assert call("--tyro-print-completion", "bash") == 0
    (tmp_path / "complete.sh").write_text(capsys.readouterr().out)
    ask = (
        "source complete.sh; f=$(complete -p closedrooms | sed 's/.*-F \\([^ ]*\\).*/\\1/');"
        'COMP_WORDS=(closedrooms "$@"); COMP_CWORD=$#; $f closedrooms "${@: -1}" x; echo "${COMPREPLY[@]}"'
    )

    def completed(*words):
        done = subprocess.run(
            ["bash", "-c", ask, "bash", *words], cwd=tmp_path, capture_output=True, text=True, check=True
        )
        return done.stdout.split()

    assert completed("pre") == ["predict"]
    assert completed("worlds", "sh") == ["show"]
    assert "--close-doors" in completed("run", "--clo")


@pytest.mark.usefixtures("third_party")
def test_a_method_of_another_package_brings_its_options(corridor, call, capsys, one_line):
    assert call("predict", "--method", "round", "--help-all") == 0
    assert "--predictor.radius" in capsys.readouterr().out
    assert call(*predict(corridor, "--method", "round", "--predictor.radius", "1.5", "--json")) == 0
    (room,) = json.loads(capsys.readouterr().out)["figures"]["rooms"]
    assert room["area_m2"] == pytest.approx(7.0, abs=0.1)
    assert call(*predict(corridor, "--config", corridor / "out" / "run.json", "--json")) == 0
    assert json.loads(capsys.readouterr().out)["figures"]["rooms"] == [room]
    assert call(*predict(corridor, "--method", "round", "--predictor.door-width", "1")) == 2
    assert "the method round does not read --predictor.door-width" in one_line()
