"""``closedrooms dataset``: maps of many buildings with closed doors, and what is really behind them."""

import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, TextIO

from closedrooms.core.errors import InvalidInputError, OutputError
from closedrooms.core.files.incoming import read_json
from closedrooms.core.files.outgoing import MANIFEST, write_bytes, write_json
from closedrooms.core.report import Report
from closedrooms.core.runtime.packages import require
from closedrooms.experiments.dataset.card import card
from closedrooms.experiments.dataset.checksums import check
from closedrooms.experiments.dataset.config import DatasetConfig
from closedrooms.experiments.dataset.layout import (
    CARD,
    DATASET_MANIFEST,
    alone,
    claim,
    description,
    file_sums,
    fingerprint,
    row,
    write_metadata,
    write_sums,
)
from closedrooms.experiments.dataset.sample import Outcome, Task, make
from closedrooms.experiments.dataset.variants import SPLITS, Variant, World, find_variants, find_worlds
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
    config = replace(config, out=config.out.resolve())
    progress.stage("worlds")
    worlds = find_worlds(config)
    variants = [variant for world in worlds for variant in find_variants(world, config)]
    claim(config, worlds)
    crew: Crew[Task, Outcome] = Crew(config.workers, config.scheduler, _needs(config), "closedrooms dataset")
    with alone(config.out):
        failures = _surveys(config, worlds, crew, progress) if config.maps == "erased" else {}
        tasks = [Task(config, v.world, v) for v in variants if v.world.name not in failures]
        failed = {v.id: failures[v.world.name] for v in variants if v.world.name in failures}
        failed |= {task.variant.id: reason for task, reason in _make(tasks, crew, progress, "samples") if task.variant}
        progress.stage("tables")
        return _finish(config, worlds, variants, failed)


def _needs(config: DatasetConfig) -> tuple[str, ...]:
    """Packages without which no worker makes a sample."""
    return ("pybullet", "mapbox_earcut", "skimage", *(("rerun",) if config.record else ()))


def _surveys(
    config: DatasetConfig, worlds: Sequence[World], crew: Crew[Task, Outcome], progress: Progress
) -> dict[str, str]:
    """Explore each building once; why it failed, by world."""
    tasks = [Task(config, world) for world in worlds]
    return {task.world.name: reason for task, reason in _make(tasks, crew, progress, "surveys")}


def _make(tasks: Sequence[Task], crew: Crew[Task, Outcome], progress: Progress, stage: str) -> list[tuple[Task, str]]:
    """Make what is not there yet; the tasks that failed, with the reason.

    Raises:
        InvalidInputError: Something there was changed since it was written.
        OutputError: Nothing can be written any more.
    """
    progress.stage(stage, len(tasks))
    missing = [task for task in tasks if not _there(task.folder)]
    number, failed = len(tasks) - len(missing), []
    progress.advance(number, f"{number} of {len(tasks)}")
    for task, outcome in crew.do(make, missing):
        if isinstance(outcome, Lost):
            failed.append((task, outcome.reason))
        elif outcome.trouble:
            raise OutputError(outcome.trouble)
        elif outcome.failure:
            failed.append((task, outcome.failure))
        number += 1
        progress.advance(number, f"{number} of {len(tasks)}")
    return failed


def _there(folder: Path) -> bool:
    """Whether a survey or sample was finished before, and is as it was written.

    Raises:
        InvalidInputError: It is not.
    """
    if not folder.exists():
        return False
    check(folder)
    return True


