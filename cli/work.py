"""What a command does where the use case itself does not return a report."""

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

from closedrooms.core.report import Report
from closedrooms.pipeline.config import ConvertWorld, GenerateWorld, ListWorlds, ShowWorld
from closedrooms.pipeline.progress import Progress

if TYPE_CHECKING:
    from closedrooms.worlds.plan import FloorPlan


def list_worlds(config: ListWorlds, *, progress: Progress) -> Iterable[str]:  # noqa: ARG001
    """List the bundled worlds."""
    from closedrooms.pipeline.world_files import list_worlds as work

    return work()


def show_world(config: ShowWorld, *, progress: Progress) -> Report:  # noqa: ARG001
    """Draw a floor plan."""
    from closedrooms.pipeline.world_files import show_world as work

    plan = work(config.world, config.out, level=config.level, force=config.force)
    return _report(plan, config.out)


def generate_world(config: GenerateWorld, *, progress: Progress) -> Report:  # noqa: ARG001
    """Generate a floor plan."""
    from closedrooms.pipeline.world_files import generate_world as work

    plan = work(config.kind, config.seed, config.out, furniture=config.furniture, force=config.force)
    return _report(plan, config.out)


def convert_world(config: ConvertWorld, *, progress: Progress) -> Report:  # noqa: ARG001
    """Convert a floor plan to another format."""
    from closedrooms.pipeline.world_files import convert_world as work

    plan = work(config.source, config.destination, config.to, level=config.level, force=config.force)
    return _report(plan, config.destination)


def _report(plan: "FloorPlan", written: Path) -> Report:
    """What the plan holds, and what was dropped, repaired or guessed when it was read."""
    from closedrooms.worlds.closing import closable_rooms

    figures = {"rooms": len(plan.rooms), "doors": len(plan.doors), "closable rooms": len(closable_rooms(plan))}
    rows = [("figure", "value"), *((name, str(value)) for name, value in figures.items())]
    return Report(folder=written, title=plan.name, rows=rows, remarks=plan.remarks, figures=figures)
