"""Errors of the tour estimates against the number of closed doors (paper, section 5.3 and figure 12).

    python benchmarks/quality/coverage_sweep.py --out DIR [WORLD ...] [--seeds 3] [--noise medium] [--picture PNG]

Every world is explored once a seed with all doors open; the maps with a third, two thirds and all of the closable doors
closed are redrawn from it (``closedrooms.experiments.dataset``). Rows go to ``DIR/sweep.csv`` as they come; what stands
there is not done again. One process.
"""

import argparse
import csv
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from closedrooms.core.files.geojson import write_doors
from closedrooms.core.files.rosmap import write_map
from closedrooms.core.random import stream
from closedrooms.coverage.estimates import compare_lengths
from closedrooms.coverage.tour.coverage_tour import CoverageTour
from closedrooms.coverage.tour.tour_planner import plan_coverage
from closedrooms.experiments.dataset.erase import Eraser
from closedrooms.experiments.dataset.open_survey import survey_open
from closedrooms.mapping.config import MapperConfig
from closedrooms.navigation.config import NavigationConfig
from closedrooms.pipeline.reporting.run_scores import mean, room_iou, rooms_seen
from closedrooms.predictor.methods import predict
from closedrooms.sim.config import SimConfig, noise_level
from closedrooms.worlds.closing import closable_rooms
from closedrooms.worlds.library import bundled_names, load_world
from closedrooms.worlds.truth import rasterise, true_rooms, truth_bounds

METHODS = ("paper", "best")
SHARES = (1, 2, 3)
FIELDS = (
    "world", "seed", "thirds", "closed", "seen", "rooms_seen", "tsp_closed", "tsp_gt",
    *(f"{figure}_{method}" for method in METHODS for figure in ("tsp", "iou", "predicted")),
)  # fmt: skip
# What the paper reports over its own environments: mean and standard deviation [%].
PAPER = {"closed": (21.37, 16.18), "baseline": (21.4, 23.38), "paper": (6.21, 9.06)}
KINDS = ("closed", "baseline", *METHODS)
NAMES = {
    "closed": "closed", "baseline": "baseline", "paper": "predicted by paper", "best": "predicted by best",
}  # fmt: skip
COLOURS = {"closed": "#0072b2", "baseline": "#e69f00", "paper": "#009e73", "best": "#cc79a7"}
START = (0.0, 0.0)
Row = dict[str, str]


def samples(world: str, seed: int, done: set[int], out: Path, noise: str) -> Iterator[Row]:
    """Measure the rows of one world and seed that are not there yet."""
    plan = load_world(world)
    closable = [doors[0] for doors in closable_rooms(plan).values()]
    order = [closable[i] for i in stream(seed, "closed doors", plan.name).permutation(len(closable))]
    survey = survey_open(plan, SimConfig(noise=noise_level(noise)), MapperConfig(), NavigationConfig(), seed)
    eraser, map_T_world = Eraser(survey), survey.world_T_map.inverse()
    truth_tour: CoverageTour | None = None
    for thirds in SHARES:
        if thirds in done:
            continue
        closed = tuple(order[: max(math.ceil(thirds * len(order) / 3), 1)])
        erased = eraser.erase(closed)
        rooms = true_rooms(plan, closed, map_T_world)
        if truth_tour is None:
            frame = erased.grid.frame.covering(*truth_bounds(plan, map_T_world))
            truth_tour = plan_coverage(rasterise(plan, frame, map_T_world), start=START)
        row: dict[str, Any] = {
            "world": plan.name, "seed": seed, "thirds": thirds, "closed": len(closed), "seen": len(erased.doors),
            "rooms_seen": rooms_seen(plan, erased.grid, map_T_world),
            "tsp_closed": round(plan_coverage(erased.grid, erased.doors, start=START).length, 3),
            "tsp_gt": round(truth_tour.length, 3),
        }  # fmt: skip
        stem = f"{plan.name}-{seed}-{thirds}"
        write_map(out / stem, erased.grid)
        write_doors(out / f"{stem}-doors.geojson", erased.doors)
        for method in METHODS:
            prediction = predict(erased.grid, erased.doors, method)
            row[f"tsp_{method}"] = round(plan_coverage(prediction.grid, start=START).length, 3)
            row[f"iou_{method}"] = round(mean(room_iou(prediction.rooms, rooms)) or 0.0, 4)
            row[f"predicted_{method}"] = len(prediction.rooms)
            write_map(out / f"{stem}-{method}", prediction.grid)
        yield {key: str(row[key]) for key in FIELDS}


