"""Which building is used for what: decided once, in ``buildings.json``.

``fit`` finds weights and evidence, ``choose`` decides between ways of doing it, ``report`` is measured and never looked
at otherwise. Buildings are grouped by identity: a floor in two releases and the floors of one building stand together,
so that nothing of a building that is reported was seen before. Every run on ``report`` is a line of ``ledger.csv``.
"""

import csv
import io
import re
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Literal, get_args

from closedrooms.core.errors import InvalidInputError
from closedrooms.core.files.incoming import read_bytes, read_json
from closedrooms.core.files.outgoing import write_bytes
from closedrooms.worlds.generation.generator import GENERATOR_VERSION

Use = Literal["fit", "choose", "report"]
USES: tuple[Use, ...] = get_args(Use)
HERE = Path(__file__).parent
BUILDINGS, LEDGER = HERE / "buildings.json", HERE / "ledger.csv"
COLUMNS = ("date", "commit", "method", "dataset", "figure", "value")
# Seeds of the first generator from this on choose, those before fit.
FIRST_CHOOSE = 1000
# ``worlds generate`` leaves out the version of its generator: today's, as far as anybody can tell.
GENERATED = re.compile(r"(?:office|school)-(?:g(\d+)-)?(\d+)")


@dataclass(frozen=True, slots=True)
class Group:
    """Buildings that are one building.

    Attributes:
        use: What they are used for.
        buildings: Names of their files, without suffix.
    """

    use: Use
    buildings: tuple[str, ...]


@cache
def read_groups() -> tuple[Group, ...]:
    """Read all groups of real and bundled buildings, in the order of the file."""
    data = read_json(BUILDINGS, what="the uses of buildings")
    return tuple(Group(use, tuple(names)) for use in USES for names in data[use])


def use_of(building: str) -> Use:
    """Look up what a building is used for.

    Args:
        building: The name of its file without suffix, or ``<kind>-g<version>-<seed>`` or ``<kind>-<seed>`` of a
            generated world.

    Raises:
        InvalidInputError: It is in no group: whoever adds a building decides once.
    """
    for group in read_groups():
        if building in group.buildings:
            return group.use
    generated = GENERATED.fullmatch(building)
    if generated:
        return generated_use(int(generated[1] or GENERATOR_VERSION), int(generated[2]))
    raise InvalidInputError(f"the building {building!r} is in no group", expected=f"one of {BUILDINGS.name}")


def generated_use(version: int, seed: int) -> Use:
    """Decide what a generated world is used for: by seed, those of later generators are reported."""
    if version > 1:
        return "report"
    return "fit" if seed < FIRST_CHOOSE else "choose"


def note_report(rows: list[dict[str, str]], path: Path = LEDGER) -> None:
    """Add the figures of a run on ``report`` to the ledger.

    Args:
        rows: Values by :data:`COLUMNS`.
        path: The ledger.

    Raises:
        InvalidInputError: A row with other columns.
        OutputError: The ledger cannot be written.
    """
    for row in rows:
        if set(row) != set(COLUMNS):
            raise InvalidInputError(f"columns {', '.join(row)}", expected=", ".join(COLUMNS), where=path)
    text = io.StringIO()
    writer = csv.DictWriter(text, COLUMNS, lineterminator="\n")
    if not path.is_file():
        writer.writeheader()
    writer.writerows(rows)
    before = read_bytes(path, what="the ledger") if path.is_file() else b""
    write_bytes(path, before + text.getvalue().encode())


def group_of(building: str) -> str:
    """Find the name of the group that a building stands in: itself where it stands in none."""
    return next((group.buildings[0] for group in read_groups() if building in group.buildings), building)


def may_train(building: str) -> bool:
    """Check whether a building may be learned from: it is of the use ``fit``, or nobody has sorted it."""
    known = GENERATED.fullmatch(building) or any(building in group.buildings for group in read_groups())
    return not known or use_of(building) == "fit"
