import numpy as np
import pytest
import trimesh
from shapely.geometry import MultiPolygon, box

from closedrooms.worlds.extrusion import extrude
from closedrooms.worlds.geometry import wall_area
from closedrooms.worlds.library import load_world


@pytest.mark.parametrize("name", ["office-08", "school-04"])
def test_the_mesh_of_a_world_is_closed_and_holds_its_walls_volume(name: str) -> None:
    area = wall_area(load_world(name))
    vertices, triangles = extrude(area, height=2.5)
    mesh = trimesh.Trimesh(vertices, triangles, process=False)
    assert mesh.is_watertight
    assert mesh.volume == pytest.approx(2.5 * area.area, rel=1e-6)
    assert set(np.unique(vertices[:, 2]).round(9)) == {0.0, 2.5}


def test_the_mesh_of_a_ring_is_the_one_that_trimesh_makes() -> None:
    area = box(0, 0, 4, 4).union(box(3, 3, 6, 5)) - box(1, 1, 3, 3)
    ours = trimesh.Trimesh(*extrude(area, height=2.0))
    theirs = trimesh.creation.extrude_polygon(area, 2.0, engine="earcut")
    assert ours.is_watertight
    assert ours.is_winding_consistent
    assert ours.volume == pytest.approx(theirs.volume)
    assert ours.area == pytest.approx(theirs.area)
    assert len(ours.faces) == len(theirs.faces)


def test_holes_stay_open() -> None:
    vertices, triangles = extrude(box(0, 0, 4, 4) - box(1, 1, 3, 3), height=1.0)
    assert trimesh.Trimesh(vertices, triangles).volume == pytest.approx(12.0)


def test_no_area_gives_an_empty_mesh() -> None:
    vertices, triangles = extrude(MultiPolygon())
    assert vertices.shape == (0, 3)
    assert triangles.shape == (0, 3)
