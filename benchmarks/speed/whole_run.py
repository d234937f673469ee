"""The whole job on buildings of growing size: seconds by stage, processor time, and how much of it are rays.

    python benchmarks/speed/whole_run.py [WORLD ...] [--record] [--quick]

Without arguments it takes bundled worlds from the smallest to the largest. Every world runs once with the same
options, one after the other in one process, so that the figures can be compared with each other; they are this
machine's and should be quoted as ratios. The last column is "ours / best known": the whole beside sensing alone, which
is PyBullet's rays, the limit of any run.
"""

import argparse
import tempfile
from pathlib import Path
from time import process_time

from closedrooms.pipeline.config import RunConfig
from closedrooms.pipeline.run import run
from closedrooms.worlds.geometry import wall_area
from closedrooms.worlds.library import load_world

WORLDS = ("office-01", "office-05", "office-07", "school-08", "school-09")
STAGES = ("sense", "map", "navigate", "move", "finish map", "predict", "cover", "write", "total")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("worlds", nargs="*", default=WORLDS)
    parser.add_argument("--record", action="store_true", help="with the recording")
    parser.add_argument("--quick", action="store_true", help="the smallest world only")
    options = parser.parse_args()
    if options.quick:
        options.worlds = WORLDS[:1]
    heads = "".join(f"{stage:>12}" for stage in STAGES)
    print(f"{'world':<24}{'size':>12}{'scans':>7}{heads}{'CPU':>8}{'x real time':>13}{'ours / best known':>19}")
    for name in options.worlds:
        x_min, y_min, x_max, y_max = wall_area(load_world(name)).bounds
        with tempfile.TemporaryDirectory() as folder:
            config = RunConfig(world=name, record=options.record, out=Path(folder) / "run")
            begin = process_time()
            result = run(config)
            taken = process_time() - begin
        exploration = result.figures["exploration"]
        seconds = "".join(f"{result.figures['durations'].get(stage, 0.0):>12.2f}" for stage in STAGES)
        size = f"{x_max - x_min:.0f} x {y_max - y_min:.0f} m"
        speed = exploration["simulated_s"] / result.figures["durations"]["total"]
        share = result.figures["durations"]["total"] / result.figures["durations"]["sense"]
        head = f"{Path(name).stem[:23]:<24}{size:>12}{exploration['scans']:>7}{seconds}"
        print(f"{head}{taken:>8.2f}{speed:>13.1f}{share:>19.2f}", flush=True)


if __name__ == "__main__":
    main()