def _finish(
    config: DatasetConfig, worlds: Sequence[World], variants: Sequence[Variant], failed: dict[str, str]
) -> Report:
    """Write what stands at the root and in front of each split."""
    out = config.out
    made = sorted((v for v in variants if v.id not in failed), key=lambda v: v.id)
    if not made:
        raise InvalidInputError(
            f"no sample could be made ({next(iter(failed.values()), 'none was wanted')})",
            expected="at least one", where=out,
        )  # fmt: skip
    counts: dict[str, tuple[int, int, int]] = {}
    stopped: dict[str, str] = {}
    # One run.json is in memory at a time: a million of them have 21 GB. What the tables and sums need goes to disk.
    with tempfile.TemporaryFile("w+", dir=out, prefix=".sums.") as sums:
        surveys = [Task(config, world).folder for world in worlds if config.maps == "erased"]
        size = sum(
            _read(folder, out, sums)[1] for folder in sorted(surveys, key=lambda path: f"{path}/") if folder.exists()
        )
        for split in sorted(SPLITS):
            own = [variant for variant in made if variant.world.split == split]
            counts[split] = (len({v.world.name for v in own}), len(own), _write_table(out, split, own, sums, stopped))
        size += sum(bytes_ for _, _, bytes_ in counts.values())
        _write_root(config, worlds, variants, made, failed, size)
        sums.seek(0)
        parts = (line.rstrip("\n").partition("  ") for line in sums)
        write_sums(out, ((name, value) for value, _, name in parts))
    splits = {split: counts[split] for split in SPLITS}
    return Report(
        folder=out,
        title=f"{len(made)} of {len(variants)} samples, {len(worlds)} worlds, {config.maps}, noise {config.noise}",
        rows=[
            ("split", "buildings", "samples", "MB"),
            *((split, str(b), str(s), f"{size / 1e6:.1f}") for split, (b, s, size) in splits.items()),
        ],
        failures=dict(sorted((failed | stopped).items())),
        remarks=[remark for world in worlds for remark in world.remarks],
        figures={
            "fingerprint": fingerprint(out),
            "splits": {split: {"buildings": b, "samples": s, "bytes": size} for split, (b, s, size) in splits.items()},
        },
    )


def early_end(exploration: Mapping[str, Any]) -> str:
    """Return why a sample holds less than its building."""
    why = f", {exploration['reason']}" if exploration.get("reason") else ""
    return f"exploration ended early: {exploration['status']}{why}"


def _read(folder: Path, out: Path, sums: TextIO) -> tuple[dict[str, Any], int]:
    """``run.json`` of a survey or sample and the bytes of its files; their checksums are put down in ``sums``."""
    about = read_json(folder / MANIFEST, what="run.json")
    for name, value in file_sums(out, folder.relative_to(out).as_posix(), about):
        sums.write(f"{value}  {name}\n")
    return about, sum(path.stat().st_size for path in folder.iterdir())


def _write_table(out: Path, split: str, made: Sequence[Variant], sums: TextIO, stopped: dict[str, str]) -> int:
    """The table of a split; the bytes of its samples. Explorations that ended early are added to ``stopped``."""
    sizes = 0

    def rows() -> Iterator[dict[str, Any]]:
        nonlocal sizes
        for variant in made:
            about, size = _read(out / variant.id, out, sums)
            sizes += size
            if about["exploration"]["status"] != "complete":
                stopped[variant.id] = early_end(about["exploration"])
            yield row(variant, about)

    if made:
        write_metadata(out / split, rows())
    return sizes


def _write_root(
    config: DatasetConfig,
    worlds: Sequence[World],
    variants: Sequence[Variant],
    made: Sequence[Variant],
    failed: dict[str, str],
    size: int,
) -> None:
    """The card and the manifest."""
    out = config.out
    write_bytes(out / CARD, card(config, worlds, made, failed, size).encode())
    samples = [
        {
            "id": variant.id,
            "split": variant.world.split,
            "world": variant.world.name,
            "repetition": variant.repetition,
            "closed": list(variant.closed),
            "status": "failed" if variant.id in failed else "ok",
            "reason": failed.get(variant.id, ""),
        }
        for variant in sorted(variants, key=lambda v: v.id)
    ]
    remarks = [remark.as_json() for world in worlds for remark in world.remarks]
    manifest = {"command": "dataset", **description(config, worlds), "complete": True, "samples": samples}
    manifest |= {"remarks": remarks} if remarks else {}
    write_json(out / DATASET_MANIFEST, manifest)
