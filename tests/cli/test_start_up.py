"""Which packages each command loads: start-up costs more than most work, and one careless import doubles it."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

CODE = """
import json, sys
from closedrooms.cli.commands import main
status = main(sys.argv[1:])
packages = {".".join(name.split(".")[:2]) if name.startswith(("scipy.", "skimage.")) else name.split(".")[0]
            for name in sys.modules}
print(json.dumps([status, sorted(packages - set(sys.stdlib_module_names))]), file=sys.__stdout__)
"""
# Of the interpreter and of the installation itself; parts of the packages that are named.
AROUND = {"_distutils_hack", "sitecustomize", "cython_runtime", "_virtualenv", "pkg_resources", "_cyutility"}
LINE = {"closedrooms", "tyro", "typeguard", "docstring_parser", "rich", "typing_extensions"}
MAPS = LINE | {"numpy", "shapely", "cv2", "yaml", "PIL", "pypocketfft"}
TOURS = MAPS | {"networkx", "skimage.morphology", "_skeletonize_various_cy"}
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
        (["worlds", "list"], LINE | {"numpy", "shapely"}),
        (["predict", "map.yaml", "--doors", "doors.geojson", "--out", "p"], MAPS),
        (["predict", "map.yaml", "--doors", "doors.geojson", "--method", "learned", "--out", "l"], MAPS),
        (["cover", "map.yaml", "--doors", "doors.geojson", "--out", "c"], TOURS | {"ortools"}),
        (["doors", "map.yaml", "--out", "d.geojson"], MAPS),
    ],
    ids=lambda value: value[0] if isinstance(value, list) else "",
)
def test_a_command_loads_what_it_needs_and_no_more(corridor: Path, words: list[str], allowed: set[str]) -> None:
    assert loaded(corridor, *words) <= allowed


@pytest.mark.simulation
def test_a_run_without_a_recording_loads_neither_rerun_nor_scipys_solvers(tmp_path: Path) -> None:
    words = ["run", "office-01", "--close", "1", "--no-record", "--out", "r"]
    # scipy solves the pose graph, where a loop closes.
    graph = {name for name in loaded(tmp_path, *words) if name.split(".")[0] in {"scipy", "numpy"}}
    assert {"scipy.optimize", "scipy.signal", "scipy.ndimage", "scipy.stats"}.isdisjoint(graph)
    assert loaded(tmp_path, *words[:-1], "r2") - graph <= SIMULATION | {"ortools"}
