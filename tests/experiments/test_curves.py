from pathlib import Path

import pytest

from closedrooms.experiments.evaluation.reporting.figures import COLOURS, draw_iou
from closedrooms.predictor.methods import METHODS


@pytest.mark.parametrize("method", ["learned", "somebody's"])
def test_every_method_is_drawn_one_of_another_package_too(tmp_path: Path, method: str) -> None:
    rows = [
        {"method": name, "closed_doors": doors, "rooms": 3, "matched_mean": 0.5, "matched_sd": 0.1}
        for name in ("best", method)
        for doors in (1, 2)
    ]
    path = tmp_path / "iou.png"
    assert draw_iou(path, rows, ["best", method], ["matched"])
    assert path.stat().st_size > 1000


def test_every_method_of_ours_has_a_colour_of_its_own() -> None:
    assert len({COLOURS[name] for name in METHODS}) == len(METHODS)
