"""Tables, pictures and the page of an evaluation."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from closedrooms.experiments.evaluation.config import EvaluateConfig, sort_methods
from closedrooms.experiments.evaluation.reporting.figures import draw_costs, draw_errors, draw_iou, draw_reliability
from closedrooms.experiments.evaluation.reporting.paper_numbers import number_rows
from closedrooms.experiments.evaluation.reporting.sample_pictures import draw_extremes, draw_worst, extreme_cases
from closedrooms.experiments.evaluation.reporting.score_summary import (
    WITHOUT_PREDICTION,
    coverage_rows,
    headline,
    iou_rows,
    paired_rows,
    room_rows,
    sample_rows,
    subset,
    world_rows,
)
from closedrooms.experiments.evaluation.samples.sample_path import SamplePath
from closedrooms.experiments.evaluation.scoring.cost import cost_rows
from closedrooms.experiments.evaluation.scoring.scores import Scores
from closedrooms.experiments.evaluation.scoring.sureness import reliability_rows, sureness_rows
from closedrooms.experiments.html_page import Section, Table, write_page
from closedrooms.experiments.tables import Row, write_table

INTERVALS = (
    "Intervals hold 95 %: low to high draws samples (other doors in the same buildings), world low to world high draws "
    "buildings with all their samples (other buildings)."
)
SURENESS = (
    "A room's confidence is the IoU that it is expected to have; groups of equally many rooms. Calibration error: mean "
    "distance of the two over the groups. AUROC: how well confidence tells rooms of IoU above 0.5. Best of k: the room "
    "and its first k - 1 alternatives. Brier and log score a cell: unknown cells within 8 m of a closed door; guess: "
    "the rooms taken as sure."
)

COSTS = (
    "Tours over completions drawn from what the rooms may be: their mean, and the interval that should hold the true "
    "cost so often. Within: how often it does, and the 95 % interval of that over buildings; below and above: where "
    "it lies else. Width of the interval, error of the mean and of the tour on the predicted map: percent of the true "
    "cost."
)


def write_report(
    folder: Path,
    scores: Sequence[Scores],
    samples: Sequence[SamplePath],
    config: EvaluateConfig,
    failures: Mapping[str, str],
) -> list[Row]:
    """Write every table (CSV, Parquet), picture (PNG) and ``report.html``.

    Args:
        folder: Where to write; the results of the samples are in it.
        scores: One entry a sample and method, sorted.
        samples: All samples, for the pictures.
        config: Options.
        failures: Why a sample, or a method on one, failed.

    Returns:
        A row a method, over all samples.
    """
    if not scores:
        write_page(folder / "report.html", "closedrooms evaluate", [_failure_section(failures)])
        return []
    chosen = subset(scores, config)
    iou, tests = iou_rows(scores, config), paired_rows(scores, config)
    coverage = [*coverage_rows(chosen, config, "subset"), *coverage_rows(scores, config, "all")]
    numbers, worlds = number_rows(scores, chosen, tests), world_rows(scores)
    write_table(folder / "rooms", room_rows(scores), ("method", "sample", "world", "repetition", "closed_doors",
                                                      "measure", "room", "iou"))  # fmt: skip
    write_table(folder / "samples", sample_rows(scores))
    write_table(folder / "summary", iou)
    write_table(folder / "worlds", worlds)
    for name, rows in (("coverage", coverage), ("tests", tests), ("numbers", numbers)):
        if rows:
            write_table(folder / name, rows)
    sure = sureness_rows(scores)
    costs = cost_rows(scores, config.resamples)
    for name, rows in (("sureness", sure), ("reliability", reliability_rows(scores)), ("completions", costs)):
        if rows:
            write_table(folder / name, rows)
    sections = _sections(folder, scores, {sample.name: sample for sample in samples}, config, iou, coverage)
    overall = [row for row in iou if row["closed_doors"] == "all"]
    first = Section(
        "Numbers of the text",
        f"{len(samples)} samples of {len({s['world'] for s in scores})} buildings. {INTERVALS}",
        tables=[_table(numbers), *_iou_tables(overall)],
        files=["numbers.csv", "summary.csv"],
    )
    tested = Section(
        "Paired tests",
        "Second minus first on the same samples; Wilcoxon's signed-rank test over the means of buildings, and over "
        "samples, which takes samples of one building as independent; no p on fewer than six buildings. The interval "
        "draws buildings. Measure error: coverage error of the prediction in percent.",
        tables=[_table(tests)],
        files=["tests.csv"] if tests else [],
    )
    surely = []
    if draw_reliability(
        folder / "reliability.png", reliability_rows(scores), sort_methods({r["method"] for r in sure})
    ):
        files = ["sureness.csv", "reliability.csv"]
        surely = [Section("How sure", SURENESS, folder / "reliability.png", [_table(sure)], files)]
    if draw_costs(folder / "completions.png", scores, sort_methods(row["method"] for row in costs)):
        surely.append(
            Section("Cost of coverage", COSTS, folder / "completions.png", [_table(costs)], ["completions.csv"])
        )
    by_world = Section("Buildings (table 1: most closed doors)", tables=[_table(worlds)], files=["worlds.csv"])
    tail = [_failure_section(failures)] if failures else []
    title = f"closedrooms evaluate: {len(samples)} samples"
    write_page(folder / "report.html", title, [first, *surely, *sections, tested, by_world, *tail])
    return overall


def _sections(
    folder: Path,
    scores: Sequence[Scores],
    samples: Mapping[str, SamplePath],
    config: EvaluateConfig,
    iou: Sequence[Row],
    coverage: Sequence[Row],
) -> list[Section]:
    """Collect the figures of the paper, as far as methods and samples allow."""
    present = {score["method"] for score in scores}
    measure = headline(scores)
    sections: list[Section] = []

    def add(heading: str, text: str, name: str, *tables: Table, csv: str, drawn: bool) -> None:
        if drawn:
            sections.append(Section(heading, text, folder / name, tables, [csv]))

    every = [name for name in (*sort_methods(set(present) - {"authors"}), "authors") if name in present]
    drawn = draw_iou(folder / "iou.png", iou, every, ("matched", "by_door"))
    add("All methods: IoU by number of closed doors", "Both ways to compare a room with the truth.", "iou.png",
        _doors_table(iou, "method", every, measure), csv="summary.csv", drawn=drawn)  # fmt: skip
    names = [name for name in ("paper", "line-of-sight", "geometric") if name in present]
    drawn = draw_iou(folder / "figure-05.png", iou, names, (measure,))
    add("Figure 5: IoU of the method and both baselines", "", "figure-05.png", csv="summary.csv", drawn=drawn)
    names = [name for name in ("paper", "rose") if name in present]
    drawn = draw_iou(folder / "figure-09.png", iou, names, (measure,))
    add("Figure 9: IoU with two ways to find structure", "", "figure-09.png", csv="summary.csv", drawn=drawn)
    names = [name for name in sort_methods(present) if any(row["estimate"] == name for row in coverage)]
    shown = [*WITHOUT_PREDICTION, *names[:1]]
    drawn = draw_errors(folder / "figure-12.png", coverage, shown)
    table = [row for row in coverage if row["part"] == "all"]
    errors = _doors_table(table, "estimate", [*WITHOUT_PREDICTION, *names], "error")
    add("Figure 12: errors of the coverage cost", "", "figure-12.png", errors, csv="coverage.csv", drawn=drawn)
    drawn = draw_errors(folder / "figure-14.png", coverage, names)
    add("Figure 14: errors of the coverage cost by prediction", "", "figure-14.png", csv="coverage.csv", drawn=drawn)
    method = next(iter(sort_methods(set(present) - {"authors"})), None)
    if method is not None:
        cases = extreme_cases(scores, method)
        count = draw_extremes(folder / "figure-07.png", folder / "figure-13.png", cases, samples)
        add("Figure 7: much predicted from little", "Of the tenth of the maps that show least: the one whose coverage "
            "cost is estimated best, and the one of another building where it is estimated worst.", "figure-07.png",
            csv="samples.csv", drawn=count > 0)  # fmt: skip
        add("Figure 13: graphs of the same maps", "", "figure-13.png", csv="samples.csv", drawn=count > 1)
        worst = "best" if "best" in present else method
        drawn = draw_worst(folder / "worst.png", scores, samples, worst, config.worst)
        add("Worst cases", "By mean IoU of matched rooms.", "worst.png", csv="samples.csv", drawn=drawn)
    return sections


def _table(rows: Sequence[Row], caption: str = "") -> Table:
    if not rows:
        return Table([[]])
    head = list(rows[0])
    body = [[row.get(name) for name in head] for row in rows]
    return Table([[name.replace("_", " ") for name in head], *body], caption)


def _iou_tables(rows: Sequence[Row]) -> list[Table]:
    """Build a table a measure: means, standard deviations, and both intervals in columns of their own."""
    measures = {"by_door": "IoU by door", "matched": "IoU matched one-to-one", "area": "IoU of the whole area",
                "with_unseen": "IoU by door, doors that were not seen as 0"}  # fmt: skip
    counts, keys = ("samples", "rooms", "not_seen"), ("mean", "sd", "low", "high", "world_low", "world_high")
    tables = []
    for name, caption in measures.items():
        figures = [
            {"method": row["method"]} | {key: row[f"{name}_{key}"] for key in keys} | {key: row[key] for key in counts}
            for row in rows
            if row[f"{name}_mean"] is not None
        ]
        tables.append(_table(figures, caption))
    return tables


def _doors_table(rows: Sequence[Row], key: str, names: Sequence[str], measure: str) -> Table:
    """Tabulate means by number of closed doors: a line a number, a column a method."""
    numbers = sorted({row["closed_doors"] for row in rows if row["closed_doors"] != "all"})
    means = {(row[key], row["closed_doors"]): row[f"{measure}_mean"] for row in rows}
    return Table([["closed doors", *names], *([n, *(means.get((name, n)) for name in names)] for n in numbers)])


def _failure_section(failures: Mapping[str, str]) -> Section:
    table = [["sample", "why"], *([name, why] for name, why in sorted(failures.items()))]
    return Section("What failed", tables=[Table(table)])
