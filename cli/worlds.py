"""What ``closedrooms worlds`` does; each action returns the lines to print."""

from collections.abc import Iterable

from closedrooms.pipeline.config import ConvertWorld, GenerateWorld, ListWorlds, ShowWorld


def act(config: ListWorlds | ShowWorld | GenerateWorld | ConvertWorld) -> Iterable[str]:
    """Carry out one action.

    Raises:
        InvalidInputError: A world that cannot be read or a format that is not known.
        OutputError: The output cannot be written.
    """
    from closedrooms.pipeline.world_files import convert_world, generate_world, list_worlds, show_world

    match config:
        case ListWorlds():
            return list_worlds()
        case ShowWorld():
            show_world(config.world, config.out, level=config.level, force=config.force)
        case GenerateWorld():
            generate_world(config.kind, config.seed, config.out, furniture=config.furniture, force=config.force)
        case ConvertWorld():
            convert_world(config.source, config.destination, config.to, level=config.level, force=config.force)
            return [f"written to {config.destination}"]
    return [f"written to {config.out}"]
