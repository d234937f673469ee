"""What ``closedrooms worlds`` does; each action returns the lines to print."""

from collections.abc import Iterable

from closedrooms.pipeline.config import ConvertWorld, GenerateWorld, ListWorlds, ShowWorld


def act(config: ListWorlds | ShowWorld | GenerateWorld | ConvertWorld) -> Iterable[str]:
    """Carry out one action.

    Raises:
        InvalidInputError: A world that cannot be read or a format that is not known.
        OutputError: The output cannot be written.
    """
    from closedrooms.worlds import commands

    match config:
        case ListWorlds():
            return commands.list_worlds()
        case ShowWorld():
            commands.show_world(config.world, config.out)
        case GenerateWorld():
            commands.generate_world(config.kind, config.seed, config.out)
        case ConvertWorld():
            commands.convert_world(config.source, config.destination, config.to)
            return [f"written to {config.destination}"]
    return [f"written to {config.out}"]
