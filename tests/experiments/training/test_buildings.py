import csv
import itertools
from pathlib import Path

import cv2
import numpy as np
import pytest
import shapely
from shapely.geometry.base import BaseGeometry

from closedrooms.core.arrays import BoolArray
from closedrooms.core.errors import InvalidInputError
from closedrooms.core.files.rosmap import read_map
from closedrooms.experiments.training.buildings import (
    COLUMNS,
    LEDGER,
    USES,
    may_train,
    note_report,
    read_groups,
    use_of,
)
from closedrooms.worlds.library import bundled_names, read_world

SHARED = Path(__file__).parents[4] / "shared" / "data"
# Two outlines of one building agree so well, in extent and in area laid over each other; of the 55 floors and the 8
# environments no two that are not one building, or siblings, do.
SAME_EXTENT, SAME_AREA = 0.07, 0.88
PICTURE = 96


def test_a_building_stands_in_one_group() -> None:
    names = [name for group in read_groups() for name in group.buildings]
    assert len(names) == len(set(names))
    assert {group.use for group in read_groups()} == set(USES)


def test_the_bundled_worlds_were_tuned_on_and_never_choose_or_report() -> None:
    assert {use_of(name) for name in bundled_names()} == {"fit"}


@pytest.mark.parametrize(
    ("name", "use"),
    [
        ("office-g1-0", "fit"),
        ("school-g1-1000", "choose"),
        ("office-g2-0", "report"),
        ("Sabadell3_updated", "report"),
        # As ``worlds generate`` names them.
        ("office-0", "fit"),
        ("school-1000", "choose"),
    ],
)
def test_what_a_building_is_used_for(name: str, use: str) -> None:
    assert use_of(name) == use
    assert may_train(name) == (use == "fit")


def test_a_building_that_nobody_sorted_is_refused() -> None:
    with pytest.raises(InvalidInputError, match="in no group"):
        use_of("a new building")


def picture_of(shape: BaseGeometry) -> BoolArray:
    x0, y0, x1, y1 = shape.bounds
    scale = PICTURE / max(x1 - x0, y1 - y0)
    drawn = np.zeros((PICTURE, PICTURE), np.uint8)
    for part in shapely.get_parts(shape):
        for number, ring in enumerate([part.exterior, *part.interiors]):
            points = (shapely.get_coordinates(ring) - ((x0 + x1) / 2, (y0 + y1) / 2)) * scale + PICTURE / 2
            cv2.fillPoly(drawn, [np.round(points).astype(np.int32)], (int(number == 0),))
    return drawn > 0


def outline_of_map(path: Path) -> BaseGeometry:
    known = read_map(path).known
    closed = cv2.morphologyEx(known.view(np.uint8), cv2.MORPH_CLOSE, np.ones((9, 9), np.uint8))
    contours, parents = cv2.findContours(closed, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_SIMPLE)
    outer, holes = [], []
    for contour, (_, _, _, parent) in zip(contours, parents[0], strict=True):
        if len(contour) > 3:
            (outer if parent < 0 else holes).append(shapely.Polygon(contour.reshape(-1, 2) * 0.05).buffer(0))
    return shapely.union_all(outer).difference(shapely.union_all(holes))


def likeness(a: BoolArray, b: BoolArray) -> float:
    turns = [np.rot90(flipped, quarter) for flipped in (a, a[:, ::-1]) for quarter in range(4)]
    return float(max((turn & b).sum() / (turn | b).sum() for turn in turns))


def extent_apart(a: BaseGeometry, b: BaseGeometry) -> float:
    sides = [sorted((s.bounds[2] - s.bounds[0], s.bounds[3] - s.bounds[1])) for s in (a, b)]
    return float(max(abs(one / other - 1.0) for one, other in zip(*sides, strict=True)))


@pytest.mark.slow
@pytest.mark.skipif(not SHARED.is_dir(), reason="no ../shared/data: nothing to compare")
def test_no_outline_of_a_building_that_is_reported_was_fitted_or_chosen_on() -> None:
    outlines: dict[str, BaseGeometry] = {}
    for folder in ("luperto", "luperto-more"):
        for path in sorted((SHARED / "plans" / folder).rglob("*.xml")):
            rooms = [room.polygon for room in read_world(str(path)).rooms]
            outlines[path.stem] = shapely.union_all(rooms).buffer(0.3).buffer(-0.3)
    for path in sorted((SHARED / "authors").glob("*/01/truth.yaml")):
        outlines[f"{path.parents[1].name} (release)"] = outline_of_map(path)
    assert len(outlines) == 63
    group_of = {name: group for group in read_groups() for name in group.buildings}
    pictures = {name: picture_of(outline) for name, outline in outlines.items()}
    alike = [
        (a, b)
        for a, b in itertools.combinations(outlines, 2)
        if extent_apart(outlines[a], outlines[b]) < SAME_EXTENT and likeness(pictures[a], pictures[b]) > SAME_AREA
    ]
    # The five floors of both releases are told by their outlines alone.
    assert len(alike) >= 5
    for pair in alike:
        first, second = (group_of[name.removesuffix(" (release)")] for name in pair)
        assert first.use == second.use, pair


def test_the_ledger_has_whole_rows() -> None:
    rows = list(csv.DictReader(LEDGER.read_text().splitlines()))
    assert rows
    for row in rows:
        assert tuple(row) == COLUMNS
        assert all(row.values())
        float(row["value"])


def test_a_run_on_report_is_added_below(tmp_path: Path) -> None:
    path = tmp_path / "ledger.csv"
    row = dict.fromkeys(COLUMNS, "1")
    note_report([row], path)
    note_report([row | {"method": "paper"}], path)
    assert [read["method"] for read in csv.DictReader(path.read_text().splitlines())] == ["1", "paper"]
    with pytest.raises(InvalidInputError, match="columns"):
        note_report([{"date": "today"}], path)
