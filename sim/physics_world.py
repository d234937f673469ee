"""PyBullet behind an interface of its own: bodies, joints and rays, nothing about buildings."""

import contextlib
from collections.abc import Sequence
from operator import itemgetter
from types import TracebackType
from typing import Any, Self

import numpy as np

from closedrooms.core.arrays import FloatArray, IntArray
from closedrooms.core.grid import Bounds
from closedrooms.sim.config import STEPS
from closedrooms.sim.pybullet_process import check_display, import_pybullet, quiet
from closedrooms.sim.solids import LEAF, RGBA, WALLS, MovingPart, volume

# PyBullet returns nothing at exactly 16384 rays and raises above (MAX_RAY_INTERSECTION_BATCH_SIZE).
MAX_RAYS = 16_383
# Meshes of 96,000 vertices work, of 128,000 fail; three vertices a triangle at most.
MAX_TRIANGLES = 30_000
# Links of one body are truncated silently at 127.
MAX_LINKS = 126
# Collision groups. PyBullet puts static bodies into group 2 and moving ones into group 1, and so
# are rays: a body whose mask leaves group 1 out is not seen.
MOVING, LEAVES, GLASS, FLOOR, ROBOT, WHEELS = 1, 4, 16, 32, 64, 128
EVERYTHING = -1
# What rays meet: neither the robot that casts them nor the floor, and glass not as a rule.
SEEN = ~(GLASS | FLOOR | ROBOT | WHEELS)
# Bodies meet where the masks of both allow it; PyBullet's default is that one of them does, and wheels meet walls.
BOTH_AGREE = 0
# Iterations of the contact solver; more change no figure of the drives tried.
ITERATIONS = 20
# Door leaves: density of a light inner door, 20 kg at 0.9 x 2.1 x 0.05 m [kg/m^3].
LEAF_DENSITY = 210.0
# Of the earth [m/s^2].
GRAVITY = 9.81
# Damping of a leaf's joint [Nm s/rad or N s/m].
LEAF_DAMPING = 1.0


