"""Trajectories in the TUM format: ``stamp x y z qx qy qz qw``, one pose a line."""

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from closedrooms.core.arrays import FloatArray
from closedrooms.core.errors import InvalidInputError
from closedrooms.core.files.incoming import read_text
from closedrooms.core.files.outgoing import write_bytes
from closedrooms.core.numbers import FARTHEST

# Stamps may be nanoseconds since 1970; a quaternion has the length 1 (others write it a little off).
LIMITS = (1e20, FARTHEST, FARTHEST, FARTHEST, 2.0, 2.0, 2.0, 2.0)


def write_trajectory(path: Path, stamps: Sequence[float] | FloatArray, poses: FloatArray) -> None:
    """Write poses ``(x, y, theta)``, shape (n, 3), metres and radians, at ``stamps`` [s], shape (n,)."""
    lines = [
        f"{t:.6f} {x:.6f} {y:.6f} 0 0 0 {math.sin(theta / 2):.9f} {math.cos(theta / 2):.9f}\n"
        for t, (x, y, theta) in zip(stamps, poses, strict=True)
    ]
    write_bytes(path, "".join(lines).encode())


def read_trajectory(path: Path) -> tuple[FloatArray, FloatArray]:
    """Read stamps [s], shape (n,), and poses ``(x, y, theta)``, shape (n, 3).

    Raises:
        InvalidInputError: A line that does not hold eight finite numbers within bounds (named by its number).
    """
    rows = []
    for number, line in enumerate(read_text(path, what="a TUM trajectory").splitlines(), start=1):
        if not line.strip() or line.startswith("#"):
            continue
        try:
            values = [float(v) for v in line.split()]
        except ValueError:
            values = []
        if len(values) != 8 or not all(abs(v) <= limit for v, limit in zip(values, LIMITS, strict=True)):
            raise InvalidInputError(f"line {number}", expected="stamp x y z qx qy qz qw", where=path)
        t, x, y, _, _, _, qz, qw = values
        rows.append((t, x, y, 2.0 * math.atan2(qz, qw)))
    table = np.array(rows, dtype=np.float64).reshape(-1, 4)
    table[:, 3] = (table[:, 3] + np.pi) % (2 * np.pi) - np.pi
    return table[:, 0], table[:, 1:]
