"""A small building made by hand, whose geometry can be checked on paper."""

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
import shapely
from shapely.geometry import Polygon, box

from closedrooms.sim.building import building_solids
from closedrooms.sim.config import LidarConfig, SimConfig, noise_level
from closedrooms.sim.physics_world import PhysicsWorld
from closedrooms.sim.simulation import Simulation
from closedrooms.worlds.plan import FloorPlan, Furniture, Opening, PlanDoor, PlanRoom, Wall

THICKNESS = 0.16


@pytest.fixture(scope="session")
def plan() -> FloorPlan:
    """A 12 x 4 m corridor, rooms above with a hinged, a double and a sliding door, a slanted wall, two ways out."""
    rooms = (
        PlanRoom("corridor", "corridor", box(0, 0, 12, 4)),
        PlanRoom("left", "office", box(0, 4, 4, 9)),
        PlanRoom("middle", "office", box(4, 4, 8, 9)),
        PlanRoom("right", "office", Polygon([(8, 4), (12, 4), (12, 9), (9, 9)])),
        PlanRoom("cut", "office", Polygon([(8, 4), (9, 9), (8, 9)])),
    )
    lines = [
        ((0, 0), (12, 0)), ((12, 0), (12, 9)), ((12, 9), (0, 9)), ((0, 9), (0, 0)),
        ((0, 4), (12, 4)), ((4, 4), (4, 9)), ((8, 4), (8, 9)), ((8, 4), (9, 9)),
    ]  # fmt: skip
    walls = tuple(
        Wall(f"w{i}", ((float(a[0]), float(a[1])), (float(b[0]), float(b[1]))), THICKNESS)
        for i, (a, b) in enumerate(lines)
    )
    doors = (
        PlanDoor("hinged", ((1.5, 4.0), (2.4, 4.0)), ("corridor", "left"), opens_into="left"),
        PlanDoor("double", ((5.2, 4.0), (6.8, 4.0)), ("corridor", "middle"), "double", opens_into="middle"),
        PlanDoor("sliding", ((10.0, 4.0), (10.9, 4.0)), ("corridor", "right"), "sliding", opens_into="right"),
        PlanDoor("entrance", ((3.0, 0.0), (4.0, 0.0)), ("corridor", None), opens_into=None),
    )
    openings = (Opening("way-out", ((12.0, 1.0), (12.0, 2.5)), ("corridor", None)),)
    desk = Furniture("desk", box(0.3, 7.5, 1.7, 8.3))
    return FloorPlan("by-hand", rooms, walls, doors, openings, (2.0, 2.0, 0.3), (desk,))


@pytest.fixture
def still() -> Iterator[PhysicsWorld]:
    """An empty world in which nothing is stepped."""
    with PhysicsWorld() as physics:
        yield physics


@pytest.fixture
def stepped() -> Iterator[PhysicsWorld]:
    """An empty world with weight and contacts."""
    with PhysicsWorld(stepped=True) as physics:
        yield physics


@pytest.fixture(scope="session")
def exact_config() -> SimConfig:
    """No noise; a lidar that sees from 1 cm."""
    return SimConfig(noise=noise_level("none"), lidar=LidarConfig(range_min=0.01))


@pytest.fixture(scope="session")
def solids_now() -> Callable[[Simulation], shapely.Geometry]:
    """Everything that blocks rays in a simulation right now, from the plan and the door states."""

    def solids(sim: Simulation) -> shapely.Geometry:
        leaves = [leaf for name in sim.door_states() for leaf in sim.door_leaves(name)]
        return shapely.union_all([building_solids(sim.plan), *(thing.polygon for thing in sim.plan.furniture), *leaves])

    return solids


@pytest.fixture(scope="session")
def shared_plans() -> Path:
    """Floor plans of real buildings beside the checkout."""
    folder = Path(__file__).parents[2].parent / "shared" / "data" / "plans"
    if not folder.is_dir():
        pytest.skip(f"no floor plans at {folder}")
    return folder
