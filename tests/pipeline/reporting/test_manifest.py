from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import pytest

from closedrooms.pipeline.reporting import manifest


def test_versions_are_those_that_the_standard_library_reads() -> None:
    manifest._versions.cache_clear()
    found = manifest.versions()
    assert "numpy" in found
    for name in manifest.LIBRARIES:
        try:
            assert found[name] == version(name)
        except PackageNotFoundError:
            assert name not in found


def test_a_package_without_a_folder_of_its_own_is_asked_for(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    (tmp_path / "numpy.dist-info").mkdir()
    (tmp_path / "scikit_learn-1.2.3.dev0+local.dist-info").mkdir()
    monkeypatch.setattr("sys.path", [str(tmp_path / "absent"), str(tmp_path)])
    assert manifest._named_by_folders() == {"scikit-learn": "1.2.3.dev0+local"}
    monkeypatch.setattr("importlib.metadata.version", lambda name: f"{name} as told")
    manifest._versions.cache_clear()
    try:
        assert manifest.versions()["numpy"] == "numpy as told"
        assert manifest.versions()["scikit-learn"] == "1.2.3.dev0+local"
    finally:
        manifest._versions.cache_clear()
