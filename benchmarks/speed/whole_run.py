"""The whole job on buildings of growing size: seconds by stage, processor time, and how much of it are rays.

    python benchmarks/speed/whole_run.py [WORLD ...] [--record] [--rounds 3] [--quick]

Without arguments it takes bundled worlds from the smallest to the largest. The worlds take turns in one process with
the same options, and medians of the rounds count; they are this machine's and should be quoted as ratios. The last
column is "ours / best known": the whole beside sensing alone, which is PyBullet's rays, the limit of any run.
"""

import argparse
import tempfile
from pathlib import Path
from statistics import median
from time import process_time

from closedrooms.pipeline.options.run import RunConfig
from closedrooms.pipeline.run import run
from closedrooms.worlds.geometry import wall_area
from closedrooms.worlds.library import load_world

WORLDS = ("office-01", "office-05", "office-07", "school-08", "school-09")
STAGES = ("sense", "map", "navigate", "move", "finish map", "predict", "cover", "write", "total")


def measure(world: str, *, record: bool) -> tuple[float, ...]:
    """Run a world once: scans, seconds by stage, processor time [s], simulated time / time, whole / sensing."""
    with tempfile.TemporaryDirectory() as folder:
        config = RunConfig(world=world, record=record, out=Path(folder) / "run")
        begin = process_time()
        result = run(config)
        taken = process_time() - begin
    exploration, durations = result.figures["exploration"], result.figures["durations"]
    stages = (durations.get(stage, 0.0) for stage in STAGES)
    total = durations["total"]
    return exploration["scans"], *stages, taken, exploration["simulated_s"] / total, total / durations["sense"]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("worlds", nargs="*", default=WORLDS)
    parser.add_argument("--record", action="store_true", help="with the recording")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--quick", action="store_true", help="the smallest world only, once")
    options = parser.parse_args()
    if options.quick:
        options.worlds, options.rounds = WORLDS[:1], 1
    heads = "".join(f"{stage:>12}" for stage in STAGES)
    print(f"{'world':<24}{'size':>12}{'scans':>7}{heads}{'CPU':>8}{'x real time':>13}{'ours / best known':>19}")
    rows: dict[str, list[tuple[float, ...]]] = {name: [] for name in options.worlds}
    for _ in range(options.rounds):
        for name, found in rows.items():
            found.append(measure(name, record=options.record))
    for name, found in rows.items():
        x_min, y_min, x_max, y_max = wall_area(load_world(name)).bounds
        scans, *stages, cpu, speed, share = (median(column) for column in zip(*found, strict=True))
        seconds = "".join(f"{stage:>12.2f}" for stage in stages)
        size = f"{x_max - x_min:.0f} x {y_max - y_min:.0f} m"
        print(f"{Path(name).stem[:23]:<24}{size:>12}{scans:>7.0f}{seconds}{cpu:>8.2f}{speed:>13.1f}{share:>19.2f}")


if __name__ == "__main__":
    main()
