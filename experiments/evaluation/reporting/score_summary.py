"""What the scores say together: by method, by number of closed doors, by building, and as paired tests."""

from collections import defaultdict
from collections.abc import Callable, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from closedrooms.experiments.evaluation.config import EvaluateConfig, sort_methods
from closedrooms.experiments.evaluation.scoring.scores import Scores
from closedrooms.experiments.statistics import compare_pairs, described, mean_figure
from closedrooms.experiments.tables import Row

# What is measured on rooms, and how it is taken from the scores of one sample.
MEASURES: dict[str, Callable[[Scores], Sequence[float]]] = {
    "matched": lambda score: score["matched"],
    "by_door": lambda score: list(score["by_door"].values()),
    # A hidden room whose door was not seen counts 0.
    "with_unseen": lambda score: [*score["by_door"].values(), *(0.0 for _ in score["not_seen"])],
    "area": lambda score: [score["area"]],
    "agreement": lambda score: [score["agreement"]] if "agreement" in score else [],
}
# The method whose estimates stand for the paper's: the first of these that was run.
REFERENCES = ("paper", "best", "rose")
# Estimates of the length of a tour that need no prediction (paper, section 5.2).
WITHOUT_PREDICTION = ("closed", "baseline")


def grouped(scores: Sequence[Scores], key: str) -> dict[Any, list[Scores]]:
    """Group scores by one of their fields, in its order."""
    groups: defaultdict[Any, list[Scores]] = defaultdict(list)
    for score in scores:
        groups[score[key]].append(score)
    return dict(sorted(groups.items()))


def headline(scores: Sequence[Scores]) -> str:
    """Choose the headline measure: of authors' maps, whose truth has rooms without a door, the matched rooms."""
    return "matched" if any("agreement" in score for score in scores) else "by_door"


