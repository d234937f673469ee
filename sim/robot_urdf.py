"""A user's own robot: what its URDF says about wheels, size and lidar, and how it really drives."""

import math
import subprocess
import sys
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from closedrooms.core.arrays import FloatArray
from closedrooms.core.errors import InvalidInputError
from closedrooms.core.files.incoming import is_file, read_bytes
from closedrooms.core.robot import RobotConfig
from closedrooms.sim.config import SimConfig
from closedrooms.sim.differential_drive import Motion
from closedrooms.sim.physics_world import PhysicsWorld, quiet
from closedrooms.sim.robot_model import RobotModel, Wheel
from closedrooms.sim.wheeled_robot import WheeledRobot
from closedrooms.worlds.formats.xml_text import parse_xml

WHAT = "a robot description (URDF)"
# Descriptions have some kilobytes; meshes are files of their own [bytes].
LARGEST, LARGEST_MESH = 2_000_000, 50_000_000
# Links of one body are truncated silently at 127; a description is loaded in a second, or not in a minute [s].
MOST_LINKS, LOADING = 120, 60.0
# An axis this near to level, or a side this far from the middle, counts as such [sine; m].
LEVEL, BESIDE = 0.1, 0.01
# A wheel ends this near to the lowest point of the robot [m].
GROUND = 0.03
# Bullet's boxes around shapes are larger by this on every side [m].
BOX_MARGIN = 1e-3
# Words in the names of links that carry a lidar.
LIDAR_NAMES = ("base_scan", "laser", "lidar", "hokuyo")
# The drive that calibrates: so long straight and so long turning [s], at these shares of the limits.
SETTLE, DRIVE, SHARE = 1.0, 2.0, 0.5
# What is tried, as shares of the accelerations set, until a robot does not tip by so much [rad].
GENTLER, TIPS = (1.0, 0.5, 0.25, 0.12), 0.1
# Stretches of a drive after which the tilt is looked at; a heading turns by less than half a turn in each.
STRETCHES = 20
# A robot that gets less than this share of what its wheels turn does not drive on them.
DRIVES = 0.1


@dataclass(frozen=True, slots=True)
class Joint:
    """One joint of the robot as it stands at the origin.

    Attributes:
        index: PyBullet's.
        name: Of the joint.
        link: Name of the link below it.
        parent: Index of the joint above, -1 for the base.
        free: It turns without end.
        limited: It turns between limits.
        axis: Unit vector, shape (3,).
        place: Shape (3,) [m].
        heading: Of the link frame [rad].
        low: Corner of the box around the link, shape (3,) [m]; its place where it has no shape.
        high: The other corner [m].
        effort: Of its motor [Nm], 0 where none is given.
    """

    index: int
    name: str
    link: str
    parent: int
    free: bool
    limited: bool
    axis: FloatArray
    place: FloatArray
    heading: float
    low: FloatArray
    high: FloatArray
    effort: float


def with_own_robot(config: SimConfig) -> SimConfig:
    """Replace radius, height and lidar in the settings by those of the URDF that they name, if they name one.

    Raises:
        InvalidInputError: The URDF cannot be used; the message says why.
    """
    return config if config.robot_urdf is None else read_robot(config)[0]


