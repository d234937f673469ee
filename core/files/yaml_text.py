"""Untrusted YAML: looked through event by event before anything is built from it, then read by the safe loader."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from closedrooms.core.errors import InvalidInputError
from closedrooms.core.files.incoming import MAX_DEPTH, MAX_DIGITS, read_text, reading
from closedrooms.core.names import shown

MAX_BYTES = 20_000_000
"""Longest YAML that is read [bytes]: the largest public RMF building has under 2 MB."""
MAX_NODES = 1_000_000
"""Most values of one file: they take 4 s to look through."""
MAX_ALIASED = 10_000
"""Most values that aliases may stand for, all together: honest writers repeat a few, bombs thousands of millions."""


def parse_yaml(path: Path, *, what: str, max_bytes: int = MAX_BYTES, plain: bool = False) -> dict[str, Any]:
    """Parse the mapping that a YAML file holds.

    Args:
        path: The file.
        what: What it should be, for the message.
        max_bytes: Larger files are refused before they are read.
        plain: Keep every scalar as the text that stands there, ``None`` for an empty one: for readers that have rules
            of their own for numbers.

    Raises:
        InvalidInputError: Missing, too large, broken, or no mapping; nested too deeply, too many values or aliases,
            merge keys, a key twice (readers disagree on which one counts), a number of thousands of digits.
    """
    import yaml

    content = read_text(path, what=what, max_bytes=max_bytes)
    # The same loaders in C are ten times faster; not every build has them.
    name, slow = ("CBaseLoader", yaml.BaseLoader) if plain else ("CSafeLoader", yaml.SafeLoader)
    loader: Any = getattr(yaml, name, slow)
    with reading(path, what):
        try:
            # The composer in C calls itself for every level and ends the interpreter when the stack is full.
            _check_events(yaml.parse(content, Loader=loader), path, what)
            data = yaml.load(content, Loader=loader)
        except yaml.YAMLError as error:
            mark = getattr(error, "problem_mark", None)
            line = "" if mark is None else f" in line {mark.line + 1}"
            raise InvalidInputError(f"broken YAML{line}", expected=what, where=path) from error
    if not isinstance(data, dict):
        raise InvalidInputError("a YAML without fields", expected=what, where=path)
    return data


@dataclass(slots=True)
class _Open:
    """A list or mapping that is not closed yet.

    How many values it holds, aliases as often as what they stand for, and the keys of a mapping.
    """

    anchor: str | None
    mapping: bool
    children: int = 0
    size: int = 1
    keys: set[str] = field(default_factory=set)


@dataclass(slots=True)
class _Scan:
    """Record of what was seen of a file: sizes by anchor (``None`` while it is open), and what aliases stand for."""

    path: Path
    what: str
    open: list[_Open] = field(default_factory=list)
    sizes: dict[str, int | None] = field(default_factory=dict)
    nodes: int = 0
    aliased: int = 0

    def refuse(self, found: str) -> InvalidInputError:
        return InvalidInputError(found, expected=self.what, where=self.path)

    def begin(self, anchor: str | None, *, mapping: bool) -> None:
        """Enter a list or mapping."""
        if anchor:
            self.sizes[anchor] = None
        self.open.append(_Open(anchor, mapping))
        if len(self.open) > MAX_DEPTH:
            raise self.refuse(f"a YAML nested {MAX_DEPTH} levels deep")

    def add(self, size: int, anchor: str | None) -> None:
        """Count a whole value as part of what is open."""
        if anchor:
            self.sizes[anchor] = size
        if self.open:
            self.open[-1].children += 1
            self.open[-1].size += size

    def alias(self, anchor: str) -> int:
        """Count the values that an alias stands for."""
        size = self.sizes.get(anchor, 1)
        if size is None:
            raise self.refuse(f"a YAML alias *{anchor} inside itself")
        self.aliased += size
        if self.aliased > MAX_ALIASED:
            raise self.refuse(f"YAML aliases that stand for more than {MAX_ALIASED} values")
        return size

    def at_key(self) -> bool:
        return bool(self.open) and self.open[-1].mapping and self.open[-1].children % 2 == 0


def _check_events(events: Any, path: Path, what: str) -> None:
    """Refuse what would take the stack, the memory or the time: depth, values, aliases, digits."""
    import yaml

    scan = _Scan(path, what)
    for event in events:
        if isinstance(event, yaml.ScalarEvent):
            _check_scalar(event, scan)
            scan.add(1, event.anchor)
        elif isinstance(event, yaml.CollectionStartEvent):
            scan.begin(event.anchor, mapping=isinstance(event, yaml.MappingStartEvent))
        elif isinstance(event, yaml.CollectionEndEvent):
            done = scan.open.pop()
            scan.add(done.size, done.anchor)
        elif isinstance(event, yaml.AliasEvent):
            scan.add(scan.alias(str(event.anchor)), None)
        scan.nodes += 1
        if scan.nodes > MAX_NODES:
            raise scan.refuse(f"a YAML of more than {MAX_NODES} values")


def _check_scalar(event: Any, scan: _Scan) -> None:
    """Refuse a merge key, and numbers of too many digits."""
    text = event.value
    if scan.at_key():
        if text == "<<" and event.implicit[0]:
            raise scan.refuse("a YAML with a merge key (<<)")
        if text in scan.open[-1].keys:
            raise scan.refuse(f"a YAML with the key {shown(text, longest=80)!r} twice")
        scan.open[-1].keys.add(text)
    if len(text) > MAX_DIGITS and text.lstrip("+-").replace("_", "").isdigit() and event.implicit[0]:
        raise scan.refuse(f"a number of {len(text)} digits")
