"""The numbers of the paper's text beside ours."""

from collections.abc import Sequence

import numpy as np

from closedrooms.experiments.evaluation.reporting.score_summary import REFERENCES, estimates, grouped, headline
from closedrooms.experiments.evaluation.scoring.scores import Scores
from closedrooms.experiments.statistics import round_figure
from closedrooms.experiments.tables import Row

# Errors of the coverage cost in the text of section 5.3: mean and standard deviation [%].
PRINTED: dict[str, tuple[float, float]] = {"closed": (21.37, 16.18), "baseline": (21.4, 23.38), "paper": (6.21, 9.06)}


def number_rows(scores: Sequence[Scores], chosen: Sequence[Scores], tests: Sequence[Row]) -> list[Row]:
    """List ``where`` (section of the paper), ``what``, the paper's figure and ours with what goes with them.

    ``sd`` are standard deviations, ``low`` and ``high`` 95 % intervals over buildings, ``p_worlds`` and ``p_samples``
    those of paired tests; ``None`` where there is none.

    Args:
        scores: Of all methods and samples.
        chosen: Those of the subset of section 5.3.
        tests: Of :func:`closedrooms.experiments.evaluation.reporting.score_summary.paired_rows`.
    """
    method = next((name for name in REFERENCES if any(s["method"] == name for s in scores)), None)
    own = [score for score in scores if score["method"] == method]
    if not own:
        return []
    rows = [
        _row("4.1", "environments", len({score["world"] for score in own}), paper=20),
        _row("4.1", "most closed doors in one map", max(score["closed_doors"] for score in own), paper=15),
        _row("4.1", "maps", len(own), paper=3885),
        _row("4.1", "predicted rooms", sum(score["doors"] - len(score["failures"]) for score in own), paper=24045),
    ]
    measure = headline(scores)
    title = {"by_door": "IoU by door", "matched": "IoU of matched rooms"}[measure]
    for few, many in ((1, 5), (6, 10), (11, 15)):
        values = _values([score for score in own if few <= score["closed_doors"] <= many], measure)
        if values:
            what = f"{title}, {few} to {many} doors (paper: figure 5)"
            rows.append(_row("4.1", what, _mean(values), sd=_deviation(values)))
    for test in tests:
        if (test["first"], test["second"]) == ("paper", "rose") and test["measure"] in {measure, "error"}:
            where, name = ("5.3", "coverage error [%]") if test["measure"] == "error" else ("4.2", title)
            rows.append(
                _row(where, f"{name}, ROSE minus 3.1 (paper: no noticeable difference)", test["difference"])
                | {key: test[key] for key in ("low", "high", "p_worlds", "p_samples")}
            )
    return [*rows, *_coverage(chosen, "subset"), *_coverage(scores, "all")]


def _row(
    where: str, what: str, ours: float, *, sd: float | None = None, paper: float | None = None,
    paper_sd: float | None = None,
) -> Row:  # fmt: skip
    """Make a row in which what the paper or we do not say is ``None``."""
    return {
        "where": where, "what": what, "paper": paper, "paper_sd": paper_sd, "ours": ours, "ours_sd": sd,
        "low": None, "high": None, "p_worlds": None, "p_samples": None,
    }  # fmt: skip


def _values(scores: Sequence[Scores], measure: str) -> list[float]:
    """List the IoU of all rooms by a measure."""
    if measure == "matched":
        return [value for score in scores for value in score["matched"]]
    return [value for score in scores for value in score["by_door"].values()]


def _mean(values: Sequence[float]) -> float:
    return round_figure(np.mean(values))


def _deviation(values: Sequence[float]) -> float:
    return round_figure(np.std(values))


def _coverage(scores: Sequence[Scores], part: str) -> list[Row]:
    """Compare with section 5.3: the subset, then the same over all."""
    by_estimate = estimates(scores)
    if not by_estimate:
        return []
    first = next(iter(by_estimate.values()))
    theirs = part == "subset"
    worlds = grouped(first, "world")
    runs = max(len({score["repetition"] for score in own}) for own in worlds.values())
    rows = [
        _row("5.3", f"{part}: environments", len(worlds), paper=15 if theirs else None),
        _row("5.3", f"{part}: runs of each, at most", runs, paper=10 if theirs else None),
        _row("5.3", f"{part}: maps", len(first), paper=1957 if theirs else None),
    ]
    for estimate, own in by_estimate.items():
        key = f"error_{estimate if estimate in {'closed', 'baseline'} else 'predicted'}"
        values = [score["tour"][key] for score in own]
        mean, sd = PRINTED.get(estimate, (None, None)) if theirs else (None, None)
        what = f"{part}: coverage error [%], {estimate}"
        rows.append(_row("5.3", what, _mean(values), sd=_deviation(values), paper=mean, paper_sd=sd))
    return rows
