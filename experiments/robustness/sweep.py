"""``closedrooms robustness``: what noise does to map, prediction and coverage, one source at a time and together."""

import contextlib
import hashlib
import json
import threading
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, replace
from functools import lru_cache, partial
from pathlib import Path

from closedrooms.core.errors import InvalidInputError, OutputError, reason
from closedrooms.core.files.incoming import read_json
from closedrooms.core.files.outgoing import write_json
from closedrooms.core.files.output_folders import MANIFEST, only_writer, real_path
from closedrooms.core.names import file_name
from closedrooms.core.remarks import Remark
from closedrooms.core.report import Report
from closedrooms.core.runtime.packages import require
from closedrooms.experiments.claimed_folder import claim_folder, write_manifest
from closedrooms.experiments.dataset.checksums import files_digest
from closedrooms.experiments.dataset.variants import given_worlds, remarks_on, world_sources
from closedrooms.experiments.robustness.config import FACTORS, RobustnessConfig
from closedrooms.experiments.robustness.levels import Case, Setting, cases
from closedrooms.experiments.robustness.onset import Onset
from closedrooms.experiments.tables import Row
from closedrooms.experiments.workers import Crew, Lost
from closedrooms.pipeline.reporting.manifest import resolved, versions
from closedrooms.pipeline.reporting.progress import Progress, Silent
from closedrooms.worlds.library import distinct_names, load_world, world_source

CELLS, RESULT = "cells", "rows.json"
# How often it is looked how far the workers are [s].
LOOK = 1.0
# What says nothing about the result of one level in one world.
NOT_CONTENT = ("out", "worlds", "workers", "scheduler", "resamples", "factors")


def robustness(config: RobustnessConfig, *, progress: Progress | None = None) -> Report:
    """Disturb, measure, and tell where the prediction starts to suffer.

    What was finished before with the same configuration and code is not done again.

    Args:
        config: Options.
        progress: Told how far it is.

    Raises:
        InvalidInputError: A world that cannot be read, or two of one name.
        OutputError: The folder cannot be written, holds something that is not ours, or another process writes it.
    """
    progress = progress or Silent()
    require("pyarrow", "matplotlib", by="closedrooms robustness")
    worlds, remarks = _worlds(config.worlds)
    claim_folder(config.out, "robustness")
    with only_writer(config.out):
        return _sweep(worlds, config, progress, remarks)


def _sweep(worlds: dict[str, str], config: RobustnessConfig, progress: Progress, remarks: Sequence[Remark]) -> Report:
    """Do what is not done yet, then write figures and manifest."""
    wanted = cases(config)
    total = len(worlds) * len({case.name for case in wanted})
    progress.stage("sweep", total)
    failures = _work(worlds, config, progress, total)
    rows = [row for name in worlds.values() if name not in failures for row in _finished(config, name, wanted)]
    if not rows:
        why = next(iter(failures.values()), "nothing was asked for")
        raise InvalidInputError(f"no world could be used ({why})", expected="at least one")
    from closedrooms.experiments.robustness.report import write_report

    progress.stage("report")
    found = write_report(config, rows, failures)
    manifest = {
        "configuration": resolved(config, leave_out=("worlds", "out", "workers", "scheduler")),
        "paths": {"worlds": world_sources(config.worlds)},
        "versions": versions(),
        "onsets": [asdict(onset) for onset in found],
        "failures": failures | early_ends(rows),
        "remarks": [remark.as_json() for remark in remarks],
        "files": sorted(path.name for path in config.out.iterdir() if path.name != MANIFEST),
    }
    write_manifest(config.out, "robustness", manifest)
    return Report(
        folder=config.out,
        title=f"{len(worlds) - len(failures)} worlds, {config.repetitions} sets of {config.closed} doors each",
        rows=_rows(found),
        failures=failures | early_ends(rows),
        remarks=remarks,
        figures={"onsets": manifest["onsets"]},
    )


def _rows(onsets: Sequence[Onset]) -> list[tuple[str, ...]]:
    """List the table for people: where every factor starts to hurt."""
    rows: list[tuple[str, ...]] = [
        ("factor", "suffers from", "IoU there", "first to give way", "its share", "coverage from")
    ]
    for onset in onsets:
        if onset.level is None or onset.difference is None or onset.stage is None or onset.share is None:
            own = ("none", "", "", "")
        else:
            own = (f"{onset.level:g}", f"{onset.difference.mean:+.3f}", onset.stage, f"{onset.share.mean:.3f}")
        coverage = "none" if onset.coverage_level is None else f"{onset.coverage_level:g}"
        rows.append((onset.factor, *own, coverage))
    return rows


def early_ends(rows: Sequence[Row]) -> dict[str, str]:
    """Name the worlds some of whose explorations ended early: their maps hold less than the building."""
    found: dict[str, set[str]] = {}
    for row in rows:
        if row["exploration"] != "complete":
            found.setdefault(row["world"], set()).add(row["exploration"])
    return {world: f"exploration ended early: {', '.join(sorted(how))}" for world, how in found.items()}


