"""Draw maps with closed doors of the buildings of one use, as samples that ``closedrooms evaluate`` reads.

    python benchmarks/fitting/drawn_maps.py PLANS --use fit|choose --out FOLDER [--maps 6] [--generated 20] [--bundled]

PLANS is a folder of floor plans, searched with its sub-folders; buildings of another use are passed by. Of a building
every map has its own doors closed, 1 to 12 rooms, those with several doors too in every third map; one map in five is
turned. Everything is drawn from the name of the building and the number of the map.
"""

import argparse
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from closedrooms.core.errors import InvalidInputError
from closedrooms.core.random import stream
from closedrooms.experiments.training.buildings import FIRST_CHOOSE, read_groups, use_of
from closedrooms.experiments.training.synthetic_maps import synthesise_map, write_sample
from closedrooms.worlds.closing import closable_rooms, draw_closed
from closedrooms.worlds.generation.generator import GENERATOR_VERSION, generate
from closedrooms.worlds.library import bundled_names, load_world
from closedrooms.worlds.plan import FloorPlan

MOST_CLOSED, TURNED = 12, 0.2


def find_plans(args: argparse.Namespace) -> Iterator[tuple[str, FloorPlan]]:
    """Find the plans of the use asked for, by name."""
    known = {name for group in read_groups() for name in group.buildings}
    for path in sorted(args.plans.rglob("*.xml")):
        if path.stem in known and use_of(path.stem) == args.use:
            try:
                yield path.stem, load_world(str(path))
            except InvalidInputError as error:
                print(f"left out {path.stem}: {error}", file=sys.stderr)
    first = FIRST_CHOOSE if args.use == "choose" else 0
    for kind in ("office", "school"):
        for seed in range(first, first + args.generated):
            name = f"{kind}-g{GENERATOR_VERSION}-{seed}"
            if use_of(name) == args.use:
                yield name, generate(kind, seed)
    for name in bundled_names() if args.bundled else ():
        if use_of(name) == args.use:
            yield name, load_world(name)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("plans", type=Path)
    parser.add_argument("--use", choices=("fit", "choose"), required=True)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--maps", type=int, default=6)
    parser.add_argument("--generated", type=int, default=20)
    parser.add_argument("--bundled", action="store_true")
    args = parser.parse_args()
    for name, plan in find_plans(args):
        for number in range(args.maps):
            several = number % 3 == 2
            rng = stream(number, "drawn", name)
            most = len(closable_rooms(plan, several_doors=several))
            if most == 0:
                continue
            count = int(rng.integers(1, min(MOST_CLOSED, most) + 1))
            try:
                closed = draw_closed(plan, count, rng, several_doors=several)
            except InvalidInputError:
                continue  # rooms with several doors hinder each other
            angle = float(rng.uniform(0.0, np.pi)) if rng.random() < TURNED else 0.0
            drawn = synthesise_map(plan, closed, rng, angle=angle)
            if drawn.doors:
                write_sample(args.out / name / f"{number:02d}", drawn, world=name, repetition=number)
        print(name, flush=True)


if __name__ == "__main__":
    main()
