"""Meshes as the physics take them: what stands of them, and how much they hold."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from shapely.geometry import Polygon, box

from closedrooms.sim.solids import MovingPart, upright, volume
from closedrooms.worlds.extrusion import extrude

SHAPES = [
    box(1.0, 2.0, 1.9, 2.05),
    Polygon([(0, 0), (4, 0), (4, 3)]),
    Polygon([(3, 1), (6, 1), (6, 5), (4, 2), (3, 4)]),
]


@pytest.mark.parametrize("area", SHAPES)
def test_of_a_prism_its_sides_are_kept_and_its_floor_and_ceiling_are_not(area: Polygon) -> None:
    vertices, triangles = extrude(area, height=2.0)
    kept = upright(vertices, triangles)
    # Two triangles for each side.
    assert len(kept) == 2 * (len(area.exterior.coords) - 1)
    assert (np.ptp(vertices[kept][:, :, 2], axis=1) == 2.0).all()
    left = {tuple(triangle) for triangle in triangles.tolist()} - {tuple(triangle) for triangle in kept.tolist()}
    assert all(np.ptp(vertices[list(triangle), 2]) == 0.0 for triangle in left)


@given(st.floats(0.0, 90.0), st.floats(0.1, 100.0))
def test_a_face_stands_from_sixty_degrees_on_however_large_it_is(slope: float, size: float) -> None:
    c, s = np.cos(np.radians(slope)), np.sin(np.radians(slope))
    vertices = size * np.array([(0.0, 0.0, 0.0), (0.0, 1.0, 0.0), (c, 0.0, s)])
    triangles = np.array([(0, 1, 2), (2, 1, 0)])
    if abs(slope - 60.0) > 1e-3:
        assert len(upright(vertices, triangles)) == (2 if slope > 60.0 else 0)


@given(
    st.sampled_from(SHAPES),
    st.floats(0.1, 3.0),
    st.tuples(st.floats(-50, 50), st.floats(-50, 50)),
    st.booleans(),
)
def test_the_volume_is_floor_area_times_height_wherever_it_stands(
    area: Polygon, height: float, at: tuple[float, float], only_sides: bool
) -> None:
    vertices, triangles = extrude(area, height=height)
    vertices = vertices + np.array([*at, 0.0])
    if only_sides:
        triangles = upright(vertices, triangles)
    part = MovingPart(vertices, triangles, False, (0.0, 0.0, 0.0), (0.0, 0.0, 1.0))
    assert volume(part) == pytest.approx(area.area * height, rel=1e-6)
