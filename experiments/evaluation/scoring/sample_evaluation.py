"""All methods on one sample: read once; predict, plan, score and keep for each method."""

import hashlib
import json
import time
from collections.abc import Sequence
from dataclasses import dataclass, field, fields
from functools import lru_cache
from pathlib import Path

import numpy as np

from closedrooms.core.arrays import BoolArray
from closedrooms.core.errors import InvalidInputError, OutputError, reason
from closedrooms.core.files.geojson import write_rooms
from closedrooms.core.files.incoming import read_json
from closedrooms.core.files.outgoing import write_json
from closedrooms.core.files.rosmap import write_raw_map
from closedrooms.experiments.dataset.checksums import digest
from closedrooms.experiments.evaluation.samples.sample_path import SamplePath
from closedrooms.experiments.evaluation.samples.sample_reader import Sample, at_hand, read_sample, renamed
from closedrooms.experiments.evaluation.scoring.cost import score_cost
from closedrooms.experiments.evaluation.scoring.scores import (
    Scores,
    added_rooms,
    hidden_area,
    iou,
    matched_iou,
    room_masks,
    split_hidden_area,
    union_of,
)
from closedrooms.experiments.evaluation.scoring.sureness import score_sureness
from closedrooms.experiments.evaluation.scoring.tours import (
    Tour,
    code_digest,
    kept_tour,
    plan_cropped_tour,
    tour_code,
    tour_figures,
)
from closedrooms.pipeline.reporting.manifest import versions
from closedrooms.pipeline.reporting.run_scores import room_iou
from closedrooms.predictor.config import FacesConfig
from closedrooms.predictor.methods import find_method
from closedrooms.predictor.paper.initial_layouts import FacesFound
from closedrooms.predictor.prediction import Prediction, free_probability

AUTHORS = "authors"
RESULT = "scores.json"
INPUTS = {".yaml", ".png", ".pgm", ".geojson", ".json"}


@dataclass(frozen=True, slots=True, eq=False)
class SampleResult:
    """Result of one sample.

    Attributes:
        scores: One entry a method that could be scored.
        problems: Why something failed, by ``sample`` (all of it), or ``method sample``.
    """

    scores: list[Scores] = field(default_factory=list)
    problems: dict[str, str] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Extras:
    """Optional work on a sample, beside predicting and scoring.

    Attributes:
        tours: Whether to plan coverage tours, where the sample tells how many rooms there are (``|R|``).
        probability: Whether to write the probability of every cell.
        completions: Number of completions from which the cost of coverage is estimated; 0 for no estimate.
    """

    tours: bool
    probability: bool
    completions: int


@dataclass(frozen=True, slots=True, eq=False)
class _Hidden:
    """Truth that the map does not show: the same for every method."""

    area: BoolArray
    rooms: list[BoolArray]
    share: float


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
    content = _content(sample.folder)
    keys = {method: _fingerprint(content, method, extras) for method in wanted}
    kept = {method: _kept(out / method / sample.name / RESULT, keys[method]) for method in wanted}
    if any(scores is None for scores in kept.values()):
        try:
            read = read_sample(sample)
            hidden = _hidden(read)
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


def _content(folder: Path) -> str:
    """Compute the digest of the files of a sample."""
    content = hashlib.sha256()
    for path in sorted(path for path in folder.glob("*") if path.suffix in INPUTS and path.is_file()):
        content.update(path.name.encode() + digest(path).encode())
    return content.hexdigest()


def _fingerprint(content: str, method: str, extras: Extras) -> str:
    """Digest the input, the method, the versions of libraries and the code that predicts, plans and scores."""
    planned = (extras.tours or extras.completions) and _has_tour(method)
    parts = [content, method, json.dumps(versions()), _code(), tour_code() if planned else ""]
    parts += ["probability"] if extras.probability and method != AUTHORS else []
    parts += [f"completions {extras.completions} {extras.tours}"] if extras.completions and planned else []
    return hashlib.sha256(" ".join(parts).encode()).hexdigest()


