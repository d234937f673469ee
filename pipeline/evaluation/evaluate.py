"""``closedrooms evaluate``: methods against the truth, over datasets (paper, section 4.1)."""

import json
from collections.abc import Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from dataclasses import dataclass, field
from multiprocessing import get_context
from pathlib import Path
from typing import Any

from closedrooms.core.errors import OutputError
from closedrooms.core.files import MANIFEST, PROGRAM, write_json
from closedrooms.pipeline.evaluation.config import EvaluateConfig
from closedrooms.pipeline.evaluation.sample import AUTHORS, Scores, evaluate_sample
from closedrooms.pipeline.evaluation.samples import SamplePath, find_samples
from closedrooms.pipeline.manifest import resolved, versions
from closedrooms.pipeline.terminal import Progress, Silent

Job = tuple[SamplePath, str]


@dataclass(frozen=True, slots=True, eq=False)
class EvaluationResult:
    """A finished evaluation.

    Attributes:
        folder: What was written.
        title: Head of the table.
        summary: One row a method over all samples.
        failures: Why a sample failed, by ``method sample``.
    """

    folder: Path
    title: str
    summary: list[dict[str, Any]]
    failures: dict[str, str] = field(default_factory=dict)

    def table(self) -> list[tuple[str, ...]]:
        """Rows for people; the first is the head."""
        head = ("method", "rooms", "IoU matched", "median", "IoU by door", "IoU whole area", "agreement", "s a map")
        names = ("matched_mean", "matched_median", "by_door_mean", "area_mean", "agreement_mean", "seconds_median")
        rows: list[tuple[str, ...]] = [head]
        for row in self.summary:
            figures = ["" if row[name] is None else f"{row[name]:.3f}" for name in names]
            rows.append((row["method"], str(row["rooms"]), *figures))
        return rows


def evaluate(config: EvaluateConfig, *, progress: Progress | None = None) -> EvaluationResult:
    """Predict every sample with every method, score it, write tables and pictures.

    What was finished before with the same input, method and code is not done again.

    Args:
        config: Options.
        progress: Told how far it is.

    Raises:
        InvalidInputError: No samples, or two with one name.
        OutputError: The folder cannot be written, or holds something that is not ours.
    """
    progress = progress or Silent()
    samples = find_samples(config.datasets)
    _claim(config.out)
    jobs: list[Job] = [(sample, method) for sample in samples for method in config.methods]
    jobs += [(sample, AUTHORS) for sample in samples if (sample.folder / "authors.yaml").is_file()]
    progress.stage("evaluate", len(jobs))
    scores: list[Scores] = []
    failures: dict[str, str] = {}
    for number, ((sample, method), outcome) in enumerate(_work(jobs, config), start=1):
        if isinstance(outcome, str):
            failures[f"{method} {sample.name}"] = outcome
        else:
            scores.append(outcome)
        progress.advance(number, f"{number} of {len(jobs)}")
    scores.sort(key=lambda score: (score["method"], score["sample"]))
    from closedrooms.pipeline.evaluation.report import write_report

    progress.stage("report")
    summary = write_report(config.out, scores, samples, config)
    manifest = {
        "program": PROGRAM,
        "command": "evaluate",
        "configuration": resolved(config, leave_out=("datasets", "out", "workers")),
        "versions": versions(),
        "samples": len(samples),
        "summary": summary,
        "failures": dict(sorted(failures.items())),
        "files": sorted(path.name for path in config.out.iterdir() if path.name != MANIFEST),
    }
    write_json(config.out / MANIFEST, manifest)
    return EvaluationResult(config.out, f"{len(samples)} samples", summary, failures)


def _claim(folder: Path) -> None:
    """Make the folder ours, or make sure that it is: an evaluation that goes on where it stopped."""
    manifest = folder / MANIFEST
    if folder.exists() and not folder.is_dir():
        raise OutputError(f"the output is a file; expected a folder: {folder}")
    if folder.is_dir() and any(folder.iterdir()):
        try:
            ours = json.loads(manifest.read_text())["command"] == "evaluate"
        except (OSError, ValueError, KeyError, TypeError):
            ours = False
        if not ours:
            raise OutputError(f"the output folder holds files of something else; expected an empty one: {folder}")
        return
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"cannot write ({error.strerror}): {folder}") from error
    write_json(manifest, {"program": PROGRAM, "command": "evaluate", "files": []})


def _work(jobs: Sequence[Job], config: EvaluateConfig) -> Iterator[tuple[Job, Scores | str]]:
    """Outcomes of the jobs as they come: scores, or the reason why a sample failed."""
    if config.workers == 1 or len(jobs) == 1:
        for job in jobs:
            yield job, evaluate_sample(*job, config.out)
        return
    with ProcessPoolExecutor(config.workers, mp_context=get_context("spawn")) as pool:
        waiting: dict[Future[Scores | str], Job] = {pool.submit(evaluate_sample, *job, config.out): job for job in jobs}
        try:
            for future in as_completed(waiting):
                yield waiting[future], future.result()
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise
