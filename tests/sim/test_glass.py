"""Panes of glass: the share of beams that they return, and where they stand."""

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from shapely.geometry import box

from closedrooms.sim.glass import SEEN, UNSEEN, comes_back, glass_area
from closedrooms.worlds.plan import FloorPlan, PlanRoom, Wall


@given(st.floats(0.0, 90.0), st.floats(0.0, 0.999))
def test_a_beam_comes_back_below_ten_degrees_never_above_twenty_and_evenly_less_between(
    degrees: float, draw: float
) -> None:
    share = min(max((20.0 - degrees) / 10.0, 0.0), 1.0)
    if abs(draw - share) > 1e-9:
        assert comes_back(np.array([math.radians(degrees)]), np.array([draw]))[0] == (draw < share)


def test_lidars_see_glass_near_its_normal_alone() -> None:
    assert 0.0 < SEEN < UNSEEN < math.pi / 2


def hall(*materials: str) -> FloorPlan:
    """Two walls that cross at right angles at (2, 0) and a third apart, 0.2 m thick, of some materials."""
    segments = (((0.0, 0.0), (4.0, 0.0)), ((2.0, -2.0), (2.0, 2.0)), ((0.0, 3.0), (4.0, 3.0)))
    walls = tuple(Wall(f"w{i}", s, 0.2) for i, s in enumerate(segments))
    walls = tuple(dataclasses.replace(w, material=m) for w, m in zip(walls, materials, strict=True))  # type: ignore[arg-type]
    return FloorPlan("hall", (PlanRoom("r0", "hall", box(0, -2, 4, 3)),), walls, ())


LEVEL, UPRIGHT, APART = box(0, -0.1, 4, 0.1), box(1.9, -2, 2.1, 2), box(0, 2.9, 4, 3.1)


@pytest.mark.parametrize(
    ("materials", "panes"),
    [
        (("solid", "solid", "solid"), box(0, 0, 0, 0)),
        (("glass", "solid", "solid"), LEVEL - UPRIGHT),
        (("solid", "glass", "solid"), UPRIGHT - LEVEL),
        (("solid", "solid", "glass"), APART),
        (("glass", "glass", "solid"), LEVEL | UPRIGHT),
        (("glass", "glass", "glass"), LEVEL | UPRIGHT | APART),
    ],
)
def test_glass_is_what_no_other_wall_holds(materials: tuple[str, ...], panes: box) -> None:
    solid = LEVEL | UPRIGHT | APART
    found = glass_area(hall(*materials), solid)
    assert found.symmetric_difference(panes).area < 1e-4
    # Of walls that a door is cut out of, what stands is glass.
    door = box(0.5, -1, 1.5, 4)
    assert glass_area(hall(*materials), solid - door).symmetric_difference(panes - door).area < 1e-4
