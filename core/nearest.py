"""What was meant by a name that does not exist."""

from collections.abc import Iterable

from closedrooms.core.names import shown

# Names that a message lists where none of them is near.
MOST_LISTED = 12
# A longer name is cut, so that the line still says what there is [characters].
LONGEST = 80


def nearest(name: str, known: Iterable[str]) -> str:
    """Find the name that was meant; empty where none is near."""
    import difflib

    return next(iter(difflib.get_close_matches(name, list(known), n=1, cutoff=0.6)), "")


def unknown(what: str, name: str, known: Iterable[str]) -> str:
    """Say that there is no such thing, with the nearest name or a list of all.

    Args:
        what: The kind of thing: ``command``, ``option``.
        name: As it was given.
        known: What there is.
    """
    names = list(known)
    near = nearest(name, names)
    name = shown(name, longest=LONGEST)
    if near:
        return f"unknown {what} {name!r}; did you mean {near}?"
    listed = ", ".join(names[:MOST_LISTED]) + (", ..." if len(names) > MOST_LISTED else "")
    return f"unknown {what} {name!r}; expected one of {listed}"
