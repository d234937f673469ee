"""What the sides and the place of a rectangle say, against counting by hand in tables drawn at random."""

import math

import numpy as np
import pytest

from closedrooms.predictor.best.door_frame import DoorFrame, Window, sum_up
from closedrooms.predictor.best.door_pose import FramedDoor
from closedrooms.predictor.best.evidence import Evidence
from closedrooms.predictor.best.features import FEATURES, score_rectangles
from closedrooms.predictor.best.rectangles import Rectangles

SIZE, THICKNESS = 240, 4
RNG = np.random.default_rng(0)
SIDES = ("left", "right", "top")
MASKS = {
    (name, side): RNG.random((SIZE, SIZE)) < share
    for name, share in (("closed", 0.3), ("sliver", 0.2), ("gap", 0.3), ("tight", 0.2), ("same", 0.05), ("outer", 0.02))
    for side in SIDES
}
ENCLOSED, TAKEN = RNG.random((SIZE, SIZE)) < 0.7, RNG.random((SIZE, SIZE)) < 0.1
KNOWN = RNG.random((SIZE, SIZE)) < 0.2
SEEN = {"width": np.linspace(0.0, 1.0, 100), "depth": np.linspace(1.0, 0.0, 60)}
# u0, v0, u1, v1: in the middle, wide, deep and partly beyond what is known, beyond the tables.
BOXES = np.array([[60, 50, 120, 110], [20, 50, 150, 100], [90, 50, 130, 220], [30, 50, 260, 120]])
FRONT = (4, 24)
CELL = 0.05


def _frame(known=KNOWN):
    ends = np.zeros((2, SIZE), dtype=np.int64)
    free = np.zeros_like(known)
    return DoorFrame(0.0, np.zeros(2), CELL, free, known, THICKNESS, ends, ends, Window(40, 30, 200, 180))


def _evidence():
    tables = {
        name: {side: sum_up(MASKS[name, side]) for side in SIDES}
        for name in ("closed", "sliver", "gap", "tight", "same", "outer")
    }
    return Evidence(**tables, enclosed=sum_up(ENCLOSED), taken=sum_up(TAKEN), seen=SEEN)


def _entry(**changes):
    usual = {"u": 100.0, "v": 46.0, "v0": 50, "left": None, "right": None, "row": 1, "front": (40, 170)}
    said = usual | changes
    return FramedDoor(**{"span": (said["u"], said["u"]), **said})


def _found(entry=None, boxes=BOXES, known=KNOWN):
    """Every feature by its name, shape (boxes,)."""
    _, measured = score_rectangles(_frame(known), _evidence(), entry or _entry(), boxes)
    return {feature.name: measured[:, column] for column, feature in enumerate(FEATURES)}


def _on(name, side, position, low, high):
    """Count along a side, as far as the tables go."""
    at = min(max(position, 0), SIZE - 1)
    return int(MASKS[name, side][max(low, 0) : max(high, 0), at].sum())


def _sides(box):
    """Name, position, ends and how far along each side is looked, of the two sides and of the back."""
    u0, v0, u1, v1 = box
    return ("right", u1, v0, v1, 400), ("left", u0, v0, v1, 400), ("top", v1, u0, u1, 800)


@pytest.mark.parametrize("name", ["closed", "sliver", "tight", "gap"])
def test_shares_of_sides_are_counted_along_them(name):
    found = _found()
    for number, box in enumerate(BOXES.tolist()):
        right, left, back = (_on(name, side, at, low, high) / (high - low) for side, at, low, high, _ in _sides(box))
        assert found[f"sides {name}"][number] == pytest.approx(right + left)
        assert found[f"back {name}"][number] == pytest.approx(back)


def test_a_side_is_free_where_it_is_neither_closed_nor_a_sliver():
    found = _found()
    for number, box in enumerate(BOXES.tolist()):
        right, left, back = (
            max(1.0 - (_on("closed", side, at, low, high) + _on("sliver", side, at, low, high)) / (high - low), 0.0)
            for side, at, low, high, _ in _sides(box)
        )
        assert found["sides free"][number] == pytest.approx(right + left)
        assert found["back free"][number] == pytest.approx(back)


