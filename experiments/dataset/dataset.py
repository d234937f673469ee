"""``closedrooms dataset``: maps of many buildings with closed doors, and what is really behind them."""

import tempfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import chain
from pathlib import Path
from typing import Any, TextIO

from closedrooms.core.errors import InvalidInputError, OutputError
from closedrooms.core.files.incoming import read_json
from closedrooms.core.files.outgoing import write_bytes
from closedrooms.core.files.output_folders import MANIFEST, real_path
from closedrooms.core.report import Report
from closedrooms.core.runtime.packages import require
from closedrooms.experiments.dataset.checksums import check
from closedrooms.experiments.dataset.config import DatasetConfig
from closedrooms.experiments.dataset.dataset_card import card
from closedrooms.experiments.dataset.layout import (
    CARD,
    Count,
    alone,
    claim_dataset,
    early_end,
    file_sums,
    fingerprint,
    row,
    write_manifest,
    write_metadata,
    write_sums,
)
from closedrooms.experiments.dataset.sample import Task, TaskResult, make
from closedrooms.experiments.dataset.sharded_dataset import finish, make_shards, shard_counts
from closedrooms.experiments.dataset.variants import (
    SPLITS,
    Split,
    World,
    count_variants,
    find_variants,
    find_worlds,
    sort_buildings,
)
from closedrooms.experiments.places import Url
from closedrooms.experiments.workers import Crew, Lost
from closedrooms.pipeline.reporting.progress import Progress, Silent


def dataset(config: DatasetConfig, *, progress: Progress | None = None) -> Report:
    """Make a dataset, or what is missing of it.

    Args:
        config: Options.
        progress: Told how far it is.

    Raises:
        InvalidInputError: A world that cannot be used, another dataset in the folder, a sample there that was changed,
            no scheduler at the address.
        OutputError: The folder cannot be written, or holds something that is not ours.
        MissingPackageError: A package that the work needs, here or on a worker.
    """
    progress = progress or Silent()
    require("pyarrow", by="closedrooms dataset")
    if isinstance(config.out, Path):
        config = replace(config, out=real_path(config.out))
    _check_reach(config)
    progress.stage("worlds")
    worlds = find_worlds(config)
    claim_dataset(config, worlds)
    with alone(config.out):
        if config.format == "shards":
            shards = make_shards(config, worlds, progress, _needs(config))
            progress.stage("tables")
            failed, _ = finish(config, worlds, shards)
            counts = shard_counts(shards)
        else:
            failed = _make_folders(config, worlds, progress)
            progress.stage("tables")
            counts, stopped = _finish(config, worlds, failed)
            failed |= stopped
        return _report(config, worlds, counts, failed)


def _check_reach(config: DatasetConfig) -> None:
    """Refuse an address that other processes do not see.

    Raises:
        InvalidInputError: ``memory://`` with workers.
    """
    alone_here = config.workers == 1 and config.scheduler is None
    if isinstance(config.out, Url) and config.out.startswith("memory://") and not alone_here:
        raise InvalidInputError("other processes do not see memory://", expected="--workers 1", where=config.out)


def _report(
    config: DatasetConfig, worlds: Sequence[World], counts: Mapping[Split, Count], failed: Mapping[str, str]
) -> Report:
    made, wanted = sum(count.samples for count in counts.values()), count_variants(worlds, config)
    return Report(
        folder=config.out,
        title=f"{made} of {wanted} samples, {len(worlds)} worlds, {config.maps}, noise {config.noise}",
        rows=[
            ("split", "buildings", "samples", "MB"),
            *((split, str(c.buildings), str(c.samples), f"{c.size / 1e6:.1f}") for split, c in counts.items()),
        ],
        failures=dict(sorted(failed.items())),
        remarks=[remark for world in worlds for remark in world.remarks],
        figures={
            "fingerprint": fingerprint(config.out),
            "splits": {
                split: {"buildings": c.buildings, "samples": c.samples, "bytes": c.size} for split, c in counts.items()
            },
        },
    )


def _make_folders(config: DatasetConfig, worlds: Sequence[World], progress: Progress) -> dict[str, str]:
    """Make what is missing of a dataset of folders and collect why samples failed, by id."""
    crew: Crew[Task, TaskResult] = Crew(config.workers, config.scheduler, _needs(config), "closedrooms dataset")
    failures: dict[str, str] = {}
    if config.maps == "erased":
        surveys = (Task(config, world) for world in worlds)
        failures = {task.world.name: why for task, why in _make(surveys, len(worlds), crew, progress, "surveys")}
    variants = (
        variant
        for split in SPLITS
        for world in sort_buildings(worlds, split)
        for variant in find_variants(world, config)
    )
    failed: dict[str, str] = {}

    def tasks() -> Iterator[Task]:
        for variant in variants:
            if variant.world.name in failures:
                failed[variant.id] = failures[variant.world.name]
            else:
                yield Task(config, variant.world, variant)

    total = count_variants(worlds, config)
    made = _make(tasks(), total, crew, progress, "samples")
    return failed | {task.variant.id: why for task, why in made if task.variant}


