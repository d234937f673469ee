"""The transforms of a bag as a graph: where the lidar sits on the robot, and the odometry among them."""

import math
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from closedrooms.core.arrays import FloatArray
from closedrooms.core.errors import InvalidInputError
from closedrooms.core.pose import Pose2, wrap_angle

BASES = ("base_footprint", "base_link", "base", "base_frame", "base_laser_link")
"""Names of a robot's own frame, the usual ones first (REP-105, REP-120)."""
ODOMETRY_FRAMES = ("odom", "odometry")
"""What the name of a frame begins with that drifts with the odometry (REP-105)."""
CORRECTED_FRAMES = ("map", "world", "earth", "vicon", "mocap")
"""Frames that do not drift: poses in them were corrected or measured from outside."""
LEVEL = math.radians(3.0)
"""Tilt of a lidar up to which there is nothing to say: 10 m away its sweep is half a metre off."""
STEADY, STEADY_ANGLE = 0.02, 0.02
"""Change ([m], [rad]) up to which a transform on /tf counts as constant."""
MOST_TILT = math.radians(15.0)
"""Tilt of a lidar up to which its sweep counts as level; beyond it rays meet floor and ceiling."""


@dataclass(frozen=True, slots=True)
class Mount:
    """Mounting of a lidar.

    Attributes:
        pose: In the plane of the robot.
        upside_down: Its z axis points down.
        tilt: From level [rad].
    """

    pose: Pose2
    upside_down: bool
    tilt: float = 0.0


@dataclass(slots=True)
class _Link:
    """One transform, ``parent_T_child``, as published over time.

    Attributes:
        matrix: The first one (of a static transform: the last), shape (4, 4).
        static: Published as never changing.
        track: ``header stamp, recording time, x, y, yaw`` of each [s, m, rad].
        steady: It has not moved in the plane.
    """

    matrix: FloatArray
    static: bool
    track: list[tuple[float, float, float, float, float]] = field(default_factory=list)
    steady: bool = True