def test_walls_in_line_make_a_side_sure_by_three_metres():
    found = _found()
    for number, box in enumerate(BOXES.tolist()):
        aligned, outer = [], []
        for side, at, low, high, reach in _sides(box):
            beyond = _on("same", side, at, low - reach, low) + _on("same", side, at, high, high + reach)
            aligned.append(1.0 - math.exp(-beyond * CELL / 3.0))
            outer.append(1.0 - math.exp(-_on("outer", side, at, low - reach, high + reach) * CELL / 3.0))
        assert found["sides aligned"][number] == pytest.approx(aligned[0] + aligned[1])
        assert found["back aligned"][number] == pytest.approx(aligned[2])
        assert found["sides outer"][number] == pytest.approx(outer[0] + outer[1])
        assert found["back outer"][number] == pytest.approx(outer[2])


def test_a_wall_that_begins_before_the_doors_wall_is_a_stub_and_two_make_a_passage():
    found = _found()
    for number, box in enumerate(BOXES.tolist()):
        right, left = (
            1.0 - math.exp(-(_on("same", side, at, low - 60, low) + _on("tight", side, at, low - 60, low)) * CELL / 0.5)
            for side, at, low, _, _ in _sides(box)[:2]
        )
        assert found["sides stub"][number] == pytest.approx(right + left)
        assert found["passage end"][number] == pytest.approx(right * left)


def test_size_and_proportion_are_logarithms():
    found = _found()
    for number, (u0, v0, u1, v1) in enumerate(BOXES.tolist()):
        width, depth = (u1 - u0) * CELL, (v1 - v0) * CELL
        taken = TAKEN[v0:v1, u0:u1].sum() * CELL**2
        log_area = math.log((width * depth - taken) / 25.0)
        assert found["log area"][number] == pytest.approx(log_area)
        assert found["log area squared"][number] == pytest.approx(log_area**2)
        assert found["log proportion squared"][number] == pytest.approx(math.log(width / depth) ** 2)
        assert found["log depth squared"][number] == pytest.approx(math.log(depth / 6.0) ** 2)
        assert found["overlap"][number] == pytest.approx(taken / (width * depth))


def test_what_lies_beyond_all_that_is_known_counts_more_the_larger_and_the_lonelier():
    lone, row, one = _found(), _found(_entry(row=3, left=60.0)), _found(_entry(right=160.0))
    for number, (u0, v0, u1, v1) in enumerate(BOXES.tolist()):
        area = (u1 - u0) * (v1 - v0)
        inside = max(min(u1, 180) - max(u0, 30), 0) * max(min(v1, 200) - max(v0, 40), 0)
        beyond, open_ = 1.0 - inside / area, 1.0 - ENCLOSED[v0:v1, u0:u1].sum() / area
        small = math.log((area - TAKEN[v0:v1, u0:u1].sum()) * CELL**2 / 4.0)
        assert lone["outside"][number] == pytest.approx(beyond)
        assert lone["open"][number] == pytest.approx(open_)
        assert lone["outside area"][number] == pytest.approx(beyond * max(small, 0.0))
        assert lone["open area"][number] == pytest.approx(open_ * max(small, 0.0))
        assert lone["lone outside"][number] == pytest.approx(beyond * small)
        assert row["outside area"][number] == pytest.approx(beyond * max(small, 0.0) / 3)
        assert row["open area"][number] == pytest.approx(open_ * max(small, 0.0) / 3)
        assert row["lone outside"][number] == one["lone outside"][number] == 0.0
    closet = _found(boxes=np.array([[170, 50, 200, 75]]))
    assert closet["lone outside"][0] < 0.0
    assert closet["outside area"][0] == closet["open area"][0] == 0.0


def test_a_door_nearer_than_six_tenths_of_a_metre_to_a_side_is_too_near():
    def margin(u, *span):
        return _found(_entry(u=u, **({"span": span} if span else {})), BOXES[:1])["door margin"][0]

    # The room reaches from 60 to 120 cells: 0.6 m are 12 of them.
    assert [margin(u) for u in (72.0, 108.0, 90.0)] == [0.0, 0.0, 0.0]
    assert [margin(u) for u in (70.0, 112.0, 58.0)] == pytest.approx([0.1, 0.2, 0.7])
    assert margin(90.0, 66.0, 105.0) == pytest.approx(0.3)
    assert margin(90.0, 75.0, 117.0) == pytest.approx(0.45)