@lru_cache(maxsize=1)
def _code() -> str:
    """Compute the digest of the code that predicts and scores."""
    root, here = Path(__file__).parents[3], Path(__file__).parent
    files = [
        *(root / "predictor").rglob("*.py"),
        *(root / "predictor").rglob("*.json"),
        *(root / "predictor").rglob("*.onnx"),
        *(root / "core").rglob("*.py"),
        root / "pipeline" / "reporting" / "run_scores.py",
        here.parent / "samples" / "sample_reader.py",
        *(here / name for name in ("sample_evaluation.py", "scores.py", "sureness.py", "cost.py")),
    ]
    return code_digest(files)


def _kept(path: Path, key: str) -> Scores | None:
    """Read scores that were kept, ``None`` where they are of other inputs or code."""
    try:
        scores: Scores = read_json(path, what="the scores of a sample")
    except InvalidInputError:
        return None
    return scores if isinstance(scores, dict) and scores.get("key") == key else None


class Starts:
    """Lines and faces of one sample, found once for all methods that begin with the same ones."""

    def __init__(self, sample: Sample) -> None:
        self._sample = sample
        self._found: dict[FacesConfig, tuple[FacesFound, float]] = {}

    def of(self, config: FacesConfig) -> tuple[FacesFound, float]:
        """Find lines, faces and initial faces under these settings, once; returns them and the seconds it took then."""
        from closedrooms.predictor.paper.initial_layouts import find_initial_faces

        faces = FacesConfig(**{item.name: getattr(config, item.name) for item in fields(FacesConfig)})
        if faces not in self._found:
            begin = time.perf_counter()
            started = find_initial_faces(self._sample.observed, self._sample.doors, faces)
            self._found[faces] = started, time.perf_counter() - begin
        return self._found[faces]


def predict_with(name: str, sample: Sample, starts: Starts | None = None) -> tuple[Prediction, float]:
    """Predict one sample with one method, and measure how long it takes.

    Args:
        name: Of the method.
        sample: The sample.
        starts: What methods share on this sample; the time that it took counts for each.

    Returns:
        The prediction and seconds.
    """
    method = find_method(name)
    config = method.config()
    shared, seconds = {}, 0.0
    if method.shares_faces:
        started, seconds = (starts or Starts(sample)).of(config)
        shared = {"started": started}
    begin = time.perf_counter()
    prediction = method.run(sample.observed, sample.doors, config, **shared)
    return prediction, seconds + time.perf_counter() - begin


def _has_tour(method: str) -> bool:
    """Check whether a tour can be planned on what a method predicts: its rooms do not overlap."""
    return method != AUTHORS and find_method(method).disjoint


def _hidden(sample: Sample) -> _Hidden:
    area = hidden_area(sample.observed, sample.truth)
    rooms = split_hidden_area(area, sample.observed.frame.resolution)
    free = int(np.count_nonzero(sample.truth.free))
    return _Hidden(area, rooms, int(np.count_nonzero(area)) / max(free, 1))


def _head(sample: Sample, name: str, method: str, key: str, hidden: _Hidden) -> Scores:
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
    hidden: _Hidden,
    out: Path,
    starts: Starts,
    extras: Extras,
) -> Scores:
    """Predict a sample with one method, keep the rooms, and measure."""
    if method == AUTHORS:
        assert sample.authors is not None, "only samples with authors.yaml come here"
        masks = added_rooms(sample.observed, sample.authors)
        return _hidden_scores(hidden, masks) | {"by_door": {}, "not_seen": []}
    prediction, seconds = predict_with(method, sample, starts)
    write_rooms(folder / "rooms.geojson", prediction.rooms)
    if extras.probability:
        write_raw_map(folder / "probability", free_probability(prediction, sample.observed))
    unknown = sample.observed.unknown
    masks = [mask & unknown for mask in room_masks(prediction.rooms, sample.observed.frame)]
    detected = {door.id for door in sample.doors}
    figures = room_iou(prediction.rooms, sample.rooms)
    scores = _hidden_scores(hidden, masks) | {
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
    if _has_tour(method) and (compared or extras.completions):
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


def _hidden_scores(hidden: _Hidden, masks: Sequence[BoolArray]) -> Scores:
    return {
        "matched": [round(float(figure), 6) for figure in matched_iou(hidden.rooms, masks)],
        "area": round(iou(hidden.area, union_of(masks, hidden.area.shape)), 6),
    }
