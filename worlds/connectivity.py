"""Connected parts of a building."""

from collections import defaultdict
from collections.abc import Iterable, Sequence

Sides = tuple[str | None, str | None]


def connected_parts(names: Sequence[str], sides: Iterable[Sides]) -> list[set[str]]:
    """Group rooms that passages connect, in the order of their first rooms.

    Args:
        names: Ids of all rooms.
        sides: The rooms on both sides of each passage; those to the outside connect nothing.
    """
    neighbours: defaultdict[str, list[str]] = defaultdict(list)
    for a, b in sides:
        if a is not None and b is not None:
            neighbours[a].append(b)
            neighbours[b].append(a)
    parts: list[set[str]] = []
    seen: set[str] = set()
    for name in names:
        if name in seen:
            continue
        part, waiting = {name}, [name]
        while waiting:
            for other in neighbours[waiting.pop()]:
                if other not in part:
                    part.add(other)
                    waiting.append(other)
        seen |= part
        parts.append(part)
    return parts
