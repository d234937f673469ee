"""Where a sample of a dataset is: in a folder of its own, or in a row of a shard."""

from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True, slots=True, order=True)
class ShardRow:
    """Row of a shard.

    Attributes:
        dataset: The dataset: an absolute path or an address, as text.
        name: The shard, relative to the dataset.
        group: The group of rows in it.
        row: Which of the group.
    """

    dataset: str
    name: str
    group: int
    row: int


@dataclass(frozen=True, slots=True, order=True)
class SamplePath:
    """Place of a sample.

    Attributes:
        name: Its path relative to the dataset.
        folder: The folder with its files; of a sample in a shard a name for messages.
        problem: Why there is nothing to read, from the manifest; empty where there should be.
        listed: Whether a manifest lists it, so that its run.json and checksums have to be there.
        digest: SHA-256 of its run.json, empty where the dataset does not say.
        world: Building, empty where nothing names it.
        repetition: Repetition, -1 where nothing names it.
        shard: Where it is a row of a shard, else ``None``.
    """

    name: str
    folder: Path
    problem: str = ""
    listed: bool = False
    digest: str = ""
    world: str = ""
    repetition: int = -1
    shard: ShardRow | None = None