def _needs(config: DatasetConfig) -> tuple[str, ...]:
    """List the packages without which no worker makes a sample."""
    return ("pybullet", "mapbox_earcut", "skimage", *(("rerun",) if config.record else ()))


def _make(
    tasks: Iterable[Task], total: int, crew: Crew[Task, TaskResult], progress: Progress, stage: str
) -> list[tuple[Task, str]]:
    """Make what is not there yet and collect the tasks that failed, with the reason.

    Raises:
        InvalidInputError: Something there was changed since it was written.
        OutputError: Nothing can be written any more.
    """
    progress.stage(stage, total)
    number, failed = 0, []

    def missing() -> Iterator[Task]:
        nonlocal number
        for task in tasks:
            if _there(task.folder):
                number += 1
            else:
                yield task

    for task, outcome in crew.do(make, missing()):
        if isinstance(outcome, Lost):
            failed.append((task, outcome.reason))
        elif outcome.trouble:
            raise OutputError(outcome.trouble)
        elif outcome.failure:
            failed.append((task, outcome.failure))
        number += 1
        progress.advance(number, f"{number} of {total}")
    return failed


def _there(folder: Path) -> bool:
    """Check whether a survey or sample was finished before, and is as it was written.

    Raises:
        InvalidInputError: It is not.
    """
    if not folder.exists():
        return False
    check(folder)
    return True


def _finish(
    config: DatasetConfig, worlds: Sequence[World], failed: Mapping[str, str]
) -> tuple[dict[Split, Count], dict[str, str]]:
    """Write root and tables of a dataset of folders; count its content, and find samples that hold too little."""
    assert isinstance(config.out, Path), "folders are of this machine"
    out = config.out
    if len(failed) == count_variants(worlds, config):
        raise InvalidInputError(
            f"no sample could be made ({next(iter(failed.values()), 'none was wanted')})",
            expected="at least one", where=out,
        )  # fmt: skip
    counts: dict[Split, Count] = {}
    stopped: dict[str, str] = {}
    # One run.json is in memory at a time: a million of them have 21 GB. What the tables and sums need goes to disk.
    with tempfile.TemporaryFile("w+", dir=out, prefix=".sums.") as sums:
        surveys = [Task(config, world).folder for world in worlds if config.maps == "erased"]
        size = sum(
            _read(folder, out, sums)[1] for folder in sorted(surveys, key=lambda path: f"{path}/") if folder.exists()
        )
        for split in sorted(SPLITS):
            counts[split] = _write_table(config, sort_buildings(worlds, split), failed, sums, stopped)
        size += sum(count.size for count in counts.values())
        made: dict[Split, int] = {split: count.samples for split, count in counts.items()}
        write_bytes(out / CARD, card(config, worlds, made, failed, size).encode())
        write_manifest(config, worlds, failed)
        sums.seek(0)
        parts = (line.rstrip("\n").partition("  ") for line in sums)
        write_sums(out, ((name, value) for value, _, name in parts))
    return {split: counts[split] for split in SPLITS}, stopped


def _read(folder: Path, out: Path, sums: TextIO) -> tuple[dict[str, Any], int]:
    """Read ``run.json`` of a survey or sample, add up its files' bytes, and put their checksums down in ``sums``."""
    about = read_json(folder / MANIFEST, what="run.json")
    for name, value in file_sums(out, folder.relative_to(out).as_posix(), about):
        sums.write(f"{value}  {name}\n")
    return about, sum(path.stat().st_size for path in folder.iterdir())


def _write_table(
    config: DatasetConfig, worlds: Sequence[World], failed: Mapping[str, str], sums: TextIO, stopped: dict[str, str]
) -> Count:
    """Write the table of a split and count what is in it; add explorations that ended early to ``stopped``."""
    assert isinstance(config.out, Path), "folders are of this machine"
    out, sizes, samples, buildings = config.out, 0, 0, set()

    def rows() -> Iterator[dict[str, Any]]:
        nonlocal sizes, samples
        for world in worlds:
            for variant in find_variants(world, config):
                if variant.id not in failed:
                    about, size = _read(out / variant.id, out, sums)
                    sizes, samples = sizes + size, samples + 1
                    buildings.add(world.name)
                    stopped.update(early_end(variant.id, about))
                    yield row(variant, about)

    source = rows()
    for first in source:
        write_metadata(out / worlds[0].split, chain((first,), source))
    return Count(len(buildings), samples, sizes)
