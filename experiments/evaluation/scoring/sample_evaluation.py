"""All methods on one sample: read once; predict, plan, score and keep for each method."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from closedrooms.core.errors import InvalidInputError, OutputError, reason
from closedrooms.core.files.geojson import write_rooms
from closedrooms.core.files.outgoing import write_json
from closedrooms.core.files.rosmap import write_raw_map
from closedrooms.experiments.evaluation.samples.sample_path import SamplePath
from closedrooms.experiments.evaluation.samples.sample_reader import Sample, at_hand, read_sample, renamed
from closedrooms.experiments.evaluation.scoring.cost import score_cost
from closedrooms.experiments.evaluation.scoring.hidden_space import HiddenSpace, find_hidden_space
from closedrooms.experiments.evaluation.scoring.kept_scores import (
    AUTHORS,
    Extras,
    content_digest,
    fingerprint,
    plans_tours,
    read_kept,
)
from closedrooms.experiments.evaluation.scoring.scores import Scores, added_rooms, iou, room_masks
from closedrooms.experiments.evaluation.scoring.sureness import score_sureness
from closedrooms.experiments.evaluation.scoring.timed_prediction import Starts, predict_with
from closedrooms.experiments.evaluation.scoring.tours import Tour, kept_tour, plan_cropped_tour, tour_figures
from closedrooms.pipeline.reporting.run_scores import room_iou
from closedrooms.predictor.prediction import free_probability

RESULT = "scores.json"


@dataclass(frozen=True, slots=True, eq=False)
class SampleResult:
    """Result of one sample.

    Attributes:
        scores: One entry a method that could be scored.
        problems: Why something failed, by ``sample`` (all of it), or ``method sample``.
    """

    scores: list[Scores] = field(default_factory=list)
    problems: dict[str, str] = field(default_factory=dict)


def evaluate_sample(
    sample: SamplePath,
    methods: Sequence[str],
    out: Path,
    *,
    tours: bool = True,
    probability: bool = False,
    completions: int = 0,
) -> SampleResult:
    """Score some methods on one sample, each kept in ``out/<method>/<sample>``.

    What was kept before from the same files, with the same method and code, is not done again.

    Args:
        sample: The sample.
        methods: Methods; the authors' own map is scored too where the sample has it.
        out: Folder of the evaluation.
        tours: Plan coverage tours too, where the sample's run.json tells ``|R|``.
        probability: Write each cell's probability too (``probability.{yaml,png}``).
        completions: Tell the cost of coverage as a distribution too, from so many completions.

    Raises:
        OutputError: The result cannot be written.
    """
    if sample.problem:
        return SampleResult(problems={sample.name: sample.problem})
    try:
        with at_hand(sample) as here:
            outcome = _evaluate(here, methods, out, Extras(tours, probability, completions))
            problems = {name: renamed(why, here.folder, sample) for name, why in outcome.problems.items()}
            return SampleResult(outcome.scores, problems)
    except InvalidInputError as error:
        return SampleResult(problems={sample.name: reason(error)})


def _evaluate(sample: SamplePath, methods: Sequence[str], out: Path, extras: Extras) -> SampleResult:
    """Score some methods on one sample in a folder."""
    outcome = SampleResult()
    wanted = [*methods, *([AUTHORS] if (sample.folder / "authors.yaml").is_file() else [])]
    content = content_digest(sample.folder)
    keys = {method: fingerprint(content, method, extras) for method in wanted}
    kept = {method: read_kept(out / method / sample.name / RESULT, keys[method]) for method in wanted}
    if any(scores is None for scores in kept.values()):
        try:
            read = read_sample(sample)
            hidden = find_hidden_space(read.observed, read.truth)
            starts = Starts(read)
        except ModuleNotFoundError:
            raise
        except Exception as error:
            outcome.problems[sample.name] = reason(error)
            return outcome
    for method in wanted:
        scores = kept[method]
        if scores is None:
            folder = out / method / sample.name
            _make(folder)
            head = _head(read, sample.name, method, keys[method], hidden)
            try:
                scores = head | _score(read, method, folder, hidden, out, starts, extras)
            except (OutputError, ModuleNotFoundError):
                raise
            except Exception as error:
                outcome.problems[f"{method} {sample.name}"] = reason(error)
                continue
            write_json(folder / RESULT, scores)
        outcome.scores.append(scores)
        if "no_tour" in scores:
            outcome.problems[f"{method} {sample.name}"] = scores["no_tour"]
    return outcome


def _make(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"cannot write ({error.strerror}): {folder}") from error


def _head(sample: Sample, name: str, method: str, key: str, hidden: HiddenSpace) -> Scores:
    """Say what a sample and a method are, in front of their scores."""
    return {
        "key": key,
        "sample": name,
        "method": method,
        "world": sample.world,
        "repetition": sample.repetition,
        "closed_doors": sample.closed,
        "doors": len(sample.doors),
        "hidden_share": round(hidden.share, 6),
    }


def _score(
    sample: Sample,
    method: str,
    folder: Path,
    hidden: HiddenSpace,
    out: Path,
    starts: Starts,
    extras: Extras,
) -> Scores:
    """Predict a sample with one method, keep the rooms, and measure."""
    if method == AUTHORS:
        assert sample.authors is not None, "only samples with authors.yaml come here"
        masks = added_rooms(sample.observed, sample.authors)
        return hidden.score(masks) | {"by_door": {}, "not_seen": []}
    prediction, seconds = predict_with(method, sample, starts)
    write_rooms(folder / "rooms.geojson", prediction.rooms)
    if extras.probability:
        write_raw_map(folder / "probability", free_probability(prediction, sample.observed))
    unknown = sample.observed.unknown
    masks = [mask & unknown for mask in room_masks(prediction.rooms, sample.observed.frame)]
    detected = {door.id for door in sample.doors}
    figures = room_iou(prediction.rooms, sample.rooms)
    scores = hidden.score(masks) | {
        "by_door": {door: round(figure, 6) for door, figure in figures.items() if door in detected},
        "not_seen": sorted(set(figures) - detected),
        "failures": prediction.failures,
        "seconds": round(seconds, 4),
        "sure": score_sureness(prediction, sample.observed, sample.doors, sample.truth, sample.rooms),
    }
    if sample.authors is not None:
        theirs = sample.authors.free & unknown
        ours = prediction.grid.on(sample.observed.frame).free & unknown
        scores["agreement"] = round(iou(ours, theirs), 6)
    compared = extras.tours and sample.rooms_seen is not None
    if plans_tours(method) and (compared or extras.completions):
        try:
            own = plan_cropped_tour(prediction.grid)
            if extras.completions:
                scores["completions"] = score_cost(sample, prediction, own, out, extras.completions)
            if compared:
                scores["tour"] = _tours(sample, tour_figures(own), out)
        except (OutputError, ModuleNotFoundError):
            raise
        except Exception as error:
            scores["no_tour"] = f"no tour: {reason(error)}"
    return scores


def _tours(sample: Sample, own: Tour, out: Path) -> Tour:
    """Measure the three tours and the errors of the three estimates in percent (paper, sections 5.2 and 5.3).

    ``own`` is the one on the predicted map, of a sample that knows how many rooms were seen.
    """
    assert sample.rooms_seen is not None, "only such samples come here"
    from closedrooms.coverage.estimates import compare_lengths

    closed = kept_tour(out, sample.observed, sample.doors)
    truth = kept_tour(out, sample.truth)
    errors = compare_lengths(
        closed["length_m"], own["length_m"], truth["length_m"], n_rooms=sample.rooms_seen, n_doors=len(sample.doors)
    )
    if errors.error_closed is None or errors.error_baseline is None or errors.error_pred is None:
        raise InvalidInputError("a true tour of length 0", expected="a building with more than one place to visit")
    return {
        "rooms_seen": sample.rooms_seen,
        "closed": closed,
        "predicted": own,
        "truth": truth,
        "baseline_m": round(errors.tsp_baseline, 6),
        "error_closed": round(errors.error_closed, 6),
        "error_baseline": round(errors.error_baseline, 6),
        "error_predicted": round(errors.error_pred, 6),
    }
