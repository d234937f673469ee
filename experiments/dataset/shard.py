"""What is in one shard of a dataset, and how its files are called."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

from closedrooms.core.errors import InvalidInputError
from closedrooms.experiments.dataset.variants import Split

DATA, PARTS = "data", "parts"


@dataclass(frozen=True, slots=True)
class Shard:
    """Content of a shard; without a row there is no file.

    Attributes:
        name: Its file, relative to the dataset.
        split: Whose samples.
        number: Its place among the split's shards.
        first: Index of its first sample in the split.
        end: Index behind its last one.
        rows: Samples in it.
        size: Bytes.
        sha256: Of the file, hexadecimal.
        worlds: Buildings of its samples, in order.
        failures: Why samples between ``first`` and ``end`` are missing, by id.
        stopped: Why samples hold less than their building, by id.
    """

    name: str
    split: Split
    number: int
    first: int
    end: int
    rows: int
    size: int
    sha256: str
    worlds: tuple[str, ...] = ()
    failures: Mapping[str, str] = field(default_factory=dict)
    stopped: Mapping[str, str] = field(default_factory=dict)

    def as_json(self) -> dict[str, Any]:
        """Convert to plain values."""
        return asdict(self)


def read_shard(data: Any, where: str) -> Shard:
    """Read what :meth:`Shard.as_json` gave.

    Raises:
        InvalidInputError: Something else.
    """
    try:
        shard = Shard(**{**data, "worlds": tuple(data["worlds"]), "failures": dict(data["failures"])})
        dict(shard.stopped)
        whole = [shard.number, shard.first, shard.end, shard.rows, shard.size]
        if any(isinstance(value, bool) or not isinstance(value, int) or value < 0 for value in whole):
            raise ValueError
        if shard.name != shard_name(shard.split, shard.number) or shard.end <= shard.first:
            raise ValueError
    except (TypeError, ValueError, KeyError) as error:
        raise InvalidInputError("no description of a shard", expected="what closedrooms wrote", where=where) from error
    return shard


def shard_name(split: str, number: int) -> str:
    """Name the file of a shard."""
    return f"{DATA}/{split}-{number:05d}.parquet"


def part_name(split: str, index: int) -> str:
    """Name the file of a part."""
    return f"{PARTS}/{split}-{index:08d}.arrow"


def note_name(split: str, number: int) -> str:
    """Name the file that says what is in a shard, until the whole dataset is done."""
    return f"{PARTS}/{split}-{number:05d}.json"