class TransformTree:
    """Frames and the transforms between them; walked both ways, whatever frame they are rooted in."""

    def __init__(self) -> None:
        self._links: dict[tuple[str, str], _Link] = {}
        self.changed: dict[str, None] = {}
        """Frames whose static transform was published with different values, in order; the last ones count."""

    def __bool__(self) -> bool:
        return bool(self._links)

    def add(
        self, parent: str, child: str, matrix: FloatArray, *, static: bool, stamp: float = 0.0, recorded: float = 0.0
    ) -> None:
        """Take in one transform ``parent_T_child``, shape (4, 4)."""
        key = (clean_name(parent), clean_name(child))
        link = self._links.get(key)
        if link is None or (static and not link.static):
            link = self._links[key] = _Link(matrix, static)
        elif static:
            if not np.allclose(link.matrix, matrix, atol=STEADY):
                self.changed[key[1]] = None
            link.matrix = matrix
        if static or link.static:
            return
        x, y, yaw = _planar(matrix)
        link.track.append((stamp, recorded, x, y, yaw))
        _, _, x0, y0, yaw0 = link.track[0]
        moved = math.hypot(x - x0, y - y0) > STEADY or abs(wrap_angle(yaw - yaw0)) > STEADY_ANGLE
        if moved or (matrix[2, 2] < 0.0) != (link.matrix[2, 2] < 0.0):
            link.steady = False

    @property
    def frames(self) -> set[str]:
        """Names of all frames."""
        return {name for pair in self._links for name in pair}

    def find(self, name: str, *, beside: str = "") -> str | None:
        """Find a frame by its name: the exact one, else the only one that ends in it (or that it ends in).

        Where none does, ``base_link`` stands for ``base_footprint`` and the other way round (REP-120).

        Args:
            name: As a message says it.
            beside: A frame whose prefix decides where several end in the name.

        Returns:
            Name of the frame in the tree; ``None`` where none fits, or several do.
        """
        name, frames = clean_name(name), self.frames
        if name in frames:
            return name
        # One of the two without a prefix; robot2/laser is not robot1/laser.
        alike = sorted(f for f in frames if name and (f.endswith(f"/{name}") or name.endswith(f"/{f}")))
        if len(alike) > 1:
            alike = [frame for frame in alike if frame.rpartition("/")[0] == clean_name(beside).rpartition("/")[0]]
        if len(alike) == 1:
            return alike[0]
        # A footprint is the base on the floor: above each other, and headed alike (REP-120).
        twin = {"base_footprint": "base_link", "base_link": "base_footprint"}.get(last_name(name))
        if twin is None or any(last_name(frame) == last_name(name) for frame in frames):
            return None
        twins = [frame for frame in frames if last_name(frame) == twin]
        return twins[0] if len(twins) == 1 else None

    def rigid(self, start: str) -> dict[str, FloatArray]:
        """Collect all frames rigidly connected to ``start``, each with ``start_T_frame``, shape (4, 4)."""
        reached = {start: np.eye(4)}
        waiting = deque([start])
        while waiting:
            name = waiting.popleft()
            for other, matrix in self._steady_neighbours(name):
                if other not in reached:
                    reached[other] = reached[name] @ matrix
                    waiting.append(other)
        return reached

    def _steady_neighbours(self, name: str) -> Iterator[tuple[str, FloatArray]]:
        """Yield the frames that are rigidly connected to a frame by one transform, with it, shape (4, 4)."""
        for (parent, child), link in self._links.items():
            if not (link.static or (link.steady and not _drifts(parent, child))):
                continue
            if parent == name:
                yield child, link.matrix
            elif child == name:
                yield parent, np.asarray(np.linalg.inv(link.matrix), dtype=np.float64)

    def mount(self, base: str, lidar: str) -> Mount:
        """Compute where the lidar sits on the robot.

        Args:
            base: Frame of the robot.
            lidar: Frame of the scans.

        Raises:
            InvalidInputError: No constant transforms from one to the other, or a lidar that is not level.
        """
        start, goal = self.find(base, beside=lidar), self.find(lidar, beside=base)
        if clean_name(base) == clean_name(lidar) or (start is not None and start == goal):
            return Mount(Pose2(), upside_down=False)
        found = self.rigid(start) if start is not None else {}
        if goal is None or goal not in found:
            moving = start is not None and goal is not None and self._joined(start, goal)
            what = "a lidar that moves against its robot" if moving else "unknown mounting of the lidar"
            ends = f"{base or 'the base'} to {lidar or 'a lidar without a frame'}"
            raise InvalidInputError(
                f"{what}: {'no constant' if moving else 'no'} transform from {ends}",
                expected="one on /tf_static or /tf, or --mount X Y YAW",
            )
        matrix = found[goal]
        tilt = math.acos(min(1.0, abs(matrix[2, 2])))
        if tilt > MOST_TILT:
            raise InvalidInputError(
                f"{lidar} tilted by {math.degrees(tilt):.0f} degrees", expected="a level lidar, or --mount X Y YAW"
            )
        return Mount(Pose2(*_planar(matrix)), bool(matrix[2, 2] < 0.0), tilt)

    def _joined(self, start: str, goal: str) -> bool:
        """Check whether moving transforms lead there too."""
        reached, waiting = {start}, deque([start])
        while waiting:
            name = waiting.popleft()
            for pair in self._links:
                if name in pair:
                    new = set(pair) - reached
                    reached |= new
                    waiting.extend(new)
        return goal in reached

    def base_of(self, lidar: str) -> str | None:
        """Find the frame of the robot that carries the lidar: of a usual name, else the root; ``None`` if unknown."""
        frame = self.find(lidar)
        if frame is None:
            return None
        rigid = self.rigid(frame)
        named = [name for base in BASES for name in sorted(rigid) if last_name(name) == base]
        if named:
            return named[0]
        children = {child for parent, child in self._links if parent in rigid}
        roots = sorted(name for name in rigid if name not in children)
        return roots[0] if roots else None

    def odometry(self, lidar: str) -> "TransformOdometry | None":
        """Find the transform by which the odometry moves the robot that carries the lidar.

        Returns:
            Its track; ``None`` where the lidar's frame is unknown or no moving transform is an odometry's.
        """
        frame = self.find(lidar)
        if frame is None:
            return None
        rigid = self.rigid(frame)
        outer = [pair for pair in self._links if len(set(pair) & set(rigid)) == 1 and self._links[pair].track]
        for parent, child in sorted(outer, key=lambda pair: not _drifts(*pair)):
            inverted = parent in rigid
            outside = parent if not inverted else child
            # Wheels and joints move too, below the robot: a frame that the robot moves in lies above it or is named so.
            if last_name(outside).startswith(CORRECTED_FRAMES) or (inverted and not _is_odometry(outside)):
                continue
            link = self._links[parent, child]
            track = np.array(link.track)
            if inverted:
                for row in track:
                    row[2:] = Pose2(*row[2:]).inverse().as_tuple()
            elif link.matrix[2, 2] < 0.0:
                track[:, 3:] *= -1.0  # see seen_from_above
            return TransformOdometry(outside, child if not inverted else parent, track)
        return None

    @property
    def corrected(self) -> list[str]:
        """Frames that hold corrected poses."""
        return sorted(name for name in self.frames if last_name(name).startswith(CORRECTED_FRAMES))


