"""What the network sees: the map around a closed door, turned so that the room lies ahead (method ``learned``)."""

import math
from dataclasses import dataclass

import cv2
import numpy as np

from closedrooms.core.arrays import BoolArray, CellArray, FloatArray, IntArray
from closedrooms.predictor.best.door_frame import TurnedMap
from closedrooms.predictor.best.door_pose import DoorPose
from closedrooms.predictor.best.resolution import in_cells
from closedrooms.predictor.best.scene import Scene

# Cells of a patch along each side, and their size [m]: 32 x 32 m, so that a room of 24 m fits.
SIZE, CELL = 128, 0.25
# The door lies in the middle of the width, so far from the patch's near edge [m]: rooms across the corridor are seen.
BEHIND = 8.0
ASIDE = SIZE * CELL / 2
AHEAD = SIZE * CELL - BEHIND
# Cells of the map in one of a patch, along each side.
FINE = in_cells(CELL)
CHANNELS = ("free", "occupied", "unknown", "door", "other doors")
# What a cell of the map holds while a patch is cut; unknown is 0.
OCCUPIED, FREE = 1, 2
# Leaves are drawn this wide where nothing tells [m].
LEAF = 0.9


@dataclass(frozen=True, slots=True, eq=False)
class Patch:
    """The map around one door: columns run along its wall, the room on their left; rows run into the room.

    Attributes:
        channels: Shares of each cell by :data:`CHANNELS`, shape (5, SIZE, SIZE).
        corner: Corner of cell (0, 0) in the map frame [m], shape (2,).
        along: Unit vector of the columns in the map frame, shape (2,).
        inward: Unit vector of the rows in the map frame, shape (2,).
        door: Mid-point of the door along and across its wall, from the corner [m], shape (2,).
    """

    channels: FloatArray
    corner: FloatArray
    along: FloatArray
    inward: FloatArray
    door: FloatArray

    def to_patch(self, points: FloatArray) -> FloatArray:
        """Convert map points [m], shape (..., 2), to distances along and across the door's wall from the corner [m]."""
        return np.asarray((points - self.corner) @ np.array([self.along, self.inward]).T)


def cut_patches(scene: Scene) -> list[Patch]:
    """Cut the patch of every door of a scene, in the order of its poses."""
    return [_cut_patch(scene.turned[pose.angle], pose, scene.poses) for pose in scene.poses]


def _cut_patch(turned: TurnedMap, pose: DoorPose, poses: tuple[DoorPose, ...]) -> Patch:
    """Cut the patch of one door out of the map that is turned along its wall."""
    corner, along, inward = _place(turned, pose)
    seen = sample_cells(turned, pose)
    channels = np.zeros((len(CHANNELS), SIZE, SIZE))
    channels[0], channels[1] = _share(seen == FREE), _share(seen == OCCUPIED)
    channels[2] = 1.0 - channels[0] - channels[1]
    axes = np.array([along, inward]) @ turned.rotation.T
    place = turned.to_map(corner.astype(np.float64))
    patch = Patch(channels, place, axes[0], axes[1], axes @ (pose.facing.middle - place))
    for other in poses:
        _draw_door(channels[3 if other is pose else 4], patch, other)
    return patch


def _place(turned: TurnedMap, pose: DoorPose) -> tuple[IntArray, IntArray, IntArray]:
    """Find where a patch lies in the turned map [cells]: its corner, and unit vectors along its wall and inward."""
    inward = np.array([(0, 1), (-1, 0), (0, -1), (1, 0)][pose.quarter])
    along = np.array([inward[1], -inward[0]])
    # To whole cells of the turned map, so that nothing is sampled between them.
    middle = np.round(turned.to_frame(pose.facing.middle)).astype(int)
    return middle - in_cells(ASIDE) * along - in_cells(BEHIND) * inward, along, inward


def sample_cells(turned: TurnedMap, pose: DoorPose) -> CellArray:
    """Sample the cells of the turned map under a door's patch: :data:`FREE`, :data:`OCCUPIED` or 0.

    Returns:
        Rows into the room, shape (SIZE * FINE, SIZE * FINE).
    """
    corner, along, inward = _place(turned, pose)
    side = SIZE * FINE
    col, row = np.minimum(corner, corner + side * (along + inward)).tolist()
    rows, cols = turned.free.shape
    cells = np.zeros((side, side), dtype=np.int8)
    r0, r1, c0, c1 = max(row, 0), min(row + side, rows), max(col, 0), min(col + side, cols)
    if r1 > r0 and c1 > c0:
        of = slice(r0, r1), slice(c0, c1)
        cells[r0 - row : r1 - row, c0 - col : c1 - col] = (
            turned.free[of] * (FREE - OCCUPIED) + turned.known[of] * OCCUPIED
        )
    return (cells, cells.T[::-1], cells[::-1, ::-1], cells.T[:, ::-1])[pose.quarter]


def _share(mask: BoolArray) -> FloatArray:
    """Measure the share of each cell of a patch that a mask fills, shape (SIZE, SIZE)."""
    return np.asarray(cv2.resize(mask.astype(np.float32), (SIZE, SIZE), interpolation=cv2.INTER_AREA), np.float64)


def _draw_door(channel: FloatArray, patch: Patch, pose: DoorPose) -> None:
    """Draw the leaf of a door, a cell thick; its wall's direction counts, not that of the leaf."""
    width = pose.facing.door.width or LEAF
    ends = pose.facing.middle + np.array([[-width / 2], [width / 2]]) * pose.facing.along
    places = patch.to_patch(ends) / CELL
    if np.any(np.abs(places) > 4 * SIZE):
        return
    first, last = [(math.floor(x), math.floor(y)) for x, y in places.tolist()]
    cv2.line(channel, first, last, 1.0)
