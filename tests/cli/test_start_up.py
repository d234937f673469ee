"""Which packages each command loads: start-up costs more than most work, and one careless import doubles it."""

import json
import math
import os
import subprocess
import sys
from pathlib import Path

import pytest

CODE = """
import json, sys
from closedrooms.cli.commands import main
from closedrooms.core.runtime.late_modules import process_is_ours
process_is_ours()
status = main(sys.argv[1:])
PARTED = ("scipy.", "skimage.", "numpy.ma.")
packages = {".".join(name.split(".")[:2]) if name.startswith(PARTED) else name.split(".")[0]
            for name in sys.modules}
print(json.dumps([status, sorted(packages - set(sys.stdlib_module_names))]), file=sys.__stdout__)
"""
# Of the interpreter and of the installation itself; parts of the packages that are named.
AROUND = {"_distutils_hack", "sitecustomize", "cython_runtime", "_virtualenv", "pkg_resources", "_cyutility"}
# Neither typeguard, which tyro loads for some types, nor rich, which only prints tables (`--quiet` here).
LINE = {"closedrooms", "tyro", "docstring_parser", "typing_extensions"}
MAPS = LINE | {"numpy", "shapely", "cv2", "yaml", "PIL"}
# Masked arrays: np.unique loads them, and with it quantiles and sets of numbers.
UNIQUE = {"numpy.ma"}
# A compiled part that is loaded by its file stands under its package's name; the package is not loaded.
TOURS = MAPS | UNIQUE | {"networkx", "skimage.morphology"}
# What scikit-learn brings, some of it only where it is installed.
LEARN = {"sklearn", "joblib", "threadpoolctl", "cloudpickle", "psutil", "narwhals", "lz4", "charset_normalizer"}
TABLES = {
    "pyarrow", "matplotlib", "mpl_toolkits", "cycler", "dateutil", "six", "kiwisolver", "pyparsing", "packaging",
    "fontTools", "threadpoolctl", "cloudpickle",
}  # fmt: skip
SIMULATION = TOURS | {
    "pybullet", "pybullet_data", "mapbox_earcut", "lazy_loader", "skimage", "skimage.graph", "skimage._shared"
}  # fmt: skip


def loaded(folder: Path, *words: str) -> set[str]:
    done = subprocess.run(
        [sys.executable, "-c", CODE, *words, "--quiet"], capture_output=True, text=True, check=False, cwd=folder
    )
    assert done.returncode == 0, done.stderr
    status, packages = json.loads(done.stdout.splitlines()[-1])
    assert status == 0, done.stderr
    private = {name for name in packages if name.startswith(("__editable__", "_", "__mp")) and name not in TOURS}
    return set(packages) - AROUND - private


@pytest.mark.parametrize(
    ("words", "allowed"),
    [
        (["worlds", "list"], LINE),
        (["predict", "map.yaml", "--doors", "doors.geojson", "--out", "p"], MAPS),
        (["predict", "map.yaml", "--doors", "doors.geojson", "--out", "p", "--method", "paper"], MAPS | UNIQUE | LEARN),
        (["map", "robot.log", "--no-record", "--out", "m"], MAPS | UNIQUE | {"charset_normalizer"}),
        (
            ["evaluate", ".", "--methods", "best", "--no-tours", "--workers", "1", "--out", "../e"],
            MAPS | UNIQUE | TABLES | {"networkx", "skimage.segmentation"},
        ),
        (["predict", "map.yaml", "--doors", "doors.geojson", "--method", "learned", "--out", "l"], MAPS),
        (["cover", "map.yaml", "--doors", "doors.geojson", "--out", "c"], TOURS | {"ortools"}),
        (["doors", "map.yaml", "--out", "d.geojson"], MAPS),
    ],
    ids=lambda value: " ".join(value[::7]) if isinstance(value, list) else "",
)
def test_a_command_loads_what_it_needs_and_no_more(corridor: Path, words: list[str], allowed: set[str]) -> None:
    # In a room of 4 x 4 m, standing still.
    ranges = [2.0 / max(abs(math.cos(a)), abs(math.sin(a))) for a in (math.radians(d - 90) for d in range(180))]
    line = f"FLASER 180 {' '.join(f'{r:.2f}' for r in ranges)} 0 0 0 0 0 0"
    (corridor / "robot.log").write_text("".join(f"{line} {n / 5} here {n / 5}\n" for n in range(20)))
    for suffix in (".png", ".yaml"):
        text = (corridor / f"map{suffix}").read_bytes().replace(b"map.png", b"truth.png")
        (corridor / f"truth{suffix}").write_bytes(text)
    found = loaded(corridor, *words)
    if "paper" in words or words[0] == "map":
        # scikit-learn and the pose graph take parts of scipy; the slowest belong to neither.
        slow = {"scipy.signal", "scipy.stats"}
        found = {name for name in found if not name.startswith(("scipy", "skimage")) or name in slow}
    assert found <= allowed


@pytest.mark.simulation
@pytest.mark.slow
def test_a_run_without_a_recording_loads_neither_rerun_nor_scipys_solvers(tmp_path: Path) -> None:
    words = ["run", "office-01", "--close", "1", "--no-record", "--out", "r"]
    # scipy solves the pose graph, where a loop closes.
    graph = {name for name in loaded(tmp_path, *words) if name.split(".")[0] in {"scipy", "numpy"}}
    assert {"scipy.optimize", "scipy.signal", "scipy.ndimage", "scipy.stats"}.isdisjoint(graph)
    assert loaded(tmp_path, *words[:-1], "r2") - graph <= SIMULATION | {"ortools"}


@pytest.mark.simulation
@pytest.mark.slow
def test_a_dataset_loads_neither_tours_nor_scipy(tmp_path: Path) -> None:
    words = ["dataset", "office-01", "--repetitions", "1", "--max-closed", "1", "--workers", "1", "--out", "d"]
    # scipy solves the pose graph, where a loop closes; threads are limited by what joblib uses too.
    found = {name for name in loaded(tmp_path, *words) if name.split(".")[0] != "scipy"}
    assert found <= SIMULATION - TOURS | MAPS | UNIQUE | {"pyarrow", "cloudpickle", "threadpoolctl"}


@pytest.mark.parametrize(("asked", "expected"), [(None, "1"), ("2", "2")])
def test_linear_algebra_has_one_thread_unless_the_user_asks_for_more(asked: str | None, expected: str) -> None:
    environment = {name: value for name, value in os.environ.items() if name != "OPENBLAS_NUM_THREADS"}
    environment |= {} if asked is None else {"OPENBLAS_NUM_THREADS": asked}
    code = """
import atexit, os, sys
early = "numpy" in sys.modules
atexit.register(lambda: print("asked", os.environ.get("OPENBLAS_NUM_THREADS"), early, flush=True))
sys.argv[1:] = ["worlds", "list", "--quiet"]
from closedrooms.cli import main
main()
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, env=environment)
    assert done.stdout.splitlines()[-1] == f"asked {expected} False"
