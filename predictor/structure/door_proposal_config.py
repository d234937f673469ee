"""Settings of door proposals. Imports nothing heavy."""

import math
from dataclasses import dataclass, fields

from closedrooms.core.errors import InvalidInputError


@dataclass(frozen=True, kw_only=True)
class ProposalConfig:
    """Limits on what a closed door looks like in a map, and which ones are worth proposing."""

    min_width: float = 0.60
    """Narrowest door [m]."""

    max_width: float = 1.30
    """Widest door [m]."""

    min_recess: float = 0.02
    """How far the leaf lies behind the wall's face at least [m]; less is noise of the map."""

    max_recess: float = 0.20
    """How far the leaf lies behind the wall's face at most [m]; more is a niche."""

    jamb: float = 0.30
    """Length of wall beside each jamb that the leaf is compared with [m]."""

    depth: float = 0.60
    """How far behind and in front of the leaf it is asked what is unknown and what is free [m]."""

    min_unknown: float = 0.50
    """Share of unknown cells behind the leaf below which it leads to no closed room."""

    min_room: float = 1.20
    """Side of the smallest room [m]: a square of it must fit into the unknown behind the leaf. 0 asks for none."""

    min_score: float = 0.50
    """Proposals below this score (0..1) are left out."""

    def __post_init__(self) -> None:
        for item in fields(self):
            value = getattr(self, item.name)
            if not math.isfinite(value) or value < 0.0:
                raise InvalidInputError(f"{item.name} {value}", expected="a finite number of at least 0")
        if not 0.0 < self.min_width <= self.max_width <= MAX_WIDTH:
            raise InvalidInputError(
                f"door widths from {self.min_width} to {self.max_width} m",
                expected=f"0 < min_width <= max_width <= {MAX_WIDTH}",
            )
        if not self.min_recess <= self.max_recess <= MAX_WIDTH:
            raise InvalidInputError(
                f"recesses from {self.min_recess} to {self.max_recess} m",
                expected=f"min_recess <= max_recess <= {MAX_WIDTH}",
            )
        if not 0.0 < self.jamb <= MAX_WIDTH or not 0.0 < self.depth <= MAX_WIDTH:
            raise InvalidInputError(f"jamb {self.jamb} m, depth {self.depth} m", expected=f"above 0 to {MAX_WIDTH} m")
        if self.min_score > 1.0 or self.min_unknown > 1.0:
            raise InvalidInputError(
                f"min_score {self.min_score}, min_unknown {self.min_unknown}", expected="shares between 0 and 1"
            )


MAX_WIDTH = 10.0
"""No door is wider [m]; bounds the search."""
