"""Tours for ROS 2, without ROS: ``nav_msgs/Path`` and waypoints as nav2's tools read them, both as YAML."""

import math
from pathlib import Path

from closedrooms.core.arrays import FloatArray
from closedrooms.core.files.outgoing import write_bytes

FRAME = "map"


def write_path_message(path: Path, poses: FloatArray) -> None:
    """Write a ``nav_msgs/msg/Path`` as ``ros2 topic echo`` prints it and ``ros2 topic pub`` takes it.

    Args:
        path: File to write.
        poses: x, y [m] and heading [rad] in the map frame, shape (n, 3).
    """
    header = f"{{stamp: {{sec: 0, nanosec: 0}}, frame_id: {FRAME}}}"
    lines = [f"header: {header}", "poses:"]
    for x, y, heading in poses.tolist():
        position = f"{{x: {x:.4f}, y: {y:.4f}, z: 0.0}}"
        z, w = math.sin(heading / 2.0), math.cos(heading / 2.0)
        orientation = f"{{x: 0.0, y: 0.0, z: {z:.6f}, w: {w:.6f}}}"
        lines += [f"- header: {header}", f"  pose: {{position: {position}, orientation: {orientation}}}"]
    write_bytes(path, ("\n".join(lines) + "\n").encode())


def write_waypoints(path: Path, poses: FloatArray) -> None:
    """Write the waypoints that the nav2 panel of RViz loads and saves (``nav2_rviz_plugins``).

    A map ``waypoints`` from ``waypoint0`` on, each with ``pose`` [x, y, z] and ``orientation`` [w, x, y, z]. The panel
    takes them in the order of the file.

    Args:
        path: File to write.
        poses: x, y [m] and heading [rad] in the map frame, shape (n, 3).
    """
    lines = ["waypoints:"]
    for number, (x, y, heading) in enumerate(poses.tolist()):
        z, w = math.sin(heading / 2.0), math.cos(heading / 2.0)
        lines += [
            f"  waypoint{number}:",
            f"    pose: [{x:.4f}, {y:.4f}, 0.0]",
            f"    orientation: [{w:.6f}, 0.0, 0.0, {z:.6f}]",
        ]
    write_bytes(path, ("\n".join(lines) + "\n").encode())
