"""Closed doors proposed from a map alone."""

import math
from collections.abc import Callable
from dataclasses import fields

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from closedrooms.core.arrays import BoolArray
from closedrooms.core.errors import InvalidInputError
from closedrooms.core.grid import FREE, OCCUPIED, UNKNOWN, GridFrame, OccupancyGrid
from closedrooms.predictor.structure.door_proposal_config import ProposalConfig
from closedrooms.predictor.structure.door_proposals import propose_doors
from closedrooms.predictor.structure.wall_directions import find_wall_directions

RESOLUTION = 0.05
SIZE = 200
# Depth of the wall that a lidar shows [m].
SHOWN = 0.10


def corridor(
    *, middle: float = 0.0, width: float = 0.9, recess: float = 0.05, angle: float = 0.0, behind: int = UNKNOWN
) -> OccupancyGrid:
    """A wall along x through the origin, turned by ``angle``: free below, a leaf set back in it, ``behind`` above."""
    frame = GridFrame(RESOLUTION, -5.0, -5.0, SIZE, SIZE)
    rows, cols = np.meshgrid(np.arange(SIZE), np.arange(SIZE), indexing="ij")
    points = frame.to_points(np.stack((rows, cols), axis=-1))
    along = points[..., 0] * math.cos(angle) + points[..., 1] * math.sin(angle)
    across = points[..., 1] * math.cos(angle) - points[..., 0] * math.sin(angle)
    face = np.where(np.abs(along - middle) < width / 2, recess, 0.0)
    cells = np.where(across < face, FREE, np.where(across < face + SHOWN, OCCUPIED, behind))
    cells[np.hypot(along, across) > 4.5] = UNKNOWN
    return OccupancyGrid(frame, cells.astype(np.int8))


@given(
    middle=st.integers(-40, 40).map(lambda cells: cells * RESOLUTION + 0.025),
    width=st.sampled_from([0.75, 0.85, 0.95, 1.05, 1.15]),
    recess=st.sampled_from([0.05, 0.10]),
    quarter=st.integers(0, 3),
)
@settings(max_examples=25, deadline=None)
def test_a_leaf_set_back_is_proposed_where_it_is(middle: float, width: float, recess: float, quarter: int) -> None:
    (door,) = propose_doors(corridor(middle=middle, width=width, recess=recess, angle=quarter * math.pi / 2))
    angle = quarter * math.pi / 2
    x, y = door.midpoint
    assert math.cos(angle) * x + math.sin(angle) * y == pytest.approx(middle, abs=0.06)
    assert math.cos(angle) * y - math.sin(angle) * x == pytest.approx(recess, abs=0.03)
    assert door.width == pytest.approx(width, abs=0.11)
    assert math.dist(*door.segment) == pytest.approx(door.width)
    assert door.recess == pytest.approx(recess, abs=0.02)
    assert 0.5 <= door.score <= 1.0


@pytest.mark.parametrize("degrees", [10.0, 30.0, 45.0, 160.0])
def test_a_door_in_a_slanted_wall_is_found(degrees: float) -> None:
    grid = corridor(middle=0.5, recess=0.10, angle=math.radians(degrees))
    best = propose_doors(grid, ProposalConfig(min_score=0.2))[0]
    assert (
        math.dist(best.midpoint, (0.5 * math.cos(math.radians(degrees)), 0.5 * math.sin(math.radians(degrees)))) < 0.2
    )


def test_a_plain_wall_holds_no_door() -> None:
    assert propose_doors(corridor(recess=0.0)) == ()


def test_a_wall_known_from_behind_holds_no_closed_room() -> None:
    assert propose_doors(corridor(behind=FREE)) == ()


@pytest.mark.parametrize("width", [0.3, 2.0])
def test_recesses_of_other_widths_are_no_doors(width: float) -> None:
    assert propose_doors(corridor(width=width)) == ()


def test_width_and_recess_can_be_set() -> None:
    assert propose_doors(corridor(width=2.0), ProposalConfig(max_width=2.5))
    assert not propose_doors(corridor(recess=0.05), ProposalConfig(min_recess=0.08))


def test_a_clearer_recess_scores_higher() -> None:
    shallow, deep = (propose_doors(corridor(recess=recess))[0].score for recess in (0.05, 0.15))
    assert deep > shallow


def test_proposals_come_best_first_and_the_same_each_time() -> None:
    grid = corridor(recess=0.10)
    cells = np.array(grid.cells)
    low = grid.frame.to_cells(np.array([2.0, 0.0]))
    cells[low[0], low[1] : low[1] + 16] = FREE
    cells[low[0] + 1 : low[0] + 3, low[1] : low[1] + 16] = OCCUPIED
    two = propose_doors(OccupancyGrid(grid.frame, cells))
    assert len(two) == 2
    assert two[0].score >= two[1].score
    assert two == propose_doors(OccupancyGrid(grid.frame, cells))


