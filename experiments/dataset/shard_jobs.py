"""What workers do for a dataset of shards: a sample becomes a part, many parts become one Parquet file.

A part is one row (``parts/``, an Arrow stream), so that a killed command loses no more than what was being made. When
the parts in front reach the size of a shard, a worker puts them together, writes down what is in it, and removes them.
"""

import json
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from closedrooms.experiments.dataset.config import DatasetConfig
from closedrooms.experiments.dataset.layout import early_end, json_bytes
from closedrooms.experiments.dataset.packing import (
    as_bytes,
    from_bytes,
    pack_sample,
    pack_survey,
    sample_schema,
)
from closedrooms.experiments.dataset.sample import Task, TaskResult, guarded, make_folder
from closedrooms.experiments.dataset.shard import Shard, note_name, part_name, shard_name
from closedrooms.experiments.dataset.survey_store import survey_name
from closedrooms.experiments.dataset.variants import Split
from closedrooms.experiments.stores import HashingWriter, Store, open_store, write_file

# Samples that are read and written at a time, 1.5 MB: who wants one of them reads no more than these.
ROW_GROUP = 16


@dataclass(frozen=True, slots=True)
class Part:
    """One sample to make.

    Attributes:
        task: The sample.
        index: Its place among the samples of its split, those that fail included.
    """

    task: Task
    index: int


@dataclass(frozen=True, slots=True)
class Filling:
    """One shard to put together from parts that are all there.

    Attributes:
        config: Of the dataset.
        split: Whose samples.
        number: Its place among the split's shards.
        first: Index of its first sample.
        end: Index behind its last one.
        failures: Why samples among them are missing: index, id and reason.
    """

    config: DatasetConfig
    split: Split
    number: int
    first: int
    end: int
    failures: tuple[tuple[int, str, str], ...] = ()


def work(job: Part | Filling | Task) -> TaskResult:
    """Make a survey, a part or a shard; tell what goes wrong, but raise a missing package."""
    if isinstance(job, Task):
        return guarded(lambda: make_survey(job))
    if isinstance(job, Part):
        return guarded(lambda: make_part(job))
    return guarded(lambda: fill_shard(job))


def make_survey(task: Task) -> TaskResult:
    """Explore a building and keep the survey."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    store = open_store(task.config.out)
    with tempfile.TemporaryDirectory(prefix="closedrooms-") as scratch:
        folder = Path(scratch) / "survey"
        make_folder(task, folder)
        with store.new(survey_name(task.world)) as file:
            pq.write_table(pa.Table.from_batches([pack_survey(folder)]), file, compression="zstd")
    return TaskResult()


def make_part(part: Part) -> TaskResult:
    """Make a sample and keep it as a part."""
    task = part.task
    assert task.variant is not None, "a survey is no part"
    with tempfile.TemporaryDirectory(prefix="closedrooms-") as scratch:
        folder = Path(scratch) / "sample"
        make_folder(task, folder)
        content = as_bytes(pack_sample(folder, task.variant.id, scans=task.config.keep_scans))
    write_file(open_store(task.config.out), part_name(task.world.split, part.index), content)
    return TaskResult(size=len(content))


def fill_shard(job: Filling) -> TaskResult:
    """Fill a shard from its parts: write the shard, then what is in it, then remove the parts."""
    import pyarrow.parquet as pq

    store = open_store(job.config.out)
    missing = {index for index, _, _ in job.failures}
    parts = [part_name(job.split, index) for index in range(job.first, job.end) if index not in missing]
    name, worlds = shard_name(job.split, job.number), dict[str, None]()
    size, digest = 0, ""
    stopped: dict[str, str] = {}
    if parts:
        with store.new(name) as file:
            sink = HashingWriter(file)
            schema = sample_schema(scans=job.config.keep_scans)
            with pq.ParquetWriter(sink, schema, compression="zstd", use_dictionary=["world"]) as writer:
                for at in range(0, len(parts), ROW_GROUP):
                    table = _joined(store, parts[at : at + ROW_GROUP])
                    worlds |= dict.fromkeys(table.column("world").to_pylist())
                    for sample, text in zip(
                        table.column("id").to_pylist(), table.column("run_json").to_pylist(), strict=True
                    ):
                        stopped |= early_end(sample, json.loads(text))
                    writer.write_table(table, row_group_size=ROW_GROUP)
            size, digest = sink.size, sink.digest
    failures = {sample: why for _, sample, why in job.failures}
    shard = Shard(
        name, job.split, job.number, job.first, job.end, len(parts), size, digest, tuple(worlds), failures, stopped
    )  # fmt: skip
    write_note(store, shard)
    store.remove(parts)
    return TaskResult(shard=shard)


def _joined(store: Store, names: Sequence[str]) -> Any:
    """Read parts and put them together to one Arrow table."""
    import pyarrow as pa

    tables = zip(names, store.read_all(names), strict=True)
    return pa.concat_tables([from_bytes(content, store.where(name)) for name, content in tables])


def write_note(store: Store, shard: Shard) -> None:
    """Write down what is in a shard.

    Raises:
        OutputError: It cannot be written.
    """
    write_file(store, note_name(shard.split, shard.number), json_bytes(shard.as_json()))