def read_robot(config: SimConfig) -> tuple[SimConfig, RobotModel]:
    """Find out how the robot of ``config.robot_urdf`` drives.

    The wheels are found by their joints or named; a short drive on an empty floor tells by how much the robot gets
    further and turns less than its wheels say (a skid steer slips at every turn).

    Returns:
        The settings with what the robot replaces in them, and the model.

    Raises:
        InvalidInputError: See :func:`with_own_robot`.
    """
    path = config.robot_urdf
    assert path is not None
    check_description(path)
    _check_loads(path)
    with PhysicsWorld(stepped=True) as physics:
        joints, base = _joints(physics, path)
    wheels, heading = _find_wheels(joints, config.robot_wheels, path)
    by_name = {joint.name: joint for joint in joints}
    driven = [by_name[wheel.joint] for wheel in wheels]
    c, s = math.cos(heading), math.sin(heading)
    left = np.array([-s, c, 0.0])
    middle = np.mean([joint.place for joint in driven], axis=0)
    lows, highs = (
        np.array([box, *(getattr(j, side) for j in joints)]) for box, side in zip(base, ("low", "high"), strict=True)
    )
    floor = float(lows[:, 2].min())
    radius = float(np.mean([(joint.high[2] - joint.low[2]) / 2.0 - BOX_MARGIN for joint in driven]))
    corners = np.array(
        [[x, y] for low, high in zip(lows, highs, strict=True) for x in (low[0], high[0]) for y in (low[1], high[1])]
    )
    robot = replace(
        config.robot,
        radius=float(np.hypot(*(corners - middle[:2]).T).max()),
        height=float(highs[:, 2].max()) - floor,
    )
    sides = {side: np.mean([by_name[w.joint].place @ left for w in wheels if w.side == side]) for side in (1, -1)}
    effort = min(joint.effort for joint in driven)
    model = RobotModel(
        urdf=path,
        wheels=wheels,
        wheel_radius=radius,
        track=float(sides[1] - sides[-1]),
        torque=effort if effort > 0.0 else math.inf,
        base_height=-floor,
        heading=heading,
        offset=(float(middle[0]), float(middle[1])),
        foreign=True,
    )
    model, robot = _calibrated(model, robot, path)
    lidar = _lidar_mount(joints, middle, heading, floor)
    found = config.lidar if lidar is None else replace(config.lidar, mount=lidar[:3], height=lidar[3])
    return replace(config, robot=robot, lidar=found), model


def check_description(path: Path) -> None:
    """Refuse what PyBullet would crash on, guess about or fetch from anywhere: it reads URDFs with no care at all.

    Raises:
        InvalidInputError: Not XML or no robot, too large, a mass below 0 or that is no number, or a mesh that is
            missing or outside the file's folder.
    """
    read_bytes(path, what=WHAT, max_bytes=LARGEST)
    root = parse_xml(path, what=WHAT)
    if root.tag != "robot" or not root.findall("link"):
        raise InvalidInputError(f"<{root.tag}> without links", expected=f"{WHAT}: <robot> with <link>", where=path)
    for item in root.iter("mass"):
        text = item.get("value", "")
        try:
            fine = math.isfinite(float(text)) and float(text) >= 0.0
        except ValueError:
            fine = False
        if not fine:
            raise InvalidInputError(f"a mass of {text!r}", expected="a finite number, at least 0", where=path)
    _check_tree(root, path)
    folder = path.resolve().parent
    for item in root.iter("mesh"):
        name = item.get("filename", "")
        mesh = (folder / name).resolve()
        if "://" in name or not mesh.is_relative_to(folder):
            raise InvalidInputError(f"a mesh {name!r}", expected=f"a file in the folder of the {WHAT}", where=path)
        if not is_file(mesh):
            raise InvalidInputError(f"a mesh {name!r} that is not there", expected="a file", where=path)
        read_bytes(mesh, what="a mesh", max_bytes=LARGEST_MESH)


def _check_tree(root: Any, path: Path) -> None:
    """Check that links and joints make one tree: PyBullet crashes on anything else."""
    links = [link.get("name") for link in root.findall("link")]
    pairs = []
    for joint in root.findall("joint"):
        ends = [item.get("link") if (item := joint.find(end)) is not None else None for end in ("parent", "child")]
        pairs.append(tuple(ends))
    parents = {child: parent for parent, child in pairs}
    whole = len(links) == len(set(links)) <= MOST_LINKS and None not in links and len(parents) == len(pairs)
    whole &= {name for pair in pairs for name in pair} <= set(links) and len(pairs) == len(links) - 1
    if whole:
        # As many joints as a tree has, each link below one other at most: what is no tree has a circle.
        for link in links:
            seen = {link}
            while (link := parents.get(link)) is not None and whole:
                whole = link not in seen
                seen.add(link)
    if not whole:
        raise InvalidInputError(
            f"{len(links)} links and {len(pairs)} joints that make no tree",
            expected=f"{WHAT}: at most {MOST_LINKS} links of different names below one", where=path,
        )  # fmt: skip


def _check_loads(path: Path) -> None:
    """Load the description in a process of its own: what is broken in a mesh may end the process."""
    code = "import sys, pybullet as p; p.connect(p.DIRECT); p.loadURDF(sys.argv[1]); p.stepSimulation()"
    done = subprocess.run(
        [sys.executable, "-c", code, str(path)], capture_output=True, timeout=LOADING, check=False, cwd=path.parent
    )
    if done.returncode != 0:
        raise InvalidInputError("a description that PyBullet does not load", expected=WHAT, where=path)