@pytest.mark.parametrize("value", [UNKNOWN, FREE, OCCUPIED])
def test_a_map_of_one_kind_holds_no_door(value: int) -> None:
    frame = GridFrame(RESOLUTION, 0.0, 0.0, 20, 30)
    assert propose_doors(OccupancyGrid(frame, np.full(frame.shape, value, dtype=np.int8))) == ()


def test_coarse_cells_find_what_they_can_show() -> None:
    frame = GridFrame(0.5, 0.0, 0.0, 20, 20)
    cells = np.full(frame.shape, FREE, dtype=np.int8)
    cells[10] = OCCUPIED
    assert propose_doors(OccupancyGrid(frame, cells)) == ()


def test_wall_directions_are_found_to_half_a_degree() -> None:
    for degrees in (0.0, 20.0, 45.0, 110.0):
        directions = find_wall_directions(corridor(recess=0.0, angle=math.radians(degrees)))
        assert directions is not None
        off = (np.degrees(directions.angles[0]) - degrees + 45.0) % 90.0 - 45.0
        assert abs(off) <= 0.5


@pytest.mark.parametrize(
    "wrong",
    [
        {"min_width": 0.0},
        {"min_width": 1.5},
        {"max_width": 1000.0},
        {"min_recess": 0.5},
        {"min_score": 1.5},
        {"jamb": 0.0},
        {"depth": float("nan")},
    ],
)
def test_settings_that_make_no_sense_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(InvalidInputError, match="expected"):
        ProposalConfig(**wrong)


def hall(places: list[float], *, width: float = 0.9, recess: float = 0.1, depth: float = 6.0) -> OccupancyGrid:
    """A hall of 20 m x ``depth``: leaves or niches in its upper wall, middles at ``places``; all else is unknown."""
    frame = GridFrame(RESOLUTION, -1.0, -1.0, round((depth + 5.0) / RESOLUTION), 440)
    cells = np.full(frame.shape, UNKNOWN, dtype=np.int8)

    def fill(x0: float, y0: float, x1: float, y1: float, value: int) -> None:
        col, row, to_col, to_row = (round((v + 1.0) / RESOLUTION) for v in (x0, y0, x1, y1))
        cells[row:to_row, col:to_col] = value

    fill(-SHOWN, -SHOWN, 20.0 + SHOWN, depth + SHOWN, OCCUPIED)
    fill(0.0, 0.0, 20.0, depth, FREE)
    for middle in places:
        low, high = middle - width / 2, middle + width / 2
        fill(low - SHOWN, depth, high + SHOWN, depth + recess + SHOWN, OCCUPIED)
        fill(low, depth, high, depth + recess, FREE)
    return OccupancyGrid(frame, cells)


@given(
    spacing=st.sampled_from([1.5, 1.8, 2.0, 3.0, 4.0]),
    width=st.sampled_from([0.75, 0.9, 1.1]),
    recess=st.sampled_from([0.05, 0.1, 0.15]),
    count=st.integers(3, 5),
)
@settings(max_examples=25, deadline=None)
def test_a_row_of_window_niches_scores_low(spacing: float, width: float, recess: float, count: int) -> None:
    grid = hall([1.5 + spacing * number for number in range(count)], width=width, recess=recess)
    proposals = propose_doors(grid, ProposalConfig(min_score=0.0))
    assert len(proposals) >= count
    assert max(proposal.score for proposal in proposals) <= 0.2
    assert propose_doors(grid) == ()


def test_windows_of_two_rooms_in_a_line_and_one_that_was_not_seen_are_a_row_too() -> None:
    uneven = hall([1.5, 3.1, 6.0, 7.6, 10.5, 12.1])
    assert propose_doors(uneven) == ()
    gap = hall([1.5, 4.5, 10.5, 13.5])
    assert propose_doors(gap) == ()


@pytest.mark.parametrize("spacing", [2.6, 3.5, 4.5])
def test_closed_doors_in_a_row_along_a_corridor_stay(spacing: float) -> None:
    places = [1.5 + spacing * number for number in range(4)]
    proposals = propose_doors(hall(places, depth=2.0))
    assert len(proposals) == 4
    assert min(proposal.score for proposal in proposals) > 0.8


def test_two_doors_and_doors_at_uneven_distances_of_a_hall_stay() -> None:
    assert len(propose_doors(hall([3.0, 6.0]))) == 2
    assert len(propose_doors(hall([3.0, 5.4, 9.5]))) == 3


