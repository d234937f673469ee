"""A dataset as shards: which jobs there are, in which order, and what stands at the root when they are done."""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from closedrooms.core.errors import ClosedroomsError, InvalidInputError, OutputError
from closedrooms.experiments.dataset.config import SURVEYS, DatasetConfig
from closedrooms.experiments.dataset.dataset_card import card
from closedrooms.experiments.dataset.layout import (
    CARD,
    SUMS,
    Count,
    description,
    json_bytes,
    read_stored_json,
    read_worlds,
)
from closedrooms.experiments.dataset.sample import Task, TaskResult
from closedrooms.experiments.dataset.shard import DATA, PARTS, Shard, read_shard
from closedrooms.experiments.dataset.shard_jobs import Filling, Part, work
from closedrooms.experiments.dataset.shard_plan import ShardPlan
from closedrooms.experiments.dataset.survey_store import survey_folder, survey_name
from closedrooms.experiments.dataset.variants import (
    SPLITS,
    Split,
    Variant,
    World,
    count_variants,
    find_variants,
    sort_buildings,
)
from closedrooms.experiments.places import Url
from closedrooms.experiments.stores import DATASET_MANIFEST, Store, file_digest, open_store, write_file
from closedrooms.experiments.workers import Crew, Lost
from closedrooms.pipeline.reporting.progress import Progress

ShardJob = Task | Part | Filling
PART = re.compile(rf"{PARTS}/([a-z]+)-(\d+)\.arrow")
NOTE = re.compile(rf"{PARTS}/([a-z]+)-(\d+)\.json")


def make_shards(
    config: DatasetConfig, worlds: Sequence[World], progress: Progress, needs: Sequence[str]
) -> list[Shard]:
    """Make a dataset of shards, or what is missing of it.

    Args:
        config: Options.
        worlds: The buildings.
        progress: Told how far it is.
        needs: Packages that workers cannot do without.

    Returns:
        What is in it, in order.

    Raises:
        InvalidInputError: A shard or a survey there was changed; no scheduler answers.
        OutputError: Nothing can be written any more.
    """
    store = open_store(config.out)
    crew: Crew[ShardJob, TaskResult] = Crew(config.workers, config.scheduler, tuple(needs), "closedrooms dataset")
    progress.stage("shards there")
    plans = _plans(config, worlds, store)
    failed = _surveys(config, worlds, store, crew, progress) if config.maps == "erased" else {}
    total = count_variants(worlds, config)
    progress.stage("samples", total)
    samples = _Samples(config, worlds, plans, failed)
    # The last shards can be filled when no sample is under way any more.
    for jobs in (samples.jobs(), samples.fillings()):
        for job, outcome in crew.do(work, jobs):
            samples.put_down(job, outcome)
            progress.advance(samples.done, f"{samples.done} of {total}")
    return [shard for split in SPLITS for _, shard in sorted(plans[split].shards.items())]


def _plans(config: DatasetConfig, worlds: Sequence[World], store: Store) -> dict[Split, ShardPlan]:
    """Find what is there: whole shards, shards whose file is gone, parts."""
    waiting = store.sizes(PARTS)
    found = {shard.name: shard for shard in _written(store, waiting)}
    there = store.sizes(DATA)
    lost = [shard for shard in found.values() if shard.rows and shard.name not in there]
    for shard in found.values():
        if shard.rows and shard.name in there:
            _check_shard(config, store, shard, there[shard.name])
    parts: dict[str, dict[int, int]] = {split: {} for split in SPLITS}
    for name, size in waiting.items():
        match = PART.fullmatch(name)
        if match and match[1] in parts:
            parts[match[1]][int(match[2])] = size
    return {
        split: ShardPlan(
            config,
            split,
            count_variants(sort_buildings(worlds, split), config),
            shards=[shard for shard in found.values() if shard.split == split and shard not in lost],
            lost=[shard for shard in lost if shard.split == split],
            parts=parts[split],
        )
        for split in SPLITS
    }


def _written(store: Store, waiting: Mapping[str, int]) -> Iterator[Shard]:
    """Yield the shards that the manifest lists, and those with a note."""
    where = store.where(DATASET_MANIFEST)
    for entry in read_stored_json(store, DATASET_MANIFEST).get("shards", []):
        yield read_shard(entry, where)
    for name in filter(NOTE.fullmatch, waiting):
        yield read_shard(read_stored_json(store, name), store.where(name))


def _check_shard(config: DatasetConfig, store: Store, shard: Shard, size: int) -> None:
    """Compare a shard with what was written: of a store elsewhere its size, so that nothing is fetched.

    Raises:
        InvalidInputError: It is another one.
    """
    whole = size == shard.size and (isinstance(config.out, Url) or file_digest(store, shard.name) == shard.sha256)
    if not whole:
        expected = "its SHA-256 when it was written; without the file its samples are made again"
        raise InvalidInputError("changed since it was written", expected=expected, where=store.where(shard.name))


