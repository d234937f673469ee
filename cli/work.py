"""What a command does where the use case itself does not return a report."""

from collections.abc import Iterable
from pathlib import Path

from closedrooms.pipeline.config import ConvertWorld, GenerateWorld, ListWorlds, ShowWorld
from closedrooms.pipeline.progress import Progress


def list_worlds(config: ListWorlds, *, progress: Progress) -> Iterable[str]:  # noqa: ARG001
    """List the bundled worlds."""
    from closedrooms.pipeline.world_files import list_worlds as work

    return work()


def show_world(config: ShowWorld, *, progress: Progress) -> Iterable[str]:  # noqa: ARG001
    """Draw a floor plan."""
    from closedrooms.pipeline.world_files import show_world as work

    work(config.world, config.out, level=config.level, force=config.force)
    return _written(config.out)


def generate_world(config: GenerateWorld, *, progress: Progress) -> Iterable[str]:  # noqa: ARG001
    """Generate a floor plan."""
    from closedrooms.pipeline.world_files import generate_world as work

    work(config.kind, config.seed, config.out, furniture=config.furniture, force=config.force)
    return _written(config.out)


def convert_world(config: ConvertWorld, *, progress: Progress) -> Iterable[str]:  # noqa: ARG001
    """Convert a floor plan to another format."""
    from closedrooms.pipeline.world_files import convert_world as work

    work(config.source, config.destination, config.to, level=config.level, force=config.force)
    return _written(config.destination)


def _written(path: Path) -> list[str]:
    return [f"written to {path}"]
