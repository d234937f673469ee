"""Which samples a dataset holds: worlds, orders of closing, numbers of closed doors, splits."""

import hashlib
import re
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Literal

from closedrooms.core.errors import InvalidInputError
from closedrooms.core.random import stream
from closedrooms.core.remarks import Remark
from closedrooms.experiments.dataset.config import DatasetConfig
from closedrooms.worlds.closing import closable_rooms
from closedrooms.worlds.formats.native import plan_text
from closedrooms.worlds.library import bundled_names, distinct_names, load_world, world_source
from closedrooms.worlds.plan import FloorPlan

Split = Literal["train", "validation", "test"]
SPLITS: tuple[Split, ...] = ("train", "validation", "test")
# Share of the buildings in ``validation`` and in ``test`` each; at least one building where there are three.
HELD_OUT = 0.15
ALL = "all"


@dataclass(frozen=True, slots=True)
class World:
    """One building of a dataset.

    Attributes:
        name: Its name in the dataset, fit for a folder.
        source: Bundled name or absolute path.
        split: Where all its samples go.
        closable: Doors that close one room each, in plan order.
        digest: SHA-256 of the plan as our JSON: tells whether a file changed.
        remarks: What was dropped, repaired or guessed on reading it.
    """

    name: str
    source: str
    split: Split
    closable: tuple[str, ...]
    digest: str
    remarks: tuple[Remark, ...] = ()


@dataclass(frozen=True, slots=True)
class Variant:
    """One sample to be: a building with some doors closed.

    Attributes:
        world: The building.
        repetition: Which order of closing, from 0.
        closed: The doors that are closed, in the order of closing.
    """

    world: World
    repetition: int
    closed: tuple[str, ...]

    @property
    def id(self) -> str:
        """Folder relative to the dataset; depends on configuration and seed only."""
        return f"{self.world.split}/{self.world.name}/r{self.repetition:02d}-c{len(self.closed):02d}"


def given_worlds(words: Sequence[str]) -> list[str]:
    """List worlds as they were given, each once; ``all`` stands for those that come with us."""
    return list(dict.fromkeys(name for word in words for name in (bundled_names() if word == ALL else [word])))


def world_sources(words: Sequence[str]) -> list[str]:
    """List worlds by bundled names and whole paths, so that a command of any folder finds them again."""
    return [world_source(text) for text in given_worlds(words)]


def find_worlds(config: DatasetConfig) -> list[World]:
    """Find the buildings, in the order of their names.

    Raises:
        InvalidInputError: An unreadable world, two of one name, or one without a room that a door closes.
    """
    plans = [load_world(text) for text in given_worlds(config.worlds)]
    sources = world_sources(config.worlds)
    found: dict[str, tuple[str, FloorPlan]] = {}
    for told, source, plan in zip(distinct_names(plans, sources), sources, plans, strict=True):
        name = re.sub(r"[^A-Za-z0-9._-]+", "-", told).strip(".-") or "world"
        if name in found:
            raise InvalidInputError(f"two worlds named {name!r}", expected="one world a name", where=source)
        found[name] = (source, plan)
    names = sorted(found)
    splits = split_buildings(names, config.seed)
    worlds = []
    for name in names:
        source, plan = found[name]
        closable = tuple(doors[0] for doors in closable_rooms(plan).values())
        if not closable:
            raise InvalidInputError("no room that one door closes", expected="a world with such rooms", where=source)
        digest = hashlib.sha256(plan_text(plan).encode()).hexdigest()
        worlds.append(World(name, source, splits[name], closable, digest, remarks_on(plan, name)))
    return worlds


def remarks_on(plan: FloorPlan, name: str) -> tuple[Remark, ...]:
    """Collect what was said on reading one plan of several, with its name."""
    return tuple(replace(remark, why=f"{remark.why}, in {name}") for remark in plan.remarks)


def split_buildings(names: Sequence[str], seed: int) -> dict[str, Split]:
    """Draw the split of each building by the seed; whole buildings, so that none is in two splits."""
    order = stream(seed, "splits").permutation(len(names))
    held = max(round(HELD_OUT * len(names)), 1) if len(names) >= len(SPLITS) else 0
    splits: dict[str, Split] = {}
    for place, index in enumerate(order):
        splits[names[index]] = "test" if place < held else "validation" if place < 2 * held else "train"
    return splits


def find_variants(world: World, config: DatasetConfig) -> Iterator[Variant]:
    """Yield every sample of a building in the order of their ids: doors closed one after the other, in several orders.

    A door closed among i stays closed among i + 1, and the first door differs between repetitions for as long as there
    are doors (paper, section 5). No more than the samples of one order are held at a time.
    """
    most = min(config.max_closed, len(world.closable))
    firsts = stream(config.seed, "first door", world.name).permutation(len(world.closable))
    for repetition in sorted(range(config.repetitions), key=lambda number: f"{number:02d}-"):
        first = int(firsts[repetition % len(firsts)])
        rng = stream(config.seed, "closed doors", world.name, str(repetition))
        others = [int(i) for i in rng.permutation(len(world.closable)) if i != first]
        order = [world.closable[i] for i in (first, *others)]
        yield from sorted((Variant(world, repetition, tuple(order[:n])) for n in range(1, most + 1)), key=_id)


def _id(variant: Variant) -> str:
    return variant.id


def count_variants(worlds: Sequence[World], config: DatasetConfig) -> int:
    """Count the samples of some buildings."""
    return config.repetitions * sum(min(config.max_closed, len(world.closable)) for world in worlds)


def sort_buildings(worlds: Sequence[World], split: Split) -> list[World]:
    """Sort the buildings of a split by their samples' ids."""
    return sorted((world for world in worlds if world.split == split), key=lambda world: f"{world.name}/")


def noise_seed(config: DatasetConfig, world: World, *variant: str) -> int:
    """Derive the seed of the simulated noise of a world's survey, or of one variant's; 32 bits."""
    return zlib.crc32("/".join((str(config.seed), world.name, *variant)).encode())