def _surveys(
    config: DatasetConfig, worlds: Sequence[World], store: Store, crew: Crew[ShardJob, TaskResult], progress: Progress
) -> dict[str, str]:
    """Explore each building once and collect why it failed, by world."""
    progress.stage("surveys", len(worlds))
    there, failed = store.sizes(SURVEYS), {}
    done = 0

    def missing() -> Iterator[ShardJob]:
        nonlocal done
        for world in worlds:
            if survey_name(world) in there:
                with survey_folder(config, world):
                    done += 1
            else:
                yield Task(config, world)

    for job, outcome in crew.do(work, missing()):
        done += 1
        why = _failure(outcome)
        if why and isinstance(job, Task):
            failed[job.world.name] = why
        progress.advance(done, f"{done} of {len(worlds)}")
    return failed


def _failure(outcome: TaskResult | Lost) -> str:
    """Explain why something was not made; empty where it was.

    Raises:
        OutputError: Nothing can be written any more.
    """
    if isinstance(outcome, Lost):
        return outcome.reason
    if outcome.trouble:
        raise OutputError(outcome.trouble)
    return outcome.failure


@dataclass
class _Samples:
    """The samples of a dataset on their way into shards.

    Attributes:
        config: Of the dataset.
        worlds: The buildings.
        plans: By split.
        failed: Why a building has no survey, by its name.
        done: Samples that are made, were there, or cannot be made.
    """

    config: DatasetConfig
    worlds: Sequence[World]
    plans: Mapping[Split, ShardPlan]
    failed: Mapping[str, str]
    done: int = 0

    def jobs(self) -> Iterator[ShardJob]:
        """Yield what is to be done, samples in order, and between them the shards that have become full."""
        for split in SPLITS:
            for index, variant in enumerate(self._variants(split)):
                yield from self.fillings()
                if not self.plans[split].wants(index):
                    self.done += 1
                elif variant.world.name in self.failed:
                    self.plans[split].fail(index, variant.id, self.failed[variant.world.name])
                    self.done += 1
                else:
                    yield Part(Task(self.config, variant.world, variant), index)

    def _variants(self, split: Split) -> Iterator[Variant]:
        return (
            variant for world in sort_buildings(self.worlds, split) for variant in find_variants(world, self.config)
        )

    def fillings(self) -> Iterator[Filling]:
        """Yield the shards that have become full."""
        for plan in self.plans.values():
            yield from plan.ready()

    def put_down(self, job: ShardJob, outcome: TaskResult | Lost) -> None:
        """Record what came of a job.

        Raises:
            OutputError: Nothing can be written any more.
            ClosedroomsError: A shard cannot be put together.
        """
        why = _failure(outcome)
        if isinstance(job, Part):
            plan, variant = self.plans[job.task.world.split], job.task.variant
            assert variant is not None, "a part is a sample"
            self.done += 1
            if why or isinstance(outcome, Lost):
                plan.fail(job.index, variant.id, why)
            else:
                plan.add(job.index, outcome.size)
        elif isinstance(job, Filling):
            if isinstance(outcome, Lost) or outcome.shard is None:
                what = f"a shard of {job.split} cannot be put together ({why})"
                raise ClosedroomsError(f"{what}; the same command tries again: {self.config.out}")
            self.plans[job.split].put(outcome.shard)


def shard_counts(shards: Sequence[Shard]) -> dict[Split, Count]:
    """Count what is in each split."""
    counts: dict[Split, Count] = {}
    for split in SPLITS:
        own = [shard for shard in shards if shard.split == split]
        buildings = {world for shard in own for world in shard.worlds}
        counts[split] = Count(len(buildings), sum(shard.rows for shard in own), sum(shard.size for shard in own))
    return counts


def finish(config: DatasetConfig, worlds: Sequence[World], shards: Sequence[Shard]) -> tuple[dict[str, str], int]:
    """Write card, manifest and checksums; notes of shards are not needed any more.

    Returns:
        Why samples are missing or hold less than their building, by id, and the bytes of all shards and surveys.

    Raises:
        InvalidInputError: There is no sample at all.
        OutputError: Something cannot be written.
    """
    store = open_store(config.out)
    failures = {name: why for shard in shards for name, why in shard.failures.items()}
    if not any(shard.rows for shard in shards):
        why = next(iter(failures.values()), "none was wanted")
        where = str(config.out)
        raise InvalidInputError(f"no sample could be made ({why})", expected="at least one", where=where)
    surveys = store.sizes(SURVEYS)
    size = sum(surveys.values()) + sum(shard.size for shard in shards)
    counts = {split: sum(shard.rows for shard in shards if shard.split == split) for split in SPLITS}
    write_file(store, CARD, card(config, worlds, counts, failures, size).encode())
    manifest: dict[str, Any] = {
        "command": "dataset",
        **description(config, worlds),
        "complete": True,
        "shards": [shard.as_json() for shard in shards],
        **read_worlds(config, worlds),
    }
    write_file(store, DATASET_MANIFEST, json_bytes(manifest))
    sums = {shard.name: shard.sha256 for shard in shards if shard.rows}
    sums |= {name: file_digest(store, name) for name in [*surveys, CARD, DATASET_MANIFEST]}
    write_file(store, SUMS, "".join(f"{value}  {name}\n" for name, value in sorted(sums.items())).encode())
    store.remove(name for name in store.sizes(PARTS) if NOTE.fullmatch(name) or PART.fullmatch(name))
    return failures | {name: why for shard in shards for name, why in shard.stopped.items()}, size
