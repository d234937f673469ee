"""What was dropped, repaired or guessed while a file was read: told on the terminal and kept in ``run.json``."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, Literal

from closedrooms.core.errors import InvalidInputError

Action = Literal["dropped", "repaired", "guessed"]

# Names told of one remark; the rest is counted.
MOST_NAMED = 6


@dataclass(frozen=True, slots=True, kw_only=True)
class Remark:
    """One kind of thing that a reader did to its input.

    Attributes:
        action: ``dropped``: it is missing from the result; ``repaired``: it was wrong and is not any more; ``guessed``:
            the file did not say.
        what: What it concerns, a plural noun where ``count`` is not 1: ``doors``, ``scans``, ``resolution``.
        why: The reason and, where something was repaired or guessed, what was taken instead.
        names: Ids of what it concerns, where they have some.
        count: How many.
        loss: It takes away something that was asked for: the command ends with exit status 3.
    """

    action: Action
    what: str
    why: str
    names: tuple[str, ...] = ()
    count: int = 1
    loss: bool = False

    def __post_init__(self) -> None:
        if self.count < 1:
            raise InvalidInputError(f"a remark about {self.count} {self.what}", expected="a count of at least 1")

    def __str__(self) -> str:
        named = ", ".join(self.names[:MOST_NAMED]) + (", ..." if len(self.names) > MOST_NAMED else "")
        number = "" if self.count == 1 and not self.names else f"{self.count} "
        return f"{self.action} {number}{self.what}{f' ({named})' if named else ''}: {self.why}"

    def as_json(self) -> dict[str, Any]:
        """Write the entry of ``run.json`` (key ``remarks``)."""
        return {
            "action": self.action,
            "what": self.what,
            "why": self.why,
            "names": list(self.names),
            "count": self.count,
            "loss": self.loss,
        }


def remark_rows(remarks: Iterable[Remark]) -> list[tuple[str, str]]:
    """List the rows of a table of results, losses first."""
    ordered = sorted(remarks, key=lambda remark: not remark.loss)
    return [("remark", str(remark)) for remark in ordered]
