"""One door in a physics world: placed along its travel, or hung on motor, friction and latch."""

import math

import numpy as np
import pytest
from shapely.geometry import MultiPolygon, Polygon, box

from closedrooms.sim.config import SimConfig
from closedrooms.sim.contacts import Obstacles, leaf_edges
from closedrooms.sim.door_leaves import Leaf, door_leaves
from closedrooms.sim.doors import DOOR_HEIGHT, HungDoor, PlacedDoor, door_part
from closedrooms.sim.physics_world import PhysicsWorld
from closedrooms.worlds.plan import DoorKind, FloorPlan, PlanDoor, PlanRoom, Wall

SWING = math.radians(95.0)
ROOMS = (PlanRoom("above", "office", box(-5, 0, 5, 4)), PlanRoom("below", "corridor", box(-5, -4, 5, 0)))
PLAN = FloorPlan("wall", ROOMS, (Wall("w0", ((-3.0, 0.0), (4.0, 0.0)), 0.2),), ())
AWAY = (0.0, -3.0, 0.2)


def leaves_of(kind: DoorKind = "hinged") -> tuple[PlanDoor, tuple[Leaf, ...]]:
    door = PlanDoor("d", ((0.0, 0.0), (0.9, 0.0)), ("below", "above"), kind=kind, opens_into="above")
    return door, door_leaves(PLAN, door, MultiPolygon(), SWING)


def place(physics: PhysicsWorld, kind: DoorKind = "hinged", seconds: float = 2.0) -> tuple[PlacedDoor, Obstacles]:
    obstacles = Obstacles(np.zeros((0, 4)), 0.5)
    door = PlacedDoor(*leaves_of(kind), physics, obstacles, SimConfig(door_seconds=seconds))
    door.place(0.0)
    return door, obstacles


@pytest.mark.parametrize("kind", ["hinged", "double", "sliding"])
def test_a_placed_door_opens_evenly_and_its_edges_go_along(still: PhysicsWorld, kind: DoorKind) -> None:
    door, obstacles = place(still, kind)
    assert door.closed
    assert not door.opens
    door.set_out()
    for step in range(1, 21):
        assert door.opens
        door.advance(0.1, *AWAY)
        assert door.opening == pytest.approx(0.05 * step)
        assert not door.closed
        assert len(door.corners()) == len(door.leaves)
        for link, (leaf, corners) in enumerate(zip(door.leaves, door.corners(), strict=True)):
            assert np.allclose(corners, leaf.at(door.opening * leaf.travel))
            assert set(leaf_edges(corners)) <= set(obstacles.near(*corners.mean(axis=0)))
            assert still.joint_position(door.body, link) == pytest.approx(door.opening * leaf.travel)
        assert len(obstacles.near(0.45, 0.2)) == 4 * len(door.leaves)
    assert not door.opens
    assert door.opening == 1.0
    # An open one has nothing to do.
    door.set_out()
    assert not door.opens


def test_a_door_that_takes_no_time_opens_at_once_and_a_slow_one_slowly(still: PhysicsWorld) -> None:
    for seconds, opening in ((0.0, 1.0), (0.5, 0.2), (10.0, 0.01)):
        door, _ = place(still, seconds=seconds)
        door.set_out()
        door.advance(0.1, *AWAY)
        assert door.opening == pytest.approx(opening)
        assert door.opens == (opening < 1.0)


def test_a_placed_door_waits_until_nothing_of_the_robot_is_in_its_way(still: PhysicsWorld) -> None:
    door, _ = place(still)
    door.set_out()
    # Beside the leaf's end on its way: a robot of 0.2 m whose edge the leaf meets.
    x, y = 0.3, 0.6
    for _ in range(60):
        door.advance(0.02, x, y, 0.2)
    (leaf,) = door.corners()
    gap = Polygon(leaf).distance(box(x, y, x, y)) - 0.2
    # A step more would touch.
    assert 1e-3 < gap < 0.9 * 0.02 * SWING / 2.0 + 2e-3
    assert door.opens
    assert 0.0 < door.opening < 1.0
    before = door.opening
    door.advance(0.02, x, y + 0.2, 0.2)
    assert door.opening == pytest.approx(before + 0.01)


@pytest.mark.parametrize("kind", ["hinged", "sliding"])
def test_the_solid_of_a_leaf_is_the_leaf_upright_on_its_joint(kind: DoorKind) -> None:
    _, (leaf, *_) = leaves_of(kind)
    part = door_part(leaf)
    low, high = part.vertices.min(axis=0), part.vertices.max(axis=0)
    assert low == pytest.approx([0.0, -0.025, 0.0])
    assert high == pytest.approx([0.9, 0.025, DOOR_HEIGHT])
    assert part.slides == (kind == "sliding")
    if part.slides:
        assert part.axis == pytest.approx((-1.0, 0.0, 0.0))
    else:
        assert part.anchor == pytest.approx((0.0, 0.025, 0.0))
        assert part.axis == (0.0, 0.0, 1.0)
    # Above every lidar, below the walls.
    assert 0.7 < DOOR_HEIGHT < 2.5


