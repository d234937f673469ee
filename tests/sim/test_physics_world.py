"""Bodies, joints and rays in PyBullet: what meets what, what weighs how much, and what is shown."""

import math
from typing import Any

import numpy as np
import pytest
from shapely.geometry import Point, Polygon, box

from closedrooms.sim.config import STEPS
from closedrooms.sim.physics_world import LEAF_DENSITY, MAX_LINKS, MAX_RAYS, MAX_TRIANGLES, PhysicsWorld
from closedrooms.sim.solids import LEAF, PANE, PERSON, WALLS, MovingPart, upright
from closedrooms.worlds.extrusion import extrude


def part_of(
    area: Polygon, *, slides: bool = False, anchor: tuple[float, float] = (0.0, 0.0), height: float = 2.0
) -> MovingPart:
    vertices, triangles = extrude(area, height=height)
    axis = (1.0, 0.0, 0.0) if slides else (0.0, 0.0, 1.0)
    return MovingPart(vertices, upright(vertices, triangles), slides, (*anchor, 0.0), axis)


def ahead(
    physics: PhysicsWorld, y: float = 0.0, *, x: float = 0.0, far: float = 10.0, z: float = 0.5
) -> tuple[float, int]:
    """How far along x a ray from ``(x, y)`` goes [m], and what it meets."""
    fractions, bodies = physics.cast(np.array([x, y, z]), np.array([[x + far, y, z]]))
    return float(fractions[0]) * far, int(bodies[0])


def test_it_is_connected_while_it_is_entered() -> None:
    physics = PhysicsWorld()
    assert not physics.connected
    with physics:
        assert physics.connected
        assert physics.client >= 0
    assert not physics.connected
    assert (PhysicsWorld().stepped, PhysicsWorld().visible, PhysicsWorld().has_glass) == (False, False, False)


@pytest.mark.parametrize("count", [1, MAX_RAYS, MAX_RAYS + 1])
def test_rays_of_any_number_meet_what_they_would_alone(still: PhysicsWorld, count: int) -> None:
    (disc,) = still.add_static(*extrude(Point(5.0, 0.0).buffer(1.0, quad_segs=64)))
    ys = np.linspace(-1.5, 1.5, count)
    ends = np.column_stack((np.full(count, 10.0), ys, np.full(count, 0.5)))
    starts = np.column_stack((np.zeros(count), ys, np.full(count, 0.5)))
    fractions, bodies = still.cast(starts, ends)
    hit = np.abs(ys) < 0.999
    assert np.array_equal(bodies[np.abs(np.abs(ys) - 1.0) > 2e-3] == disc, hit[np.abs(np.abs(ys) - 1.0) > 2e-3])
    assert 10.0 * fractions[hit] == pytest.approx(5.0 - np.sqrt(1.0 - ys[hit] ** 2), abs=5e-3)
    assert (fractions[bodies < 0] == 1.0).all()
    fractions, bodies, normals = still.cast_at_glass(starts, ends)
    assert (bodies == -1).all()
    assert normals.shape == (count, 3)


