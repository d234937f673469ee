import math
from dataclasses import replace
from itertools import pairwise

import pytest

from closedrooms.worlds.glazing import PANE, glazed
from closedrooms.worlds.plan import FloorPlan, Wall


def test_walls_are_cut_into_equal_panes_end_to_end(small: FloorPlan) -> None:
    odd = Wall("odd", ((1.0, 2.0), (4.0, 6.0)), 0.1, "glass")
    plan = replace(small, walls=(*small.walls, odd))
    after = glazed(plan, 0.5, 1)
    assert (after.rooms, after.doors, after.openings, after.name) == (plan.rooms, plan.doors, plan.openings, plan.name)
    panes = {wall.id: [] for wall in plan.walls}
    for pane in after.walls:
        name, _, number = pane.id.rpartition(".")
        assert int(number) == len(panes[name])
        panes[name].append(pane)
    for wall in plan.walls:
        length, own = math.dist(*wall.segment), panes[wall.id]
        assert len(own) == math.ceil(length / PANE)
        assert own[0].segment[0] == pytest.approx(wall.segment[0])
        assert own[-1].segment[1] == pytest.approx(wall.segment[1])
        for a, b in pairwise(own):
            assert a.segment[1] == pytest.approx(b.segment[0])
        assert [math.dist(*pane.segment) for pane in own] == pytest.approx([length / len(own)] * len(own))
        assert {pane.thickness for pane in own} == {wall.thickness}
        if wall.material == "glass":
            assert {pane.material for pane in own} == {"glass"}


def test_panes_are_as_long_as_glass_is_sold(small: FloorPlan) -> None:
    for length, count in ((0.1, 1), (2.0, 1), (2.1, 2), (7.9, 4)):
        wall = Wall("w", ((0.0, 0.0), (length, 0.0)), 0.1)
        assert len(glazed(replace(small, walls=(wall,)), 1.0, 0).walls) == count


@pytest.mark.parametrize("share", [0.1, 0.5, 0.9])
def test_as_large_a_share_as_asked_for_is_glass(small: FloorPlan, share: float) -> None:
    walls = tuple(Wall(f"w{n}", ((0.0, 0.1 * n), (4.0, 0.1 * n)), 0.1) for n in range(400))
    after = glazed(replace(small, walls=walls), share, 3)
    glass = sum(wall.material == "glass" for wall in after.walls)
    assert glass == pytest.approx(800 * share, abs=4 * math.sqrt(800 * share * (1 - share)))


def test_no_share_changes_nothing(small: FloorPlan) -> None:
    assert glazed(small, 0.0, 1) is small
    assert all(wall.material == "glass" for wall in glazed(small, 1.0, 1).walls)
