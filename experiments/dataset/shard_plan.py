"""Which samples go into which shard: their order and their sizes decide it, not who made them or when."""

from collections.abc import Iterable, Iterator

from closedrooms.experiments.dataset.config import DatasetConfig
from closedrooms.experiments.dataset.shard import Shard
from closedrooms.experiments.dataset.shard_jobs import Filling
from closedrooms.experiments.dataset.variants import Split

MB = 1_000_000
# What samples take in a shard, by what they take as parts: neighbours share a building, and compress together. Of
# 30.3 kB a sample (school and offices, 180 beams) 15.4 kB are left in groups of three, 10.5 kB in groups of six: about
# 7.5 kB in ours of sixteen, if it goes on like that.
TOGETHER = 0.25


class ShardPlan:
    """Samples of one split in order: those in shards, those that wait as parts, those to come.

    A shard ends with the sample that reaches its size, with the split, or where one that is there already begins. No
    more is held than the sizes of parts that wait: about one shard's.

    Args:
        config: Of the dataset.
        split: Whose samples.
        total: How many there are, those that will fail included.
        shards: Those that were written before.
        lost: Shards that were written before and whose file is gone: they are filled with the same samples again.
        parts: Parts that wait: bytes by index.
    """

    def __init__(
        self,
        config: DatasetConfig,
        split: Split,
        total: int,
        *,
        shards: Iterable[Shard] = (),
        lost: Iterable[Shard] = (),
        parts: dict[int, int] | None = None,
    ) -> None:
        self._config, self._split, self._total = config, split, total
        self.shards = {shard.first: shard for shard in shards}
        self._ends = {shard.first: shard.end for shard in lost}
        self._sizes = dict(parts or {})
        self._failures: dict[int, tuple[str, str]] = {}
        self._number, self._first, self._next, self._size = 0, 0, 0, 0
        self._inside = 0
        self._begins = sorted(self.shards, reverse=True)

    def wants(self, index: int) -> bool:
        """Check whether a sample has to be made; asked in order."""
        shard = self.shards.get(index)
        if shard is not None:
            self._inside = shard.end
        return index >= self._inside and index not in self._sizes

    def add(self, index: int, size: int) -> None:
        """Record that a part is there."""
        self._sizes[index] = size

    def fail(self, index: int, name: str, reason: str) -> None:
        """Record that a sample cannot be made."""
        self._failures[index] = (name, reason)

    def put(self, shard: Shard) -> None:
        """Record that a shard is written."""
        self.shards[shard.first] = shard

    def ready(self) -> Iterator[Filling]:
        """Yield the shards that can be filled now, each once."""
        while self._next < self._total:
            if self._next == self._first:
                self._skip_written()
                if self._next >= self._total:
                    return
            known = self._sizes.get(self._next)
            if known is None and self._next not in self._failures:
                return
            self._size += known or 0
            self._next += 1
            if self._is_full():
                yield self._filled()

    def _skip_written(self) -> None:
        """Go on behind the shards that are there already."""
        while self._begins and self._begins[-1] < self._next:
            self._begins.pop()
        while self._begins and self._begins[-1] == self._next:
            shard = self.shards[self._begins.pop()]
            self._first = self._next = shard.end
            self._number = shard.number + 1

    def _is_full(self) -> bool:
        """Check whether the samples since the last shard make the next one."""
        end = self._ends.get(self._first)
        if end is not None:
            return self._next == end
        begins = bool(self._begins) and self._begins[-1] == self._next
        return TOGETHER * self._size >= self._config.shard_mb * MB or self._next == self._total or begins

    def _filled(self) -> Filling:
        """Make the job that fills the next shard, and begin another."""
        first, end = self._first, self._next
        failures = []
        for index in range(first, end):
            self._sizes.pop(index, None)
            if index in self._failures:
                failures.append((index, *self._failures.pop(index)))
        job = Filling(self._config, self._split, self._number, first, end, tuple(failures))
        self._number, self._first, self._size = self._number + 1, end, 0
        return job