def subset(scores: Sequence[Scores], config: EvaluateConfig) -> list[Scores]:
    """Select the scores of the subset of section 5.3: 15 environments, 10 repetitions of each.

    The paper does not say which. Environments are spread evenly over all in the order of their names, so that every
    kind of building is in it; repetitions are the first ones.
    """
    worlds = sorted({score["world"] for score in scores})
    count = min(config.subset_worlds, len(worlds))
    chosen = {worlds[place * len(worlds) // count] for place in range(count)}
    repetitions: defaultdict[str, set[int]] = defaultdict(set)
    for score in scores:
        repetitions[score["world"]].add(score["repetition"])
    first = {world: set(sorted(numbers)[: config.subset_repetitions]) for world, numbers in repetitions.items()}
    return [score for score in scores if score["world"] in chosen and score["repetition"] in first[score["world"]]]


def iou_rows(scores: Sequence[Scores], config: EvaluateConfig) -> list[Row]:
    """Summarise IoU by method: over all samples (``closed_doors`` is ``all``), then by number of closed doors."""
    rows = [_iou_row(method, "all", own, config) for method, own in grouped(scores, "method").items()]
    for method, own in grouped(scores, "method").items():
        rows += [_iou_row(method, doors, group, config) for doors, group in grouped(own, "closed_doors").items()]
    return rows


def _iou_row(method: str, doors: int | str, scores: Sequence[Scores], config: EvaluateConfig) -> Row:
    """Summarise every measure of one method and one number of closed doors."""
    worlds = [score["world"] for score in scores]
    rooms = sum(len(score["matched"]) for score in scores)
    row: Row = {"closed_doors": doors, "method": method, "samples": len(scores), "rooms": rooms}
    row["rooms_by_door"] = sum(len(score["by_door"]) for score in scores)
    row["not_seen"] = sum(len(score["not_seen"]) for score in scores)
    for name, measure in MEASURES.items():
        groups = [np.array(measure(score), dtype=np.float64) for score in scores]
        figures = described(groups, worlds, config.resamples, f"{method} {name} {doors}")
        row |= {f"{name}_{figure}": value for figure, value in figures.items()}
    return row


def coverage_rows(scores: Sequence[Scores], config: EvaluateConfig, part: str) -> list[Row]:
    """Summarise the errors of every estimate of the coverage cost [%], over all and by number of closed doors.

    Args:
        scores: Of all methods.
        config: Bootstrap.
        part: Which samples these are: ``all`` or ``subset``.
    """
    rows: list[Row] = []
    for estimate, own in estimates(scores).items():
        error = f"error_{estimate if estimate in WITHOUT_PREDICTION else 'predicted'}"
        by_doors: dict[Any, list[Scores]] = {"all": own} | grouped(own, "closed_doors")
        for doors, group in by_doors.items():
            values = [np.array([score["tour"][error]]) for score in group]
            figures = described(values, [s["world"] for s in group], config.resamples, f"{estimate} {part} {doors}")
            head: Row = {"part": part, "estimate": estimate, "closed_doors": doors, "samples": len(group)}
            rows.append(head | {f"error_{name}": value for name, value in figures.items()})
    return rows


def estimates(scores: Sequence[Scores]) -> dict[str, list[Scores]]:
    """Group scores with tours by estimate: ``closed`` and ``baseline`` (once a sample), then the methods."""
    toured = grouped([score for score in scores if "tour" in score], "method")
    ordered = {method: toured[method] for method in sort_methods(toured)}
    if not ordered:
        return {}
    largest = max(ordered.values(), key=len)
    return dict.fromkeys(WITHOUT_PREDICTION, largest) | ordered


def world_rows(scores: Sequence[Scores]) -> list[Row]:
    """Summarise each building and method: largest number of closed doors (paper, table 1), IoU, coverage error."""
    rows = []
    for world, own in grouped(scores, "world").items():
        for method, group in grouped(own, "method").items():
            row: Row = {"world": world, "method": method, "samples": len(group)}
            row["most_closed"] = max(score["closed_doors"] for score in group)
            for name in ("matched", "by_door", "area"):
                row[f"{name}_mean"] = mean_figure([value for score in group for value in MEASURES[name](score)])
            row["error_predicted_mean"] = mean_figure([s["tour"]["error_predicted"] for s in group if "tour" in s])
            rows.append(row)
    return rows


def paired_rows(scores: Sequence[Scores], config: EvaluateConfig) -> list[Row]:
    """Compare every method with the first of paper, best and rose in paired tests: IoU and coverage error."""
    methods = grouped(scores, "method")
    reference = next((method for method in REFERENCES if method in methods), None)
    if reference is None:
        return []
    worlds = {score["sample"]: score["world"] for score in scores}
    rows: list[Row] = []
    for method in methods:
        for name in ("matched", "by_door", "area", "error"):
            first, second = (_figure(methods[which], name) for which in (reference, method))
            test = compare_pairs(first, second, worlds, config.resamples, f"{reference} {method} {name}")
            if method != reference and test is not None:
                rows.append({"first": reference, "second": method, "measure": name} | asdict(test))
    return rows


def _figure(scores: Sequence[Scores], name: str) -> dict[str, float]:
    """Compute one figure a sample: the mean IoU of its rooms, or the coverage error of the prediction in percent."""
    if name == "error":
        return {score["sample"]: score["tour"]["error_predicted"] for score in scores if "tour" in score}
    figures: dict[str, float] = {}
    for score in scores:
        average = mean_figure(MEASURES[name](score))
        if average is not None:
            figures[score["sample"]] = average
    return figures


def room_rows(scores: Sequence[Scores]) -> list[Row]:
    """List the IoU by room and measure; a hidden room whose door was not seen counts 0 in a measure of its own."""
    rows: list[Row] = []
    for score in scores:
        head = {name: score[name] for name in ("method", "sample", "world", "repetition", "closed_doors")}
        measured: list[tuple[str, str, float]] = [
            *(("matched", f"{number:02d}", figure) for number, figure in enumerate(score["matched"])),
            *(("by door", door, figure) for door, figure in score["by_door"].items()),
            *(("not seen", door, 0.0) for door in score["not_seen"]),
        ]
        rows += [head | {"measure": measure, "room": room, "iou": figure} for measure, room, figure in measured]
    return rows


def sample_rows(scores: Sequence[Scores]) -> list[Row]:
    """List the figures of each sample and method."""
    rows: list[Row] = []
    for score in scores:
        names = ("method", "sample", "world", "repetition", "closed_doors", "doors", "hidden_share")
        row: Row = {name: score[name] for name in names}
        row |= {f"{name}_mean": mean_figure(MEASURES[name](score)) for name in ("matched", "by_door")}
        row |= {"area": score["area"], "agreement": score.get("agreement")}
        tour = score.get("tour")
        if tour is not None:
            row["rooms_seen"] = tour["rooms_seen"]
            row |= {f"tsp_{name}_m": tour[name]["length_m"] for name in ("closed", "predicted", "truth")}
            row["tsp_baseline_m"] = tour["baseline_m"]
            row |= {name: tour[name] for name in ("error_closed", "error_baseline", "error_predicted")}
        rows.append(row)
    return rows
