"""Runs inputs after public files that were once read wrongly, and compares what comes out with what is right.

    python tests/hostile/real_cases.py FOLDER [--only-real]

FOLDER holds the sub-folders ``real`` and ``hostile``; the cases of the latter follow, by ``cases.py``. One line a case;
exits with 1 when one is not as wanted.
"""

import argparse
import contextlib
import io
import json
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
from scipy import ndimage
from shapely.geometry import Point, box

from closedrooms.cli.commands import main
from closedrooms.core.errors import InvalidInputError
from closedrooms.core.files.geojson import read_features, read_rooms
from closedrooms.core.files.rosmap import read_map
from closedrooms.core.grid import OccupancyGrid
from closedrooms.mapping.logs import read_run
from closedrooms.mapping.logs.recorded_run import RecordedRun
from closedrooms.mapping.map_builder import build_map
from closedrooms.mapping.trajectory import ate
from closedrooms.worlds.geometry import room_interior, wall_area
from closedrooms.worlds.library import load_world

SAME_WALL, SHARE = 0.1, 0.97
"""Walls of two maps within this [m] are the same; share of them from which the maps are."""
SAME_PATH, OTHER_KEYFRAMES = 0.05, 0.92
"""Two estimates of one drive within this [m] are the same. Their maps are drawn from other keyframes, which see other
corners: of the plain log, begun 1, 2, 3, 5 or 8 scans later, 87 to 97 % of the walls are those of the whole."""


@dataclass(frozen=True)
class Told:
    """Outcome of a command: exit status, all that it said, the folder that it wrote."""

    status: int
    text: str
    out: Path

    @property
    def run(self) -> dict[str, Any]:
        """Content of ``run.json``."""
        return dict(json.loads((self.out / "run.json").read_text()))


def call(command: str, *words: object) -> Told:
    """Run a command in this process into a folder of its own."""
    out, said = Path(tempfile.mkdtemp(prefix="real-")) / "out", io.StringIO()
    with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
        status = main([command, *map(str, words), "--out", str(out)])
    return Told(status, said.getvalue(), out)


def same_map(first: Path, second: Path) -> list[str]:
    """Map two logs and compare the walls."""
    grids = []
    for log in (first, second):
        told = call("map", log, "--no-record")
        if told.status:
            return [f"status {told.status}: {told.text.splitlines()[-1]}"]
        grids.append(read_map(told.out / "map.yaml"))
    share = min(walls_near(*grids), walls_near(*grids[::-1]))
    return [] if share >= SHARE else [f"only {share:.0%} of the walls are the same"]


def same_drive(first: Path, second: Path) -> list[str]:
    """Map two logs of the same scans, one without odometry, and compare where the robot drove, and the walls."""
    one, other = (build_map(read_run(log)) for log in (first, second))
    apart = ate(one.trajectory, other.trajectory)[0]
    share = min(walls_near(one.grid, other.grid), walls_near(other.grid, one.grid))
    wrong = [f"{apart:.3f} m from where it drove"] if apart > SAME_PATH else []
    return wrong if share >= OTHER_KEYFRAMES else [*wrong, f"only {share:.0%} of the walls are the same"]


def walls_near(grid: OccupancyGrid, other: OccupancyGrid) -> float:
    """Measure the share of a map's walls that lie near walls of another."""
    gap = np.asarray(ndimage.distance_transform_edt(~np.pad(other.occupied, 1))) * other.frame.resolution
    cells = other.frame.to_cells(grid.frame.to_points(np.argwhere(grid.occupied))) + 1
    rows, cols = (np.clip(cells[:, axis], 0, gap.shape[axis] - 1) for axis in (0, 1))
    return float((gap[rows, cols] <= SAME_WALL).mean())


def same_scans(first: Path, second: Path) -> list[str]:
    """Compare the end points of two logs' scans, in the frame of the robot."""
    a, b = (read_run(path) for path in (first, second))
    if len(a.scans) != len(b.scans):
        return [f"{len(a.scans)} scans and {len(b.scans)}"]
    apart = max(np.abs(ends(a, i) - ends(b, i)).max() for i in range(len(a.scans)))
    return [] if apart < 0.1 else [f"end points up to {apart:.2f} m apart"]


def ends(run: RecordedRun, number: int) -> Any:
    """End points of one scan as x, y [m], the missing ones at the origin."""
    scan = run.scans[number]
    ranges = np.nan_to_num(scan.ranges, nan=0.0, posinf=0.0)
    angles = scan.angle_min + scan.angle_increment * np.arange(ranges.size)
    return np.column_stack((ranges * np.cos(angles), ranges * np.sin(angles)))


def pyrobosim_pose(real: Path) -> list[str]:
    plan = load_world(str(real / "01-pyrobosim-pose/pyrobosim-pose.yaml"))
    floors = {room.label: room_interior(plan, room.id) for room in plan.rooms}
    wanted = {"hall": box(0, 0, 8, 3), "office": box(0.5, 3.6, 3.5, 7.6), "store": box(5, 4.1, 8, 6.1)}
    wrong = [
        f"{name} lies elsewhere"
        for name, floor in wanted.items()
        if name not in floors or floors[name].symmetric_difference(floor).area > 0.05 * floor.area
    ]
    return wrong if len(plan.doors) == 2 else [*wrong, f"{len(plan.doors)} doors"]


