import pytest

from closedrooms.core.runtime import packages
from closedrooms.core.runtime.packages import BROUGHT_BY, MissingPackageError, missing_package, require


def test_nothing_is_said_of_packages_that_are_there():
    require("networkx", "skimage", by="closedrooms cover")


def test_all_missing_packages_stand_in_one_line_with_the_command_that_brings_them(monkeypatch):
    monkeypatch.setattr(packages, "find_spec", lambda name: None if name in {"rerun", "pybullet"} else object())
    with pytest.raises(MissingPackageError) as caught:
        require("pybullet", "networkx", "rerun", by="closedrooms run", instead="--no-record")
    expected = "pip install 'closedrooms[sim]' rerun-sdk (or --no-record)"
    assert str(caught.value) == f"closedrooms run needs pybullet, rerun, which are not installed here: {expected}"


def test_a_failed_import_of_a_known_package_becomes_that_line():
    error = ModuleNotFoundError("No module named 'ortools.x'", name="ortools.constraint_solver")
    assert "pip install ortools" in str(missing_package(error, by="closedrooms cover"))
    assert missing_package(ModuleNotFoundError("No module named 'typo'", name="typo"), by="x") is None


@pytest.mark.parametrize("name", BROUGHT_BY)
def test_what_brings_a_package_is_in_the_metadata(name):
    import tomllib
    from pathlib import Path

    project = tomllib.loads((Path(__file__).parents[3] / "pyproject.toml").read_text())["project"]
    for words in BROUGHT_BY[name].replace("'", "").split():
        if words.startswith("closedrooms["):
            extra = words.removeprefix("closedrooms[").removesuffix("]")
            assert extra in project["optional-dependencies"]
        else:
            assert words in project["dependencies"]