def test_a_side_in_the_middle_to_the_next_door_counts_one():
    # Half the way from 100 to the next door, half a wall before it.
    def middle(box, **neighbours):
        return _found(_entry(**neighbours), np.array([box]))["sides middle"][0]

    assert middle([60, 50, 128, 110], right=160.0) == pytest.approx(1.0)
    assert middle([72, 50, 128, 110], left=40.0) == pytest.approx(1.0)
    assert middle([72, 50, 128, 110], left=40.0, right=160.0) == pytest.approx(2.0)
    assert middle([72, 50, 128, 110]) == 0.0
    # 0.4 m beside it, on either side, 1/e.
    for off in (-8, 8):
        assert middle([60, 50, 128 + off, 110], right=160.0) == pytest.approx(1 / math.e)
        assert middle([72 + off, 50, 128, 110], left=40.0) == pytest.approx(1 / math.e)
    # The last door of a room of two counts.
    assert middle([60, 50, 138, 110], right=160.0, span=(100.0, 120.0)) == pytest.approx(1.0)
    assert middle([62, 50, 138, 110], left=40.0, span=(80.0, 120.0)) == pytest.approx(1.0)


def test_near_rooms_and_back_walls_beside_are_counted():
    found = _found()
    for number, (u0, v0, u1, v1) in enumerate(BOXES.tolist()):
        near = _on("same", "top", v1, u0 - 160, u0) + _on("same", "top", v1, u1, u1 + 160)
        assert found["near aligned"][number] == pytest.approx(1.0 - math.exp(-near * CELL / 3.0))
        # From 1.5 m behind the door's wall to 0.4 m before the back, over 5 m to either side.
        columns = slice(v0 + 31, max(v1 - 7, v0 + 31))
        table = MASKS["outer", "top"]
        passed = table[max(u0 - 100, 0) : u0, columns].sum() + table[u1 : u1 + 100, columns].sum()
        assert found["sticks out"][number] == pytest.approx(1.0 - math.exp(-passed * CELL / 5 / 1.5))


def test_the_front_is_measured_over_the_width():
    found = _found(_entry(front=(70, 110)))
    for number, (u0, v0, u1, _) in enumerate(BOXES.tolist()):
        width, last = u1 - u0, min(u1, SIZE)
        strip = TAKEN[v0 + FRONT[0] : v0 + FRONT[1], u0:last].sum()
        assert found["front taken"][number] == pytest.approx(strip / (width * (FRONT[1] - FRONT[0])))
        before = KNOWN[50 - THICKNESS - 4 : 50, u0:last].any(axis=0).sum()
        assert found["front closed"][number] == pytest.approx(before / width)
        assert found["beyond front"][number] == pytest.approx((max(70 - u0, 0) + max(u1 - 110, 0)) / width)


def test_known_space_before_the_wall_counts_up_to_a_wall_and_its_slack():
    for row, share in ((42, 1.0), (41, 0.0), (49, 1.0), (50, 0.0)):
        known = np.zeros_like(KNOWN)
        known[row] = True
        assert _found(boxes=BOXES[:1], known=known)["front closed"][0] == share
    near = _found(_entry(v0=0), np.array([[60, 0, 120, 60]]), np.ones_like(KNOWN))
    assert near["front closed"][0] == 0.0


def test_usual_sizes_are_looked_up_by_cells():
    found = _found()
    assert found["width seen"] == pytest.approx(SEEN["width"][[60, 99, 40, 99]])
    assert found["depth seen"] == pytest.approx(SEEN["depth"][[59, 50, 59, 59]])


def test_a_score_is_the_sum_of_all_that_was_measured_by_its_weight():
    scores, measured = score_rectangles(_frame(), _evidence(), _entry(), BOXES)
    assert scores == pytest.approx([sum(f.weight * v for f, v in zip(FEATURES, row, strict=True)) for row in measured])
    assert len({feature.name for feature in FEATURES}) == len(FEATURES)
    whole = Rectangles(_frame(), _evidence(), _entry(), np.array([[60, 50, 61, 51]]))
    assert whole.area.tolist() == [CELL**2]
