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
from closedrooms.experiments.html_page import Section, Table, table_of, write_page
from closedrooms.experiments.tables import Row, write_table

NUMBERS = (
    "Section: of the paper. Rows that name no method are of paper, or of best where paper was not asked for. ROSE "
    "minus 3.1: rose less paper. Subset: the maps of section 5.3. "
)
IOUS = {
    "by_door": "IoU by door",
    "matched": "IoU matched one-to-one",
    "area": "IoU of the whole area",
    "with_unseen": "IoU by door, doors that were not seen as 0",
}
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
TESTS = (
    "Second minus first on the same samples; Wilcoxon's signed-rank test over the means of buildings, and over "
    "samples, which takes samples of one building as independent; no p on fewer than six buildings. The interval "
    "draws buildings. Measure error: coverage error of the prediction in percent."
)
COSTS = (
    "Tours over completions drawn from what the rooms may be: their mean, and the interval that should hold the true "
    "cost so often. Within: how often it does, and the 95 % interval of that over buildings; below and above: where "
    "it lies else. Width of the interval, error of the mean and of the tour on the predicted map: percent of the true "
    "cost."
)
ROOM_COLUMNS = ("method", "sample", "world", "repetition", "closed_doors", "measure", "room", "iou")


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
    tables = _tables(scores, config)
    write_table(folder / "rooms", room_rows(scores), ROOM_COLUMNS)
    for name, rows in tables.items():
        if rows:
            write_table(folder / name, rows)
    overall = [row for row in tables["summary"] if row["closed_doors"] == "all"]
    first = Section(
        "Numbers of the text",
        f"{len(samples)} samples of {len({s['world'] for s in scores})} buildings. {NUMBERS}{INTERVALS}",
        tables=[_numbers_table(tables["numbers"]), *_iou_tables(overall)],
        files=[f"{name}.csv" for name in ("numbers", "summary") if tables[name]],
    )
    sections = _sections(folder, scores, {sample.name: sample for sample in samples}, config, tables)
    tested = Section("Paired tests", TESTS, tables=[table_of(tables["tests"])], files=["tests.csv"])
    by_world = Section("Buildings (table 1: most closed doors)", tables=[table_of(tables["worlds"])],
                       files=["worlds.csv"])  # fmt: skip
    page = [first, *_sure_sections(folder, scores, tables), *sections, *([tested] if tables["tests"] else []), by_world]
    if failures:
        page.append(_failure_section(failures))
    write_page(folder / "report.html", f"closedrooms evaluate: {len(samples)} samples", page)
    return overall


def _tables(scores: Sequence[Scores], config: EvaluateConfig) -> dict[str, list[Row]]:
    """Make the tables that stand beside the page, by the names of their files; some may be empty."""
    chosen, tests = subset(scores, config), paired_rows(scores, config)
    return {
        "samples": sample_rows(scores),
        "summary": iou_rows(scores, config),
        "worlds": world_rows(scores),
        "coverage": [*coverage_rows(chosen, config, "subset"), *coverage_rows(scores, config, "all")],
        "tests": tests,
        "numbers": number_rows(scores, chosen, tests),
        "sureness": sureness_rows(scores),
        "reliability": reliability_rows(scores),
        "completions": cost_rows(scores, config.resamples),
    }


def _sure_sections(folder: Path, scores: Sequence[Scores], tables: Mapping[str, Sequence[Row]]) -> list[Section]:
    """Draw how sure rooms and costs of coverage are, as far as the scores tell."""
    sections = []
    sure, costs = tables["sureness"], tables["completions"]
    picture = folder / "reliability.png"
    if draw_reliability(picture, tables["reliability"], sort_methods({row["method"] for row in sure})):
        files = ["sureness.csv", "reliability.csv"]
        sections.append(Section("How sure", SURENESS, picture, [table_of(sure)], files))
    picture = folder / "completions.png"
    if draw_costs(picture, scores, sort_methods(row["method"] for row in costs)):
        sections.append(Section("Cost of coverage", COSTS, picture, [table_of(costs)], ["completions.csv"]))
    return sections


def _sections(
    folder: Path,
    scores: Sequence[Scores],
    samples: Mapping[str, SamplePath],
    config: EvaluateConfig,
    tables: Mapping[str, Sequence[Row]],
) -> list[Section]:
    """Collect the figures of the paper, as far as methods and samples allow."""
    iou, coverage = tables["summary"], tables["coverage"]
    present = {score["method"] for score in scores}
    measure = headline(scores)
    sections: list[Section] = []

    def add(heading: str, text: str, name: str, *beside: Table, csv: str, drawn: bool) -> None:
        if drawn:
            sections.append(Section(heading, text, folder / name, beside, [csv]))

    every = [name for name in (*sort_methods(set(present) - {"authors"}), "authors") if name in present]
    drawn = draw_iou(folder / "iou.png", iou, every, ("matched", "by_door"))
    means = _doors_table(iou, "method", every, measure, f"Mean {IOUS[measure]}")
    add("All methods: IoU by number of closed doors", "Both ways to compare a room with the truth.", "iou.png",
        means, csv="summary.csv", drawn=drawn)  # fmt: skip
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
    errors = _doors_table(table, "estimate", [*WITHOUT_PREDICTION, *names], "error", "Mean error, all maps [%]")
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


def _numbers_table(rows: Sequence[Row]) -> Table:
    """Build the table of the paper's numbers, what they are before the section that has them."""
    named = ("what", "where")
    return table_of(
        [
            {"what": row["what"], "section": row["where"], **{key: row[key] for key in row if key not in named}}
            for row in rows
        ]
    )


def _iou_tables(rows: Sequence[Row]) -> list[Table]:
    """Build a table a measure: means, standard deviations, and both intervals in columns of their own."""
    counts, keys = ("samples", "rooms", "not_seen"), ("mean", "sd", "low", "high", "world_low", "world_high")
    tables = []
    for name, caption in IOUS.items():
        figures = [
            {"method": row["method"]} | {key: row[f"{name}_{key}"] for key in keys} | {key: row[key] for key in counts}
            for row in rows
            if row[f"{name}_mean"] is not None
        ]
        tables.append(table_of(figures, caption))
    return tables


def _doors_table(rows: Sequence[Row], key: str, names: Sequence[str], measure: str, caption: str) -> Table:
    """Tabulate means by number of closed doors: a line a number, a column a method."""
    numbers = sorted({row["closed_doors"] for row in rows if row["closed_doors"] != "all"})
    means = {(row[key], row["closed_doors"]): row[f"{measure}_mean"] for row in rows}
    lines = [[number, *(means.get((name, number)) for name in names)] for number in numbers]
    return Table([["closed doors", *names], *lines], caption)


def _failure_section(failures: Mapping[str, str]) -> Section:
    table = [["sample", "why"], *([name, why] for name, why in sorted(failures.items()))]
    return Section("What failed", tables=[Table(table)])
