"""What the network learns from: patches around closed doors, and the true rooms behind them."""

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import cv2
import numpy as np
import numpy.typing as npt
import shapely

from closedrooms.core.arrays import FloatArray, IntArray
from closedrooms.core.errors import ClosedroomsError, reason
from closedrooms.core.room import Room
from closedrooms.core.shapes import Shape
from closedrooms.experiments.evaluation.samples.sample_path import SamplePath
from closedrooms.experiments.evaluation.samples.sample_reader import Sample, read_sample
from closedrooms.experiments.training.buildings import group_of, may_train
from closedrooms.predictor.best.scene import prepare
from closedrooms.predictor.config import BestConfig
from closedrooms.predictor.learned.patches import AHEAD, ASIDE, BEHIND, CELL, FINE, SIZE, Patch, cut_patches

Bytes = npt.NDArray[np.uint8]
# Cells of the map in one of a patch: shares are kept as whole numbers of them.
WHOLE = FINE * FINE
# Bits of the third channel that is kept.
DOOR, OTHER_DOORS = 1, 2
# Distances that are told apart, from the door to either side and back: one a cell.
ASIDE_CELLS, AHEAD_CELLS, DOOR_ROW = round(ASIDE / CELL), round(AHEAD / CELL), round(BEHIND / CELL)
# Steps of a cell in which sides of rooms are measured: a patch has some 100,000 then.
STEPS = 2
# Rounds of the search for the rectangle of a room, which stops after 2 to 4.
ROUNDS = 8


@dataclass(frozen=True, slots=True, eq=False)
class Examples:
    """Doors with their true rooms; n of them.

    Attributes:
        shown: Cells of the map in each cell of a patch that are free, that are occupied, and bits for the doors; shape
            (n, 3, SIZE, SIZE).
        masks: Cells of the map in each cell of a patch that are in the room, shape (n, SIZE, SIZE).
        sides: How far the room reaches left and right of its door and back [m], shape (n, 3).
        groups: Which building each is of, shape (n,).
        names: Of the groups.
    """

    shown: Bytes
    masks: Bytes
    sides: FloatArray
    groups: IntArray
    names: tuple[str, ...]

    def __len__(self) -> int:
        """Count the doors."""
        return len(self.groups)

    def digest(self) -> str:
        """Compute the SHA-256 of names and arrays."""
        total = hashlib.sha256(repr(self.names).encode())
        for part in (self.shown, self.masks, self.sides, self.groups):
            total.update(np.ascontiguousarray(part).tobytes())
        return total.hexdigest()


@dataclass(slots=True, eq=False)
class Gathered:
    """Outcome of reading samples.

    Attributes:
        examples: Doors with their rooms.
        failures: Why a sample could not be used, by its name.
        withheld: Samples of buildings that are kept to choose by or to report on.
        unused: Closed doors without a true room or without unknown space behind them.
    """

    examples: Examples
    failures: dict[str, str] = field(default_factory=dict)
    withheld: int = 0
    unused: int = 0


def gather_examples(paths: Sequence[SamplePath], advance: Callable[[int], None] = lambda _: None) -> Gathered:
    """Read samples and make examples of their doors.

    Args:
        paths: Of the samples.
        advance: Told how many were read.
    """
    shown, masks, sides, groups = [], [], [], []
    failures: dict[str, str] = {}
    withheld = unused = 0
    for number, path in enumerate(paths, start=1):
        try:
            sample = read_sample(path)
            if not may_train(sample.world):
                withheld += 1
                continue
            scene = prepare(sample.observed, sample.doors, BestConfig())
        except (ClosedroomsError, OSError) as error:
            failures[path.name] = reason(error)
            continue
        truth = _true_rooms(sample)
        used = 0
        for pose, patch in zip(scene.poses, cut_patches(scene), strict=True):
            room = truth.get(pose.facing.door.id)
            fine = None if room is None else draw_room(patch, room.polygon)
            if fine is not None and fine.any():
                shown.append(pack_patch(patch))
                masks.append(fine.reshape(SIZE, FINE, SIZE, FINE).sum(axis=(1, 3)).astype(np.uint8))
                sides.append(measure_sides(fine))
                groups.append(group_of(sample.world))
                used += 1
        unused += len(sample.doors) - used
        advance(number)
    names = tuple(sorted(set(groups)))
    examples = Examples(
        np.array(shown, dtype=np.uint8).reshape(-1, 3, SIZE, SIZE),
        np.array(masks, dtype=np.uint8).reshape(-1, SIZE, SIZE),
        np.array(sides, dtype=np.float64).reshape(-1, 3),
        np.array([names.index(group) for group in groups], dtype=np.int64),
        names,
    )
    return Gathered(examples, failures, withheld, unused)


