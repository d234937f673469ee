"""The same rays cast by others, on the walls as extruded: Embree, IR-SIM and pyrobosim, each where it is installed.

IR-SIM and pyrobosim are simulators of robots in the plane; of both the lidar alone is asked, as one step of theirs asks
it. Every peer is a call without arguments that returns the distances of all scans, (scans, beams) [m], or ``None``
where its package is missing.
"""

import io
import tempfile
from collections.abc import Callable
from contextlib import redirect_stdout
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import yaml
from numpy.typing import NDArray
from shapely.geometry import Point, Polygon, box
from shapely.geometry.base import BaseGeometry

from closedrooms.core.pose import Pose2
from closedrooms.sim.config import LidarConfig
from closedrooms.worlds.extrusion import extrude

Rays = Callable[[], NDArray[np.float64]]


def embree(solids: BaseGeometry, poses: list[Pose2], lidar: LidarConfig) -> Rays | None:
    """Embree on the triangles of the extruded walls."""
    try:
        from embreex.mesh_construction import TriangleMesh
        from embreex.rtcore_scene import EmbreeScene
    except ImportError:
        return None
    vertices, faces = extrude(solids)
    scene = EmbreeScene()
    TriangleMesh(scene, np.asarray(vertices, dtype=np.float32)[np.asarray(faces)])
    angles = lidar.angle_min + lidar.angle_increment * np.arange(lidar.beams)
    batches = []
    for pose in poses:
        starts = np.tile(np.array([pose.x, pose.y, lidar.height], dtype=np.float32), (lidar.beams, 1))
        directions = np.zeros((lidar.beams, 3), dtype=np.float32)
        directions[:, 0], directions[:, 1] = np.cos(angles + pose.theta), np.sin(angles + pose.theta)
        batches.append((starts, directions))
    return lambda: np.array([scene.run(starts, directions, query="DISTANCE") for starts, directions in batches])


def ir_sim(solids: BaseGeometry, poses: list[Pose2], lidar: LidarConfig) -> Rays | None:
    """IR-SIM's ``Lidar2D`` in a world whose obstacles are the rings of the walls."""
    try:
        with redirect_stdout(io.StringIO()):
            import irsim
    except ImportError:
        return None
    rings = [ring for part in getattr(solids, "geoms", [solids]) for ring in (part.exterior, *part.interiors)]
    x0, y0, x1, y1 = solids.bounds
    span = lidar.angle_increment * (lidar.beams - 1)
    sensor = {"name": "lidar2d", "range_max": lidar.range_max, "angle_range": span, "number": lidar.beams}
    world = {
        "world": {"width": float(x1 - x0), "height": float(y1 - y0), "offset": [float(x0), float(y0)]},
        "robot": [
            {
                "kinematics": {"name": "diff"},
                "shape": {"name": "circle", "radius": 0.2},
                "state": [0, 0, 0],
                "sensors": [sensor],
            }
        ],
        "obstacle": [
            {"shape": {"name": "linestring", "vertices": [list(xy) for xy in ring.coords]}, "state": [0, 0, 0]}
            for ring in rings
        ],
    }
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "world.yaml"
        file.write_text(yaml.safe_dump(world))
        scene = irsim.make(str(file), display=False, log_level="ERROR")
    sensor = scene.robot.lidar
    turned = lidar.angle_min - sensor.angle_min
    states = [np.array([[pose.x], [pose.y], [pose.theta + turned]]) for pose in poses]

    def run() -> NDArray[np.float64]:
        ranges = np.empty((len(states), lidar.beams))
        for row, state in zip(ranges, states, strict=True):
            sensor.step(state)
            row[:] = sensor.range_data
        return ranges

    return run


def pyrobosim(solids: BaseGeometry, poses: list[Pose2], lidar: LidarConfig) -> Rays | None:
    """Pyrobosim's ``Lidar2D``, which takes the free space of a world as one polygon."""
    try:
        from pyrobosim.sensors.lidar import Lidar2D
        from pyrobosim.utils.pose import Pose
    except ImportError:
        return None
    free = box(*solids.bounds).buffer(2 * lidar.range_max).difference(solids)
    last = lidar.angle_min + lidar.angle_increment * (lidar.beams - 1.5)
    sensor = Lidar2D(
        update_rate_s=0.1,
        angle_units="radians",
        min_angle=lidar.angle_min,
        max_angle=last,
        angular_resolution=lidar.angle_increment,
        max_range_m=lidar.range_max,
    )
    world = SimpleNamespace(total_external_polygon=free, robots=[])
    places: list[tuple[Polygon, Pose]] = [
        (Point(pose.x, pose.y).buffer(0.2), Pose(x=pose.x, y=pose.y, yaw=pose.theta)) for pose in poses
    ]

    def run() -> NDArray[np.float64]:
        ranges = np.empty((len(places), lidar.beams))
        for row, (footprint, place) in zip(ranges, places, strict=True):
            sensor.robot = SimpleNamespace(world=world, polygon=footprint, get_pose=lambda place=place: place)
            sensor.update()
            row[:] = sensor.get_measurement()
        return ranges

    return run


PEERS = {"embree": embree, "IR-SIM": ir_sim, "pyrobosim": pyrobosim}
