"""``closedrooms run``: one run, or several in one folder with one table."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from closedrooms.core.errors import ClosedroomsError, InvalidInputError
from closedrooms.core.names import file_name
from closedrooms.core.report import Report
from closedrooms.pipeline.options.run import RunConfig
from closedrooms.pipeline.reporting.progress import Progress, Silent
from closedrooms.pipeline.reporting.report import figure
from closedrooms.pipeline.run import run
from closedrooms.worlds.library import load_world


def run_all(config: RunConfig, *, progress: Progress | None = None) -> Report:
    """Do one run, or one for every world and seed.

    Args:
        config: Options; with ``more_worlds`` or ``seeds``, ``out`` is the folder that holds the runs.
        progress: Told what is done.

    Returns:
        The report of the run, or a table with a row for each. A run that cannot be done stops no other; it is named
        among the failures.

    Raises:
        InvalidInputError: A world cannot be read, two of them have one name, an option is not usable.
        OutputError: The folder of a single run cannot be written.
    """
    progress = progress or Silent()
    if not config.more_worlds and not config.seeds:
        return run(config, progress=progress)
    parent = config.out or Path("runs")
    tasks = plan_runs(config, parent)
    reports: dict[str, Report] = {}
    failures: dict[str, str] = {}
    for number, (name, task) in enumerate(tasks.items(), 1):
        progress.tell(f"run {number} of {len(tasks)}: {name}")
        try:
            reports[name] = run(task, progress=progress)
        except ClosedroomsError as error:
            failures[name] = str(error)
            continue
        failures |= {f"{name}, {what}": why for what, why in reports[name].failures.items()}
    return Report(
        folder=parent,
        title=f"{len(reports)} of {len(tasks)} runs",
        rows=[HEAD, *(_row(name, report.figures) for name, report in reports.items())],
        failures=failures,
        remarks=tuple(dict.fromkeys(remark for report in reports.values() for remark in report.remarks)),
        figures={"runs": {name: dict(report.figures) for name, report in reports.items()}},
    )


def plan_runs(config: RunConfig, parent: Path) -> dict[str, RunConfig]:
    """Say what every run does, by the name of its folder in ``parent``.

    Raises:
        InvalidInputError: A world cannot be read, or two runs would be written to one folder.
    """
    tasks: dict[str, RunConfig] = {}
    for world in (config.world, *config.more_worlds):
        plan = load_world(world, level=config.level)
        for seed in config.seeds or (config.seed,):
            name = f"{file_name(plan.name)}-{seed}"
            if name in tasks:
                raise InvalidInputError(f"two runs would be written to {name}", expected="each world and seed once")
            tasks[name] = replace(config, world=world, more_worlds=(), seed=seed, seeds=(), out=parent / name)
    return tasks


HEAD = ("run", "doors seen", "area mapped", "ATE", "IoU mean", "tour error")


def _row(name: str, figures: Mapping[str, Any]) -> tuple[str, ...]:
    """Make the row of one run in the table of several, see ``HEAD``."""
    metrics = figures["metrics"]
    return (
        name,
        f"{len(figures['doors']['seen'])} of {len(figures['closed'])}",
        figure(metrics["area_mapped"], "{:.1f} %", scale=100.0),
        f"{metrics['ate_m']:.3f} m",
        figure(metrics["room_iou_mean"], "{:.3f}"),
        figure(metrics["tour"]["errors_percent"]["predicted"], "{:.1f} %"),
    )
