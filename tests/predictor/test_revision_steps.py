"""The steps of a revision on small maps, each against cells that are counted by hand or one by one."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.ndimage import distance_transform_edt
from shapely.geometry import Polygon, box

from closedrooms.core.door import ClosedDoor
from closedrooms.core.grid import FREE, OCCUPIED, UNKNOWN, GridFrame, OccupancyGrid
from closedrooms.core.room import Alternative, Room
from closedrooms.predictor.inpainting import inpaint
from closedrooms.predictor.prediction import Prediction
from closedrooms.predictor.revision import (
    _assign_parts,
    _cut_known,
    _find_nearest,
    _find_new_parts,
    _find_observed,
    _find_room,
    _make_square,
    _open_doorways,
    _prepare,
    _Scene,
    _trace_largest,
    update,
)

CELL = 0.125  # exact in binary: 64 cells a square metre
ROWS, COLS = 40, 60
FRAME = GridFrame(CELL, 0.0, 0.0, ROWS, COLS)


def _mask(*boxes):
    """Cells of some boxes ``row, col, rows, cols``."""
    mask = np.zeros(FRAME.shape, dtype=np.bool_)
    for row, col, rows, cols in boxes:
        mask[row : row + rows, col : col + cols] = True
    return mask


NONE = _mask()


def _grid(free=NONE, occupied=NONE):
    cells = np.full(FRAME.shape, UNKNOWN, dtype=np.int8)
    cells[free], cells[occupied] = FREE, OCCUPIED
    return OccupancyGrid(FRAME, cells)


def _scene(*, before=None, now=None, masks=(), thresholds=None, own=None, doorways=NONE):
    rooms = [Room(Polygon(), (f"d{i}",)) for i in range(len(masks))]
    nothing = [NONE] * len(masks)
    return _Scene(
        FRAME, before or _grid(), now or _grid(), rooms, list(masks), list(thresholds or nothing), list(own or nothing),
        doorways,
    )  # fmt: skip


def test_new_parts_are_free_cells_that_were_unknown_or_predicted_outside_of_doorways():
    room = _mask((10, 10, 10, 10))
    # Before: free below row 5, and what was predicted was drawn in as free.
    before = _grid(free=_mask((0, 0, 5, 60)) | room)
    now = _grid(free=_mask((0, 0, 5, 60), (10, 10, 10, 10), (10, 30, 3, 3)))
    scene = _scene(before=before, now=now, masks=[room], doorways=_mask((10, 10, 2, 10)))
    parts = _find_new_parts(scene)
    assert (parts > 0).tolist() == _mask((12, 10, 8, 10), (10, 30, 3, 3)).tolist()
    assert parts[15, 15] != parts[11, 31]
    assert set(np.unique(parts)) == {0, 1, 2}
    # Of several rooms all are looked at.
    more = _find_new_parts(_scene(before=before, now=now, masks=[NONE, room]))
    assert (more > 0)[10:20, 10:20].all()


def test_what_is_narrower_than_three_cells_is_no_part_and_parts_meet_at_sides_not_at_corners():
    strips = _mask((5, 5, 2, 20), (10, 5, 3, 20))
    parts = _find_new_parts(_scene(now=_grid(free=strips)))
    assert (parts > 0).tolist() == _mask((10, 5, 3, 20)).tolist()
    parts = _find_new_parts(_scene(now=_grid(free=_mask((5, 5, 4, 4), (9, 9, 4, 4)))))
    assert len(np.unique(parts)) == 3
    parts = _find_new_parts(_scene(now=_grid(free=_mask((5, 5, 4, 4), (8, 8, 4, 4)))))
    assert len(np.unique(parts)) == 2


def test_the_nearest_prediction_and_how_far_it_is():
    masks = [_mask((10, 10, 5, 5)), NONE, _mask((10, 30, 5, 5))]
    nearest, distance = _find_nearest(_scene(masks=masks))
    assert (nearest[masks[0]] == 0).all()
    assert (nearest[masks[2]] == 2).all()
    assert distance[12, 10:15].tolist() == [0.0] * 5
    assert [nearest[12, col] for col in (21, 22, 23)] == [0, 0, 2]  # 22 is 8 from both
    exact = np.minimum(*(distance_transform_edt(~masks[i]) for i in (0, 2)))
    np.testing.assert_allclose(distance, exact, rtol=0.03, atol=0.01)
    nearest, distance = _find_nearest(_scene(masks=[NONE]))
    assert (nearest == -1).all()
    assert np.isinf(distance).all()


@given(seed=st.integers(0, 10_000))
@settings(max_examples=40)
def test_a_part_belongs_to_the_rooms_behind_whose_doors_it_is_else_to_the_nearest(seed):
    rng = np.random.default_rng(seed)
    parts = np.zeros(FRAME.shape, dtype=np.int32)
    for number in range(1, 6):
        row, col = rng.integers(0, (ROWS - 8, COLS - 8))
        parts[row : row + 8, col : col + 8] = number
    rooms = 3

    def scattered(size):
        row, col = rng.integers(0, (ROWS - size, COLS - size))
        return _mask((row, col, size, size))

    masks = [scattered(6) for _ in range(rooms)]
    thresholds = [scattered(9) if rng.random() < 0.8 else NONE for _ in range(rooms)]
    scene = _scene(masks=masks, thresholds=thresholds)
    nearest, distance = _find_nearest(scene)
    expected = np.full(FRAME.shape, -1)
    for number in set(np.unique(parts).tolist()) - {0}:
        part = parts == number
        behind = [i for i in range(rooms) if (thresholds[i] & part).any()]
        # 0.6 m are 4.8 cells.
        near = (distance[part] <= 4.8).any()
        for row, col in np.argwhere(part):
            at = int(nearest[row, col])
            if len(behind) == 1:
                expected[row, col] = behind[0]
            elif (behind and at in behind) or (not behind and near):
                expected[row, col] = at
    assert np.array_equal(_assign_parts(scene, parts), expected)


def test_a_part_nearly_six_tenths_of_a_metre_away_belongs_to_a_room_and_a_further_one_to_none():
    parts = _mask((10, 10, 5, 5)).astype(np.int32)
    for gap, owner in ((3, 0), (4, -1)):
        # The first cell of the mask is gap + 1 cells from the last of the part: 4 cells are 0.5 m, 5 are 0.625 m.
        found = _assign_parts(_scene(masks=[_mask((10, 15 + gap, 5, 5))]), parts)
        assert set(found[parts > 0].tolist()) == {owner}
        assert (found[parts == 0] == -1).all()
    assert (_assign_parts(_scene(masks=[NONE]), np.zeros(FRAME.shape, dtype=np.int32)) == -1).all()


def test_a_room_counts_as_looked_into_from_half_a_square_metre_on():
    for size, seen in (((4, 8), True), ((3, 10), False), ((3, 11), True)):
        region = _mask((10, 10, *size))
        (found,) = _find_observed(_scene(now=_grid(free=region), masks=[_mask((8, 8, 20, 20))]))
        assert np.array_equal(found, region if seen else NONE)


@pytest.mark.parametrize(
    ("resolution", "cells"), [(0.05, 7), (0.06, 5), (0.1, 3), (0.15, 3), (0.2, 1), (0.3, 1), (0.03, 11), (0.5, 1)]
)
def test_squares_close_gaps_and_are_odd(resolution, cells):
    square = _make_square(0.30, GridFrame(resolution, 0.0, 0.0, 4, 4))
    assert square.shape == (cells, cells)
    assert (square == 1).all()


def test_a_prediction_goes_on_from_what_was_seen_of_it_to_the_next_wall():
    room = _mask((10, 10, 12, 30))
    seen = _mask((10, 10, 12, 8))
    assert np.array_equal(_find_room(_scene(masks=[room]), seen, 0), room)
    # A wall across, of single hits two cells apart, ends it.
    hits = np.zeros_like(room)
    hits[8:24:2, 25] = True
    found = _find_room(_scene(now=_grid(occupied=hits), masks=[room]), seen, 0)
    assert np.array_equal(found, _mask((10, 10, 12, 15)))
    # A gap of half a metre in a wall leads on.
    wall = _mask((8, 25, 6, 1), (18, 25, 6, 1))
    found = _find_room(_scene(now=_grid(occupied=wall), masks=[room]), seen, 0)
    assert found[12, 35]
    assert not found[12, 25]


def test_strips_of_a_prediction_and_what_does_not_touch_what_was_seen_are_left_out():
    # A strip of two cells along the top, a piece of its own, and a wall through what was seen itself.
    room = _mask((10, 10, 10, 10), (20, 10, 2, 30), (30, 30, 5, 5))
    seen = _mask((10, 10, 10, 10), (12, 5, 4, 5))
    wall = _mask((14, 10, 1, 3))
    found = _find_room(_scene(now=_grid(occupied=wall), masks=[room]), seen, 0)
    expected = _mask((10, 10, 12, 10), (12, 5, 4, 5))
    assert np.array_equal(found & ~_mask((20, 10, 2, 30)), expected & ~_mask((20, 10, 2, 30)))
    assert not found[20:22, 22:].any()
    assert not found[30:, 30:].any()
    # It reads the mask of its own room.
    assert np.array_equal(_find_room(_scene(masks=[room, seen]), seen, 1), seen)


@pytest.mark.parametrize(("hits", "cut"), [(9, False), (10, True)])
def test_a_prediction_is_cut_from_two_parts_in_a_hundred_on(hits, cut):
    room = Room(box(0.0, 0.0, 1.0, 1.0), ("d0",))
    mask = _mask((10, 10, 10, 50))
    occupied = _mask((10, 10, 1, hits))
    scene = _scene(now=_grid(occupied=occupied), masks=[mask])
    shape = _cut_known(scene, [NONE], 0, room)
    if not cut:
        assert shape is room.polygon
        return
    # A cell around the hits goes too: one row above and a column beside them. Outlines cut corners of a cell.
    left = box(10 * CELL, 10 * CELL, 60 * CELL, 20 * CELL).difference(box(0, 0, (11 + hits) * CELL, 12 * CELL))
    assert shape.symmetric_difference(left).area < CELL**2
    # What was occupied before is no news.
    known = _scene(before=_grid(occupied=occupied), now=_grid(occupied=occupied), masks=[mask])
    assert _cut_known(known, [NONE], 0, room) is room.polygon


def test_what_was_seen_of_another_room_is_cut_from_a_prediction_and_its_own_is_not():
    room = Room(box(0.0, 0.0, 1.0, 1.0), ("d0",))
    masks, region = [_mask((10, 10, 10, 20))] * 2, _mask((10, 10, 10, 5))
    scene = _scene(masks=masks)
    assert _cut_known(scene, [region, NONE], 0, room) is room.polygon
    shape = _cut_known(scene, [NONE, region], 0, room)
    assert shape.symmetric_difference(box(16 * CELL, 10 * CELL, 30 * CELL, 20 * CELL)).area < 1e-9
    assert _cut_known(scene, [NONE, masks[0]], 0, room) is None


def test_the_largest_part_of_a_mask_is_traced_along_its_cells_without_holes():
    assert _trace_largest(NONE, FRAME) is None
    assert _trace_largest(_mask((10, 10, 1, 1)), FRAME) is None
    assert _trace_largest(_mask((10, 10, 1, 9)), FRAME) is None
    for low, left, rows, cols in ((10, 10, 6, 9), (3, 20, 20, 3), (10, 10, 2, 2)):
        shape = _trace_largest(_mask((low, left, rows, cols)), FRAME)
        whole = box(left * CELL, low * CELL, (left + cols) * CELL, (low + rows) * CELL)
        assert shape.symmetric_difference(whole).area < 1e-9
    large = _mask((10, 10, 10, 10)) & ~_mask((14, 14, 3, 3))
    shape = _trace_largest(large | _mask((30, 30, 5, 5)), FRAME)
    assert shape.symmetric_difference(box(10 * CELL, 10 * CELL, 20 * CELL, 20 * CELL)).area < 1e-9
    # A gap of four cells is closed, one of five is not.
    for gap, whole in ((4, True), (5, False)):
        both = _trace_largest(_mask((10, 10, 12, 10), (10, 20 + gap, 12, 9)), FRAME)
        assert (both.bounds[2] == pytest.approx((29 + gap) * CELL)) == whole


def test_doorways_are_open_where_the_prediction_had_opened_them_or_a_room_was_seen_behind():
    doorways = [_mask((10, 10, 2, 4)), _mask((10, 20, 2, 4)), _mask((10, 30, 2, 4))]
    scene = _scene(
        before=_grid(free=doorways[0]), masks=[NONE] * 3, own=doorways, doorways=doorways[0] | doorways[1] | doorways[2]
    )
    walls = OccupancyGrid(
        FRAME.cropped(-2, -3, ROWS + 4, COLS + 5), np.full((ROWS + 4, COLS + 5), OCCUPIED, dtype=np.int8)
    )
    opened = _open_doorways(walls, scene, [NONE, _mask((20, 20, 3, 3)), NONE])
    assert opened.frame == walls.frame
    assert np.array_equal(opened.on(FRAME).free, doorways[0] | doorways[1])
    assert (opened.occupied | opened.free).all()
    assert opened.free.sum() == 16


DOORS = (
    ClosedDoor("a", (2.0, 1.0), ((1.5, 1.0), (2.5, 1.0)), 1.0),
    ClosedDoor("b", (5.0, 1.0), ((4.5, 1.0), (5.5, 1.0)), 1.0),
)


def test_a_scene_holds_rooms_doors_and_thresholds_on_one_frame():
    room = Room(box(1.0, 1.0, 3.0, 3.0), ("a",))
    grid = _grid(free=_mask((0, 0, 8, 60)))
    small = grid.on(FRAME.cropped(4, 4, 20, 30))
    scene = _prepare(Prediction(small, (room,)), grid, DOORS)
    assert scene.frame == FRAME
    assert scene.now is grid
    assert np.array_equal(scene.before.cells, small.on(FRAME).cells)
    # A door without a room has one without floor.
    assert [r.doors for r in scene.rooms] == [("a",), ("b",)]
    assert np.array_equal(scene.masks[0], _mask((8, 8, 16, 16)))
    assert not scene.masks[1].any()
    # From x = 1.5 to 2.5: columns 12 to 19; 0.35 m are cells whose centre is so near: rows 6 to 10 from 0.65 to 1.35 m.
    for number, first in ((0, 12), (1, 36)):
        near = np.abs((np.arange(ROWS) + 0.5) * CELL - 1.0)
        for masks, reach in ((scene.own_doorways, 0.35), (scene.thresholds, 0.5)):
            expected = np.zeros(FRAME.shape, dtype=np.bool_)
            expected[near < reach, first : first + 8] = True
            assert np.array_equal(masks[number], expected)
    assert np.array_equal(scene.doorways, scene.own_doorways[0] | scene.own_doorways[1])


def _corridor():
    """Free below y = 0.875, a wall of two cells with the leaves of both doors, unknown above."""
    return _grid(free=_mask((0, 0, 7, 60)), occupied=_mask((7, 0, 2, 60)))


OTHER = (Alternative(box(0, 0, 1, 1), 0.5),)
FIRST = Room(box(1.0, 1.125, 3.0, 3.5), ("a",), "independent", 2.0, confidence=0.5, alternatives=OTHER)
SECOND = Room(box(4.0, 1.125, 6.0, 3.5), ("b",), "independent", 1.0, confidence=0.5, alternatives=OTHER)


def _predicted(*rooms, failures=None):
    grid = inpaint(_corridor(), [room.polygon for room in rooms], [box(1.6, 0.8, 2.4, 1.4)])
    return Prediction(grid, rooms, failures or {})


def _seen(*boxes):
    """The corridor, with boxes free behind doors that stand open."""
    cells = _corridor().cells.copy()
    for row, col, rows, cols in boxes:
        ring = cells[row - 2 : row + rows + 2, col - 2 : col + cols + 2]
        ring[ring == UNKNOWN] = OCCUPIED
        cells[row : row + rows, col : col + cols] = FREE
    return OccupancyGrid(FRAME, cells)


def test_an_observed_room_is_no_guess_any_more_and_the_other_stays_as_it_was():
    after = update(_predicted(FIRST, SECOND), _seen((9, 8, 10, 16)), doors=DOORS)
    first, second = after.rooms
    assert first.polygon.symmetric_difference(box(1.0, 1.125, 3.0, 2.375)).area < 1e-9
    assert (first.confidence, first.alternatives) == (None, ())
    assert (first.kind, first.score, first.doors) == ("independent", 2.0, ("a",))
    assert second == SECOND
    assert after.failures == {}
    # Where a room was seen its doorway is open, and so is that which the prediction had opened; that of b is not.
    assert after.grid.on(FRAME).free[7:9, 12:20].all()
    assert after.grid.on(FRAME).occupied[7:9, 36:44].all()


def test_reasons_are_kept_for_doors_without_a_room_and_dropped_for_those_with_one():
    before = _predicted(FIRST, failures={"b": "why", "c": "other"})
    assert update(before, _corridor(), doors=DOORS).failures == {"b": "why", "c": "other"}
    after = update(before, _seen((9, 32, 10, 16)), doors=DOORS)
    assert after.failures == {"c": "other"}
    assert [room.doors for room in after.rooms] == [("a",), ("b",)]
    # But for its doorway, two rows of which lie in the room.
    seen = box(4.0, 1.125, 6.0, 2.375).difference(box(4.5, 1.125, 5.5, 1.375))
    assert after.rooms[1].polygon.symmetric_difference(seen).area < 2 * CELL**2
    # All wall: of a predicted room there is a reason, of one that was not predicted there is no new one.
    cells = _corridor().cells.copy()
    cells[9:] = OCCUPIED
    walls = OccupancyGrid(FRAME, cells)
    gone = "there is no room where one was predicted"
    assert update(_predicted(FIRST), walls, doors=DOORS).failures == {"a": gone}
    assert update(before, walls, doors=DOORS).failures == {"a": gone, "b": "why", "c": "other"}


@pytest.mark.parametrize(("cols", "kept"), [(8, True), (7, False)])
def test_what_is_left_of_a_room_is_one_from_half_a_square_metre_on(cols, kept):
    # All of a room is wall now but for 6 x 10 cells, of which a cell beside the walls goes too: 4 x 8 are 0.5 m2.
    cells = _corridor().cells.copy()
    cells[9:] = OCCUPIED
    cells[12:18, 11 : 11 + cols + 2] = UNKNOWN
    after = update(_predicted(FIRST), OccupancyGrid(FRAME, cells), doors=DOORS)
    assert bool(after.rooms) == kept
    if kept:
        assert after.rooms[0].polygon.area == pytest.approx(0.5)


def test_rooms_that_nobody_has_looked_into_are_predicted_again_on_what_is_known():
    asked = []
    again = Room(box(3.5, 1.125, 6.5, 3.0), ("b",), "dependent", 7.0)

    def predictor(grid, doors):
        asked.append((grid, doors))
        return Prediction(grid, (again, Room(box(1.0, 1.0, 2.0, 2.0), ("x",))))

    seen = _seen((9, 8, 10, 16))
    after = update(_predicted(FIRST, SECOND), seen, doors=DOORS, predictor=predictor)
    ((grid, doors),) = asked
    assert doors == [DOORS[1]]
    # The map with the observed room drawn in.
    assert np.array_equal(grid.cells, inpaint(seen, [after.rooms[0].polygon], []).cells)
    assert after.rooms[1] == again
    assert [room.doors for room in after.rooms] == [("a",), ("b",)]
    # A door that has no room yet gets one.
    after = update(_predicted(FIRST, failures={"b": "why"}), seen, doors=DOORS, predictor=predictor)
    assert after.rooms[1] == again
    assert after.failures == {}
    # Nothing to ask where nothing was looked into, or where all was.
    asked.clear()
    assert update(_predicted(FIRST, SECOND), _corridor(), doors=DOORS, predictor=predictor).rooms == (FIRST, SECOND)
    update(_predicted(FIRST), seen, doors=DOORS[:1], predictor=predictor)
    assert asked == []


def test_a_room_that_is_not_found_again_stays_as_it_was():
    seen = _seen((9, 8, 10, 16))
    after = update(_predicted(FIRST, SECOND), seen, doors=DOORS, predictor=lambda grid, _: Prediction(grid, ()))
    assert after.rooms[1] == SECOND


def test_what_was_observed_gives_way_to_no_prediction():
    # The new prediction of b reaches into a, with a better score.
    wide = Room(box(2.0, 1.125, 6.0, 3.5), ("b",), "dependent", 99.0)
    seen = _seen((9, 8, 10, 16))
    after = update(_predicted(FIRST, SECOND), seen, doors=DOORS, predictor=lambda grid, _: Prediction(grid, (wide,)))
    assert after.rooms[0].polygon.area == pytest.approx(2.0 * 1.25)
    assert after.rooms[1].polygon.intersection(after.rooms[0].polygon).area < 1e-9
