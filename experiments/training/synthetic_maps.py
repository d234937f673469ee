"""Maps with closed doors drawn straight from a floor plan: what a robot would bring home, without the drive.

A simulated exploration takes minutes a map; these take a fraction of a second, so that hundreds of closings of a
building can be fitted on. The robot is taken to have seen all that it can reach: reached floor is free, the face of
every wall and leaf around it is occupied. Scan matching bends walls by a cell, a face is one or two cells thick and
has holes; what lies behind it stays unknown.
"""

import shutil
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from scipy.special import ndtri

from closedrooms.core.arrays import BoolArray, CellArray, FloatArray
from closedrooms.core.door import ClosedDoor
from closedrooms.core.files.geojson import write_doors, write_rooms
from closedrooms.core.files.outgoing import write_json
from closedrooms.core.files.rosmap import write_map
from closedrooms.core.grid import FREE, OCCUPIED, UNKNOWN, GridFrame, OccupancyGrid
from closedrooms.core.pose import Pose2
from closedrooms.core.room import Room
from closedrooms.worlds.closing import hidden_rooms
from closedrooms.worlds.plan import FloorPlan
from closedrooms.worlds.start_pose import start_pose
from closedrooms.worlds.truth import rasterise, reachable, true_rooms, truth_bounds

RESOLUTION = 0.05
# Unknown cells around the building [m].
MARGIN = 1.0
# Walls are bent by about this much, over about this length [m]: what scan matching left on the simulated worlds.
BEND, BEND_LENGTH = 0.03, 4.0
# Share of the cells of a wall's face without a hit; how much of all faces is two cells thick, in patches so long [m].
HOLES, THICK, PATCH = 0.02, 0.5, 0.4
# Standard deviation of where a closed door is taken to be [m], of each coordinate.
DOOR_SD = 0.03


@dataclass(frozen=True, slots=True, eq=False)
class DrawnMap:
    """Map, closed doors and truth, on one frame.

    Attributes:
        observed: The map with closed doors.
        truth: The true map.
        doors: Closed doors that can be seen.
        rooms: True rooms behind closed doors that can be seen.
    """

    observed: OccupancyGrid
    truth: OccupancyGrid
    doors: tuple[ClosedDoor, ...]
    rooms: tuple[Room, ...]


def synthesise_map(plan: FloorPlan, closed: Sequence[str], rng: np.random.Generator, *, angle: float = 0.0) -> DrawnMap:
    """Draw what a robot maps of a plan with some doors closed.

    Args:
        plan: The building.
        closed: Ids of doors that hide whole rooms.
        rng: Noise.
        angle: Of the building in the map [rad].
    """
    map_T_world = Pose2(0.0, 0.0, angle)
    x0, y0, x1, y1 = truth_bounds(plan, map_T_world)
    rows, cols = (int(np.ceil((high - low + 2 * MARGIN) / RESOLUTION)) for low, high in ((y0, y1), (x0, x1)))
    frame = GridFrame(RESOLUTION, x0 - MARGIN, y0 - MARGIN, rows, cols)
    start = start_pose(plan)
    truth = rasterise(plan, frame, map_T_world)
    reached = reachable(plan, closed, frame, map_T_world, (start.x, start.y))
    observed = OccupancyGrid(frame, _observe(reached, rng))
    doors = _sight_doors(plan, closed, map_T_world, observed, rng)
    seen = {door.id for door in doors}
    rooms = [room for room in true_rooms(plan, closed, map_T_world) if set(room.doors) <= seen]
    hidden = {door for _, doors_of in hidden_rooms(plan, closed) for door in doors_of}
    return DrawnMap(observed, truth, tuple(door for door in doors if door.id in hidden), tuple(rooms))


def _observe(reached: BoolArray, rng: np.random.Generator) -> CellArray:
    """Draw the cells of a map whose reachable floor is ``reached``, both of shape (rows, cols)."""
    shape = reached.shape
    field = [_smooth_field(shape, BEND_LENGTH, rng) * BEND / RESOLUTION for _ in range(2)]
    y, x = np.indices(shape, dtype=np.float32)
    bent = cv2.remap(
        reached.view(np.uint8),
        (x + field[0]).astype(np.float32),
        (y + field[1]).astype(np.float32),
        cv2.INTER_NEAREST,
        borderValue=0.0,
    )
    cross = np.ones((3, 3), np.uint8)
    face = cv2.dilate(bent, cross)
    second = (cv2.dilate(face, cross) > 0) & (_smooth_field(shape, PATCH, rng) > float(ndtri(1.0 - THICK)))
    wall = ((face > 0) | second) & (bent == 0) & (rng.random(shape) >= HOLES)
    cells = np.full(shape, UNKNOWN, dtype=np.int8)
    cells[bent > 0] = FREE
    cells[wall] = OCCUPIED
    return cells


def _smooth_field(shape: tuple[int, int], length: float, rng: np.random.Generator) -> FloatArray:
    """Draw noise of a shape, mean 0 and standard deviation 1, that changes over about ``length`` [m]."""
    step = max(int(length / RESOLUTION), 1)
    coarse = rng.standard_normal((shape[0] // step + 3, shape[1] // step + 3))
    fine = cv2.resize(coarse, (coarse.shape[1] * step, coarse.shape[0] * step), interpolation=cv2.INTER_LINEAR)
    window = np.asarray(fine[: shape[0], : shape[1]], dtype=np.float64)
    return np.asarray(window / max(float(window.std()), 1e-9))


def _sight_doors(
    plan: FloorPlan, closed: Sequence[str], map_T_world: Pose2, observed: OccupancyGrid, rng: np.random.Generator
) -> list[ClosedDoor]:
    """Find the closed doors with reached floor before them, as a robot tells where they are."""
    doors = []
    near = cv2.dilate(observed.free.view(np.uint8), np.ones((2 * round(0.3 / RESOLUTION) + 1,) * 2, np.uint8)) > 0
    for door in plan.doors:
        if door.id not in set(closed):
            continue
        ends = map_T_world.transform(np.array(door.segment))
        row, col = observed.frame.to_cells(ends.mean(axis=0))
        if not near[row, col]:
            continue
        (ax, ay), (bx, by) = (ends + rng.normal(0.0, DOOR_SD, 2)).tolist()
        middle = ((ax + bx) / 2, (ay + by) / 2)
        doors.append(ClosedDoor(door.id, middle, ((ax, ay), (bx, by)), door.width))
    return doors


def write_sample(folder: Path, drawn: DrawnMap, *, world: str, repetition: int) -> None:
    """Write a drawn map as a sample that ``closedrooms evaluate`` reads.

    Raises:
        OutputError: The folder cannot be written.
    """
    if folder.exists():
        shutil.rmtree(folder)
    folder.mkdir(parents=True)
    write_map(folder / "map", drawn.observed)
    write_map(folder / "truth", drawn.truth)
    write_doors(folder / "doors.geojson", drawn.doors)
    write_rooms(folder / "truth_rooms.geojson", drawn.rooms)
    about = {"world": world, "repetition": repetition, "closed": [door.id for door in drawn.doors]}
    write_json(folder / "run.json", about)
