"""The numbers of the paper's text beside ours."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from closedrooms.experiments.evaluation.summary import REFERENCES, estimates, grouped, headline

Scores = dict[str, Any]
Row = dict[str, Any]


def number_rows(scores: Sequence[Scores], chosen: Sequence[Scores], tests: Sequence[Row]) -> list[Row]:
    """Rows of ``where`` (section of the paper), ``what``, ``paper`` and ``ours``.

    Args:
        scores: Of all methods and samples.
        chosen: Those of the subset of section 5.3.
        tests: Of :func:`closedrooms.experiments.evaluation.summary.paired_rows`.
    """
    method = next((name for name in REFERENCES if any(s["method"] == name for s in scores)), None)
    own = [score for score in scores if score["method"] == method]
    rows: list[Row] = []
    if not own:
        return rows

    def row(where: str, what: str, paper: str, ours: str) -> None:
        rows.append({"where": where, "what": what, "paper": paper, "ours": ours})

    row("4.1", "environments", "20", str(len({score["world"] for score in own})))
    row("4.1", "most closed doors in one map", "15", str(max(score["closed_doors"] for score in own)))
    row("4.1", "maps", "3885", str(len(own)))
    row("4.1", "predicted rooms", "24045", str(sum(score["doors"] - len(score["failures"]) for score in own)))
    measure = headline(scores)
    title = {"by_door": "IoU by door", "matched": "IoU of matched rooms"}[measure]
    for few, many in ((1, 5), (6, 10), (11, 15)):
        values = _values([score for score in own if few <= score["closed_doors"] <= many], measure)
        if values:
            row("4.1", f"{title}, {few} to {many} doors: mean (sd)", "figure 5", _spread(values))
    for test in tests:
        if (test["first"], test["second"]) == ("paper", "rose") and test["measure"] in {measure, "error"}:
            where, name = ("5.3", "coverage error [%]") if test["measure"] == "error" else ("4.2", title)
            ours = f"{test['difference']:+.3f} ({test['low']:+.3f} to {test['high']:+.3f})"
            if test["p_worlds"] is not None:
                ours += f", p {test['p_worlds']:.2g} over buildings, {test['p_samples']:.2g} over samples"
            row(where, f"{name}, ROSE minus 3.1: mean (95 %)", "no noticeable difference", ours)
    _coverage(row, chosen, "subset")
    _coverage(row, scores, "all")
    return rows


def _values(scores: Sequence[Scores], measure: str) -> list[float]:
    if measure == "matched":
        return [value for score in scores for value in score["matched"]]
    return [value for score in scores for value in score["by_door"].values()]


def _spread(values: Sequence[float]) -> str:
    return f"{np.mean(values):.3f} ({np.std(values):.3f})"


def _coverage(row: Any, scores: Sequence[Scores], part: str) -> None:
    """Section 5.3: the subset, then the same over all."""
    by_estimate = estimates(scores)
    if not by_estimate:
        return
    first = next(iter(by_estimate.values()))
    theirs = part == "subset"
    worlds = grouped(first, "world")
    runs = max(len({score["repetition"] for score in own}) for own in worlds.values())
    row("5.3", f"{part}: environments, runs of each", "15, 10" if theirs else "", f"{len(worlds)}, {runs}")
    row("5.3", f"{part}: maps", "1957" if theirs else "", str(len(first)))
    printed = {"closed": "21.37 (16.18)", "baseline": "21.4 (23.38)", "paper": "6.21 (9.06)"}
    for estimate, own in by_estimate.items():
        key = f"error_{estimate if estimate in {'closed', 'baseline'} else 'predicted'}"
        values = [score["tour"][key] for score in own]
        ours = f"{np.mean(values):.2f} ({np.std(values):.2f})"
        row(
            "5.3",
            f"{part}: coverage error [%], {estimate}: mean (sd)",
            printed.get(estimate, "figure 14") if theirs else "",
            ours,
        )