def test_a_mesh_of_too_many_triangles_is_several_bodies_that_stand_where_it_does(still: PhysicsWorld) -> None:
    # A comb of teeth along y, of which a ray meets each.
    count = MAX_TRIANGLES // 8 + 400
    tooth, faces = extrude(box(2.0, 0.0, 2.5, 0.008))
    vertices = np.concatenate([tooth + np.array([0.0, 0.01 * n, 0.0]) for n in range(count)])
    triangles = np.concatenate([faces + 8 * n for n in range(count)])
    bodies = still.add_static(vertices, triangles)
    assert len(bodies) == math.ceil(len(triangles) / MAX_TRIANGLES) > 1
    ys = np.array([0.01 * n + 0.004 for n in (0, 1, 1000, 2500, count // 2, count - 1)])
    z = np.full(len(ys), 0.5)
    fractions, met = still.cast(
        np.column_stack((np.zeros(len(ys)), ys, z)), np.column_stack((np.full(len(ys), 4.0), ys, z))
    )
    assert 4.0 * fractions == pytest.approx(np.full(len(ys), 2.0), abs=1e-4)
    assert set(met.tolist()) == set(bodies)


def test_a_body_is_moved_where_rays_meet_it_at_once(still: PhysicsWorld) -> None:
    (body,) = still.add_static(*extrude(box(-0.5, -0.5, 0.5, 0.5)))
    for x, y in ((3.0, 0.0), (5.0, 2.0), (4.0, -7.0)):
        still.move_body(body, x, y)
        assert ahead(still, y) == (pytest.approx(x - 0.5, abs=1e-5), body)


def test_glass_is_met_by_those_who_ask_for_glass_alone(still: PhysicsWorld) -> None:
    (wall,), (pane,) = (still.add_static(*extrude(box(x, -2, x + 0.2, 2))) for x in (5.0, 3.0))
    assert ahead(still) == (pytest.approx(3.0), pane)
    still.make_glass(pane)
    assert still.has_glass
    assert ahead(still) == (pytest.approx(5.0), wall)
    fractions, bodies, normals = still.cast_at_glass(
        np.array([0.0, 0.0, 0.5]), np.array([[10.0, 0.0, 0.5], [0.0, 10.0, 0.5]])
    )
    assert bodies.tolist() == [pane, -1]
    assert 10.0 * fractions[0] == pytest.approx(3.0)
    assert np.abs(normals[0]) == pytest.approx([1.0, 0.0, 0.0])


@pytest.mark.parametrize("slides", [True, False])
def test_links_of_a_body_are_moved_by_their_joints_and_may_be_glass(still: PhysicsWorld, slides: bool) -> None:
    parts = [part_of(box(3.0, y, 3.1, y + 1.0), slides=slides, anchor=(3.0, y)) for y in (0.0, 2.0)]
    body = still.add_moving(parts)
    for link, y in ((0, 0.5), (1, 2.5)):
        assert still.joint_position(body, link) == 0.0
        assert ahead(still, y) == (pytest.approx(3.0, abs=1e-5), body)
        still.move_joint(body, link, 0.4)
        assert still.joint_position(body, link) == pytest.approx(0.4)
        # A slide along x by 0.4 m, or a turn about the lower corner to the left.
        expected = 3.4 if slides else 3.0 - 0.5 * math.tan(0.4)
        assert ahead(still, y) == (pytest.approx(expected, abs=1e-4), body)
    still.make_glass(body, 2)
    assert ahead(still, 0.5) == (10.0, -1)
    assert ahead(still, 2.5) == (10.0, -1)


@pytest.mark.parametrize("count", [0, MAX_LINKS + 1])
def test_a_body_has_as_many_links_as_it_takes(still: PhysicsWorld, count: int) -> None:
    parts = [part_of(box(0.0, y, 0.1, y + 0.5)) for y in range(count)]
    with pytest.raises(ValueError, match=f"{count} moving parts"):
        still.add_moving(parts)


def test_the_last_of_as_many_links_as_there_may_be_is_there(still: PhysicsWorld) -> None:
    body = still.add_moving([part_of(box(1.0, y, 1.1, y + 0.5)) for y in range(MAX_LINKS)])
    assert ahead(still, MAX_LINKS - 1 + 0.25) == (pytest.approx(1.0, abs=1e-4), body)


def test_time_passes_by_steps_and_what_is_let_go_falls(stepped: PhysicsWorld) -> None:
    bullet, client = stepped.bullet, stepped.client
    sphere = bullet.createCollisionShape(bullet.GEOM_SPHERE, radius=0.1, physicsClientId=client)
    ball = bullet.createMultiBody(1.0, sphere, basePosition=[0, 0, 5.0], physicsClientId=client)
    bullet.changeDynamics(ball, -1, linearDamping=0.0, physicsClientId=client)
    for _ in range(STEPS // 2):
        stepped.step()
    position, _ = bullet.getBasePositionAndOrientation(ball, physicsClientId=client)
    # Half a second of 9.81 m/s2, and half a step more.
    assert 5.0 - position[2] == pytest.approx(0.5 * 9.81 * 0.5 * (0.5 + 1.0 / STEPS), rel=1e-3)
    # Rays do not meet the floor, nor what is under it.
    fractions, bodies = stepped.cast(np.array([3.0, 0.0, 1.0]), np.array([[3.0, 0.0, -1.0]]))
    assert (fractions[0], bodies[0]) == (1.0, -1)


def hung(physics: PhysicsWorld, *, slides: bool = False, limit: float = 1.2) -> int:
    return physics.add_hung([part_of(box(0.0, -0.025, 0.9, 0.025), slides=slides, height=2.1)], [limit])


def test_a_leaf_weighs_as_light_doors_do_and_turns_as_a_box(stepped: PhysicsWorld) -> None:
    body = hung(stepped)
    mass, friction, inertia, *_ = stepped.bullet.getDynamicsInfo(body, 0, physicsClientId=stepped.client)
    assert mass == pytest.approx(LEAF_DENSITY * 0.9 * 0.05 * 2.1, rel=1e-6)
    assert 15.0 < mass < 25.0
    x, y, z = 0.9, 0.05, 2.1
    assert inertia == pytest.approx(
        [mass / 12 * (y * y + z * z), mass / 12 * (x * x + z * z), mass / 12 * (x * x + y * y)], rel=1e-5
    )
    assert friction == pytest.approx(0.2)
    # Its centre of mass is in its middle.
    state = stepped.bullet.getLinkState(body, 0, physicsClientId=stepped.client)
    assert state[0] == pytest.approx((0.45, 0.0, 1.05), abs=1e-6)


@pytest.mark.parametrize("slides", [False, True])
def test_a_motor_moves_a_leaf_at_its_speed_up_to_its_target_and_never_beyond_its_limits(
    stepped: PhysicsWorld, slides: bool
) -> None:
    body = hung(stepped, slides=slides, limit=1.2)
    stepped.drive_joint(body, 0, 1.0, force=500.0, speed=0.5)
    places = []
    for _ in range(500):
        stepped.step()
        places.append(stepped.joint_position(body, 0))
    assert places[-1] == pytest.approx(1.0, abs=0.02)
    assert places[199] == pytest.approx(0.5, abs=0.06)
    # Beyond its limits it does not go.
    for target, most in ((3.0, 1.2), (-3.0, 0.0)):
        stepped.drive_joint(body, 0, target, force=500.0, speed=5.0)
        for _ in range(300):
            stepped.step()
        assert stepped.joint_position(body, 0) == pytest.approx(most, abs=0.03)


def test_friction_brings_a_leaf_to_rest(stepped: PhysicsWorld) -> None:
    body = hung(stepped)
    stepped.bullet.resetJointState(body, 0, 0.1, 1.0, physicsClientId=stepped.client)
    stepped.brake_joint(body, 0, 50.0)
    for _ in range(100):
        stepped.step()
    rested = stepped.joint_position(body, 0)
    assert 0.1 <= rested < 0.3
    for _ in range(100):
        stepped.step()
    assert stepped.joint_position(body, 0) == pytest.approx(rested, abs=1e-3)


def test_leaves_do_not_meet_the_frame_that_they_fill(stepped: PhysicsWorld) -> None:
    stepped.add_static(*extrude(box(-0.5, -0.1, 0.0, 0.1)))
    stepped.add_static(*extrude(box(0.9, -0.1, 1.5, 0.1)))
    stepped.add_static(*extrude(box(0.5, 0.05, 0.9, 0.5)))
    body = hung(stepped)
    stepped.drive_joint(body, 0, 1.0, force=20.0, speed=1.0)
    for _ in range(400):
        stepped.step()
    assert stepped.joint_position(body, 0) == pytest.approx(1.0, abs=0.05)


class Recording:
    """PyBullet, of which some calls are noted and not made."""

    def __init__(self, bullet: Any, *noted: str) -> None:
        self._bullet, self._noted, self.calls = bullet, noted, []

    def __getattr__(self, name: str) -> Any:
        real = getattr(self._bullet, name)
        if name not in self._noted:
            return real
        return lambda *words, **named: self.calls.append((name, words, named)) or -1


def test_what_is_shown_has_flat_faces_on_both_sides_in_its_colour(still: PhysicsWorld) -> None:
    vertices, triangles = extrude(box(0, 0, 2, 1))
    recording = Recording(still.bullet, "createVisualShape")
    still._bullet = recording
    still.add_static(vertices, triangles, PANE)
    assert recording.calls == []
    still.visible = True
    still.add_static(vertices, triangles, PANE)
    ((_, _, shown),) = recording.calls
    assert shown["rgbaColor"] == list(PANE)
    corners = np.array(shown["vertices"]).reshape(-1, 3, 3)
    normals = np.array(shown["normals"]).reshape(-1, 3, 3)
    assert len(corners) == 2 * len(triangles)
    assert shown["indices"] == list(range(6 * len(triangles)))
    for face, normal in zip(corners, normals, strict=True):
        expected = np.cross(face[1] - face[0], face[2] - face[0])
        assert normal == pytest.approx(np.tile(expected / np.linalg.norm(expected), (3, 1)))
    faces = {frozenset(map(tuple, face.tolist())) for face in corners}
    assert faces == {frozenset(map(tuple, vertices[triangle].tolist())) for triangle in triangles}
    # Each is there once from either side.
    assert np.abs(normals.sum(axis=0)).max() < 1e-9
    # Leaves too.
    recording.calls.clear()
    still.add_hung([part_of(box(0, 0, 1, 0.1))], [1.0])
    assert [named["rgbaColor"] for _, _, named in recording.calls] == [list(LEAF)]


def test_the_window_looks_at_the_middle_of_the_building_from_so_far_that_all_is_seen(still: PhysicsWorld) -> None:
    recording = Recording(still.bullet, "configureDebugVisualizer", "resetDebugVisualizerCamera")
    still._bullet = recording
    still.look_at((1.0, 2.0, 11.0, 8.0))
    assert recording.calls == []
    still._window = True
    distances = []
    for bounds in ((1.0, 2.0, 11.0, 8.0), (1.0, 2.0, 21.0, 8.0), (1.0, 2.0, 11.0, 22.0)):
        recording.calls.clear()
        still.look_at(bounds)
        (panels, camera) = recording.calls
        assert panels[1] == (still.bullet.COV_ENABLE_GUI, 0)
        x0, y0, x1, y1 = bounds
        assert camera[2]["cameraTargetPosition"] == ((x0 + x1) / 2, (y0 + y1) / 2, 0.0)
        assert camera[2]["cameraPitch"] == -80.0
        assert camera[2]["cameraYaw"] == 0.0
        distances.append(camera[2]["cameraDistance"])
    # By its width, or by its depth where that is more than the window's shape takes; about as far away as it is wide.
    assert 5.0 < distances[0] < 10.0
    assert distances == pytest.approx([distances[0], 2.0 * distances[0], 2.8 * distances[0]])


def test_colours_can_be_told_apart_and_only_panes_are_seen_through() -> None:
    colours = [WALLS, PANE, LEAF, PERSON]
    assert len(set(colours)) == 4
    assert all(0.0 <= part <= 1.0 for colour in colours for part in colour)
    assert [colour[3] for colour in (WALLS, LEAF, PERSON)] == [1.0, 1.0, 1.0]
    assert 0.0 < PANE[3] < 1.0
