"""Run the main job on many worlds and print one table, in Markdown: area mapped, trajectory error, doors, IoU, seconds.

    python benchmarks/quality/all_worlds.py [WORLD ...] [--noise medium] [--seed 0] [--close 5] [--method best]
                                                [--body wheels] [--drive]

Without worlds it takes the 20 bundled ones. Nothing is recorded; one process, one world after the other.
"""

import argparse
import tempfile
from pathlib import Path

from closedrooms.core.errors import ClosedroomsError
from closedrooms.core.report import Report
from closedrooms.pipeline.options.run import RunConfig, named_sim
from closedrooms.pipeline.reporting.report import figure
from closedrooms.pipeline.run import run
from closedrooms.worlds.library import bundled_names

HEAD = (
    "world",
    "status",
    "area mapped",
    "ATE [m]",
    "doors seen",
    "mean IoU",
    "tour error closed / baseline / predicted [%]",
    "scans",
    "s",
)


def row(name: str, result: Report) -> list[str]:
    figures = result.figures
    metrics, doors = figures["metrics"], figures["doors"]
    average = metrics["room_iou_mean"]
    errors = metrics["tour"]["errors_percent"]
    cells = [
        Path(name).stem,
        figures["exploration"]["status"],
        f"{100 * metrics['area_mapped']:.1f} %",
        f"{metrics['ate_m']:.3f}",
        f"{len(doors['seen'])} of {len(figures['closed'])}",
        "" if average is None else f"{average:.3f}",
        " / ".join(figure(errors[kind], "{:.1f}") for kind in ("closed", "baseline", "predicted")),
        str(figures["exploration"]["scans"]),
        f"{figures['durations']['total']:.1f}",
    ]
    if "drive" in metrics:
        cells.append(" ".join(f"{key}={value}" for key, value in metrics["drive"].items() if key != "revisions"))
    return cells


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("worlds", nargs="*", default=bundled_names())
    parser.add_argument("--noise", default="medium", choices=("none", "low", "medium", "high"))
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--close", type=int, default=5)
    parser.add_argument("--method", default="best")
    parser.add_argument("--body", default="wheels", choices=("wheels", "kinematic"))
    parser.add_argument("--drive", action="store_true")
    options = parser.parse_args()
    print(f"| {' | '.join(HEAD)} |\n|{' --- |' * len(HEAD)}", flush=True)
    for name in options.worlds:
        with tempfile.TemporaryDirectory() as folder:
            config = RunConfig(
                world=name,
                noise=options.noise,
                seed=options.seed,
                close=options.close,
                method=options.method,
                drive=options.drive,
                sim=named_sim(options.noise, body=options.body),
                record=False,
                out=Path(folder) / "run",
            )
            try:
                print(f"| {' | '.join(row(name, run(config)))} |", flush=True)
            except ClosedroomsError as error:
                print(f"| {Path(name).stem} | failed: {error} |", flush=True)


if __name__ == "__main__":
    main()