def errors(row: Row) -> dict[str, float]:
    """Compute the errors of one row in percent, by kind of estimate."""
    found: dict[str, float | None] = {}
    for method in METHODS:
        figures = compare_lengths(
            float(row["tsp_closed"]), float(row[f"tsp_{method}"]), float(row["tsp_gt"]),
            n_rooms=int(row["rooms_seen"]), n_doors=int(row["seen"]),
        )  # fmt: skip
        found |= {"closed": figures.error_closed, "baseline": figures.error_baseline, method: figures.error_pred}
    return {kind: error for kind, error in found.items() if error is not None}


def report(rows: list[Row]) -> Iterator[str]:
    """Write Markdown: all errors beside the paper's, by share of closed doors, and the worst."""
    table = [errors(row) for row in rows]
    yield f"{len(rows)} maps of {len({row['world'] for row in rows})} worlds"
    yield ""
    yield "| error [%] | paper: mean (sd) | mean (sd) | median | a third closed | two thirds | all |"
    yield "| --- | ---: | ---: | ---: | ---: | ---: | ---: |"
    for kind in KINDS:
        values = np.array([line[kind] for line in table])
        paper = "{:.2f} ({:.2f})".format(*PAPER[kind]) if kind in PAPER else ""
        cells = []
        for thirds in SHARES:
            chosen = np.array([int(row["thirds"]) == thirds for row in rows])
            cells.append(f"{values[chosen].mean():.1f} ({values[chosen].std():.1f})" if chosen.any() else "")
        yield (
            f"| {NAMES[kind]} | {paper} | {values.mean():.2f} ({values.std():.2f}) | {np.median(values):.1f} | "
            f"{' | '.join(cells)} |"
        )
    for method in METHODS:
        iou = np.array([float(row[f"iou_{method}"]) for row in rows])
        worst = sorted(zip(rows, table, strict=True), key=lambda pair: -pair[1][method])[:6]
        names = ", ".join(f"{r['world']}-{r['seed']}-{r['thirds']} {e[method]:.0f} %" for r, e in worst)
        yield ""
        yield f"`{method}`: mean IoU by door {iou.mean():.3f}; largest errors: {names}"


def draw(rows: list[Row], picture: Path) -> None:
    """Draw figure 12: each error against the number of closed doors."""
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    table = [errors(row) for row in rows]
    counts = np.array([int(row["closed"]) for row in rows])
    edges = np.unique(np.quantile(counts, np.linspace(0.0, 1.0, 8)).round().astype(int))
    groups = [
        np.flatnonzero((counts >= low) & (counts < high))
        for low, high in zip(edges, [*edges[1:-1], counts.max() + 1], strict=False)
    ]
    groups = [group for group in groups if group.size]
    figure, axis = plt.subplots(figsize=(8.0, 4.2), constrained_layout=True)
    for kind in KINDS:
        values = np.array([line[kind] for line in table])
        middle = np.array([values[group].mean() for group in groups])
        spread = np.array([values[group].std() for group in groups])
        places = np.array([counts[group].mean() for group in groups])
        axis.plot(places, middle, "o-", color=COLOURS[kind], label=NAMES[kind])
        axis.fill_between(places, np.maximum(middle - spread, 0.0), middle + spread, color=COLOURS[kind], alpha=0.12)
    axis.set(xlabel="closed doors", ylabel="error of the length of the tour [%]", ylim=(0.0, 120.0))
    axis.set_title(f"{len(rows)} maps of {len({row['world'] for row in rows})} worlds: mean and standard deviation")
    axis.grid(alpha=0.3)
    axis.legend()
    figure.savefig(picture, dpi=110)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("worlds", nargs="*", default=bundled_names())
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--noise", default="medium", choices=("none", "low", "medium", "high"))
    parser.add_argument("--picture", type=Path)
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    path = options.out / "sweep.csv"
    rows: list[Row] = []
    if path.exists():
        with path.open(newline="") as file:
            rows = [row for row in csv.DictReader(file) if None not in row.values()]
    for seed in range(options.seeds):
        for world in options.worlds:
            name = Path(world).stem
            done = {int(row["thirds"]) for row in rows if (row["world"], row["seed"]) == (name, str(seed))}
            if done >= set(SHARES):
                continue
            for row in samples(world, seed, done, options.out, options.noise):
                with path.open("a", newline="") as file:
                    writer = csv.DictWriter(file, FIELDS)
                    if not rows:
                        writer.writeheader()
                    writer.writerow(row)
                rows.append(row)
    print("\n".join(report(rows)))
    if options.picture:
        draw(rows, options.picture)


if __name__ == "__main__":
    main()