def _joints(physics: PhysicsWorld, path: Path) -> tuple[list[Joint], tuple[FloatArray, FloatArray]]:
    """List the joints, and the corners of the box around the base, of the robot with its base at the origin."""
    bullet, client = physics.bullet, physics.client
    with quiet():
        flags = bullet.URDF_USE_INERTIA_FROM_FILE
        body = bullet.loadURDF(str(path), [0.0, 0.0, 0.0], flags=flags, physicsClientId=client)
    offset = bullet.getDynamicsInfo(body, -1, physicsClientId=client)[3]
    bullet.resetBasePositionAndOrientation(body, offset, [0.0, 0.0, 0.0, 1.0], physicsClientId=client)
    bullet.performCollisionDetection(physicsClientId=client)
    found = []
    for index in range(bullet.getNumJoints(body, physicsClientId=client)):
        info = bullet.getJointInfo(body, index, physicsClientId=client)
        state = bullet.getLinkState(body, index, computeForwardKinematics=1, physicsClientId=client)
        turn = np.array(bullet.getMatrixFromQuaternion(state[5])).reshape(3, 3)
        box = _box(physics, body, index, state[4])
        revolute = info[2] == bullet.JOINT_REVOLUTE
        found.append(
            Joint(
                index, info[1].decode(errors="replace"), info[12].decode(errors="replace"), info[16],
                free=revolute and info[8] > info[9], limited=revolute and info[8] <= info[9],
                axis=turn @ np.array(info[13]), place=np.array(state[4]),
                heading=math.atan2(turn[1, 0], turn[0, 0]), low=box[0], high=box[1], effort=info[10],
            )
        )  # fmt: skip
    return found, _box(physics, body, -1, (0.0, 0.0, 0.0))


def _box(physics: PhysicsWorld, body: int, link: int, place: Any) -> tuple[FloatArray, FloatArray]:
    bullet, client = physics.bullet, physics.client
    if not bullet.getCollisionShapeData(body, link, physicsClientId=client):
        return np.array(place), np.array(place)
    low, high = bullet.getAABB(body, link, physicsClientId=client)
    return np.array(low), np.array(high)


def _find_wheels(joints: list[Joint], named: str | None, path: Path) -> tuple[tuple[Wheel, ...], float]:
    """Find the driven wheels and the direction in which they roll [rad]."""
    by_name = {joint.name: joint for joint in joints}
    if named is not None:
        names = [name.strip() for name in named.split(",") if name.strip()]
        unknown = [name for name in names if name not in by_name]
        if unknown or not names:
            raise InvalidInputError(
                f"wheels {named!r}", expected=f"joints of {', '.join(by_name) or 'the robot'}", where=path
            )
        wheels = [by_name[name] for name in names]
        if any(abs(wheel.axis[2]) > LEVEL or not wheel.free for wheel in wheels):
            raise InvalidInputError(
                f"wheels {named!r}", expected="joints that turn freely about a level axis", where=path
            )
    else:
        lowest = min((joint.low[2] for joint in joints), default=0.0)
        wheels = [
            j for j in joints
            if j.free and abs(j.axis[2]) < LEVEL and np.ptp([j.low[2], j.high[2]]) > 0 and j.low[2] < lowest + GROUND
        ]  # fmt: skip
    steering = [above for wheel in wheels for above in _above(wheel, joints) if above.limited]
    if steering:
        steered = ", ".join(sorted({joint.name for joint in steering}))
        raise InvalidInputError(
            f"a robot that steers like a car ({steered})", expected="wheels on two sides that turn it", where=path
        )
    fixed = [wheel for wheel in wheels if not _above(wheel, joints)]
    if not fixed:
        raise InvalidInputError(
            "a robot without wheels", expected="free joints with level axes near the floor", where=path
        )
    forward = np.cross(fixed[0].axis, [0.0, 0.0, 1.0])
    if forward @ np.array([1.0, 0.5, 0.0]) < 0.0:
        forward = -forward
    heading = math.atan2(forward[1], forward[0])
    left = np.array([-math.sin(heading), math.cos(heading), 0.0])
    if any(abs(np.cross(wheel.axis, left)).max() > LEVEL for wheel in fixed):
        raise InvalidInputError("a robot whose wheels roll in several directions", expected="parallel axes", where=path)
    middle = float(np.mean([wheel.place @ left for wheel in fixed]))
    found = [
        Wheel(wheel.name, 1 if wheel.axis @ left > 0 else -1, 1 if wheel.place @ left > middle else -1)
        for wheel in fixed
        if abs(wheel.place @ left - middle) > BESIDE
    ]
    if {wheel.side for wheel in found} != {1, -1}:
        raise InvalidInputError(
            f"a robot with {len(fixed)} wheels on one side", expected="driven wheels on two sides", where=path
        )
    return tuple(found), heading


