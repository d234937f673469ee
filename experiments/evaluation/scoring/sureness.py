"""How well a method knows how sure it is: of its rooms, of what else they could be, and of every cell."""

from collections.abc import Sequence
from typing import Any

import cv2
import numpy as np

from closedrooms.core.arrays import BoolArray, FloatArray
from closedrooms.core.door import ClosedDoor
from closedrooms.core.grid import OccupancyGrid
from closedrooms.core.room import Room
from closedrooms.core.shapes import polygon_iou
from closedrooms.experiments.evaluation.scoring.scores import Scores
from closedrooms.experiments.statistics import round_figure
from closedrooms.experiments.tables import Row
from closedrooms.predictor.prediction import Prediction

# Cells are asked about where the map is unknown within this of a closed door [m], whatever a method predicts there and
# whatever the truth is: about the depth of the larger rooms.
ASKED = 8.0
# A probability of 0 or 1 that turns out wrong would cost infinitely much: it counts as this close to it.
SUREST = 0.01
# A room counts as found from this IoU on; confidences are compared with IoUs in so many groups of equal size.
FOUND, BINS = 0.5, 10


def cells_asked(observed: OccupancyGrid, doors: Sequence[ClosedDoor]) -> BoolArray:
    """Find the unknown cells within :data:`ASKED` of a closed door, shape of the grid."""
    near = np.zeros(observed.frame.shape, dtype=np.uint8)
    reach = round(ASKED / observed.frame.resolution)
    for door in doors:
        row, col = observed.frame.to_cells(np.array(door.midpoint)).tolist()
        cv2.circle(near, (col, row), reach, (1,), thickness=-1)
    return np.asarray(near > 0) & observed.unknown


def score_sureness(
    prediction: Prediction,
    observed: OccupancyGrid,
    doors: Sequence[ClosedDoor],
    truth: OccupancyGrid,
    true_rooms: Sequence[Room],
) -> Scores:
    """Score how sure a method was on one sample.

    Args:
        prediction: With confidences, alternatives and probabilities.
        observed: The map.
        doors: Its closed doors.
        truth: The true map, on the frame of ``observed``.
        true_rooms: By their doors.

    Returns:
        ``rooms``: confidence and the best IoU of the room and its first 0, 1, 2, 3 alternatives. ``cells`` asked, and
        sums over them of the Brier and the log score of the probability, and of the rooms as if they were sure.
    """
    true = {door: room.polygon for room in true_rooms for door in room.doors}
    rooms = []
    for room in prediction.rooms:
        if room.confidence is None or room.doors[0] not in true:
            continue
        shapes = [room.polygon, *(other.polygon for other in room.alternatives)]
        ious = [polygon_iou(shape, true[room.doors[0]]) for shape in shapes]
        best = [max(ious[: count + 1]) for count in range(4)]
        rooms.append([round_figure(value) for value in (room.confidence, *best)])
    scores: Scores = {"rooms": rooms}
    if prediction.probability is not None:
        asked = cells_asked(observed, doors)
        free = truth.free[asked].astype(np.float64)
        chance = np.maximum(prediction.probability.on(observed.frame).cells[asked], 0) / 100.0
        guess = (prediction.grid.on(observed.frame).free & observed.unknown)[asked].astype(np.float64)
        scores["cells"] = int(free.size)
        for name, values in (("", chance), ("_guess", guess)):
            scores[f"brier{name}"] = round_figure(((values - free) ** 2).sum())
            scores[f"log{name}"] = round_figure(-_log_score(values, free).sum())
    return scores


def _log_score(chance: FloatArray, free: FloatArray) -> FloatArray:
    """Compute the logarithm of the probability that was given to what is there."""
    clipped = np.clip(chance, SUREST, 1.0 - SUREST)
    return np.asarray(np.log(np.where(free > 0.5, clipped, 1.0 - clipped)))


