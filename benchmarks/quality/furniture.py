"""What furniture costs the prediction, and what it brings to count it as free where walls are looked for.

    python benchmarks/quality/furniture.py [WORLD ...] [--sets 3] [--closed 6]

Each world is explored twice, furnished and bare, all doors open; the drive is mapped with the noise ``medium``; sets of
rooms are closed by redrawing the map (as ``closedrooms robustness`` does). Every map is predicted with
``clutter_area`` 0 (furniture as it is) and as the predictor comes. Figures are the mean IoU by door over the sets.
"""

import argparse
from dataclasses import replace

import numpy as np

from closedrooms.core.random import stream
from closedrooms.experiments.dataset.erase import Eraser
from closedrooms.experiments.robustness.drives import furnished, map_drive, record_drive
from closedrooms.mapping.config import MapperConfig
from closedrooms.navigation.config import NavigationConfig
from closedrooms.pipeline.reporting.run_scores import room_iou
from closedrooms.pipeline.survey import true_building
from closedrooms.predictor.methods import METHODS as ALL
from closedrooms.predictor.methods import predict
from closedrooms.sim.config import NOISE_LEVELS, SimConfig
from closedrooms.worlds.closing import closable_rooms, draw_closed
from closedrooms.worlds.library import load_world

WORLDS = ("office-01", "office-05", "school-01", "office-06", "office-02")
METHODS = ("paper", "rose", "best")


def figures(world: str, share: float, sets: int, closed: int) -> list[float]:
    """Measure the mean IoU by door of each method, furniture as it is and counted as free."""
    plan = load_world(world)
    drive = record_drive(furnished(plan, share, 0), SimConfig(), MapperConfig(), NavigationConfig(), 0)
    eraser = Eraser(map_drive(drive, NOISE_LEVELS["medium"], MapperConfig(), 0))
    found: list[list[float]] = [[] for _ in range(2 * len(METHODS))]
    for number in range(sets):
        count = min(closed, len(closable_rooms(plan)))
        doors = draw_closed(plan, count, stream(0, "closed doors", plan.name, str(number)))
        mapped = eraser.erase(doors)
        truth = true_building(plan, doors, mapped.grid.frame, drive.world_T_map.inverse())
        defaults = [(name, ALL[name].config()) for name in METHODS]
        tried = [(n, kind) for n, config in defaults for kind in (replace(config, clutter_area=0.0), config)]
        for column, (name, config) in zip(found, tried, strict=True):
            by_door = room_iou(predict(mapped.grid, mapped.doors, name, config).rooms, truth.rooms)
            column.append(float(np.mean([by_door.get(door, 0.0) for door in doors])))
    return [float(np.mean(column)) for column in found]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("worlds", nargs="*", default=WORLDS)
    parser.add_argument("--sets", type=int, default=3)
    parser.add_argument("--closed", type=int, default=6)
    options = parser.parse_args()
    heads = [f"{name}, {what}" for name in METHODS for what in ("as it is", "free")]
    print(f"| world | furniture | {' | '.join(heads)} |\n| --- | --- | {'---: | ' * len(heads)}", flush=True)
    for world in options.worlds:
        for share in (1.0, 0.0):
            row = figures(world, share, options.sets, options.closed)
            print(f"| {world} | {share:g} | {' | '.join(f'{value:.3f}' for value in row)} |", flush=True)


if __name__ == "__main__":
    main()
