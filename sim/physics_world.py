"""PyBullet behind an interface of its own: bodies, joints and rays, nothing about buildings."""

import contextlib
import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from operator import itemgetter
from types import TracebackType
from typing import Any, Self

import numpy as np

from closedrooms.core.arrays import FloatArray, IntArray

# PyBullet returns nothing at exactly 16384 rays and raises above (MAX_RAY_INTERSECTION_BATCH_SIZE).
MAX_RAYS = 16_383
# Meshes of 96,000 vertices work, of 128,000 fail; three vertices a triangle at most.
MAX_TRIANGLES = 30_000
# Links of one body are truncated silently at 127.
MAX_LINKS = 126
# Collision groups that rays meet: static bodies are in group 2, moving ones in group 1.
EVERYTHING = -1
# A face whose normal is steeper than this against the floor is floor or ceiling.
UPRIGHT = 0.5


@dataclass(frozen=True, slots=True, eq=False)
class MovingPart:
    """A solid on one joint.

    Attributes:
        vertices: Shape (n, 3), metres, world frame, at joint position 0.
        triangles: Shape (m, 3).
        slides: Prismatic along ``axis``, else revolute around it.
        anchor: A point of the axis, world frame [m].
        axis: Direction of the axis, right-handed.
    """

    vertices: FloatArray
    triangles: IntArray
    slides: bool
    anchor: tuple[float, float, float]
    axis: tuple[float, float, float]


def upright(vertices: FloatArray, triangles: IntArray) -> IntArray:
    """The triangles of a mesh that stand: horizontal rays meet no others, and fewer faces make rays a third faster."""
    a, b, c = (vertices[triangles[:, i]] for i in range(3))
    normals = np.cross(b - a, c - a)
    standing: IntArray = triangles[np.abs(normals[:, 2]) <= UPRIGHT * np.linalg.norm(normals, axis=1)]
    return standing


class PhysicsWorld:
    """One PyBullet client; a context manager that always disconnects.

    Every body is a concave triangle mesh (convex hulls are wrong by metres for a building, boxes are slower and let
    rays that start inside pass). Nothing is stepped: what moves is placed, so that a run costs its rays and no more.
    """

    def __init__(self) -> None:
        self._bullet: Any = None
        self._client = -1

    def __enter__(self) -> Self:
        self._bullet = _import_pybullet()
        self._client = self._bullet.connect(self._bullet.DIRECT)
        if self._client < 0:
            raise RuntimeError("PyBullet has no client left to give")
        return self

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

    def add_static(self, vertices: FloatArray, triangles: IntArray) -> list[int]:
        """A solid that never moves; returns its bodies (several only beyond PyBullet's limit on vertices).

        Args:
            vertices: Shape (n, 3), metres, world frame.
            triangles: Shape (m, 3).
        """
        bodies = []
        for first in range(0, len(triangles), MAX_TRIANGLES):
            used, local = np.unique(triangles[first : first + MAX_TRIANGLES], return_inverse=True)
            shape = self._mesh(vertices[used], local.reshape(-1, 3))
            bodies.append(self._bullet.createMultiBody(0.0, shape, physicsClientId=self._client))
        return bodies

    def add_moving(self, parts: Sequence[MovingPart]) -> int:
        """A body whose links hang on one joint each, fixed to the world; returns the body."""
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

    def move_joint(self, body: int, link: int, position: float) -> None:
        """Put a joint at ``position`` [rad or m]; rays see it at once."""
        self._bullet.resetJointState(body, link, position, physicsClientId=self._client)

    def cast(self, start: tuple[float, float, float], ends: FloatArray) -> tuple[FloatArray, IntArray]:
        """The first thing that each ray hits.

        Args:
            start: Where all rays start, world frame [m].
            ends: Where they end at the latest, shape (n, 3).

        Returns:
            The share of the way to the end at the hit, shape (n,), 1 without one, and the body hit, shape (n,), -1
            without one.
        """
        n = len(ends)
        fractions, bodies = np.empty(n), np.empty(n, dtype=np.int64)
        for first in range(0, n, MAX_RAYS):
            part = slice(first, min(first + MAX_RAYS, n))
            count = part.stop - part.start
            hits = self._bullet.rayTestBatch(
                [start] * count,
                ends[part].tolist(),
                collisionFilterMask=EVERYTHING,
                physicsClientId=self._client,
            )
            bodies[part] = np.fromiter(map(itemgetter(0), hits), dtype=np.int64, count=count)
            fractions[part] = np.fromiter(map(itemgetter(2), hits), dtype=np.float64, count=count)
        return fractions, bodies

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


def _import_pybullet() -> Any:
    """Import PyBullet without the line that it writes to the terminal from C."""
    with _quiet_stderr():
        import pybullet
    return pybullet


@contextlib.contextmanager
def _quiet_stderr() -> Iterator[None]:
    import sys

    if "pybullet" in sys.modules:
        yield
        return
    try:
        kept = os.dup(2)
    except OSError:  # there is no terminal to keep quiet
        yield
        return
    silent = os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(silent, 2)
        yield
    finally:
        os.dup2(kept, 2)
        os.close(kept)
        os.close(silent)