def _above(joint: Joint, joints: list[Joint]) -> list[Joint]:
    """List the joints between a link and the base that can turn."""
    found, parent = [], joint.parent
    while parent >= 0:
        above = joints[parent]
        if above.free or above.limited:
            found.append(above)
        parent = above.parent
    return found


def _calibrated(model: RobotModel, robot: RobotConfig, path: Path) -> tuple[RobotModel, RobotConfig]:
    """Calibrate wheel radius, track and accelerations so that the robot drives as it is told and does not tip.

    Raises:
        InvalidInputError: It does not get on, does not turn or tips, however gently it is driven.
    """
    for share in GENTLER:
        limits = replace(
            robot,
            max_acceleration=share * robot.max_acceleration,
            max_turn_acceleration=share * robot.max_turn_acceleration,
        )
        tried = _try_out(model, limits)
        if tried.tilt < TIPS and tried.ahead > DRIVES and tried.turned > DRIVES:
            track = model.track * tried.ahead / tried.turned
            return replace(model, wheel_radius=model.wheel_radius * tried.ahead, track=track), limits
    why = "tips over" if tried.tilt >= TIPS else "does not get on" if tried.ahead <= DRIVES else "does not turn"
    raise InvalidInputError(f"a robot that {why} when its wheels turn", expected="one that drives", where=path)


@dataclass(frozen=True, slots=True)
class _Trial:
    """How a robot drove: shares of the distance and the turn that its wheels counted, and the largest tilt [rad]."""

    ahead: float
    turned: float
    tilt: float


def _try_out(model: RobotModel, limits: RobotConfig) -> _Trial:
    """Drive ahead, stop, and turn on the spot on an empty floor."""
    with PhysicsWorld(stepped=True) as physics, quiet():
        driven = WheeledRobot(physics, model, limits, (0.0, 0.0, 0.0))
        driven.advance(0.0, 0.0, SETTLE, _ignore)
        x, y, c, s = driven.x, driven.y, math.cos(driven.theta), math.sin(driven.theta)
        counted: list[Motion] = []
        tilts = []
        for _ in range(STRETCHES):
            driven.advance(SHARE * limits.max_speed, 0.0, DRIVE / STRETCHES, counted.append)
            tilts.append(driven.tilt)
        ahead = (c * (driven.x - x) + s * (driven.y - y)) / max(sum(motion.dx for motion in counted), 1e-6)
        driven.advance(0.0, 0.0, SETTLE, _ignore)
        before = driven.theta
        counted.clear()
        for _ in range(STRETCHES):
            driven.advance(0.0, SHARE * limits.max_turn_rate, DRIVE / STRETCHES, counted.append)
            tilts.append(driven.tilt)
        turned = (driven.theta - before) / max(sum(motion.turn for motion in counted), 1e-6)
    return _Trial(ahead, turned, max(tilts))


def _ignore(_: Motion) -> None:
    pass


def _lidar_mount(
    joints: list[Joint], middle: FloatArray, heading: float, floor: float
) -> tuple[float, float, float, float] | None:
    """Find the lidar, ``(x, y, theta)`` in the robot frame, and its height [m]; ``None`` where no link says."""
    for word in LIDAR_NAMES:
        for joint in joints:
            if word in joint.link.lower():
                x, y, _ = joint.place - middle
                c, s = math.cos(heading), math.sin(heading)
                height = float(joint.place[2]) - floor
                if not 0.0 < height < 0.7:
                    raise InvalidInputError(
                        f"a lidar ({joint.link}) {height:.2f} m above the floor",
                        expected="below 0.7 m, where furniture ends",
                    )
                return (float(c * x + s * y), float(c * y - s * x), joint.heading - heading, height)
    return None