def _true_rooms(sample: Sample) -> dict[str, Room]:
    return {door: room for room in sample.rooms for door in room.doors}


def pack_patch(patch: Patch) -> Bytes:
    """Keep a patch in three bytes a cell, shape (3, SIZE, SIZE)."""
    doors = (patch.channels[3] > 0) * DOOR + (patch.channels[4] > 0) * OTHER_DOORS
    return np.stack((*np.rint(patch.channels[:2] * WHOLE), doors)).astype(np.uint8)


def unpack_patches(shown: Bytes) -> npt.NDArray[np.float32]:
    """Make patches of what was kept, shape (n, 5, SIZE, SIZE)."""
    free, occupied = (shown[:, at].astype(np.float32) / WHOLE for at in (0, 1))
    doors = [((shown[:, 2] & bit) > 0).astype(np.float32) for bit in (DOOR, OTHER_DOORS)]
    return np.stack((free, occupied, 1.0 - free - occupied, *doors), axis=1)


def draw_room(patch: Patch, shape: Shape) -> Bytes:
    """Draw a true room in the cells of the map under a patch, shape (SIZE * FINE, SIZE * FINE); 1 inside."""
    drawn = np.zeros((SIZE * FINE,) * 2, dtype=np.uint8)
    for part in shapely.get_parts(shape):
        for ring, inside in ((part.exterior, 1), *((hole, 0) for hole in part.interiors)):
            places = patch.to_patch(shapely.get_coordinates(ring)) * (FINE / CELL) - 0.5
            cv2.fillPoly(drawn, [np.rint(places).astype(np.int32)], (inside,))
    return drawn


def measure_sides(fine: Bytes) -> tuple[float, float, float]:
    """Measure how far a room reaches left and right of its door and back [m].

    Of the rectangle that overlaps most (IoU) with it, found side by side from its bounding box; the door's wall counts
    as its front.

    Args:
        fine: The room in cells of the map, some set, shape (SIZE * FINE, SIZE * FINE).
    """
    coarse = cv2.resize(fine.astype(np.float32), (SIZE * STEPS,) * 2, interpolation=cv2.INTER_AREA)
    sums = cv2.integral(coarse, sdepth=cv2.CV_64F)
    rows, cols = np.flatnonzero(coarse.any(axis=1)), np.flatnonzero(coarse.any(axis=0))
    front, whole = int(rows[0]), sums[-1, -1]
    box = [int(cols[0]), int(cols[-1]) + 1, int(rows[-1]) + 1]
    choices = (np.arange(cols[0], cols[-1] + 1), np.arange(cols[0] + 1, cols[-1] + 2), np.arange(front + 1, box[2] + 1))
    for _ in range(ROUNDS):
        before = list(box)
        for side, positions in enumerate(choices):
            u0, u1, v1 = (positions if at == side else value for at, value in enumerate(box))
            inside = sums[v1, u1] - sums[front, u1] - sums[v1, u0] + sums[front, u0]
            area = np.maximum(u1 - u0, 0) * (v1 - front)
            overlap = np.where(area > 0, inside / (area + whole - inside), -1.0)
            box[side] = int(positions[int(overlap.argmax())])
        if box == before:
            break
    cell = CELL / STEPS
    return ASIDE - box[0] * cell, box[1] * cell - ASIDE, box[2] * cell - BEHIND
