"""One method on one sample: predict, score, keep."""

import hashlib
import json
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from closedrooms.core.arrays import BoolArray
from closedrooms.core.errors import ClosedroomsError, OutputError
from closedrooms.core.files import write_json
from closedrooms.core.geojson import write_rooms
from closedrooms.pipeline.evaluation.samples import Sample, SamplePath, read_sample
from closedrooms.pipeline.evaluation.scores import (
    added_rooms,
    hidden_area,
    hidden_rooms,
    iou,
    matched_iou,
    room_masks,
    union_of,
)
from closedrooms.pipeline.manifest import versions
from closedrooms.pipeline.metrics import room_iou
from closedrooms.predictor.prediction import Prediction

AUTHORS = "authors"
RESULT = "scores.json"
INPUTS = {".yaml", ".png", ".pgm", ".geojson"}
Scores = dict[str, Any]


def evaluate_sample(sample: SamplePath, method: str, out: Path) -> Scores | str:
    """Scores of one method on one sample, kept in ``out/<method>/<sample>``; the reason as text when it fails.

    Raises:
        OutputError: The result cannot be written.
    """
    folder = out / method / sample.name
    key = _fingerprint(sample.folder, method)
    kept = _kept(folder / RESULT, key)
    if kept is not None:
        return kept
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"cannot write ({error.strerror}): {folder}") from error
    try:
        read = read_sample(sample.folder)
        scores: Scores = {"key": key, "sample": sample.name, "method": method, "doors": len(read.doors)}
        scores |= _score_authors(read) if method == AUTHORS else _score(read, method, folder)
    except OutputError:
        raise
    except ClosedroomsError as error:
        return str(error)
    write_json(folder / RESULT, scores)
    return scores


def _fingerprint(folder: Path, method: str) -> str:
    """Changes with the input, the method, the versions of libraries and the code that predicts and scores."""
    digest = hashlib.sha256(f"{method} {json.dumps(versions())}".encode())
    root = Path(__file__).parents[2]
    code = [
        *(root / "predictor").rglob("*.py"),
        *(root / "core").rglob("*.py"),
        *(root / "pipeline" / "evaluation").glob("*.py"),
    ]
    given = [path for path in folder.glob("*") if path.is_file() and path.suffix in INPUTS]
    for path in [*sorted(code), *sorted(given)]:
        digest.update(path.name.encode() + hashlib.sha256(path.read_bytes()).digest())
    return digest.hexdigest()


def _kept(path: Path, key: str) -> Scores | None:
    try:
        scores: Scores = json.loads(path.read_text())
    except (OSError, ValueError):
        return None
    return scores if scores.get("key") == key else None


def predict_with(method: str, sample: Sample) -> Prediction:
    """The prediction of one method (``paper``, ``best``, ``rose``, ``line-of-sight``, ``geometric``) on one sample."""
    from closedrooms.predictor.baselines import geometric, line_of_sight
    from closedrooms.predictor.config import preset
    from closedrooms.predictor.predict import predict

    if method == "line-of-sight":
        return line_of_sight(sample.observed, sample.doors, preset("paper"))
    if method == "geometric":
        return geometric(sample.observed, sample.doors, preset("paper"))
    config = preset("best" if method == "best" else "paper")
    if method == "rose":
        config = replace(config, structure="rose")
    return predict(sample.observed, sample.doors, config)


def _score(sample: Sample, method: str, folder: Path) -> Scores:
    begin = time.perf_counter()
    prediction = predict_with(method, sample)
    seconds = time.perf_counter() - begin
    write_rooms(folder / "rooms.geojson", prediction.rooms)
    unknown = sample.observed.unknown
    masks = [mask & unknown for mask in room_masks(prediction.rooms, sample.observed.frame)]
    detected = {door.id for door in sample.doors}
    figures = room_iou(prediction.rooms, sample.rooms)
    scores = _hidden_scores(sample, masks) | {
        "by_door": {door: round(figure, 6) for door, figure in figures.items() if door in detected},
        "not_seen": sorted(set(figures) - detected),
        "failures": prediction.failures,
        "seconds": round(seconds, 4),
    }
    if sample.authors is not None:
        theirs = sample.authors.free & unknown
        ours = prediction.grid.on(sample.observed.frame).free & unknown
        scores["agreement"] = round(iou(ours, theirs), 6)
    return scores


def _score_authors(sample: Sample) -> Scores:
    assert sample.authors is not None, "only samples with authors.yaml come here"
    return _hidden_scores(sample, added_rooms(sample.observed, sample.authors)) | {"by_door": {}, "not_seen": []}


def _hidden_scores(sample: Sample, masks: Sequence[BoolArray]) -> Scores:
    area = hidden_area(sample.observed, sample.truth)
    rooms = hidden_rooms(area, sample.observed.frame.resolution)
    return {
        "matched": [round(float(figure), 6) for figure in matched_iou(rooms, masks)],
        "area": round(iou(area, union_of(masks, area.shape)), 6),
    }
