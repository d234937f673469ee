"""A plan as bodies: what stands where, how high, of what, and which doors there are."""

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
import shapely
from shapely.geometry import MultiPolygon, Point, box

from closedrooms.core.errors import InvalidInputError
from closedrooms.sim.building import FURNITURE_HEIGHT, Building, building_solids, gap_from
from closedrooms.sim.config import SimConfig, noise_level
from closedrooms.sim.contacts import distance
from closedrooms.sim.physics_world import PhysicsWorld
from closedrooms.worlds.geometry import wall_area
from closedrooms.worlds.plan import FloorPlan

CONFIG = SimConfig(noise=noise_level("none"))


@pytest.fixture
def physics() -> Iterator[PhysicsWorld]:
    with PhysicsWorld() as physics:
        yield physics


def test_doors_and_openings_to_the_outside_are_shut_and_inner_ones_are_not(plan: FloorPlan) -> None:
    solids, walls = building_solids(plan), wall_area(plan)
    shut = solids.difference(walls)
    # The entrance of 1 m and the way out of 1.5 m, in walls of 0.16 m.
    assert shut.area == pytest.approx(0.16 * (1.0 + 1.5), rel=1e-3)
    assert solids.covers(Point(3.5, 0.0))
    assert solids.covers(Point(12.0, 2.0))
    assert not solids.intersects(Point(1.95, 4.0))
    inside = replace(plan, doors=plan.doors[:3], openings=())
    assert building_solids(inside).equals(wall_area(inside))


def met(physics: PhysicsWorld, a: tuple[float, float], b: tuple[float, float], z: float) -> tuple[float, int]:
    """How far a ray from a to b goes [m], and what it meets."""
    fractions, bodies = physics.cast(np.array([*a, z]), np.array([[*b, z]]))
    return float(fractions[0]) * math.dist(a, b), int(bodies[0])


def test_furniture_is_as_high_as_tables_are_and_walls_as_rooms(plan: FloorPlan, physics: PhysicsWorld) -> None:
    building = Building(plan, [], CONFIG, physics)
    # The desk from y = 7.5 to 8.3, and the wall behind it, whose face is at 8.92.
    for z, y in ((0.05, 7.5), (0.69, 7.5), (0.8, 8.92), (2.0, 8.92)):
        assert met(physics, (1.0, 6.0), (1.0, 12.0), z)[0] == pytest.approx(y - 6.0, abs=1e-4)
    assert met(physics, (1.0, 6.0), (1.0, 12.0), 2.6)[1] == -1
    assert 0.7 < FURNITURE_HEIGHT < 0.8
    # The robot meets it as an edge.
    near = building.obstacles.near(1.0, 7.4)
    assert distance(1.0, 7.4, near) == pytest.approx(0.1)
    assert building.solids.covers(Point(1.0, 8.0))


def test_panes_are_glass_and_the_rest_of_the_walls_is_not(plan: FloorPlan, physics: PhysicsWorld) -> None:
    glazed = replace(
        plan,
        walls=tuple(replace(w, material="glass") if w.id == "w4" else w for w in plan.walls),
        doors=tuple(replace(d, material="glass") if d.id == "double" else d for d in plan.doors),
    )
    building = Building(glazed, ["hinged", "double", "sliding"], CONFIG, physics)
    assert physics.has_glass
    # Through the pane at y = 4 up to the wall at 9, but not through a door that is none.
    assert met(physics, (3.2, 2.0), (3.2, 12.0), 0.3)[0] == pytest.approx(6.92, abs=1e-4)
    assert met(physics, (1.95, 2.0), (1.95, 12.0), 0.3) == (
        pytest.approx(1.975, abs=1e-4),
        building.doors["hinged"].body,
    )
    # Both leaves of the double door are of glass.
    for x in (5.6, 6.4):
        assert met(physics, (x, 2.0), (x, 12.0), 0.3)[0] > 6.0
        fractions, bodies, _ = physics.cast_at_glass(np.array([x, 2.0, 0.3]), np.array([[x, 12.0, 0.3]]))
        assert (10 * fractions[0], bodies[0]) == (pytest.approx(1.975, abs=1e-4), building.doors["double"].body)
    # To the robot's edges they are walls.
    assert distance(3.2, 3.8, building.obstacles.near(3.2, 3.8)) == pytest.approx(0.12)


def test_doors_stand_open_but_for_those_that_are_closed(plan: FloorPlan, physics: PhysicsWorld) -> None:
    building = Building(plan, ["double"], CONFIG, physics)
    assert list(building.doors) == ["hinged", "double", "sliding"]
    assert {name: door.opening for name, door in building.doors.items()} == {
        "hinged": 1.0,
        "double": 0.0,
        "sliding": 1.0,
    }
    assert building.door_of_body == {door.body: door for door in building.doors.values()}
    assert not building.moving


def test_a_door_opens_while_time_passes_and_each_but_once(plan: FloorPlan, physics: PhysicsWorld) -> None:
    building = Building(plan, ["hinged", "double"], CONFIG, physics)
    building.open_door("sliding")
    assert not building.moving
    for name in ("hinged", "hinged", "double"):
        building.open_door(name)
    assert building.moving
    building.advance(0.5, 50.0, 50.0, 0.2)
    assert building.doors["hinged"].opening == pytest.approx(0.25)
    building.open_door("hinged")
    building.advance(0.5, 50.0, 50.0, 0.2)
    assert building.doors["hinged"].opening == pytest.approx(0.5)
    building.advance(1.0, 50.0, 50.0, 0.2)
    assert not building.moving
    assert building.doors["double"].opening == 1.0
    for name in ("entrance", "way-out", "nowhere"):
        with pytest.raises(InvalidInputError, match="one of hinged, double, sliding"):
            building.open_door(name)


def test_a_plan_without_inner_doors_has_none_to_close(plan: FloorPlan, physics: PhysicsWorld) -> None:
    bare = replace(plan, doors=plan.doors[3:])
    assert Building(bare, [], CONFIG, physics).doors == {}
    with pytest.raises(InvalidInputError, match="no doors between rooms"):
        Building(bare, ["hinged"], CONFIG, physics)


def test_the_gap_to_solids_is_the_distance_to_their_nearest_edge() -> None:
    solids = box(0, 0, 1, 1) | box(5, 0, 6, 1)
    for x, y, gap in ((2.0, 0.5, 1.0), (4.5, 0.5, 0.5), (0.5, 0.5, 0.0), (-3.0, -4.0, 5.0)):
        assert gap_from(solids, x, y) == pytest.approx(gap)
    assert gap_from(MultiPolygon(), 0.0, 0.0) == math.inf
    assert gap_from(shapely.Polygon(), 0.0, 0.0) == math.inf
