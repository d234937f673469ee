import numpy as np
import pytest
import shapely
import trimesh
from shapely.geometry import MultiPolygon, Polygon, box

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


def test_walls_are_as_high_as_rooms_are() -> None:
    vertices, _ = extrude(box(0, 0, 1, 1))
    assert vertices[:, 2].min() == 0.0
    # Above doors, which have 2.1 m, and below what needs a hall.
    assert 2.2 <= vertices[:, 2].max() <= 3.0


@pytest.mark.parametrize("clockwise", [False, True])
def test_every_face_of_a_prism_looks_outwards_whichever_way_its_rings_run(clockwise: bool) -> None:
    area = Polygon([(0, 0), (4, 0), (4, 3), (2, 1), (0, 3)], [[(1, 0.2), (1, 0.8), (3, 0.8), (3, 0.2)]])
    area = shapely.reverse(area) if clockwise else area
    for shape in (area, MultiPolygon([area, box(6, 0, 7, 1), Polygon()])):
        mesh = trimesh.Trimesh(*extrude(shape, height=1.5), process=False)
        assert mesh.is_watertight
        assert mesh.is_winding_consistent
        # Counted with their sense, the faces hold what the area does.
        assert mesh.volume == pytest.approx(1.5 * shape.area)
        level = np.abs(mesh.face_normals[:, 2]) > 0.5
        heights = mesh.triangles_center[level, 2]
        assert (np.sign(mesh.face_normals[level, 2]) == np.where(heights > 0.75, 1.0, -1.0)).all()
