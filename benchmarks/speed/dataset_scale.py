"""Whether a large dataset costs more a sample, or more memory, than a small one: trivial work in place of maps.

    python benchmarks/speed/dataset_scale.py [--sizes 1000 10000 100000] [--workers 2] [--quick] [--csv FILE]

All is as in ``closedrooms dataset --format shards`` (jobs handed out, parts written, shards filled, tables), only a
sample is 2 kB of nothing. Each size is a process of its own. CPU time is that of the command and of its workers; memory
is the largest that the command has, and the largest of its workers. The last column is "ours / best known": CPU time a
sample against the smallest size, above 1 is more. Called again with the same ``--csv``, it keeps the
sizes that are there.
"""

import argparse
import csv
import json
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from closedrooms.experiments.dataset import sharded_dataset
from closedrooms.experiments.dataset.config import DatasetConfig
from closedrooms.experiments.dataset.dataset import dataset
from closedrooms.experiments.dataset.packing import as_bytes, sample_schema
from closedrooms.experiments.dataset.sample import Task, TaskResult
from closedrooms.experiments.dataset.shard import part_name
from closedrooms.experiments.dataset.shard_jobs import Filling, Part, fill_shard
from closedrooms.experiments.stores import open_store, write_file

WORLD, CLOSED = "office-03", 10
HEAD = ("samples", "shards", "CPU ms a sample", "wall s", "command MB", "worker MB", "ours / best known")


def make_nothing(job: Task | Part | Filling) -> TaskResult:
    """Make a part with nothing in it; shards are filled as always."""
    import pyarrow as pa

    if isinstance(job, Filling):
        return TaskResult(shard=fill_shard(job).shard)
    assert isinstance(job, Part), "nothing is surveyed"
    assert job.task.variant is not None, "a part is a sample"
    variant, config = job.task.variant, job.task.config
    row: dict[str, Any] = {
        "id": variant.id,
        "world": variant.world.name,
        "repetition": variant.repetition,
        "closed": list(variant.closed),
        "map": {"bytes": bytes(1000), "path": "map.png"},
        "truth": {"bytes": bytes(1000), "path": "truth.png"},
        "run_json": json.dumps({"exploration": {"status": "complete"}}),
    }
    content = as_bytes(pa.RecordBatch.from_pylist([row], schema=sample_schema(scans=False)))
    write_file(open_store(config.out), part_name(variant.world.split, job.index), content)
    return TaskResult(size=len(content))


def measure(samples: int, workers: int) -> dict[str, Any]:
    """Make one dataset in this process."""
    sharded_dataset.work = make_nothing
    with tempfile.TemporaryDirectory() as scratch:
        config = DatasetConfig(
            worlds=(WORLD,), out=Path(scratch) / "d", format="shards", shard_mb=1.0, maps="simulated", workers=workers,
            repetitions=samples // CLOSED, max_closed=CLOSED,
        )  # fmt: skip
        begin = time.perf_counter()
        report = dataset(config)
        wall = time.perf_counter() - begin
        shards = len(list((Path(scratch) / "d" / "data").iterdir()))
    own, others = resource.getrusage(resource.RUSAGE_SELF), resource.getrusage(resource.RUSAGE_CHILDREN)
    return {
        "samples": sum(split["samples"] for split in report.figures["splits"].values()),
        "shards": shards,
        "cpu": own.ru_utime + own.ru_stime + others.ru_utime + others.ru_stime,
        "wall": wall,
        "own": own.ru_maxrss / 1e3,
        "worker": others.ru_maxrss / 1e3,
    }


def read_before(path: Path | None) -> tuple[list[str], list[tuple[Any, ...]]]:
    """Read the notes and the rows of an earlier call, none where there is no file."""
    if path is None or not path.exists():
        return [], []
    lines = path.read_text().splitlines(keepends=True)
    notes = [line for line in lines if line.startswith("#")]
    return notes, [tuple(row) for row in csv.reader(lines[len(notes) + 1 :])]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sizes", type=int, nargs="+", default=[1_000, 10_000, 100_000])
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--quick", action="store_true", help="200 and 1,000 samples")
    parser.add_argument("--csv", type=Path)
    parser.add_argument("--one", type=int, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.one:
        print(json.dumps(measure(options.one, options.workers)))
        return
    notes, rows = read_before(options.csv)
    print("".join(f"{name:>19}" for name in HEAD))
    for row in rows:
        print("".join(f"{value:>19}" for value in row), flush=True)
    there = {int(row[0]) for row in rows}
    for size in [200, 1_000] if options.quick else options.sizes:
        if size in there:
            continue
        line = [sys.executable, __file__, "--one", str(size), "--workers", str(options.workers)]
        found = json.loads(subprocess.run(line, check=True, capture_output=True, text=True).stdout)
        cost = 1e3 * found["cpu"] / found["samples"]
        first = float(rows[0][2]) if rows else round(cost, 3)
        values = (found["samples"], found["shards"], round(cost, 3), round(found["wall"], 1), round(found["own"], 1),
                  round(found["worker"], 1), round(cost / first, 2))  # fmt: skip
        rows.append(values)
        print("".join(f"{value:>19}" for value in values), flush=True)
        if options.csv:
            with options.csv.open("w", newline="") as file:
                file.writelines(notes)
                csv.writer(file, lineterminator="\n").writerows([HEAD, *rows])


if __name__ == "__main__":
    main()
