"""The robot in a recording: its body, the scans it takes, the paths it drives, what touches it."""

from collections.abc import Sequence

import numpy as np
import rerun as rr

from closedrooms.core.arrays import FloatArray
from closedrooms.core.door import Point
from closedrooms.core.pose import Pose2
from closedrooms.core.scan import LaserScan
from closedrooms.visualization import colours
from closedrooms.visualization.rerun import drawables
from closedrooms.visualization.rerun.stream import RecordingStream

# Out of ten scans a second two are kept: what the eye can follow [s].
SCAN_PERIOD = 0.5
# Scans are handed over in batches of this size.
SCAN_BATCH = 64
# A vertex of a drawn path every so many metres.
PATH_STEP = 0.1
PATH_COLOURS = {"odometry": colours.ODOMETRY, "estimate": colours.ESTIMATE, "truth": colours.TRUTH}


class RecordedRobot:
    """Robot in a recording: what it senses and drives, in the map frame [m]; batched where that is cheaper."""

    def __init__(self, stream: RecordingStream, radius: float) -> None:
        self._stream, self._radius = stream, radius
        self._scans: list[tuple[float, int, FloatArray]] = []
        self._paths: dict[str, list[Point]] = {name: [] for name in PATH_COLOURS}
        self._touched: list[Point] = []
        self.last_scan = -np.inf
        """When a scan was last kept [s]."""

    def draw_body(self, path: str, colour: colours.Colour) -> None:
        """Draw the body and its heading, in the robot frame."""
        self._stream.log(
            f"{path}/body",
            rr.Cylinders3D(
                lengths=[0.3], radii=[self._radius], centers=[[0, 0, 0.15]], colors=[colour], fill_mode="solid"
            ),
            static=True,
        )
        self._stream.log(
            f"{path}/heading",
            rr.Arrows3D(origins=[[0, 0, 0.32]], vectors=[[3 * self._radius, 0, 0]], colors=[colour], radii=[0.05]),
            static=True,
        )

    def style_scans(self) -> None:
        """Say once how scans look."""
        style = rr.Points3D.from_fields(colors=[colours.SCAN], radii=[drawables.MEDIUM])
        self._stream.log("map/scan", style, static=True)

    def add_poses(self, odometry: Pose2, estimate: Pose2, truth: Pose2 | None) -> None:
        """Lengthen the paths by where the robot is; the odometry in its own frame."""
        for name, pose in {"odometry": odometry, "estimate": estimate, "truth": truth}.items():
            path = self._paths[name]
            if pose is not None and (not path or np.hypot(pose.x - path[-1][0], pose.y - path[-1][1]) > PATH_STEP):
                path.append((pose.x, pose.y))

    def add_scan(self, scan: LaserScan, map_T_robot: Pose2, stage: int) -> bool:
        """Keep every few scans; whether there are so many now that they should be sent."""
        if scan.stamp < self.last_scan + SCAN_PERIOD - 1e-6:
            return False
        self.last_scan = scan.stamp
        ends = map_T_robot.transform(Pose2(*scan.robot_T_sensor).transform(scan.points_sensor()))
        self._scans.append((scan.stamp, stage, ends))
        return len(self._scans) >= (1 if self._stream.live else SCAN_BATCH)

    def send_scans(self) -> None:
        """Send the scans kept since the last time in one call: many times cheaper than one call each."""
        if not self._scans:
            return
        lengths = [len(ends) for _, _, ends in self._scans]
        places = drawables.lifted(np.concatenate([ends for _, _, ends in self._scans]), drawables.Z_POINT)
        columns = rr.Points3D.columns(positions=places).partition(lengths)
        stages = [stage for _, stage, _ in self._scans]
        stamps = np.array([stamp for stamp, _, _ in self._scans])
        self._stream.columns("map/scan", columns, stamps=stamps, stages=stages)
        self._scans = []

    def draw_paths(self) -> None:
        """Draw the paths so far."""
        for name, path in self._paths.items():
            if path:
                self._draw_path(name, np.array(path))

    def correct_path(self, poses: FloatArray) -> None:
        """Replace the estimated path by the one after the last optimisation, shape (n, 3)."""
        path = np.asarray(poses, dtype=np.float64)[:, :2]
        self._paths["estimate"] = [(float(x), float(y)) for x, y in path[:: max(len(path) // 2000, 1)]]
        self._draw_path("estimate", path)

    def draw_reference(self, poses: FloatArray) -> None:
        """Draw the true path where it comes afterwards, shape (n, 3)."""
        self._draw_path("truth", np.asarray(poses, dtype=np.float64)[:, :2])

    def _draw_path(self, name: str, path: FloatArray) -> None:
        drawn = drawables.strips([path], PATH_COLOURS[name], z=drawables.Z_PATH)
        self._stream.log(f"map/path/{name}", drawn)

    def draw_contacts(self, bumps: Sequence[float], map_T_robot: Pose2) -> bool:
        """Draw where something pressed, by directions in the robot frame [rad]; whether these are the first."""
        ends = self._radius * np.column_stack((np.cos(bumps), np.sin(bumps)))
        first = not self._touched
        self._touched += [(float(x), float(y)) for x, y in map_T_robot.transform(ends)]
        places = np.array(self._touched)
        self._stream.log("map/contacts", drawables.points(places, colours.CONTACT, radius=2 * drawables.THICK))
        return first