def _worlds(given: Sequence[str]) -> tuple[dict[str, str], list[Remark]]:
    """Name the worlds by what was given, and tell what was said on reading them."""
    given = given_worlds(given)
    plans = [load_world(text) for text in given]
    names = [file_name(name) for name in distinct_names(plans, given)]
    remarks = [remark for plan, name in zip(plans, names, strict=True) for remark in remarks_on(plan, name)]
    return dict(zip(given, names, strict=True)), remarks


@contextlib.contextmanager
def _watch(done: Callable[[], int], total: int, progress: Progress) -> Iterator[None]:
    """Tell every few moments how far the workers are, wherever they are: a world takes them minutes."""
    over = threading.Event()

    def look() -> None:
        while not over.wait(LOOK):
            number = done()
            progress.advance(number, f"{number} of {total}")

    watcher = threading.Thread(target=look, daemon=True)
    watcher.start()
    try:
        yield
    finally:
        over.set()
        watcher.join()


def _work(worlds: dict[str, str], config: RobustnessConfig, progress: Progress, total: int) -> dict[str, str]:
    """Do every world; why some failed."""
    names = {case.name for case in cases(config)}

    def done() -> int:
        return sum((_folder(config, world, name) / RESULT).is_file() for world in worlds.values() for name in names)

    given = {world_source(text): world for text, world in worlds.items()}
    tours = ("networkx", "ortools") if config.tours else ()
    needs = ("pybullet", "mapbox_earcut", "skimage", *tours)
    workers = min(config.workers, len(worlds))
    crew: Crew[tuple[str, str], str] = Crew(workers, config.scheduler, needs, "closedrooms robustness")
    problems: dict[str, str] = {}
    job = partial(sweep_world, config=replace(config, out=real_path(config.out)))
    with _watch(done, total, progress):
        for (_, world), outcome in crew.do(job, given.items()):
            if outcome:
                problems[world] = outcome.reason if isinstance(outcome, Lost) else outcome
    progress.advance(done(), f"{done()} of {total}")
    return problems


def sweep_world(world: tuple[str, str], config: RobustnessConfig) -> str:
    """Try every level in one world; the reason when it failed, else nothing.

    Args:
        world: The world as it was given, and its name.
        config: Options.

    Raises:
        OutputError: A result cannot be written.
    """
    try:
        _do_levels(*world, config)
    except (OutputError, ModuleNotFoundError):
        raise
    except Exception as error:
        return reason(error)
    return ""


def _do_levels(text: str, world: str, config: RobustnessConfig) -> None:
    """Do one level after the other of what is not there yet."""
    from closedrooms.experiments.robustness.trial import BuildingTrials

    key = _fingerprint(text, config)
    distinct = {case.name: case.setting for case in cases(config)}
    missing = {name: s for name, s in distinct.items() if not _kept(_folder(config, world, name), key, s)}
    if not missing:
        return
    building = BuildingTrials(text, config)
    for name, setting in missing.items():
        folder = _folder(config, world, name)
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise OutputError(f"cannot write ({error.strerror}): {folder}") from error
        rows = building.rows(setting, folder)
        write_json(folder / RESULT, {"key": key, "setting": asdict(setting), "rows": rows})
        building.forget(setting)


def _folder(config: RobustnessConfig, world: str, name: str) -> Path:
    return config.out / CELLS / world / name


def _finished(config: RobustnessConfig, world: str, wanted: Sequence[Case]) -> list[Row]:
    """List what is there of one world, levels in order."""
    rows: list[Row] = []
    for case in wanted:
        kept = read_json(_folder(config, world, case.name) / RESULT, what="a finished level")["rows"]
        head = {"factor": case.factor, "number": case.number, "level": case.level}
        rows += [head | row for row in kept]
    return rows


def _kept(folder: Path, key: str, setting: Setting) -> bool:
    """Check whether a level is finished; what another configuration or other code left is not, and goes."""
    path = folder / RESULT
    try:
        kept = read_json(path, what="a finished level")
        if kept["key"] == key and kept["setting"] == asdict(setting):
            return True
    except (InvalidInputError, KeyError, TypeError):
        pass
    path.unlink(missing_ok=True)
    return False


def _fingerprint(world: str, config: RobustnessConfig) -> str:
    """Hash the world, the configuration, the versions of libraries and the code."""
    from closedrooms.worlds.formats.native import plan_text

    content = resolved(config, leave_out=(*NOT_CONTENT, *_LEVELS))
    parts = [plan_text(load_world(world)), json.dumps(content), json.dumps(versions()), _code()]
    return hashlib.sha256("\n".join(parts).encode()).hexdigest()


# Levels stand in the setting of each case.
_LEVELS = FACTORS[:-1]


@lru_cache(maxsize=1)
def _code() -> str:
    """Compute the digest of the code that disturbs and measures."""
    root = Path(__file__).parents[2]
    folders = (
        "core",
        "worlds",
        "sim",
        "mapping",
        "predictor",
        "coverage",
        "navigation",
        "experiments/dataset",
        "experiments/robustness",
    )
    files = [path for folder in folders for path in (root / folder).rglob("*.py")]
    return files_digest(
        [path for path in files if path.name not in {"report.py", "figures.py", "onset.py", "sweep.py"}]
    )
