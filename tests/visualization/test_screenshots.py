"""Every tab of a recording at every moment, as the viewer shows it: no view is empty."""

import importlib.util
import sys
from dataclasses import replace
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from closedrooms.core.grid import FREE, GridFrame, OccupancyGrid
from closedrooms.pipeline.options.run import RunConfig
from closedrooms.pipeline.run import run
from closedrooms.visualization.rerun.recorder import Recorder
from closedrooms.visualization.rerun.stream import Stage

STAGES = (0, 1, Stage.SEGMENTS, Stage.INITIAL, Stage.EXPANSION, Stage.EXPANSION + 1, Stage.ROOMS, Stage.COVERAGE)
VULKAN = any(Path("/usr/share/vulkan/icd.d").glob("*.json"))
needs_viewer = pytest.mark.skipif(not VULKAN, reason="no Vulkan driver (Debian: mesa-vulkan-drivers libvulkan1)")


def _load() -> ModuleType:
    path = Path(__file__).parents[2] / "benchmarks" / "screenshots.py"
    spec = importlib.util.spec_from_file_location("screenshots", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules["screenshots"] = module
    spec.loader.exec_module(module)
    return module


screenshots = _load()


def test_one_colour_is_empty_and_a_letter_is_not() -> None:
    pixels = np.full((300, 400, 3), 222)
    assert screenshots.is_empty(pixels, plot=False)
    pixels[100:110, 100:110] = 40
    assert not screenshots.is_empty(pixels, plot=False)


def test_grey_axes_alone_are_an_empty_plot() -> None:
    pixels = np.full((300, 400, 3), 13)
    pixels[::50] = 60
    assert screenshots.is_empty(pixels, plot=True)
    pixels[150, 10:390] = (0, 114, 178)
    assert not screenshots.is_empty(pixels, plot=True)


def test_what_is_still_being_loaded_is_empty_and_so_is_a_plot_with_a_legend_alone() -> None:
    pixels = np.full((300, 400, 3), 222)
    pixels[4:10, 360:396] = 255
    assert screenshots.is_empty(pixels, plot=False)
    plot = np.full((300, 400, 3), 13)
    plot[10:20, 12:22] = (0, 114, 178)
    assert screenshots.is_empty(plot, plot=True)


@pytest.mark.slow
@needs_viewer
@pytest.mark.parametrize("method", ["best", "paper"])
def test_no_view_of_a_run_is_empty_at_any_moment(tmp_path: Path, method: str) -> None:
    report = run(RunConfig(world="office-01", close=2, method=method, out=tmp_path / "run"))
    seconds = float(np.loadtxt(report.folder / "trajectory.tum")[-1, 0])
    config = screenshots.ScreenshotConfig(
        recording=report.folder / "run.rrd",
        out=tmp_path / "pictures",
        sim_times=(0.0, seconds / 2, seconds),
        stages=tuple(int(stage) for stage in STAGES),
        # What is found out once is static: it shows the same at every moment.
        unchanging=("Weighing", "Coverage", "Log", "Result"),
        window=(1100, 700),
    )
    shots = screenshots.take(config)
    tabs = {shot.tab.split(" - ")[0] for shot in shots}
    own = {"Evidence", "Weighing"} if method == "best" else {"Structure", "Expansion"}
    assert tabs == {"Building", "Mapping", "Rooms", "How sure", "Coverage", "Log", "Result"} | own
    assert {(shot.tab, shot.moment): shot.empty for shot in shots if shot.empty} == {}


@pytest.mark.slow
@needs_viewer
def test_a_tab_for_what_the_recording_does_not_hold_is_found_empty(tmp_path: Path) -> None:
    path = tmp_path / "empty.rrd"
    frame = GridFrame(0.1, 0.0, 0.0, 50, 50)
    grid = OccupancyGrid(frame, np.full(frame.shape, FREE, dtype=np.int8))
    with Recorder(path, name="empty", bounds=(0.0, 0.0, 5.0, 5.0)) as recorder:
        recorder.map(grid, 0.0)
        # What the recorder never does.
        recorder._holds = replace(recorder._holds, truth=True, room_iou=True)
    shots = screenshots.take(screenshots.ScreenshotConfig(recording=path, out=tmp_path, patience=3.0))
    empty = {view for shot in shots for view in shot.empty if shot.tab == "Rooms"}
    assert any(view.startswith("Truth") for view in empty), empty
    assert any(view.startswith("IoU") for view in empty), empty
