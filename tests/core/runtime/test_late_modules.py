import subprocess
import sys
from pathlib import Path

import pytest

from closedrooms.core.runtime import late_modules
from closedrooms.core.runtime.late_modules import importing_less, process_is_ours


@pytest.fixture
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    name = "lateness_" + tmp_path.name.replace("-", "_")
    folder = tmp_path / name
    folder.mkdir()
    (folder / "__init__.py").write_text("")
    (folder / "heavy.py").write_text(
        "class Box:\n    size = 3\nbox = Box()\ndef double(x, *, by=2):\n    return by * x\n"
    )
    (folder / "user.py").write_text(
        f"from {name}.heavy import box, double\ntry:\n    import sqlite3\nexcept ImportError:\n    sqlite3 = None\n"
    )
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setattr(late_modules, "_OURS", [])
    monkeypatch.delitem(sys.modules, "sqlite3", raising=False)
    __import__(name)
    return name


def import_user(package: str) -> object:
    with importing_less([f"{package}.heavy"], ["sqlite3"]):
        __import__(f"{package}.user")
    return sys.modules[f"{package}.user"]


def test_what_comes_late_is_loaded_when_it_is_used(package: str) -> None:
    process_is_ours()
    user = import_user(package)
    assert f"{package}.heavy" not in sys.modules
    assert user.double(4, by=3) == 12  # type: ignore[attr-defined]
    assert user.box.size == 3  # type: ignore[attr-defined]
    assert sys.modules[f"{package}.heavy"].double(1) == 2


def test_what_is_absent_is_found_again_afterwards(package: str) -> None:
    process_is_ours()
    user = import_user(package)
    assert user.sqlite3 is None  # type: ignore[attr-defined]
    import sqlite3

    assert sqlite3.sqlite_version


def test_used_while_others_are_imported_it_is_loaded_at_once(package: str) -> None:
    process_is_ours()
    with importing_less([f"{package}.heavy"]):
        assert sys.modules[f"{package}.heavy"].double(2) == 4
        assert sys.modules[f"{package}.heavy"].box.size == 3
    assert sys.modules[f"{package}.heavy"].double(3) == 6


def test_a_failing_import_leaves_no_stand_in(package: str) -> None:
    process_is_ours()
    with pytest.raises(ModuleNotFoundError), importing_less([f"{package}.heavy"], ["sqlite3"]):
        __import__("sqlite3")
    assert {f"{package}.heavy", "sqlite3"}.isdisjoint(sys.modules)
    assert not hasattr(sys.modules[package], "heavy")


def test_a_program_of_others_imports_everything(package: str) -> None:
    user = import_user(package)
    assert f"{package}.heavy" in sys.modules
    assert user.sqlite3 is not None  # type: ignore[attr-defined]


CLUSTERS = """
import sys
from closedrooms.core.runtime.late_modules import process_is_ours
process_is_ours()
from closedrooms.predictor.paper.clusterers import ABSENT, LATE, sklearn_cluster
cluster = sklearn_cluster()
assert not {*LATE, *ABSENT} & {*sys.modules}, "loaded"
points = [[0.0, 0.0], [0.1, 0.0], [5.0, 5.0]]
assert cluster.DBSCAN(eps=1.0, min_samples=1).fit(points).labels_.tolist() == [0, 0, 1]
assert len(cluster.MeanShift(bandwidth=1.0).fit(points).cluster_centers_) == 2
assert not {*LATE, *ABSENT} & {*sys.modules}, "loaded by use"
from sklearn.metrics import label_ranking_average_precision_score
assert label_ranking_average_precision_score([[1, 0]], [[0.9, 0.1]]) == 1.0
import numpy, scipy
assert scipy.stats.rankdata([2, 1]).tolist() == [2, 1]
numpy.testing.assert_array_equal([1], [1])
"""


def test_scikit_learn_clusters_without_statistics_and_has_them_when_asked() -> None:
    done = subprocess.run([sys.executable, "-c", CLUSTERS], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