class PhysicsWorld:
    """One PyBullet client; a context manager that always disconnects.

    Every body of a building is a concave triangle mesh (convex hulls are wrong by metres for a building, boxes are
    slower and let rays that start inside pass). Without ``stepped`` what moves is placed, so that a run costs its rays
    and no more; with it there are a floor, gravity and contacts, and time passes in steps of ``1 / STEPS`` seconds.
    """

    def __init__(self, *, stepped: bool = False, window: bool = False) -> None:
        self.stepped = stepped
        self._window = self.visible = window
        self.has_glass = False
        self._bullet: Any = None
        self._client = -1

    def __enter__(self) -> Self:
        if self._window:
            check_display()
        self._bullet = import_pybullet()
        with quiet() if self._window else contextlib.nullcontext():
            self._client = self._bullet.connect(self._bullet.GUI if self._window else self._bullet.DIRECT)
        if self._client < 0:
            raise RuntimeError("PyBullet has no client left to give")
        if self.stepped:
            self._begin_physics()
        return self

    def _begin_physics(self) -> None:
        """Set what a prototype found to work, and lay the floor.

        Cone friction turns a robot that grazes a wall into it; file caching would load a rewritten URDF as it was.
        """
        bullet, client = self._bullet, self._client
        bullet.setPhysicsEngineParameter(
            fixedTimeStep=1.0 / STEPS,
            numSolverIterations=ITERATIONS,
            enableConeFriction=0,
            deterministicOverlappingPairs=1,
            enableFileCaching=0,
            collisionFilterMode=BOTH_AGREE,
            physicsClientId=client,
        )
        bullet.setGravity(0.0, 0.0, -GRAVITY, physicsClientId=client)
        plane = bullet.createCollisionShape(bullet.GEOM_PLANE, physicsClientId=client)
        self.floor = bullet.createMultiBody(0.0, plane, physicsClientId=client)
        bullet.setCollisionFilterGroupMask(self.floor, -1, FLOOR, WHEELS, physicsClientId=client)
        bullet.changeDynamics(self.floor, -1, lateralFriction=1.0, physicsClientId=client)

    def look_at(self, bounds: Bounds) -> None:
        """Show ``(x_min, y_min, x_max, y_max)`` [m] from above in the window, without PyBullet's panels."""
        if not self._window:
            return
        x0, y0, x1, y1 = bounds
        self._bullet.configureDebugVisualizer(self._bullet.COV_ENABLE_GUI, 0, physicsClientId=self._client)
        self._bullet.resetDebugVisualizerCamera(
            cameraDistance=0.62 * max(x1 - x0, 1.4 * (y1 - y0)),
            cameraYaw=0.0,
            cameraPitch=-80.0,
            cameraTargetPosition=((x0 + x1) / 2, (y0 + y1) / 2, 0.0),
            physicsClientId=self._client,
        )

    @property
    def bullet(self) -> Any:
        """The ``pybullet`` module, for bodies with joints of their own; every call takes ``client``."""
        return self._bullet

    @property
    def client(self) -> int:
        """``physicsClientId`` of every call."""
        return self._client

    def step(self) -> None:
        """Let ``1 / STEPS`` seconds pass."""
        self._bullet.stepSimulation(physicsClientId=self._client)

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        client, self._client = self._client, -1
        if client >= 0:
            self._bullet.disconnect(physicsClientId=client)

    @property
    def connected(self) -> bool:
        """Whether the client is there."""
        return self._client >= 0

    def add_static(self, vertices: FloatArray, triangles: IntArray, colour: RGBA = WALLS) -> list[int]:
        """Add a solid that never moves; returns its bodies (several only beyond PyBullet's limit on vertices).

        Args:
            vertices: Shape (n, 3), metres, world frame.
            triangles: Shape (m, 3).
            colour: Where bodies are shown.
        """
        bodies = []
        for first in range(0, len(triangles), MAX_TRIANGLES):
            used, local = np.unique(triangles[first : first + MAX_TRIANGLES], return_inverse=True)
            mesh = vertices[used], local.reshape(-1, 3)
            shape, seen = self._mesh(*mesh), self._visual(*mesh, colour)
            bodies.append(self._bullet.createMultiBody(0.0, shape, seen, physicsClientId=self._client))
        return bodies

    def make_glass(self, body: int, links: int = 0) -> None:
        """Let rays pass a static body, or the links of a moving one; :meth:`cast` can ask for glass alone."""
        bullet, client = self._bullet, self._client
        for link in range(links) if links else (-1,):
            bullet.setCollisionFilterGroupMask(body, link, GLASS, ROBOT | MOVING, physicsClientId=client)
        self.has_glass = True

    def move_body(self, body: int, x: float, y: float) -> None:
        """Teleport a body without mass, made around the world's origin, to ``(x, y)`` [m]; rays see it at once.

        It has no speed: contacts on the way are not found.
        """
        self._bullet.resetBasePositionAndOrientation(
            body, [x, y, 0.0], [0.0, 0.0, 0.0, 1.0], physicsClientId=self._client
        )

    def add_moving(self, parts: Sequence[MovingPart]) -> int:
        """Add a body whose links hang on one joint each, fixed to the world; returns the body."""
        if not 0 < len(parts) <= MAX_LINKS:
            raise ValueError(f"{len(parts)} moving parts in one body")
        shapes = [self._mesh(part.vertices - np.array(part.anchor), part.triangles) for part in parts]
        n = len(parts)
        turn, slide = self._bullet.JOINT_REVOLUTE, self._bullet.JOINT_PRISMATIC
        body: int = self._bullet.createMultiBody(
            0.0,
            -1,
            linkMasses=[1.0] * n,
            linkCollisionShapeIndices=shapes,
            linkVisualShapeIndices=[-1] * n,
            linkPositions=[list(part.anchor) for part in parts],
            linkOrientations=[[0.0, 0.0, 0.0, 1.0]] * n,
            linkInertialFramePositions=[[0.0, 0.0, 0.0]] * n,
            linkInertialFrameOrientations=[[0.0, 0.0, 0.0, 1.0]] * n,
            linkParentIndices=[0] * n,
            linkJointTypes=[slide if part.slides else turn for part in parts],
            linkJointAxis=[list(part.axis) for part in parts],
            physicsClientId=self._client,
        )
        for link in range(n):
            self.move_joint(body, link, 0.0)
        return body

    def add_hung(self, parts: Sequence[MovingPart], limits: Sequence[float]) -> int:
        """Add a body whose links hang on one joint each and move by forces between 0 and ``limits`` [rad or m].

        Leaves meet the robot alone: they would jam in the frame that they fill.
        """
        bullet, client = self._bullet, self._client
        sizes = [np.ptp(part.vertices, axis=0) for part in parts]
        centres = [(part.vertices.min(axis=0) + part.vertices.max(axis=0)) / 2.0 for part in parts]
        masses = [LEAF_DENSITY * volume(part) for part in parts]
        n = len(parts)
        body: int = bullet.createMultiBody(
            0.0,
            -1,
            linkMasses=masses,
            linkCollisionShapeIndices=[
                self._mesh(part.vertices - np.array(part.anchor), part.triangles) for part in parts
            ],
            linkVisualShapeIndices=[
                self._visual(part.vertices - np.array(part.anchor), part.triangles, LEAF) for part in parts
            ],
            linkPositions=[list(part.anchor) for part in parts],
            linkOrientations=[[0.0, 0.0, 0.0, 1.0]] * n,
            linkInertialFramePositions=[(c - part.anchor).tolist() for c, part in zip(centres, parts, strict=True)],
            linkInertialFrameOrientations=[[0.0, 0.0, 0.0, 1.0]] * n,
            linkParentIndices=[0] * n,
            linkJointTypes=[bullet.JOINT_PRISMATIC if part.slides else bullet.JOINT_REVOLUTE for part in parts],
            linkJointAxis=[list(part.axis) for part in parts],
            flags=bullet.URDF_ENABLE_SLEEPING,
            physicsClientId=client,
        )
        for link, (mass, size, limit) in enumerate(zip(masses, sizes, limits, strict=True)):
            # Limits go by themselves: beside damping they are silently ignored.
            bullet.changeDynamics(body, link, jointLowerLimit=0.0, jointUpperLimit=limit, physicsClientId=client)
            squares = size * size
            inertia = mass / 12.0 * (squares.sum() - squares)
            bullet.changeDynamics(
                body, link, localInertiaDiagonal=inertia.tolist(), jointDamping=LEAF_DAMPING, lateralFriction=0.2,
                physicsClientId=client,
            )  # fmt: skip
            bullet.setCollisionFilterGroupMask(body, link, LEAVES, ROBOT | MOVING, physicsClientId=client)
            self.move_joint(body, link, 0.0)
        return body

    def drive_joint(self, body: int, link: int, target: float, *, force: float, speed: float) -> None:
        """Let a motor move a joint to ``target`` [rad or m] at ``speed`` [rad/s or m/s] by ``force`` [Nm or N].

        Force and speed are upper limits: a joint that is blocked stays.
        """
        self._bullet.setJointMotorControl2(
            body, link, self._bullet.POSITION_CONTROL, targetPosition=target, force=force, maxVelocity=speed,
            physicsClientId=self._client,
        )  # fmt: skip
        self.wake(body)

    def brake_joint(self, body: int, link: int, force: float) -> None:
        """Hold a joint by friction of ``force`` [Nm or N] and nothing else."""
        self._bullet.setJointMotorControl2(
            body, link, self._bullet.VELOCITY_CONTROL, targetVelocity=0.0, force=force, physicsClientId=self._client
        )

    def wake(self, body: int) -> None:
        """Wake a body: a sleeping one ignores its motors."""
        bullet = self._bullet
        bullet.changeDynamics(body, -1, activationState=bullet.ACTIVATION_STATE_WAKE_UP, physicsClientId=self._client)

    def joint_position(self, body: int, link: int) -> float:
        """Read the position of a joint [rad or m]."""
        return float(self._bullet.getJointState(body, link, physicsClientId=self._client)[0])

    def move_joint(self, body: int, link: int, position: float) -> None:
        """Put a joint at ``position`` [rad or m]; rays see it at once."""
        self._bullet.resetJointState(body, link, position, physicsClientId=self._client)

    def cast(self, start: FloatArray, ends: FloatArray) -> tuple[FloatArray, IntArray]:
        """Find the first thing that each ray hits, glass left out.

        Args:
            start: Where all rays start, shape (3,), or each, shape (n, 3), world frame [m].
            ends: Where they end at the latest, shape (n, 3).

        Returns:
            The share of the ray up to the hit, shape (n,), 1 without one, and the body hit, shape (n,), -1
            without one.
        """
        fractions, bodies, _ = self._cast(start, ends, SEEN, normals=False)
        return fractions, bodies

    def cast_at_glass(self, start: FloatArray, ends: FloatArray) -> tuple[FloatArray, IntArray, FloatArray]:
        """Find the first pane that each ray hits, as :meth:`cast`, with the normals there, shape (n, 3)."""
        return self._cast(start, ends, GLASS, normals=True)

    def _cast(
        self, start: FloatArray, ends: FloatArray, mask: int, *, normals: bool
    ) -> tuple[FloatArray, IntArray, FloatArray]:
        """Cast rays as :meth:`cast` at bodies of some groups, in batches that PyBullet takes."""
        n = len(ends)
        fractions, bodies = np.empty(n), np.empty(n, dtype=np.int64)
        found = np.zeros((n if normals else 0, 3))
        for first in range(0, n, MAX_RAYS):
            part = slice(first, min(first + MAX_RAYS, n))
            count = part.stop - part.start
            hits = self._bullet.rayTestBatch(
                [start.tolist()] * count if start.ndim == 1 else start[part].tolist(),
                ends[part].tolist(),
                collisionFilterMask=mask,
                physicsClientId=self._client,
            )
            bodies[part] = np.fromiter(map(itemgetter(0), hits), dtype=np.int64, count=count)
            fractions[part] = np.fromiter(map(itemgetter(2), hits), dtype=np.float64, count=count)
            if normals:
                found[part] = [hit[4] for hit in hits]
        return fractions, bodies, found

    def _visual(self, vertices: FloatArray, triangles: IntArray, colour: RGBA) -> int:
        """Make what is drawn of a mesh, flat faces from both sides; -1, nothing, where nobody looks."""
        if not self.visible:
            return -1
        # Every face has corners and a normal of its own, and once more turned round.
        faces = np.concatenate((triangles, triangles[:, ::-1]))
        a, b, c = (vertices[faces[:, i]] for i in range(3))
        normals = np.cross(b - a, c - a)
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
        shape: int = self._bullet.createVisualShape(
            self._bullet.GEOM_MESH,
            vertices=vertices[faces.ravel()].tolist(),
            indices=list(range(faces.size)),
            normals=np.repeat(normals, 3, axis=0).tolist(),
            rgbaColor=list(colour),
            physicsClientId=self._client,
        )
        return shape

    def _mesh(self, vertices: FloatArray, triangles: IntArray) -> int:
        shape: int = self._bullet.createCollisionShape(
            self._bullet.GEOM_MESH,
            vertices=vertices.tolist(),
            indices=triangles.ravel().tolist(),
            physicsClientId=self._client,
        )
        if shape < 0:
            raise RuntimeError(f"PyBullet took no mesh of {len(vertices)} vertices, {len(triangles)} triangles")
        return shape
