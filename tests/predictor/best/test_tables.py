"""Tables of a door's frame, against looking at every edge by itself in maps drawn at random."""

import numpy as np
import pytest

from closedrooms.predictor.best.door_frame import TurnedMap, Window, door_frame, find_faces_in
from closedrooms.predictor.best.evidence import gather, rate_sizes

ROWS, COLS, THICKNESS = 150, 170, 4
FACE_DEPTH = 3
SIDES = ("right", "left", "top")


def _turned(seed=0, rows=ROWS, cols=COLS):
    """Blocks of free, occupied and unknown cells."""
    rng = np.random.default_rng(seed)
    kinds = np.kron(rng.integers(0, 3, (rows // 10, cols // 10)), np.ones((10, 10), dtype=np.int64))
    specks = rng.random(kinds.shape) < 0.01
    kinds[specks] = rng.integers(0, 3, int(specks.sum()))
    return TurnedMap(0.3, np.array([1.0, -2.0]), 0.05, kinds == 1, kinds >= 1)


FRAME = door_frame(_turned(), 0, THICKNESS)
WINDOW = Window(60, 40, 130, 120)
EVIDENCE = gather(FRAME, WINDOW, (70.0, 80.0), rate_sizes(FRAME))


def _behind(side, v, u, distance):
    """The cell so far behind an edge of a side, 1 for the next one; unknown outside."""
    row, col = {
        "right": (v, u + distance - 1), "left": (v, u - distance), "top": (v + distance - 1, u),
    }[side]  # fmt: skip
    inside = 0 <= row < ROWS and 0 <= col < COLS
    return bool(FRAME.known[row, col]) if inside else False, bool(FRAME.free[row, col]) if inside else False


def _first_known(side, v, u, most):
    return next((d for d in range(1, most + 1) if _behind(side, v, u, d)[0]), most + 1)


def _is_face(side, v, u):
    """Free space before the edge, none behind it, and an occupied cell within the depth of a face."""
    if not (0 <= v <= ROWS and 0 <= u <= COLS):
        return False
    free_before = _behind(side, v, u, 0)[1]
    behind = [_behind(side, v, u, d) for d in range(1, FACE_DEPTH + 1)]
    inside = {"right": u < COLS, "left": u > 0, "top": v < ROWS}[side]
    return inside and free_before and not behind[0][1] and any(known and not free for known, free in behind)


OPPOSITE = {"right": "left", "left": "right", "top": "bottom"}


def _is_far_face(side, v, u):
    """A face that looks away from the room: free space behind the edge, none before it."""
    row, col = {"right": (v, u), "left": (v, u - 1), "top": (v, u)}[side]
    if not (0 <= row < ROWS and 0 <= col < COLS):
        return False
    _, free = _behind(side, v, u, 1)
    before = [_behind(side, v, u, 1 - d) for d in range(1, FACE_DEPTH + 1)]
    return free and not before[0][1] and any(known and not is_free for known, is_free in before)


def _edges(side):
    """Edges in the middle of the tables, as (position, along, v, u)."""
    rng = np.random.default_rng(1)
    for _ in range(150):
        v, u = int(rng.integers(WINDOW.v0, WINDOW.v1)), int(rng.integers(72, 80))
        if side == "right":
            u = int(rng.integers(72, WINDOW.u1))
        elif side == "left":
            u = int(rng.integers(WINDOW.u0, 80))
        else:
            u = int(rng.integers(WINDOW.u0, WINDOW.u1))
        yield (v, u, v, u) if side == "top" else (u, v, v, u)


def _holds(table, position, along):
    return table.stretch(np.array([position]), np.array([along]), np.array([along + 1]))[0] == 1.0


@pytest.mark.parametrize("side", SIDES)
def test_known_space_behind_an_edge_is_right_behind_it_a_strip_or_a_gap_away(side):
    kinds = set()
    for position, along, v, u in _edges(side):
        first = _first_known(side, v, u, THICKNESS + 100)
        # Up to a wall and 0.2 m, 1.8 m, 5 m.
        expected = (
            first <= THICKNESS + 4,
            THICKNESS + 4 < first <= THICKNESS + 36,
            THICKNESS + 36 < first <= THICKNESS + 100,
        )
        got = tuple(_holds(getattr(EVIDENCE, name)[side], position, along) for name in ("closed", "sliver", "gap"))
        assert got == expected, (side, v, u)
        kinds.add(got)
    assert len(kinds) >= 2


@pytest.mark.parametrize("side", SIDES)
def test_faces_of_walls_count_a_few_cells_around(side):
    found = 0
    for position, along, v, u in _edges(side):
        step = {"right": (0, 1), "left": (0, 1), "top": (1, 0)}[side]
        sign = -1 if side == "left" else 1
        near = [_is_face(side, v + k * step[0], u + k * step[1]) for k in range(-2, 3)]
        assert _holds(EVIDENCE.same[side], position, along) == any(near), (side, v, u)
        # The far face of a wall stands its thickness further away.
        far = [
            _is_far_face(side, v + (k + sign * THICKNESS) * step[0], u + (k + sign * THICKNESS) * step[1])
            for k in range(-3, 4)
        ]
        assert _holds(EVIDENCE.tight[side], position, along) == any(far), (side, v, u)
        found += any(near)
    assert found


@pytest.mark.parametrize("side", SIDES)
def test_an_outer_wall_has_nothing_known_behind_it_for_four_metres(side):
    def outer(v, u):
        beyond = [_behind(side, v, u, d)[0] for d in range(5, 81)]
        return _is_face(side, v, u) and not any(beyond)

    step = {"right": (0, 1), "left": (0, 1), "top": (1, 0)}[side]
    for position, along, v, u in _edges(side):
        near = [outer(v + k * step[0], u + k * step[1]) for k in range(-2, 3)]
        assert _holds(EVIDENCE.outer[side], position, along) == any(near), (side, v, u)


def test_outer_walls_are_found_where_a_building_ends():
    known = np.zeros((120, 200), dtype=np.bool_)
    free = known.copy()
    free[20:60, 20:60] = True
    known[16:64, 16:64] = True
    frame = door_frame(TurnedMap(0.0, np.zeros(2), 0.05, free, known), 0, THICKNESS)
    found = gather(frame, Window(10, 10, 110, 190), (40.0, 40.0), {})
    # The wall's right face at column 60, widened by two cells; nothing else of that row.
    row = [_holds(found.outer["right"], position, 40) for position in range(42, 189)]
    assert np.flatnonzero(row).tolist() == [58 - 42, 59 - 42, 60 - 42, 61 - 42, 62 - 42]
    known[40, 60 + 80 - 1] = True
    frame = door_frame(TurnedMap(0.0, np.zeros(2), 0.05, free, known), 0, THICKNESS)
    found = gather(frame, Window(10, 10, 110, 190), (40.0, 40.0), {})
    assert not any(_holds(found.outer["right"], position, 40) for position in range(42, 189))
    assert _holds(found.outer["right"], 60, 41)


def test_cells_between_known_ones_are_enclosed_and_those_near_free_ones_taken():
    rows, cols = np.indices((ROWS, COLS))
    for v, u in np.random.default_rng(2).integers((60, 40), (130, 120), (200, 2)).tolist():
        one = np.array([v]), np.array([u]), np.array([v + 1]), np.array([u + 1])
        row, col = np.flatnonzero(FRAME.known[v]), np.flatnonzero(FRAME.known[:, u])
        inside = bool((row.size and row[0] <= u <= row[-1]) or (col.size and col[0] <= v <= col[-1]))
        assert EVIDENCE.enclosed.count(*one)[0] == inside
        near = FRAME.free & (np.maximum(np.abs(rows - v), np.abs(cols - u)) <= THICKNESS)
        assert EVIDENCE.taken.count(*one)[0] == near.any()


@pytest.mark.parametrize("quarter", range(4))
def test_a_frame_is_the_map_turned_by_right_angles(quarter):
    turned = _turned(3, 60, 90)
    frame = door_frame(turned, quarter, THICKNESS)
    rows, cols = np.nonzero(turned.free)
    points = turned.to_map(np.column_stack((cols, rows)) + 0.5)
    u, v = np.floor(frame.to_frame(points)).astype(int).T
    assert frame.free[v, u].all()
    assert frame.free.sum() == turned.free.sum()
    inward = frame.to_map(np.array([0.0, 1.0])) - frame.to_map(np.zeros(2))
    angle = turned.angle + quarter * np.pi / 2
    assert inward == pytest.approx(0.05 * np.array([-np.sin(angle), np.cos(angle)]))
    for row, (first, after) in enumerate(frame.row_ends.T.tolist()):
        known = np.flatnonzero(frame.known[row])
        assert (first, after) == ((known[0], known[-1] + 1) if known.size else (0, 0))
    for col, (first, after) in enumerate(frame.col_ends.T.tolist()):
        known = np.flatnonzero(frame.known[:, col])
        assert (first, after) == ((known[0], known[-1] + 1) if known.size else (0, 0))


def test_the_extent_of_a_frame_leaves_out_rows_and_columns_with_fewer_than_five_known_cells():
    known = np.zeros((60, 80), dtype=np.bool_)
    known[20:40, 30:50] = True
    known[45, 30:34] = True
    known[47, 35:40] = True
    known[20:24, 60] = True
    frame = door_frame(TurnedMap(0.0, np.zeros(2), 0.05, known, known), 0, THICKNESS)
    assert frame.extent == Window(20, 30, 48, 50)
    nothing = np.zeros_like(known)
    assert door_frame(TurnedMap(0.0, np.zeros(2), 0.05, nothing, nothing), 0, THICKNESS).extent == Window(0, 0, 0, 0)


def test_windows_grow_as_far_as_a_raster_goes_and_join():
    window = Window(10, 20, 30, 60)
    assert window.cells == 800
    assert window.grown(5, 7, (100, 200)) == Window(5, 13, 35, 67)
    assert window.grown(15, 25, (40, 70)) == Window(0, 0, 40, 70)
    assert window.joined(Window(5, 30, 20, 90)) == Window(5, 20, 30, 90)
    assert window.joined(Window(15, 10, 50, 40)) == Window(10, 10, 50, 60)
    assert np.zeros((100, 100))[window.of].shape == (20, 40)


def test_a_speck_of_known_space_in_front_of_a_face_is_no_wall():
    free = np.zeros((3, 12), dtype=np.bool_)
    free[:, :4] = True
    known = free.copy()
    known[0, 4], known[1, 6], known[2, 7] = True, True, True
    edges = find_faces_in(free, known, "right", Window(0, 0, 3, 12))
    assert np.argwhere(edges).tolist() == [[0, 4], [1, 4]]


@pytest.mark.parametrize(("width", "depth"), [(80, 60), (50, 100)])
def test_sizes_of_rooms_seen_are_usual_and_corridors_say_nothing(width, depth):
    free = np.zeros((400, 900), dtype=np.bool_)
    for number in range(3):
        free[100 : 100 + depth, 50 + number * 150 : 50 + number * 150 + width] = True
    # A corridor, 40 wide and 20 times as long.
    free[20:60, 20:820] = True
    known = np.zeros_like(free)
    known[:-4, :-4] |= free[4:, 4:]
    known[4:, 4:] |= free[:-4, :-4]
    known[:-4, 4:] |= free[4:, :-4]
    known[4:, :-4] |= free[:-4, 4:]
    frame = door_frame(TurnedMap(0.0, np.zeros(2), 0.05, free, known | free), 0, THICKNESS)
    rates = rate_sizes(frame)
    for name, usual in (("width", width), ("depth", depth)):
        rate = rates[name]
        assert len(rate) == 500
        assert int(rate.argmax()) == usual
        assert rate[usual] == pytest.approx(2 / 3, abs=0.01)
        assert (rate[[usual - 4, usual + 4]] > 0.1).all()
        assert rate[usual - 5] == rate[usual + 5] == 0.0
        # Symmetric, and falling with the distance.
        assert rate[usual - 4 : usual] == pytest.approx(rate[usual + 4 : usual : -1])
    assert rates["depth"][40] == 0.0
    # Counted by rows: three rooms as deep as they are; the kernel's middle, half of the largest and 1.
    smooth = 3 * depth * np.array([5, 4, 3, 2, 1]) / 5.0
    assert rates["width"][width : width + 5] == pytest.approx(smooth / (smooth + smooth[0] / 2 + 1.0))
