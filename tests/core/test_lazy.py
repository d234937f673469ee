"""Public faces: every name is there, and nothing is imported before it is asked for."""

import importlib
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
FACES = ["predictor", "pipeline", "experiments", "visualization", "cli"]


@pytest.mark.parametrize("package", FACES)
def test_every_public_name_is_there(package):
    face = importlib.import_module(f"closedrooms.{package}")
    assert face.__all__
    for name in face.__all__:
        assert getattr(face, name).__name__ == name if name != "METHODS" else getattr(face, name)
        assert name in dir(face)


@pytest.mark.parametrize("package", FACES)
def test_an_unknown_name_is_an_attribute_error(package):
    with pytest.raises(AttributeError, match="has no attribute 'nothing'"):
        importlib.import_module(f"closedrooms.{package}").nothing  # noqa: B018


@pytest.mark.parametrize("package", FACES)
def test_importing_a_face_imports_no_library(package):
    heavy = "{'numpy', 'scipy', 'cv2', 'shapely', 'tyro', 'rich', 'matplotlib', 'rerun', 'pybullet'}"
    code = f"import sys, closedrooms.{package}; print(sorted({heavy} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_the_face_of_the_predictor_predicts(tmp_path):
    code = "from closedrooms.predictor import METHODS, PaperConfig, predict; print(predict.__module__, len(METHODS))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=tmp_path)
    assert done.stdout.split() == ["closedrooms.predictor.methods", "5"]


def test_every_package_is_marked_as_typed():
    tools = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["setuptools"]
    assert "py.typed" in tools["package-data"]["*"]
    for package in tools["packages"]:
        assert (ROOT.joinpath(*package.split(".")[1:]) / "py.typed").is_file(), package
