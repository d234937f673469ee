"""Block maxima of the likelihood field: upper bounds of a scan's mean likelihood over blocks of shifts."""

import cv2
import numpy as np

from closedrooms.core.arrays import FloatArray, IntArray, Mask
from closedrooms.mapping.matching.likelihood_field import Float32Array

FEW_BLOCKS = 5
"""Blocks along an axis up to which they are looked up one by one; more are read side by side."""


class BlockMaxima:
    """Block maxima of the field around a scan: upper bounds of its mean value over blocks of shifts.

    Values are rounded up to 1/255, as bytes are read quicker.
    """

    def __init__(self, values: Float32Array, rows: IntArray, cols: IntArray, margin: int) -> None:
        """Take what the points of each turn reach, cells of shape (turns, n) each, and ``margin`` around it."""
        row0, col0 = int(rows.min()) - margin, int(cols.min()) - margin
        reach = values[row0 : int(rows.max()) + margin + 1, col0 : int(cols.max()) + margin + 1]
        self._levels = cv2.convertScaleAbs(reach, alpha=255.0, beta=0.5)
        self._rows, self._cols = rows - row0, cols - col0
        self._maxima: dict[int, Mask] = {}

    def _highest(self, cells: int) -> Mask:
        """Find the largest value in the block of ``cells`` x ``cells`` that starts at each cell."""
        if cells not in self._maxima:
            kernel = np.ones((cells, cells), dtype=np.uint8)
            # With the anchor at (0, 0) a block starts at the cell itself.
            self._maxima[cells] = np.asarray(
                cv2.dilate(self._levels, kernel, anchor=(0, 0), borderType=cv2.BORDER_CONSTANT, borderValue=0.0),
                dtype=np.uint8,
            )
        return self._maxima[cells]

    def bounds_of(self, angles: IntArray, shifts: IntArray, cells: int) -> FloatArray:
        """Bound some blocks: by their turns, shape (b,), and first shifts, shape (b, s, 2); returns shape (b, s)."""
        maxima = self._highest(cells)
        flat = self._rows[angles] * maxima.shape[1] + self._cols[angles]
        offsets = shifts[..., 0] * maxima.shape[1] + shifts[..., 1]
        blocks = maxima.reshape(-1).take(flat[:, None, :] + offsets[:, :, None]).reshape(-1, flat.shape[1])
        sums = cv2.reduce(blocks, 1, cv2.REDUCE_SUM, dtype=cv2.CV_32S)
        return np.asarray(sums.reshape(offsets.shape) * (1.0 / (255.0 * flat.shape[1])), dtype=np.float64)

    def bounds(self, half: int, cells: int) -> FloatArray:
        """Bound all blocks, shape (turns, blocks): they start at ``-half``, ``-half + cells``, ..., rows first."""
        side = 2 * half // cells + 1
        if side <= FEW_BLOCKS:
            starts = pairs(np.arange(side) * cells - half)
            return self.bounds_of(
                np.arange(len(self._rows)), np.broadcast_to(starts, (len(self._rows), *starts.shape)), cells
            )
        maxima, (turns, n) = self._highest(cells), self._rows.shape
        # One picture for each of the cells x cells phases: in it, the blocks of one point lie side by side.
        height, width = (-(-size // cells) for size in maxima.shape)
        whole = np.zeros((height * cells, width * cells), dtype=np.uint8)
        whole[: maxima.shape[0], : maxima.shape[1]] = maxima
        phases = np.ascontiguousarray(whole.reshape(height, cells, width, cells).transpose(1, 3, 0, 2))
        windows = np.lib.stride_tricks.sliding_window_view(phases, (side, side), axis=(2, 3))
        block_rows, phase_rows = np.divmod(self._rows - half, cells)
        block_cols, phase_cols = np.divmod(self._cols - half, cells)
        bounds: FloatArray = np.empty((turns, side * side), dtype=np.float64)
        for i in range(turns):
            blocks = windows[phase_rows[i], phase_cols[i], block_rows[i], block_cols[i]].reshape(-1, side * side)
            bounds[i] = cv2.reduce(blocks, 0, cv2.REDUCE_SUM, dtype=cv2.CV_32S)
        bounds *= 1.0 / (255.0 * n)
        return bounds


def pairs(steps: IntArray) -> IntArray:
    """List all pairs of two steps, rows first, shape (steps^2, 2)."""
    return np.stack(np.meshgrid(steps, steps, indexing="ij"), axis=-1).reshape(-1, 2)
