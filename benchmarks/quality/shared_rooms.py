"""Rooms with several closed doors: how often a method tells that they lead to one room, and what that gains.

    python benchmarks/quality/shared_rooms.py [WORLD ...] [--method best|learned] [--close 10] [--draws 2]

Worlds are names or files; the default are the bundled ones that have a room whose several doors can all be closed.
All such rooms are closed, as far as that cuts nothing else off, and rooms with one door beside them, ``--close``
altogether; another draw closes other ones. The map is drawn from the plan, without a drive: what a robot can reach is
free, the cells around it are occupied, the rest is unknown. Each map is predicted twice, as it is and with joining
switched off. A door between two closed rooms is seen by nobody and left out.
"""

import argparse
import itertools
import math
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from unittest import mock

import numpy as np

from closedrooms.core.door import ClosedDoor
from closedrooms.core.grid import FREE, OCCUPIED, UNKNOWN, GridFrame, OccupancyGrid
from closedrooms.core.pose import Pose2
from closedrooms.core.random import stream
from closedrooms.core.room import Room
from closedrooms.experiments.robustness.door_noise import true_doors
from closedrooms.pipeline.reporting.run_scores import room_iou
from closedrooms.predictor.best import shared_rooms as shared
from closedrooms.predictor.methods import predict
from closedrooms.worlds.closing import closable_rooms, draw_closed
from closedrooms.worlds.library import bundled_names, load_world
from closedrooms.worlds.plan import FloorPlan
from closedrooms.worlds.start_pose import start_pose
from closedrooms.worlds.truth import reachable, true_rooms, truth_bounds

HERE = Pose2()
RESOLUTION = 0.05
# A door is seen from free space nearer than this [m]. Of pairs of doors that lead to two rooms those nearer than this
# could be taken for doors of one [m]: all but a few of one room are nearer.
SEEN, NEAR = 0.4, 15.0


@dataclass
class Tally:
    """Counts of rooms and pairs of doors over some maps; figures are IoU by door."""

    rooms: int = 0
    pairs: int = 0
    joined: int = 0
    apart: int = 0
    wrong: int = 0
    several: dict[str, list[float]] = field(default_factory=lambda: {"joined": [], "apart": []})
    alone: dict[str, list[float]] = field(default_factory=lambda: {"joined": [], "apart": []})

    def row(self, name: str) -> str:
        """Build a row of the table."""
        counts = (self.rooms, self.pairs, self.joined, self.apart, self.wrong)
        figures = [_mean(kind[how]) for kind in (self.several, self.alone) for how in ("joined", "apart")]
        return f"| {name} | {' | '.join(map(str, counts))} | {' | '.join(figures)} |"


def _mean(values: Sequence[float]) -> str:
    return f"{np.mean(values):.3f}" if values else ""


def seen_map(plan: FloorPlan, closed: Sequence[str]) -> OccupancyGrid:
    """Draw the map of all that a robot reaches with some doors closed."""
    import cv2

    x0, y0, x1, y1 = truth_bounds(plan, HERE)
    x0, y0 = (math.floor(v / RESOLUTION) * RESOLUTION - 1.0 for v in (x0, y0))
    rows, cols = (math.ceil((high - low + 1.0) / RESOLUTION) for low, high in ((y0, y1), (x0, x1)))
    frame = GridFrame(RESOLUTION, x0, y0, rows, cols)
    start = start_pose(plan)
    free = reachable(plan, closed, frame, HERE, (start.x, start.y))
    around = cv2.dilate(free.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
    return OccupancyGrid(frame, np.where(free, FREE, np.where(around, OCCUPIED, UNKNOWN)).astype(np.int8))


def seen_doors(plan: FloorPlan, closed: Sequence[str], grid: OccupancyGrid) -> list[ClosedDoor]:
    """Find the closed doors with free space beside them."""
    places = grid.frame.to_points(np.argwhere(grid.free))
    doors = true_doors(plan, closed, HERE)
    return [door for door in doors if np.hypot(*(places - door.midpoint).T).min() <= SEEN]


@contextmanager
def no_joining() -> Iterator[None]:
    """Give every door a room of its own."""
    with mock.patch.object(shared, "SHARED", math.inf):
        yield


def tally_map(tally: Tally, doors: Sequence[ClosedDoor], truth: Sequence[Room], joined: Sequence[Room],
          apart: Sequence[Room]) -> None:  # fmt: skip
    """Add one map to the tally."""
    owner = {door: number for number, room in enumerate(truth) for door in room.doors}
    found = {door: number for number, room in enumerate(joined) for door in room.doors}
    counts = Counter(owner[door.id] for door in doors)
    tally.rooms += sum(count > 1 for count in counts.values())
    for how, rooms in (("joined", joined), ("apart", apart)):
        by_door = room_iou(rooms, truth)
        for door in doors:
            kind = tally.several if counts[owner[door.id]] > 1 else tally.alone
            kind[how].append(by_door[door.id])
    for a, b in itertools.combinations(doors, 2):
        together = found.get(a.id, a.id) == found.get(b.id, b.id)
        if owner[a.id] == owner[b.id]:
            tally.pairs += 1
            tally.joined += together
        elif math.dist(a.midpoint, b.midpoint) < NEAR:
            tally.apart += 1
            tally.wrong += together


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("worlds", nargs="*")
    parser.add_argument("--method", choices=("best", "learned"), default="best")
    parser.add_argument("--close", type=int, default=10)
    parser.add_argument("--draws", type=int, default=2)
    options = parser.parse_args()
    heads = [
        "world", "rooms with several doors", "pairs of their doors", "joined", f"pairs to two rooms within {NEAR:g} m",
        "joined wrongly", "IoU of rooms with several doors", "of these without joining", "IoU of rooms with one door",
        "of those without joining",
    ]  # fmt: skip
    print(f"| {' | '.join(heads)} |\n| --- | {'---: | ' * (len(heads) - 1)}", flush=True)
    whole = Tally()
    for name in options.worlds or bundled_names():
        plan = load_world(name)
        rooms = closable_rooms(plan, several_doors=True)
        if all(len(doors) == 1 for doors in rooms.values()):
            continue
        own = Tally()
        for draw in range(options.draws):
            rng = stream(draw, "shared rooms", plan.name)
            # The draw is by rooms: of several, the one with most rooms of several doors.
            sets = [draw_closed(plan, min(options.close, len(rooms) // 2), rng, several_doors=True) for _ in range(20)]
            closed = max(sets, key=len)
            grid = seen_map(plan, closed)
            doors, truth = seen_doors(plan, closed, grid), true_rooms(plan, closed, HERE)
            with no_joining():
                apart = predict(grid, doors, options.method).rooms
            joined = predict(grid, doors, options.method).rooms
            for tally in (own, whole):
                tally_map(tally, doors, truth, joined, apart)
        print(own.row(plan.name), flush=True)
    print(whole.row("all"))


if __name__ == "__main__":
    main()
