"""What a command does where the use case itself does not return a report."""

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from closedrooms.core.report import Report
from closedrooms.pipeline.options.worlds import ConvertWorld, GenerateWorld, ListWorlds, ShowWorld
from closedrooms.pipeline.reporting.progress import Progress

if TYPE_CHECKING:
    from closedrooms.worlds.plan import FloorPlan


def report_worlds(config: ListWorlds, *, progress: Progress) -> Iterable[str]:  # noqa: ARG001
    """List the bundled worlds."""
    from closedrooms.pipeline.world_files import list_worlds

    return list_worlds(verbose=config.verbose)


def report_world(config: ShowWorld, *, progress: Progress) -> Report | Iterable[str]:  # noqa: ARG001
    """Draw a floor plan, or tell what is in it, or both."""
    from closedrooms.pipeline.world_files import describe_world, show_world
    from closedrooms.worlds.library import load_world

    if config.out is None:
        return describe_world(load_world(config.world, level=config.level))
    plan = show_world(config.world, config.out, level=config.level, force=config.force)
    if config.text:
        return [*describe_world(plan), "", f"written to {config.out}"]
    return _report(plan, config.out)


def report_generated(config: GenerateWorld, *, progress: Progress) -> Report:  # noqa: ARG001
    """Generate a floor plan."""
    from closedrooms.pipeline.world_files import generate_world

    plan = generate_world(
        config.kind, config.seed, config.out, furniture=config.furniture, glass=config.glass, force=config.force
    )
    return _report(plan, config.out)


def report_converted(config: ConvertWorld, *, progress: Progress) -> Report:  # noqa: ARG001
    """Convert a floor plan to another format."""
    from closedrooms.pipeline.world_files import beside, convert_world

    plan = convert_world(config.source, config.destination, config.to, level=config.level, force=config.force)
    files = beside(config.destination, config.to)
    return _report(plan, files[0] if files else config.destination, files)


def _report(plan: "FloorPlan", written: Path, files: Sequence[Path] = ()) -> Report:
    """Report what the plan holds, what was dropped, repaired or guessed on reading, and every file of several."""
    from closedrooms.worlds.closing import closable_rooms

    figures = {"rooms": len(plan.rooms), "doors": len(plan.doors), "closable rooms": len(closable_rooms(plan))}
    rows = [("figure", "value"), *((name, str(value)) for name, value in figures.items())]
    rows += [("file", str(file)) for file in files]
    told = {**figures, "files": [str(file) for file in files or (written,)]}
    return Report(folder=written, title=plan.name, rows=rows, remarks=plan.remarks, figures=told)