def starts(real: Path) -> list[str]:
    wrong = []
    for path in sorted((real / "03-start-in-stub").iterdir()):
        told = call("run", path, "--noise", "none", "--no-record")
        if told.status not in {0, 3} or told.run["metrics"]["area_mapped"] < 0.9:
            wrong.append(f"{path.name}: status {told.status}")
    return wrong


def zero_tour(real: Path) -> list[str]:
    told = call("run", real / "04-zero-tour/single-hall.building.yaml", "--noise", "none", "--no-record")
    return [] if told.status == 0 and "n/a" in told.text and (told.out / "summary.png").exists() else [told.text[-200:]]


def thin_walls(real: Path) -> list[str]:
    path = real / "06-thin-walls/thin-partition.yaml"
    grid, plan = read_map(path), load_world(str(path))
    walls, centres = wall_area(plan), grid.frame.to_points(np.argwhere(grid.occupied))
    lost = sum(not walls.covers(Point(centre)) for centre in centres)
    return [f"{lost} of {len(centres)} occupied cells are no wall"] if lost else []


def vertex_in_pillar(real: Path) -> list[str]:
    path = real / "07-vertex-in-pillar/pillars.yaml"
    told = call("cover", path)
    grid = read_map(path)
    points = [geometry for geometry, _ in read_features(told.out / "tour.geojson") if geometry.geom_type == "Point"]
    cells = grid.frame.to_cells(np.array([(p.x, p.y) for p in points]))
    bad = int((~grid.free[cells[:, 0], cells[:, 1]]).sum())
    return [f"{bad} of {len(points)} vertices are not free"] if bad or told.status else []


def facing_doors(real: Path) -> list[str]:
    wrong = []
    for name in ("cl-w5-opp", "ov-t0-d3"):
        stem = real / "16-two-doors-facing" / name
        told = call("predict", f"{stem}.yaml", "--doors", f"{stem}.geojson", "--no-record")
        rooms = [room.polygon for room in read_rooms(told.out / "rooms.geojson")]
        shared = sum(a.intersection(b).area for a, b in combinations(rooms, 2))
        wrong += [f"{name}: {shared:.1f} m2 belong to two rooms"] if shared > 0.01 or not rooms else []
    return wrong


def image_paths(real: Path) -> list[str]:
    folder = real / "14-image-path"
    plain = read_map(folder / "plain.yaml").cells
    return [path.name for path in sorted(folder.glob("*.yaml")) if not np.array_equal(read_map(path).cells, plain)]


def dataset_level(real: Path) -> list[str]:
    path = real / "19-dataset-level/two-levels.building.yaml"
    level = next(iter(told_levels(path)))
    told = call("dataset", f"{path}:{level}", "--repetitions", "1", "--max-closed", "1", "--workers", "1")
    return [] if told.status == 0 else [told.text[-200:]]


def told_levels(path: Path) -> list[str]:
    """Read the names of the levels out of the refusal of a building with several."""
    try:
        load_world(str(path))
    except InvalidInputError as error:
        return str(error).partition("with the levels ")[2].partition(";")[0].split(", ")
    return []


def old_bag(real: Path) -> list[str]:
    told = call("map", real / "21-bag-messages/old-format.bag")
    return [] if told.status == 1 and "a ROS bag 1.2; expected ROS bag 2.0" in told.text else [told.text]


def odometry_reset(real: Path) -> list[str]:
    folder = real / "23-odometry-reset"
    told = call("map", folder / "odomreset", "--no-record")
    said = [] if "a jump of the odometry" in told.text else ["the jump is not told"]
    return said + same_map(folder / "odomreset", folder / "plain")


def checks(real: Path) -> Iterator[tuple[str, Callable[[], list[str]]]]:
    """Yield every case with its name; a check returns what is wrong."""
    for check in (pyrobosim_pose, starts, zero_tour, thin_walls, vertex_in_pillar, image_paths, facing_doors,
                  dataset_level, old_bag, odometry_reset):  # fmt: skip
        yield check.__name__, lambda check=check: check(real)
    for bag in ("09-tf-mount/upside_in_tf.bag", "09-tf-mount/mount_in_tf.bag", "10-tf-odometry/tfodom",
                "18-multiecho/multiecho"):  # fmt: skip
        yield bag, lambda bag=bag: same_map(real / bag, real / "plain")
    yield "10-tf-odometry/noodom", lambda: same_drive(real / "10-tf-odometry/noodom", real / "plain")
    carmen = real / "12-carmen-step"
    for log in sorted(carmen.iterdir()):
        yield log.name, lambda log=log: same_scans(log, carmen / "rl181.log.gz")


def run_all() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--only-real", action="store_true", help="leave out the hostile ones")
    options = parser.parse_args()
    bad = 0
    for name, check in checks(options.folder / "real"):
        wrong = check()
        bad += bool(wrong)
        sys.stdout.write(f"{'BAD' if wrong else 'ok '} {name:<44} {'; '.join(wrong)}\n")
        sys.stdout.flush()
    sys.stdout.write(f"{bad} not as wanted\n")
    if options.only_real:
        return int(bad > 0)
    hostile = [sys.executable, str(Path(__file__).with_name("cases.py")), str(options.folder / "hostile")]
    return int(subprocess.run(hostile, check=False).returncode > 0 or bad > 0)


if __name__ == "__main__":
    sys.exit(run_all())
