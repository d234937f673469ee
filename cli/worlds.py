"""What ``closedrooms worlds`` does; each action returns the lines to print, and whether something was lost."""

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

from closedrooms.pipeline.config import ConvertWorld, GenerateWorld, ListWorlds, ShowWorld

if TYPE_CHECKING:
    from closedrooms.worlds.plan import FloorPlan


def act(config: ListWorlds | ShowWorld | GenerateWorld | ConvertWorld) -> tuple[Iterable[str], bool]:
    """Carry out one action.

    Returns:
        Lines to print, and whether reading took away something that was asked for (exit status 3).

    Raises:
        InvalidInputError: A world that cannot be read or a format that is not known.
        OutputError: The output cannot be written.
    """
    from closedrooms.pipeline.world_files import convert_world, generate_world, list_worlds, show_world

    match config:
        case ShowWorld():
            return _said(show_world(config.world, config.out, level=config.level), config.out)
        case GenerateWorld():
            return _said(generate_world(config.kind, config.seed, config.out, furniture=config.furniture), config.out)
        case ConvertWorld():
            plan = convert_world(config.source, config.destination, config.to, level=config.level)
            return _said(plan, config.destination)
    return list_worlds(), False


def _said(plan: "FloorPlan", written: Path) -> tuple[Iterable[str], bool]:
    ordered = sorted(plan.remarks, key=lambda remark: not remark.loss)
    return [*map(str, ordered), f"written to {written}"], any(remark.loss for remark in ordered)
