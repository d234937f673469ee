"""The normal equations of a pose graph: sparse, of one pattern from step to step."""

import math

import numpy as np

from closedrooms.core.arrays import FloatArray, IntArray

LARGEST_TURN = math.pi / 4
"""A keyframe never turns by more than this at once [rad]: the linearisation would not hold."""


class Pattern:
    """Places of the edges' blocks in the sparse matrix over all poses but the first, which does not move.

    The matrix is kept by columns (CSC), in blocks of 3 x 3: each edge adds to four of them.
    """

    def __init__(self, source: IntArray, target: IntArray, poses: int) -> None:
        """Sort out the blocks.

        Args:
            source: Pose a of each edge, shape (m,).
            target: Pose b of each edge, shape (m,).
            poses: How many there are.
        """
        self._nodes = np.stack((source, target)) - 1  # (2, m), the first pose is -1
        free = poses - 1
        rows, cols = np.broadcast_arrays(self._nodes[:, None], self._nodes[None, :])  # (2, 2, m)
        diagonal = np.arange(free)
        self._inside = np.flatnonzero(((rows >= 0) & (cols >= 0)).ravel())
        keys = np.concatenate(((cols * free + rows).ravel()[self._inside], diagonal * (free + 1)))
        blocks, block_of = np.unique(keys, return_inverse=True)
        block_cols, block_rows = np.divmod(blocks, free)
        heights = np.bincount(block_cols, minlength=free)  # blocks in each column of blocks
        starts = np.cumsum(heights) - heights
        # Element (row, col) of a block: whole columns of blocks before it, whole columns of its own, blocks above it.
        axis, first = np.arange(3), np.arange(len(blocks)) - starts[block_cols]
        places = (9 * starts[block_cols] + 3 * first)[:, None, None] + axis[:, None]
        places = places + (3 * heights[block_cols])[:, None, None] * axis  # (blocks, rows, cols)
        self._places = places[block_of[: self._inside.size]].ravel()
        self._diagonal = places[block_of[self._inside.size :]][:, axis, axis].ravel()
        indices = np.empty(places.size, dtype=np.int32)
        indices[places] = (3 * block_rows)[:, None, None] + axis[:, None]
        self._indices, self._size = indices, 3 * free
        self._starts = np.concatenate(([0], np.cumsum(np.repeat(3 * heights, 3)))).astype(np.int32)

    def solve(
        self, to_a: FloatArray, to_b: FloatArray, errors: FloatArray, information: FloatArray, damping: float
    ) -> FloatArray:
        """Take one damped step.

        Args:
            to_a: Derivatives of the errors by pose a of each edge, shape (m, 3, 3).
            to_b: The same by pose b.
            errors: Shape (m, 3).
            information: Their weights, shape (m, 3, 3).
            damping: Of Levenberg and Marquardt, relative to the diagonal.

        Returns:
            Steps of all poses, shape (poses, 3); the first one's are 0.
        """
        from scipy.sparse import csc_matrix
        from scipy.sparse.linalg import splu

        jacobians = np.stack((to_a, to_b))  # (2, m, 3, 3)
        weighted = jacobians.transpose(0, 1, 3, 2) @ information
        blocks = (weighted[:, None] @ jacobians[None]).reshape(-1, 9)
        values = np.bincount(self._places, blocks[self._inside].ravel(), minlength=self._indices.size)
        values[self._diagonal] += damping * values[self._diagonal] + 1e-9
        hessian = csc_matrix((values, self._indices, self._starts), (self._size, self._size))
        slopes = (weighted @ errors[None, :, :, None]).reshape(-1, 3)
        nodes = self._nodes.ravel()
        gradient = np.stack([np.bincount(nodes + 1, column, minlength=self._size // 3 + 1) for column in slopes.T])
        # Symmetric and positive: ordered as such and without pivoting, which is twice as quick.
        factors = splu(hessian, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
        step = np.zeros((self._size // 3 + 1, 3))
        step[1:] = factors.solve(-gradient[:, 1:].T.ravel()).reshape(-1, 3)
        largest = float(np.abs(step[:, 2]).max())
        return step if largest <= LARGEST_TURN else step * (LARGEST_TURN / largest)
