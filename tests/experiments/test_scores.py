import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import linear_sum_assignment
from shapely.geometry import box
from skimage.segmentation import watershed

from closedrooms.core.grid import FREE, OCCUPIED, UNKNOWN, GridFrame, OccupancyGrid
from closedrooms.core.room import Room
from closedrooms.experiments.evaluation.scoring.scores import (
    _assignment,
    added_rooms,
    hidden_area,
    iou,
    matched_iou,
    room_masks,
    split_hidden_area,
)
from closedrooms.experiments.evaluation.scoring.watershed import flood

FRAME = GridFrame(0.05, 0.0, 0.0, 120, 240)


def two_rooms() -> tuple[OccupancyGrid, OccupancyGrid]:
    """A map that knows a corridor, and the truth with two rooms of 4 x 3 m and 5 x 3 m above it, joined by a door."""
    observed = np.full(FRAME.shape, UNKNOWN, dtype=np.int8)
    observed[2:30] = FREE
    truth = observed.copy()
    truth[32:92, 10:90] = FREE
    truth[32:92, 96:196] = FREE
    truth[50:62, 90:96] = FREE
    truth[30:32], truth[92:94] = OCCUPIED, OCCUPIED
    return OccupancyGrid(FRAME, observed), OccupancyGrid(FRAME, truth)


def test_hidden_rooms_are_told_apart_at_a_door() -> None:
    observed, truth = two_rooms()
    rooms = split_hidden_area(hidden_area(observed, truth), FRAME.resolution)
    areas = sorted(room.sum() * 0.05**2 for room in rooms)
    assert areas == pytest.approx([12.0, 15.0], abs=0.2)


def test_nothing_hidden_has_no_rooms() -> None:
    _, truth = two_rooms()
    assert split_hidden_area(hidden_area(truth, truth), FRAME.resolution) == []


def test_small_pieces_are_no_rooms() -> None:
    area = np.zeros(FRAME.shape, dtype=bool)
    area[5:24, 5:24] = True
    assert split_hidden_area(area, 0.05) == []
    area[5:26, 5:26] = True
    assert len(split_hidden_area(area, 0.05)) == 1


def test_a_room_is_rasterised_by_the_centres_of_its_cells() -> None:
    (mask,) = room_masks([Room(box(0.1, 0.2, 1.1, 0.7), ("d",))], FRAME)
    assert mask.sum() == 200
    assert mask[4:14, 2:22].all()


def test_matching_is_one_to_one_and_best_in_sum() -> None:
    (a, b), wide = room_masks([Room(box(0, 0, 2, 2), ()), Room(box(2, 0, 4, 2), ())], FRAME), box(0, 0, 3, 2)
    (over,) = room_masks([Room(wide, ())], FRAME)
    assert matched_iou([a, b], [over]).tolist() == pytest.approx([2 / 3, 0.0])
    assert matched_iou([a, b], [b, a]).tolist() == [1.0, 1.0]
    assert matched_iou([a, b], []).tolist() == [0.0, 0.0]


def test_somebodys_completed_map_is_parted_by_its_walls() -> None:
    observed, truth = two_rooms()
    cells = truth.cells.copy()
    cells[32:92, 91] = OCCUPIED
    assert len(added_rooms(observed, OccupancyGrid(FRAME, cells))) == 2
    assert len(added_rooms(observed, truth)) == 1


@given(st.integers(0, 2**32 - 1))
def test_iou_is_symmetric_and_one_only_for_equal_masks(seed: int) -> None:
    rng = np.random.default_rng(seed)
    a, b = rng.random((2, 4, 5)) < 0.5
    assert iou(a, b) == iou(b, a)
    assert 0.0 <= iou(a, b) <= 1.0
    assert (iou(a, b) == 1.0) == bool((a == b).all())


@given(seed=st.integers(0, 10_000), side=st.integers(1, 40))
def test_flooding_is_scikit_images_watershed(seed: int, side: int) -> None:
    draws = np.random.default_rng(seed)
    height = draws.integers(0, 6, (side, 30)).astype(np.float32)
    seeds = np.where(draws.random(height.shape) < 0.05, draws.integers(1, 9, height.shape), 0).astype(np.int32)
    area = draws.random(height.shape) < 0.8
    assert np.array_equal(flood(height, seeds, area), watershed(height, seeds, mask=area))


def test_what_is_not_found_by_its_file_is_taken_from_its_package(monkeypatch: pytest.MonkeyPatch) -> None:
    _assignment.cache_clear()
    monkeypatch.setattr("importlib.util.find_spec", lambda _name: None)
    try:
        assert _assignment() is linear_sum_assignment
        test_flooding_is_scikit_images_watershed.hypothesis.inner_test(seed=1, side=20)
    finally:
        _assignment.cache_clear()