def sureness_rows(scores: Sequence[Scores]) -> list[Row]:
    """Summarise each method: how confidence and IoU agree, what the best of several guesses has, scores a cell."""
    rows = []
    for method in dict.fromkeys(score["method"] for score in scores):
        own = [score["sure"] for score in scores if score["method"] == method and "sure" in score]
        figures = np.array([room for sure in own for room in sure["rooms"]]).reshape(-1, 5)
        if not len(figures):
            continue
        confidence, iou = figures[:, 0], figures[:, 1]
        row: Row = {
            "method": method,
            "rooms": len(figures),
            "confidence_mean": round_figure(confidence.mean()),
            "iou_mean": round_figure(iou.mean()),
            "calibration_error": round_figure(calibration_error(confidence, iou)),
            "auroc": _optional(auroc(confidence, iou > FOUND)),
            "spearman": _optional(spearman(confidence, iou)),
        }
        row |= {f"best_of_{count}": round_figure(figures[:, count].mean()) for count in (2, 3, 4)}
        cells = sum(sure.get("cells", 0) for sure in own)
        if cells:
            row["cells"] = cells
            for name in ("brier", "brier_guess", "log", "log_guess"):
                row[name] = round_figure(sum(sure.get(name, 0.0) for sure in own) / cells)
        rows.append(row)
    return rows


def reliability_rows(scores: Sequence[Scores]) -> list[Row]:
    """Compare mean confidence and mean IoU, a row a method and group of equally many rooms."""
    rows = []
    for method in dict.fromkeys(score["method"] for score in scores):
        own = [room for score in scores if score["method"] == method for room in score.get("sure", {}).get("rooms", [])]
        figures = np.array(own).reshape(-1, 5)
        for number, group in enumerate(_groups(figures[:, 0], figures[:, 1])):
            confidence, iou = figures[group, 0], figures[group, 1]
            rows.append(
                {
                    "method": method,
                    "group": number,
                    "rooms": len(group),
                    "confidence": round_figure(confidence.mean()),
                    "iou": round_figure(iou.mean()),
                    "iou_sd": round_figure(iou.std()),
                }
            )
    return rows


def calibration_error(confidence: FloatArray, iou: FloatArray) -> float:
    """Compute the expected calibration error: mean distance of confidence from IoU over groups of equal size.

    Rooms of one confidence count with their mean IoU each: which of them fall into a group says nothing.
    """
    if not len(confidence):
        return 0.0
    _, same = np.unique(confidence, return_inverse=True)
    usual = (np.bincount(same, weights=iou) / np.bincount(same))[same]
    groups = _groups(confidence, usual)
    return float(sum(abs((confidence[group] - usual[group]).mean()) * len(group) for group in groups) / len(iou))


def _groups(confidence: FloatArray, iou: FloatArray) -> list[Any]:
    """Split rooms into groups of equal size by their confidence, those of one confidence by their IoU."""
    if not len(confidence):
        return []
    order = np.lexsort((iou, confidence))
    return [group for group in np.array_split(order, BINS) if len(group)]


def auroc(confidence: FloatArray, found: BoolArray) -> float | None:
    """Compute the probability that a room found is surer than one that was not; ``None`` where all are alike."""
    hits, misses = int(found.sum()), int((~found).sum())
    if not hits or not misses:
        return None
    ranks = ranked(confidence)
    return float((ranks[found].sum() - hits * (hits + 1) / 2) / (hits * misses))


def ranked(values: FloatArray) -> FloatArray:
    """Rank values from 1 on, equal ones by the mean of their ranks; scipy.stats takes 0.5 s to be imported for it."""
    _, same, counts = np.unique(values, return_inverse=True, return_counts=True)
    ranks: FloatArray = (np.cumsum(counts) - (counts - 1) / 2)[same]
    return ranks


def spearman(confidence: FloatArray, iou: FloatArray) -> float | None:
    """Compute the rank correlation of confidence and IoU; ``None`` where one is the same for all rooms."""
    ranks = [ranked(values) for values in (confidence, iou)]
    if len(confidence) < 2 or any(np.ptp(rank) == 0.0 for rank in ranks):
        return None
    table: FloatArray = np.corrcoef(np.array(ranks))
    return float(table[0, 1])


def _optional(value: float | None) -> float | None:
    return None if value is None else round_figure(value)
