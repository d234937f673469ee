import subprocess
import sys

import pytest

from closedrooms.core.errors import InvalidInputError
from closedrooms.predictor.config import BestConfig, PaperConfig
from closedrooms.predictor.methods import METHODS, find_method, predict


def test_ours_stand_first_in_the_order_of_tables():
    assert list(METHODS)[:6] == ["paper", "rose", "best", "learned", "line-of-sight", "geometric"]


def test_an_unknown_method_is_refused_with_the_nearest_name():
    with pytest.raises(InvalidInputError, match=r"did you mean paper\?.*expected one of paper, rose"):
        find_method("papre")


def test_settings_of_another_method_are_refused_by_name(mapped):
    scene = mapped(closed=("t2",))
    with pytest.raises(InvalidInputError, match="PaperConfig for the method best; expected BestConfig"):
        predict(scene.grid, scene.doors, "best", PaperConfig())


@pytest.mark.parametrize("name", METHODS)
def test_every_method_predicts_with_its_own_defaults(mapped, name):
    scene = mapped(closed=("t2",))
    assert len(predict(scene.grid, scene.doors, name).rooms) == 1


def test_a_method_without_stages_ignores_the_wish_for_a_trace(mapped):
    scene = mapped(closed=("t2",))
    assert predict(scene.grid, scene.doors, "geometric", trace=True).trace is None
    assert predict(scene.grid, scene.doors, "best", BestConfig(), trace=True).trace is not None


@pytest.fixture
def third_party(install_round):
    """A package installed beside us that brings a method, one that is not there and one that is none."""
    install_round("third_party_rooms", missing="ABSENT", wrong="NOTHING")


@pytest.mark.usefixtures("third_party")
def test_another_package_adds_a_method_with_settings_of_its_own(mapped):
    scene = mapped(closed=("t2",))
    config = find_method("round").config(radius=1.0)
    assert predict(scene.grid, scene.doors, "round", config).rooms[0].polygon.area == pytest.approx(3.14, abs=0.03)
    assert "round" in METHODS


@pytest.mark.usefixtures("third_party")
@pytest.mark.parametrize(("name", "message"), [("missing", "cannot be loaded"), ("wrong", "expected a Method")])
def test_a_broken_package_is_named_and_takes_nothing_with_it(name, message):
    with pytest.raises(InvalidInputError, match=message):
        find_method(name)
    assert find_method("best").config is BestConfig


def test_listing_methods_imports_nothing_heavy():
    code = "import sys; from closedrooms.predictor.methods import METHODS; list(METHODS); print('numpy' in sys.modules)"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout.strip() == "False"


def test_only_the_baselines_predict_each_room_for_itself_and_all_but_rectangles_begin_with_faces():
    assert {name for name, method in METHODS.items() if not method.disjoint} == {"line-of-sight", "geometric"}
    faces = {name for name, method in METHODS.items() if method.shares_faces}
    assert faces == {"paper", "rose", "line-of-sight", "geometric"}
