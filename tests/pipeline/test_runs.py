"""Several worlds and seeds in one command, and what else ``run`` does beside its result."""

import json
import os
import signal
import socket
import subprocess
import sys
import urllib.request
from pathlib import Path
from subprocess import Popen
from typing import Any

import numpy as np
import pytest

from closedrooms.core.errors import InvalidInputError
from closedrooms.core.files.rosmap import read_ros_map
from closedrooms.core.report import Report
from closedrooms.pipeline import runs
from closedrooms.pipeline.map import map_log
from closedrooms.pipeline.options.map import MapConfig
from closedrooms.pipeline.options.run import RunConfig
from closedrooms.pipeline.reporting.progress import Silent
from closedrooms.pipeline.runs import plan_runs, run_all
from closedrooms.visualization.rerun import live
from closedrooms.visualization.rerun.live import HOST, open_viewer
from closedrooms.visualization.rerun.stream import RecordingStream


def test_every_world_and_seed_has_a_folder_of_its_own() -> None:
    config = RunConfig(world="office-01", more_worlds=("school-01",), seeds=(0, 3))
    tasks = plan_runs(config, Path("somewhere"))
    assert list(tasks) == ["office-01-0", "office-01-3", "school-01-0", "school-01-3"]
    assert [(task.world, task.seed) for task in tasks.values()] == [
        ("office-01", 0), ("office-01", 3), ("school-01", 0), ("school-01", 3),
    ]  # fmt: skip
    assert tasks["school-01-3"].out == Path("somewhere/school-01-3")
    assert not any(task.more_worlds or task.seeds for task in tasks.values())


@pytest.mark.parametrize(("more", "seeds"), [(("office-01",), ()), ((), (2, 2))])
def test_two_runs_of_one_name_are_refused(more: tuple[str, ...], seeds: tuple[int, ...]) -> None:
    with pytest.raises(InvalidInputError, match="two runs would be written to office-01"):
        plan_runs(RunConfig(world="office-01", more_worlds=more, seeds=seeds), Path())


def test_a_world_that_does_not_exist_is_refused_before_the_first_run(tmp_path: Path) -> None:
    with pytest.raises(InvalidInputError):
        run_all(RunConfig(world="office-01", more_worlds=("nowhere",), out=tmp_path))
    assert not list(tmp_path.iterdir())


def test_a_run_that_fails_stops_no_other(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    def fake(config: RunConfig, *, progress: Any) -> Report:  # noqa: ARG001
        if config.seed == 1:
            raise InvalidInputError("no way")
        figures = {
            "doors": {"seen": ["d01"]},
            "closed": ["d01", "d02"],
            "metrics": {
                "area_mapped": 0.5,
                "ate_m": 0.01,
                "room_iou_mean": 0.25,
                "tour": {"errors_percent": {"predicted": 3.0}},
            },
        }
        return Report(folder=tmp_path, title="", rows=[("a", "b")], figures=figures, failures={"d02": "not seen"})

    monkeypatch.setattr(runs, "run", fake)
    report = run_all(RunConfig(world="office-01", seeds=(0, 1, 2), out=tmp_path))
    assert [row[0] for row in report.rows] == ["run", "office-01-0", "office-01-2"]
    assert report.rows[1][1:] == ("1 of 2", "50.0 %", "0.010 m", "0.250", "3.0 %")
    assert report.failures == {
        "office-01-0, d02": "not seen", "office-01-1": "no way", "office-01-2, d02": "not seen",
    }  # fmt: skip
    assert report.partial


def test_watching_needs_a_recording() -> None:
    with pytest.raises(InvalidInputError, match="--live without a recording"):
        RunConfig(web=True, record=False)


def test_a_window_without_a_screen_is_one_clear_error(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr("sys.platform", "linux")
    with pytest.raises(InvalidInputError, match="no screen"), open_viewer(web=False, tell=Silent().tell):
        pass


def test_a_viewer_for_a_browser_listens_on_this_machine_alone_and_goes() -> None:
    said: list[str] = []
    with open_viewer(web=True, tell=said.append) as viewer:
        (line,) = said
        page = line.split(" at ")[1]
        assert page.startswith(f"http://{HOST}:")
        assert viewer.address.startswith(f"rerun+http://{HOST}:")
        with urllib.request.urlopen(page, timeout=10) as answer:
            assert answer.status == 200
        port = int(page.split(":")[2].split("/")[0])
    with pytest.raises(OSError), socket.create_connection((HOST, port), timeout=1):  # noqa: PT011
        pass


@pytest.mark.parametrize("how", [signal.SIGKILL, pytest.param(signal.SIGSTOP, marks=pytest.mark.slow)])
def test_a_viewer_that_is_closed_or_hangs_costs_no_recording(
    tmp_path: Path, how: signal.Signals, monkeypatch: pytest.MonkeyPatch
) -> None:
    started: list[subprocess.Popen[bytes]] = []

    def start(*words: Any, **options: Any) -> "subprocess.Popen[bytes]":
        started.append(Popen(*words, **options))
        return started[-1]

    monkeypatch.setattr(live.subprocess, "Popen", start)
    said: list[str] = []
    path = tmp_path / "run.rrd"
    with open_viewer(web=True, tell=said.append) as viewer:
        monkeypatch.undo()
        with RecordingStream(path, "closed", viewer) as stream:
            for i in range(40):
                stream.at(0.1 * i)
                stream.say("here", "x" * 20_000)
                if i == 20:
                    os.killpg(started[0].pid, how)
    # What is sent to a viewer that has just gone may seem to have arrived: then there is nothing to say.
    assert said[1:] in ([], ["the viewer was closed or hangs; the recording is in the file all the same"])
    rerun = Path(sys.executable).with_name("rerun")
    subprocess.run([rerun, "rrd", "verify", path], check=True, capture_output=True)


@pytest.mark.slow
def test_a_live_run_with_a_bag_that_maps_to_the_same_map(tmp_path: Path) -> None:
    pytest.importorskip("rosbags", reason="the optional extra 'bags' is not installed")
    out = tmp_path / "run"
    run_all(RunConfig(world="office-01", close=2, web=True, bag=True, out=out))
    assert (out / "run.rrd").stat().st_size > 100_000
    assert (
        not {"live", "web", "seeds", "more_worlds"} & json.loads((out / "run.json").read_text())["configuration"].keys()
    )
    map_log(MapConfig(log=out / "sensed", out=tmp_path / "map", record=False))
    mine, again = (read_ros_map(folder / "map.yaml").grid for folder in (out, tmp_path / "map"))
    assert again.frame == mine.frame
    np.testing.assert_array_equal(again.cells, mine.cells)
    poses = [np.loadtxt(folder / "trajectory.tum")[:, 1:3] for folder in (out, tmp_path / "map")]
    assert np.abs(poses[0] - poses[1]).max() < 1e-6