def hang(
    physics: PhysicsWorld,
    kind: DoorKind = "hinged",
    *,
    latched: bool = True,
    seconds: float = 2.0,
    opening: float = 0.0,
) -> HungDoor:
    config = SimConfig(body="wheels", doors="latched" if latched else "unlatched", door_seconds=seconds)
    door = HungDoor(*leaves_of(kind), physics, Obstacles(np.zeros((0, 4)), 0.5), config)
    door.place(opening)
    return door


def pushed(physics: PhysicsWorld, door: HungDoor, force: float, steps: int = 100) -> float:
    """How far a door opens that is pushed into its room at its middle, by a force [N], for half a second."""
    bullet, client = physics.bullet, physics.client
    for _ in range(steps):
        physics.wake(door.body)
        at = Polygon(door.corners()[0]).centroid
        direction = door.leaves[0].direction
        bullet.applyExternalForce(
            door.body, 0, [force * direction[0], force * direction[1], 0.0], [at.x, at.y, 1.0], bullet.WORLD_FRAME,
            physicsClientId=client,
        )  # fmt: skip
        physics.step()
    return door.opening


def run(physics: PhysicsWorld, door: HungDoor, seconds: float) -> None:
    for _ in range(round(200 * seconds)):
        physics.step()
        if door.opens:
            door.advance(0.005, *AWAY)


@pytest.mark.parametrize("kind", ["hinged", "double", "sliding"])
def test_a_hung_door_opens_in_its_time_and_then_stays(stepped: PhysicsWorld, kind: DoorKind) -> None:
    door = hang(stepped, kind)
    assert door.closed
    assert door.opening == 0.0
    run(stepped, door, 0.2)
    assert door.opening == 0.0
    door.set_out()
    assert door.opens
    run(stepped, door, 1.0)
    assert door.opening == pytest.approx(0.5, abs=0.12)
    assert not door.closed
    run(stepped, door, 1.5)
    assert not door.opens
    assert door.opening > 0.98
    rested = door.opening
    run(stepped, door, 0.5)
    assert door.opening == pytest.approx(rested, abs=0.01)
    for corners, leaf in zip(door.corners(), door.leaves, strict=True):
        assert np.allclose(corners, leaf.at(leaf.travel), atol=0.03)
    door.set_out()
    assert not door.opens


def test_a_hung_door_that_is_to_take_no_time_is_as_quick_as_its_motor_is_strong(stepped: PhysicsWorld) -> None:
    # 20 Nm swing 20 kg of 0.9 m: after 0.5 s by half of 3.7 rad/s2 times 0.25 s2, without damping.
    door = hang(stepped, seconds=0.0)
    door.set_out()
    run(stepped, door, 0.5)
    swung = 0.5 * 20.0 / (210.0 * 0.9 * 0.05 * DOOR_HEIGHT * 0.9**2 / 3.0) * 0.5**2
    assert 0.85 * swung < door.opening * SWING < 1.02 * swung
    run(stepped, door, 0.8)
    assert door.opening > 0.9


def test_a_latch_holds_what_friction_does_not(stepped: PhysicsWorld) -> None:
    # 100 N at half a leaf are 45 Nm.
    latched, loose = hang(stepped), hang(stepped, latched=False)
    assert latched.latched
    assert not loose.latched
    assert pushed(stepped, latched, 100.0) == 0.0
    assert latched.corners()[0] == pytest.approx(latched.leaves[0].corners, abs=2e-3)
    assert pushed(stepped, loose, 100.0) > 0.5


@pytest.mark.parametrize(("force", "moves"), [(2.0, False), (20.0, True)])
def test_friction_holds_a_leaf_against_a_draught_alone(stepped: PhysicsWorld, force: float, moves: bool) -> None:
    # 2 Nm at half a leaf of 0.9 m are 4.4 N; a rail holds 5 N.
    for kind in ("hinged", "sliding"):
        door = hang(stepped, kind, latched=False)  # type: ignore[arg-type]
        assert (pushed(stepped, door, force) > 0.02) == moves


def test_what_holds_a_door_by_hand_stops_its_motor(stepped: PhysicsWorld) -> None:
    # 20 Nm at half a leaf are 44 N, and as much slides a leaf.
    for kind in ("hinged", "sliding"):
        for force, opens in ((-20.0, True), (-150.0, False)):
            door = hang(stepped, kind)  # type: ignore[arg-type]
            door.set_out()
            assert (pushed(stepped, door, force, steps=200) > 0.1) == opens


@pytest.mark.parametrize(("opening", "closed"), [(0.0, True), (0.01, True), (0.05, False), (1.0, False)])
def test_a_door_that_is_not_latched_is_closed_while_it_is_in_its_frame(
    stepped: PhysicsWorld, opening: float, closed: bool
) -> None:
    for latched in (True, False):
        door = hang(stepped, "double", latched=latched, opening=opening)
        assert door.closed == closed
        assert door.latched == (latched and opening == 0.0)
        assert door.opening == pytest.approx(opening)
        assert door.corners()[1] == pytest.approx(door.leaves[1].at(opening * SWING))
