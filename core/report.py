"""What a command tells of its result: the same shape for every use case."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from closedrooms.core.remarks import Remark, remark_rows


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Report:
    """The outcome of one use case.

    Attributes:
        folder: What was written: a folder, a single file, or an address.
        title: Head of the table.
        rows: Rows for people; the first is the head.
        failures: What could not be done and why, by its id; the rest is written.
        remarks: What was dropped, repaired or guessed on reading.
        figures: The result for programs, plain JSON values.
    """

    folder: Path | str
    title: str
    rows: Sequence[Sequence[str]]
    failures: Mapping[str, str] = field(default_factory=dict)
    remarks: Sequence[Remark] = ()
    figures: Mapping[str, Any] = field(default_factory=dict)

    @property
    def partial(self) -> bool:
        """Whether something that was asked for is missing from the result (exit status 3)."""
        return bool(self.failures) or any(remark.loss for remark in self.remarks)

    def table(self) -> list[tuple[str, ...]]:
        """List rows and remarks, all as wide as the head."""
        width = len(self.rows[0])
        rows = [*map(tuple, self.rows), *remark_rows(self.remarks)]
        return [(*row, *[""] * (width - len(row))) for row in rows]

    def as_json(self) -> dict[str, Any]:
        """Write the object that ``--json`` prints."""
        return {
            "title": self.title,
            "written": str(self.folder),
            "partial": self.partial,
            "figures": dict(self.figures),
            "failures": dict(self.failures),
            "remarks": [remark.as_json() for remark in self.remarks],
        }


def counted(number: int, noun: str) -> str:
    """Write a number with its noun, one that takes an s where there are several."""
    return f"{number} {noun}{'' if number == 1 else 's'}"