@dataclass(frozen=True, slots=True, eq=False)
class TransformOdometry:
    """Odometry among the transforms.

    Attributes:
        frame: In which the robot moves.
        base: Frame of the robot.
        track: ``header stamp, recording time, x, y, yaw``, shape (n, 5) [s, m, rad].
    """

    frame: str
    base: str
    track: FloatArray


def transform_matrix(
    translation: tuple[float, float, float], rotation: tuple[float, float, float, float]
) -> FloatArray:
    """Make the homogeneous matrix (4, 4) of a shift [m] and a quaternion ``x, y, z, w`` of any length above 0.

    Raises:
        InvalidInputError: Numbers that are not finite, or a quaternion of no length.
    """
    length = math.sqrt(sum(value * value for value in rotation))
    if not (all(map(math.isfinite, translation)) and math.isfinite(length) and length > 1e-6):
        raise InvalidInputError("a transform without a rotation", expected="finite numbers and a quaternion")
    x, y, z, w = (value / length for value in rotation)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y), translation[0]],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x), translation[1]],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y), translation[2]],
            [0.0, 0.0, 0.0, 1.0],
        ]
    )


def seen_from_above(matrix: FloatArray) -> tuple[float, float, float]:
    """Project the pose of a robot, shape (4, 4); in a frame whose z axis points down (NED) it would be mirrored."""
    x, y, yaw = _planar(matrix)
    return (x, -y, -yaw) if matrix[2, 2] < 0.0 else (x, y, yaw)


def _planar(matrix: FloatArray) -> tuple[float, float, float]:
    """Project a transform: position and heading of the x axis, seen from above."""
    return float(matrix[0, 3]), float(matrix[1, 3]), math.atan2(matrix[1, 0], matrix[0, 0])


def clean_name(name: str) -> str:
    """Strip blanks, then slashes, from both ends of a frame's name: old tf began names with a slash."""
    return name.strip().strip("/")


def last_name(name: str) -> str:
    """Strip prefix and namespace from a frame's name."""
    return clean_name(name).rpartition("/")[2]


def _is_odometry(name: str) -> bool:
    return last_name(name).startswith(ODOMETRY_FRAMES)


def _drifts(parent: str, child: str) -> bool:
    """Check whether a transform is the odometry by its names, even while the robot stands."""
    return _is_odometry(parent) or _is_odometry(child)
