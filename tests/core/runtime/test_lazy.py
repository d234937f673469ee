"""Public faces: every name is there, and nothing is imported before it is asked for."""

import ast
import importlib
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[3]
FACES = [
    "core", "worlds", "worlds.formats", "mapping", "mapping.logs", "predictor", "coverage", "visualization", "pipeline",
    "experiments", "cli",
]  # fmt: skip
CONSTANTS = {"METHODS", "FREE", "OCCUPIED", "UNKNOWN", "DEFAULT_WORLD"}


@pytest.mark.parametrize("package", FACES)
def test_every_public_name_is_there(package):
    face = importlib.import_module(f"closedrooms.{package}")
    assert face.__all__
    for name in face.__all__:
        value = getattr(face, name)
        assert name in CONSTANTS or value.__name__ == name
        assert name in dir(face)


@pytest.mark.parametrize("package", FACES)
def test_an_unknown_name_is_an_attribute_error(package):
    with pytest.raises(AttributeError, match="has no attribute 'nothing'"):
        importlib.import_module(f"closedrooms.{package}").nothing  # noqa: B018


@pytest.mark.parametrize("package", FACES)
def test_importing_a_face_imports_no_library(package):
    heavy = (
        "{'numpy', 'scipy', 'cv2', 'shapely', 'tyro', 'rich', 'matplotlib', 'rerun', 'pybullet', 'yaml', 'networkx'}"
    )
    code = f"import sys, closedrooms.{package}; print(sorted({heavy} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_the_version_is_that_of_the_installation():
    from importlib.metadata import PackageNotFoundError, version

    from closedrooms import core

    try:
        assert core.__version__ == version("closedrooms")
    except PackageNotFoundError:  # a checkout that nobody installed
        pytest.skip("closedrooms is not installed")


def test_the_docstring_of_a_folder_names_no_file_that_is_gone():
    tools = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["setuptools"]
    for package in tools["packages"]:
        folder = ROOT.joinpath(*package.split(".")[1:])
        said = set(re.findall(r"``(\w+)``", ast.get_docstring(ast.parse((folder / "__init__.py").read_text())) or ""))
        files = {path.stem for path in folder.glob("*.py")}
        assert said <= files | {"best", "learned"}, package  # methods that are named like their folder


def test_the_face_of_the_predictor_predicts(tmp_path):
    code = "from closedrooms.predictor import METHODS, PaperConfig, predict; print(predict.__module__, len(METHODS))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=tmp_path)
    assert done.stdout.split() == ["closedrooms.predictor.methods", "6"]


def test_every_package_is_marked_as_typed():
    tools = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["setuptools"]
    assert "py.typed" in tools["package-data"]["*"]
    for package in tools["packages"]:
        assert (ROOT.joinpath(*package.split(".")[1:]) / "py.typed").is_file(), package