@pytest.mark.parametrize(("behind", "proposed"), [(0.8, False), (1.6, True)])
def test_a_leaf_is_proposed_where_the_unknown_behind_it_has_room_for_a_room(behind: float, proposed: bool) -> None:
    grid = hall([10.0], depth=2.0)
    cells = grid.cells.copy()
    row = round((2.0 + 0.1 + 4.0 * RESOLUTION + behind + 1.0) / RESOLUTION)
    cells[row:] = FREE
    assert bool(propose_doors(OccupancyGrid(grid.frame, cells))) == proposed
    assert propose_doors(OccupancyGrid(grid.frame, cells), ProposalConfig(min_room=0.0))


def test_a_room_beside_the_leaf_counts_only_where_the_leaf_opens_into_it() -> None:
    """A shaft of 1 m behind the leaf; next to it there is room, but the door does not lead there."""
    grid = hall([10.0], depth=2.0)
    cells = grid.cells.copy()
    low, high = (round((10.0 + side + 1.0) / RESOLUTION) for side in (-0.5, 0.5))
    behind = round((2.0 + 0.3 + 1.0) / RESOLUTION)
    cells[behind:, low - 4 : low] = cells[behind:, high : high + 4] = FREE
    assert propose_doors(OccupancyGrid(grid.frame, cells)) == ()


@pytest.mark.parametrize("name", [field.name for field in fields(ProposalConfig)])
def test_every_setting_is_a_finite_number_of_at_least_nothing(name: str) -> None:
    for value in (-1e-9, -1.0, math.nan, math.inf):
        with pytest.raises(InvalidInputError, match=f"{name} .*expected a finite number of at least 0"):
            ProposalConfig(**{name: value})


def test_settings_are_taken_up_to_their_limits_and_refused_beyond() -> None:
    tiny = math.ulp(0.0)
    for good in (
        {"min_width": tiny}, {"max_width": 10.0}, {"min_width": 1.3}, {"max_width": 0.6}, {"min_recess": 0.0},
        {"max_recess": 10.0}, {"max_recess": 0.02}, {"min_recess": 0.2}, {"jamb": 10.0}, {"jamb": tiny},
        {"depth": 10.0}, {"depth": tiny}, {"min_score": 1.0}, {"min_unknown": 1.0}, {"min_score": 0.0},
        {"min_room": 0.0},
    ):  # fmt: skip
        ProposalConfig(**good)
    for wrong, line in (
        ({"min_width": 0.0}, "door widths from 0.0 to 1.3 m; expected 0 < min_width <= max_width <= 10.0"),
        ({"max_width": 10.001}, "door widths"), ({"min_width": 1.301}, "door widths"),
        ({"max_width": 0.599}, "door widths"),
        ({"max_recess": 10.001}, "recesses from 0.02 to 10.001 m; expected min_recess <= max_recess <= 10.0"),
        ({"max_recess": 0.019}, "recesses"), ({"jamb": 0.0}, "jamb 0.0 m, depth 0.6 m; expected above 0 to 10.0 m"),
        ({"depth": 0.0}, "jamb 0.3 m, depth 0.0 m"), ({"jamb": 10.001}, "jamb"), ({"depth": 10.001}, "jamb"),
        ({"min_score": 1.001}, "min_score 1.001, min_unknown 0.5; expected shares between 0 and 1"),
        ({"min_unknown": 1.001}, "min_score 0.5, min_unknown 1.001"),
    ):  # fmt: skip
        with pytest.raises(InvalidInputError, match=line):
            ProposalConfig(**wrong)


def test_candidates_look_at_the_cells_around_them_and_not_at_the_whole_map(monkeypatch: pytest.MonkeyPatch) -> None:
    whole = []
    for name in ("free", "occupied", "known", "unknown"):
        mask = getattr(OccupancyGrid, name).fget

        def look(grid: OccupancyGrid, mask: Callable[[OccupancyGrid], BoolArray] = mask) -> BoolArray:
            whole.append(grid)
            return mask(grid)

        monkeypatch.setattr(OccupancyGrid, name, property(look))
    one = corridor()
    propose_doors(one)
    looks = len(whole)
    whole.clear()
    # Every other one stands back: side by side in one line they would be a row of rooms.
    beside = np.concatenate([one.cells, np.roll(one.cells, 30, axis=0)] * 3, axis=1)
    six = OccupancyGrid(GridFrame(RESOLUTION, -5.0, -5.0, SIZE, 6 * SIZE), beside)
    assert len(propose_doors(six)) == 6
    assert len(whole) == looks
