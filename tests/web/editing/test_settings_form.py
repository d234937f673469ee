from dataclasses import dataclass

import pytest

from closedrooms.core.errors import InvalidInputError
from closedrooms.predictor.config import BestConfig, PaperConfig, RoseConfig
from closedrooms.predictor.methods import METHODS
from closedrooms.web.editing.settings_form import setting_rows, with_setting


@pytest.mark.parametrize("method", ["paper", "rose", "best", "learned", "line-of-sight", "geometric"])
def test_every_setting_of_every_method_has_a_row_that_leaves_it_as_it_is(method: str) -> None:
    settings = METHODS[method].config()
    rows = setting_rows(settings)
    assert len(rows) >= 7
    for row in rows:
        assert row.about, row.name
        assert with_setting(settings, row.name, row.shown) == settings


def test_nested_and_optional_settings_are_changed() -> None:
    settings = with_setting(with_setting(PaperConfig(), "lines.max_gap", 1), "phi", "as-printed")
    assert settings.lines.max_gap == 1.0
    assert isinstance(settings.lines.max_gap, float)
    assert settings.phi == "as-printed"
    assert with_setting(with_setting(PaperConfig(), "wall_thickness", 0.2), "wall_thickness", None) == PaperConfig()
    assert with_setting(PaperConfig(), "max_level", 4.0).max_level == 4


@pytest.mark.parametrize(
    ("name", "value"),
    [("lines.max_gap", None), ("lines.max_gap", "1"), ("lines.max_gap", True), ("lines.max_gap", float("nan")),
     ("max_level", 1.5), ("phi", "other"), ("phi", None), ("joint_layout", 1), ("lines", 3), ("nothing", 1),
     ("keep_trace", True), ("min_unknown", 2.0), ("lines.canny_aperture", 4), ("door_width", 0.0), ("__class__", 1)],
)  # fmt: skip
def test_what_is_no_value_of_a_setting_is_refused(name: str, value: object) -> None:
    with pytest.raises(InvalidInputError):
        with_setting(PaperConfig(), name, value)


def test_what_cannot_be_set_has_no_row() -> None:
    assert "directions" not in {row.name for row in setting_rows(RoseConfig())}
    assert "keep_trace" not in {row.name for row in setting_rows(BestConfig())}


def test_settings_of_another_package_have_rows_too() -> None:
    @dataclass(frozen=True, kw_only=True)
    class Theirs:
        radius: float = 2.0
        names: tuple[str, ...] = ()

    assert [(row.name, row.kind, row.about) for row in setting_rows(Theirs())] == [("radius", "number", "")]
    assert with_setting(Theirs(), "radius", 3).radius == 3.0
