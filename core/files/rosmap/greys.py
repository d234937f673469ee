"""Which cell each grey value of a ROS map's picture stands for, and what is worth telling about that."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from closedrooms.core.arrays import CellArray
from closedrooms.core.errors import InvalidInputError
from closedrooms.core.files.rosmap.map_description import number
from closedrooms.core.grid import FREE, OCCUPIED, UNKNOWN
from closedrooms.core.numbers import bounded, repr_of
from closedrooms.core.remarks import Remark

# 205 is p = 0.196078: a free_thresh of 0.196 keeps it unknown, 0.25 would reload it as free.
FREE_THRESH, OCCUPIED_THRESH = 0.196, 0.65
PIXEL_FREE, PIXEL_UNKNOWN, PIXEL_OCCUPIED = 254, 205, 0
APART, MOST_RARE = 16, 0.05
"""Greys so far apart, each of at least this share of a picture, mean different things to whoever drew it."""
JPEG_SPREAD = 24
"""Greys of a JPEG that differ from the usual unknown by at most this still mean unknown: enough for a quality of 50."""


@dataclass(frozen=True, slots=True)
class GreyMeaning:
    """How the YAML of a map says that greys are to be read.

    The occupancy p of a pixel is its darkness (its brightness where negated), 0 to 1.

    Attributes:
        mode: ``trinary``, ``scale`` or ``raw``; of ``raw`` a grey is the occupancy in percent, the rest is unused.
        negate: Whether bright is occupied.
        free_below: Pixels of a smaller p are free.
        occupied_above: Pixels of a larger p are occupied.
        assumed: Fields that the file leaves out, with the value taken for each.
    """

    mode: str = "trinary"
    negate: bool = False
    free_below: float = FREE_THRESH
    occupied_above: float = OCCUPIED_THRESH
    assumed: tuple[tuple[str, str], ...] = ()

    @property
    def usual_unknown(self) -> int:
        """The grey that map_server writes for unknown."""
        return 255 - PIXEL_UNKNOWN if self.negate else PIXEL_UNKNOWN

    def cells(self, *, spread: int = 1) -> CellArray:
        """Find the cell that each grey value stands for, shape (256,).

        Args:
            spread: In the mode ``trinary``, greys that differ from the usual unknown by at most this are unknown too:
                other programs write 204 or 206, or a free_thresh (0.25) that turns 205 into free.
        """
        levels = np.arange(256)
        if self.mode == "raw":
            return np.where(levels <= OCCUPIED, levels, UNKNOWN).astype(np.int8)
        p = (levels if self.negate else 255 - levels) / 255.0
        cells = np.full(256, UNKNOWN, dtype=np.int8)
        if self.mode == "scale":
            between = (p - self.free_below) / max(self.occupied_above - self.free_below, 1e-9) * 98.0 + 1.0
            cells = np.clip(np.rint(between), 1, 99).astype(np.int8)
        cells[p > self.occupied_above] = OCCUPIED
        cells[p < self.free_below] = FREE
        if self.mode == "trinary":
            cells[self.usual_unknown - spread : self.usual_unknown + spread + 1] = UNKNOWN
        return cells

    def remark_assumed(self) -> list[Remark]:
        """Say which meanings of greys the file leaves open, and what was taken."""
        if not self.assumed:
            return []
        why = f"not in the file; taken: {', '.join(f'{name} {value}' for name, value in self.assumed)}"
        return [Remark(action="guessed", what="meaning of greys", why=why)]

    def remark_odd(self, counts: npt.NDArray[np.int64]) -> list[Remark]:
        """Say which greys of a picture other programs take for something else.

        Args:
            counts: Pixels of each grey, shape (256,).
        """
        if self.mode == "raw":
            strange = int(counts[OCCUPIED + 1 : 255].sum())
            why = f"greys from {OCCUPIED + 1} to 254 mean nothing in the mode raw (trinary?); unknown"
            return [Remark(action="dropped", what="cells", why=why, count=strange, loss=True)] if strange else []
        count = int(counts[self.usual_unknown])
        if not count:
            return []
        if self.mode == "scale":
            why = f"{self.usual_unknown}, unknown in the mode trinary, is nearly free in the mode scale; taken so"
            return [Remark(action="guessed", what="cells", why=why, count=count)]
        if self.free_below <= (255 - PIXEL_UNKNOWN) / 255:
            return []
        why = f"{self.usual_unknown} means unknown, though free_thresh {self.free_below:g} makes it free"
        return [Remark(action="guessed", what="cells", why=why, count=count)]


def remark_merged(counts: npt.NDArray[np.int64], table: CellArray) -> list[Remark]:
    """Say where greys that somebody told apart are all free, or all occupied: one may be another program's unknown.

    Args:
        counts: Opaque pixels of each grey, shape (256,).
        table: The cell of each grey, shape (256,).
    """
    frequent = counts >= max(MOST_RARE * counts.sum(), 1)
    remarks = []
    for cell, name in ((FREE, "free"), (OCCUPIED, "occupied")):
        greys = np.flatnonzero(frequent & (table == cell))
        if greys.size and greys[-1] - greys[0] >= APART:
            why = f"greys {', '.join(map(str, greys))} are all {name} by the thresholds (is one of them unknown?)"
            remarks.append(Remark(action="guessed", what="cells", why=why, count=int(counts[greys].sum())))
    return remarks


def read_meaning(fields: dict[str, Any], mode: str, path: Path) -> GreyMeaning:
    """Read ``negate`` and the thresholds of a map.

    Args:
        fields: Of the YAML, see :func:`~closedrooms.core.files.rosmap.map_description.read_fields`.
        mode: ``trinary``, ``scale`` or ``raw``.
        path: The YAML, for messages.

    Raises:
        InvalidInputError: No such value.
    """
    if mode == "raw":
        return GreyMeaning(mode)
    negate = _negate(fields.get("negate", "0"), path)
    free_below, occupied_above = _thresholds(fields, path)
    taken = {"negate": "0", "free_thresh": f"{free_below:g}", "occupied_thresh": f"{occupied_above:g}"}
    assumed = tuple((name, value) for name, value in taken.items() if name not in fields)
    return GreyMeaning(mode, negate, free_below, occupied_above, assumed)


def _negate(value: Any, path: Path) -> bool:
    """Read ``negate``, as a number or a word."""
    words = {"0": False, "1": True, "false": False, "true": True, "no": False, "yes": True}
    negate = words.get(value.strip().lower()) if isinstance(value, str) else None
    if negate is None:
        raise InvalidInputError(f"map negate {repr_of(value)}", expected="0 or 1", where=path)
    return negate


def _thresholds(fields: dict[str, Any], path: Path) -> tuple[float, float]:
    """Read the thresholds: free below the first, occupied above the second.

    Where one is missing its usual value is taken, or the other one where that would put them in the wrong order.
    """
    given = {
        key: bounded(number(fields, key), 0.0, 1.0, name=f"map {key}", where=path)
        for key in ("free_thresh", "occupied_thresh")
        if key in fields
    }
    occupied_above = given.get("occupied_thresh", max(OCCUPIED_THRESH, given.get("free_thresh", 0.0)))
    free_below = given.get("free_thresh", min(FREE_THRESH, occupied_above))
    if free_below > occupied_above:
        raise InvalidInputError(
            f"map thresholds free {free_below}, occupied {occupied_above}",
            expected="0 <= free <= occupied <= 1",
            where=path,
        )
    return free_below, occupied_above
