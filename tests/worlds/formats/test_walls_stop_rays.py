"""Walls of imported plans against the faces that rays hit in the simulation, and doors against the way through them."""

import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import shapely

from closedrooms.sim.building import building_solids
from closedrooms.sim.physics_world import PhysicsWorld
from closedrooms.sim.solids import upright
from closedrooms.worlds.extrusion import extrude
from closedrooms.worlds.geometry import WallAxes
from closedrooms.worlds.library import load_world
from closedrooms.worlds.plan import FloorPlan

pytestmark = pytest.mark.simulation

FIXTURES = Path(__file__).parents[2] / "fixtures"
WORLDS = [
    "office-04", "school-04", "kth_small.xml", "luperto_small.xml", "rmf_small.building.yaml:L1",
    "rmf_small.building.yaml:L2", "pyrobosim_small.yaml", "houseexpo_small.json",
]  # fmt: skip
# Rays start this far before a wall's face, at this height, this far apart along the wall [m].
BEFORE, HEIGHT, STEP = 0.04, 0.3, 0.3


@pytest.fixture(params=WORLDS)
def plan(request: pytest.FixtureRequest) -> FloorPlan:
    name = str(request.param)
    return load_world(name if "." not in name else str(FIXTURES / name))


@pytest.fixture
def physics(plan: FloorPlan) -> Iterator[PhysicsWorld]:
    vertices, triangles = extrude(building_solids(plan))
    with PhysicsWorld() as world:
        world.add_static(vertices, upright(vertices, triangles))
        yield world


def cast(physics: PhysicsWorld, start: np.ndarray, end: np.ndarray) -> float:
    """How far a ray gets [m]."""
    shares, _ = physics.cast(np.array([*start.tolist(), HEIGHT]), np.array([[*end.tolist(), HEIGHT]]))
    return float(shares[0]) * math.dist(start, end)


def test_rays_end_at_the_faces_of_every_wall(plan: FloorPlan, physics: PhysicsWorld) -> None:
    lines = WallAxes(plan)
    gaps = shapely.union_all([lines.gap(passage.segment) for passage in plan.passages]).buffer(0.01)
    solid = building_solids(plan)
    checked = 0
    for wall in plan.walls:
        a, b = np.array(wall.segment[0]), np.array(wall.segment[1])
        length = math.dist(a, b)
        u = (b - a) / length
        normal = np.array([-u[1], u[0]])
        for along in np.arange(0.05, length - 0.05, STEP):
            on = a + along * u
            for side in (1.0, -1.0):
                start = on + side * (wall.thickness / 2 + BEFORE) * normal
                if gaps.covers(shapely.Point(on)) or solid.covers(shapely.Point(start)):
                    continue
                # A wall that meets this one at an angle may be nearer.
                assert cast(physics, start, on) < BEFORE + 2e-3, (wall.id, along)
                checked += 1
    assert checked > 50


def test_rays_pass_every_door_and_opening_between_rooms_from_one_to_the_other(
    plan: FloorPlan, physics: PhysicsWorld
) -> None:
    lines = WallAxes(plan)
    rooms = {room.id: room.polygon for room in plan.rooms}
    assert plan.passages or plan.name.endswith("L2")
    for passage in plan.passages:
        a, b = np.array(passage.segment[0]), np.array(passage.segment[1])
        u = (b - a) / math.dist(a, b)
        normal = np.array([-u[1], u[0]])
        depth = (lines.thickness(passage.segment) or 0.0) / 2 + 0.1
        for share in (0.05, 0.5, 0.95):
            on = a + share * (b - a)
            left, right = on + depth * normal, on - depth * normal
            assert cast(physics, left, right) == pytest.approx(2 * depth, abs=1e-3), passage.id
            sides = {name for name in rooms for end in (left, right) if rooms[name].distance(shapely.Point(end)) < 0.1}
            assert {side for side in passage.rooms if side} <= sides
