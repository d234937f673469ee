"""``closedrooms evaluate``: methods against the truth, over datasets (paper, section 4.1)."""

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from statistics import median
from typing import Any

from closedrooms.core.files.output_folders import MANIFEST, only_writer, real_path
from closedrooms.core.remarks import Remark
from closedrooms.core.report import Report
from closedrooms.core.runtime.packages import require
from closedrooms.experiments.claimed_folder import claim_folder, write_manifest
from closedrooms.experiments.evaluation.config import EvaluateConfig
from closedrooms.experiments.evaluation.samples.listing import find_samples
from closedrooms.experiments.evaluation.samples.sample_path import SamplePath
from closedrooms.experiments.evaluation.scoring.sample_evaluation import SampleResult, evaluate_sample
from closedrooms.experiments.evaluation.scoring.scores import Scores
from closedrooms.experiments.workers import Crew, Lost
from closedrooms.pipeline.reporting.manifest import input_path, resolved, versions
from closedrooms.pipeline.reporting.progress import Progress, Silent


def evaluate(config: EvaluateConfig, *, progress: Progress | None = None) -> Report:
    """Predict every sample with every method, score it, write tables and pictures.

    What was finished before with the same input, method and code is not done again.

    Args:
        config: Options.
        progress: Told how far it is.

    Raises:
        InvalidInputError: No samples, or two with one name.
        OutputError: The folder cannot be written, holds something that is not ours, or another process writes it.
        MissingPackageError: A package that the tables or the pictures need, here or on a worker.
    """
    progress = progress or Silent()
    require("pyarrow", "matplotlib", by="closedrooms evaluate")
    # Workers of a cluster stand in other folders.
    samples = [
        sample if sample.shard else replace(sample, folder=sample.folder.resolve())
        for sample in find_samples(config.datasets)
    ]
    claim_folder(config.out, "evaluate")
    with only_writer(config.out):
        return _evaluate(samples, config, progress)


def _evaluate(samples: Sequence[SamplePath], config: EvaluateConfig, progress: Progress) -> Report:
    """Evaluate what is not done yet, then write tables, pictures and manifest."""
    progress.stage("evaluate", len(samples))
    scores: list[Scores] = []
    failures: dict[str, str] = {}
    for number, outcome in enumerate(_work(samples, config), start=1):
        scores += outcome.scores
        failures |= outcome.problems
        progress.advance(number, f"{number} of {len(samples)}")
    scores.sort(key=lambda score: (score["method"], score["sample"]))
    failures = dict(sorted(failures.items()))
    from closedrooms.experiments.evaluation.reporting.report import write_report

    progress.stage("report")
    summary = write_report(config.out, scores, samples, config, failures)
    seconds = _seconds(scores)
    remarks = _unchecked(samples)
    manifest = {
        "configuration": resolved(config, leave_out=("datasets", "out", "workers", "scheduler")),
        "paths": {"datasets": [input_path(folder) for folder in config.datasets]},
        "versions": versions(),
        "samples": len(samples),
        "summary": summary,
        "failures": failures,
        "remarks": [remark.as_json() for remark in remarks],
        "durations": {"prediction_median_s": seconds},
        "files": sorted(path.name for path in config.out.iterdir() if path.name != MANIFEST),
    }
    write_manifest(config.out, "evaluate", manifest)
    return Report(
        folder=config.out,
        title=f"{len(samples)} samples",
        rows=_rows(summary, seconds),
        failures=failures,
        remarks=remarks,
        figures={"summary": summary, "prediction_median_s": seconds},
    )


def _unchecked(samples: Sequence[SamplePath]) -> list[Remark]:
    """Tell of a dataset's samples that its checksums do not name, so that a change would not show."""
    names = tuple(sample.name for sample in samples if sample.listed and not (sample.shard or sample.digest))
    why = "not in SHA256SUMS, taken as they are"
    return [Remark(action="guessed", what="samples", why=why, names=names, count=len(names))] if names else []


def _rows(summary: Sequence[Mapping[str, Any]], seconds: Mapping[str, float]) -> list[tuple[str, ...]]:
    """Build the table for people, one row a method over all samples."""
    head = ("method", "rooms", "IoU matched", "median", "IoU by door", "IoU whole area", "agreement", "s a map")
    names = ("matched_mean", "matched_median", "by_door_mean", "area_mean", "agreement_mean")
    rows: list[tuple[str, ...]] = [head]
    for row in summary:
        figures = ["" if row[name] is None else f"{row[name]:.3f}" for name in names]
        time = seconds.get(row["method"])
        rows.append((row["method"], str(row["rooms"]), *figures, "" if time is None else f"{time:.3f}"))
    return rows


def _seconds(scores: Sequence[Scores]) -> dict[str, float]:
    """Compute the median time of a prediction, by method [s]."""
    times: defaultdict[str, list[float]] = defaultdict(list)
    for score in scores:
        if "seconds" in score:
            times[score["method"]].append(score["seconds"])
    return {method: round(median(values), 3) for method, values in sorted(times.items())}


def _work(samples: Sequence[SamplePath], config: EvaluateConfig) -> Iterator[SampleResult]:
    """Yield what comes of the samples, as they are finished."""
    job = partial(
        evaluate_sample,
        methods=config.methods,
        out=real_path(config.out),
        tours=config.tours,
        probability=config.probability,
        completions=config.completions,
    )
    workers = min(config.workers, len(samples))
    needs = ("skimage", *(("networkx", "ortools") if config.tours or config.completions else ()))
    crew: Crew[SamplePath, SampleResult] = Crew(workers, config.scheduler, needs, "closedrooms evaluate")
    for sample, outcome in crew.do(job, samples):
        yield SampleResult([], {sample.name: outcome.reason}) if isinstance(outcome, Lost) else outcome
