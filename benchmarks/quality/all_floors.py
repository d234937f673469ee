"""Run the main job on every floor of a folder of floor plans, unattended and resumable, and make one table.

    python benchmarks/quality/all_floors.py ../shared/data/plans --out /tmp/floors [--noise medium] [--close 5]
                                    [--seed 0] [--workers 1] [--limit 1200] [--smallest-first] [--only-table]

Every file below the folder that an importer knows is a floor; a file with several levels is one floor a level. A floor
is two processes: ``closedrooms run`` with the method ``best``, then ``closedrooms predict`` with the method ``paper``
on the map that the run left. Each has a time limit; its wall time, CPU time and peak memory are noted beside its run
directory. A floor whose ``run.json`` is there is not run again, so that the same command goes on where it was stopped.

``floors.csv`` and ``floors.md`` in the output folder hold a row a floor: extent, rooms, closed doors, area mapped,
doors seen, ATE, mean IoU by door of both methods, tour errors, seconds, memory, and why a floor failed. Seconds of a
loaded machine mislead; CPU seconds stand beside them.
"""

import argparse
import csv
import json
import math
import os
import signal
import statistics
import subprocess
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from closedrooms.core.errors import ClosedroomsError, InvalidInputError
from closedrooms.core.files.geojson import read_rooms
from closedrooms.pipeline.reporting.report import figure
from closedrooms.pipeline.reporting.run_scores import mean, room_iou
from closedrooms.worlds.closing import closable_rooms
from closedrooms.worlds.geometry import wall_area
from closedrooms.worlds.library import load_world

PROGRAM = (sys.executable, "-c", "import sys; from closedrooms.cli.commands import main; sys.exit(main())")
HEAD = (
    "floor", "size [m]", "rooms", "closed", "area mapped [%]", "doors seen", "ATE [m]", "IoU best", "IoU paper",
    "tour error closed / baseline / predicted [%]", "simulated [s]", "wall [s]", "CPU [s]", "peak [MB]", "remark",
)  # fmt: skip


@dataclass(frozen=True)
class FloorToRun:
    """Floor to run, and its size [m]."""

    name: str
    path: str
    level: str | None
    width: float
    height: float
    rooms: int
    closable: int


@dataclass(frozen=True)
class Spent:
    """Cost of a process: exit status (negative: the signal that ended it), seconds, megabytes, last line of errors."""

    status: int
    wall: float
    cpu: float
    memory: float
    error: str


def find_floors(folder: Path) -> tuple[list[FloorToRun], dict[str, str]]:
    """Find every floor below a folder, the largest first, and the unreadable files with the reason."""
    floors, broken = [], {}
    for path in sorted(p for p in folder.rglob("*") if p.suffix in {".xml", ".yaml", ".json"}):
        for level in levels_of(path):
            name = path.name.split(".")[0] + (f"-{level}" if level else "")
            try:
                plan = load_world(str(path), level=level)
            except InvalidInputError as error:
                broken[name] = str(error).removesuffix(f": {path}")
                continue
            x_min, y_min, x_max, y_max = wall_area(plan).bounds
            size = (round(x_max - x_min, 1), round(y_max - y_min, 1))
            floors.append(FloorToRun(name, str(path), level, *size, len(plan.rooms), len(closable_rooms(plan))))
    return sorted(floors, key=lambda floor: (-floor.width * floor.height, floor.name)), broken


def levels_of(path: Path) -> list[str | None]:
    """List the names of the levels of an RMF building, ``[None]`` for every other file."""
    import yaml

    if not path.name.endswith(".building.yaml"):
        return [None]
    levels = (yaml.safe_load(path.read_text()) or {}).get("levels") or {}
    return list(levels) or [None]


def spend(words: list[str], limit: float) -> Spent:
    """Run the command line in a process group of its own and say what it cost; it is killed after ``limit`` seconds."""
    start = time.perf_counter()
    threads = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    process = subprocess.Popen(
        [*PROGRAM, *words],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        env={**os.environ, **threads},
        start_new_session=True,
    )
    late = threading.Event()

    def end() -> None:
        late.set()
        os.killpg(process.pid, signal.SIGKILL)

    timer = threading.Timer(limit, end)
    timer.start()
    assert process.stderr is not None
    lines = process.stderr.read().decode(errors="replace").strip().splitlines()
    _, status, usage = os.wait4(process.pid, 0)
    timer.cancel()
    process.returncode = os.waitstatus_to_exitcode(status)
    error = f"not done after {limit:.0f} s" if late.is_set() else (lines[-1] if process.returncode and lines else "")
    cpu = usage.ru_utime + usage.ru_stime
    return Spent(process.returncode, time.perf_counter() - start, cpu, usage.ru_maxrss / 1024, error)


def run_floor(floor: FloorToRun, out: Path, options: argparse.Namespace) -> None:
    """Run both processes of a floor, where their results are not there yet; what they cost goes beside them."""
    folder, paper = out / floor.name, out / f"{floor.name}-paper"
    level = ["--level", floor.level] if floor.level else []
    close = ["--close", str(min(options.close, floor.closable)), "--noise", options.noise, "--seed", str(options.seed)]
    if not (folder / "run.json").exists():
        words = ["run", floor.path, *level, *close, "--no-record", "--out", str(folder)]
        note(out, floor.name, spend(words, options.limit))
    if (folder / "run.json").exists() and not (paper / "run.json").exists():
        words = ["predict", str(folder / "map.yaml"), "--doors", str(folder / "doors.geojson"), "--method", "paper"]
        note(out, f"{floor.name}-paper", spend([*words, "--out", str(paper)], options.limit))
    print(" | ".join(row(floor, out)), flush=True)


def note(out: Path, name: str, spent: Spent) -> None:
    (out / f"{name}.json").write_text(json.dumps(asdict(spent), indent=1) + "\n")


def row(floor: FloorToRun, out: Path) -> list[str]:
    """Build the table's cells of one floor."""
    size = [floor.name, f"{floor.width:.0f} x {floor.height:.0f}", str(floor.rooms)]
    spent = Spent(**read(out / f"{floor.name}.json")) if (out / f"{floor.name}.json").exists() else None
    cost = ["", "", ""] if spent is None else [f"{spent.wall:.0f}", f"{spent.cpu:.0f}", f"{spent.memory:.0f}"]
    if not (out / floor.name / "run.json").exists():
        remark = "not run yet" if spent is None else f"failed: {spent.error}"
        return [*size, *[""] * 8, *cost, remark]
    run = read(out / floor.name / "run.json")
    metrics, doors = run["metrics"], run["doors"]
    errors = metrics["tour"]["errors_percent"]
    return [
        *size,
        str(metrics["doors_closed"]),
        f"{100 * metrics['area_mapped']:.1f}",
        str(metrics["doors_seen"]),
        f"{metrics['ate_m']:.3f}",
        _figure(metrics["room_iou_mean"]),
        _figure(paper_iou(floor, out, set(metrics["room_iou"]))),
        " / ".join(figure(errors[kind], "{:.1f}") for kind in ("closed", "baseline", "predicted")),
        f"{run['exploration']['simulated_s']:.0f}",
        *cost,
        remark_of(run["exploration"]["status"], doors, run["notes"]),
    ]


def remark_of(status: str, doors: dict[str, Any], notes: list[str]) -> str:
    remarks = [] if status == "complete" else [f"exploration: {status}"]
    remarks += [f"not seen: {', '.join(doors['not_seen'])}"] if doors["not_seen"] else []
    remarks += [f"not predicted: {door} ({reason})" for door, reason in doors["failures"].items()]
    remarks += [text for text in notes if text.startswith("no tour")]
    return "; ".join(remarks)


def paper_iou(floor: FloorToRun, out: Path, seen: set[str]) -> float | None:
    """Measure the mean IoU by door of the method ``paper`` on the map of the run."""
    predicted = out / f"{floor.name}-paper" / "rooms.geojson"
    if not predicted.exists():
        return None
    figures = room_iou(read_rooms(predicted), read_rooms(out / floor.name / "truth_rooms.geojson"))
    return mean({door: iou for door, iou in figures.items() if door in seen})


def read(path: Path) -> dict[str, Any]:
    return dict(json.loads(path.read_text()))


def _figure(value: float | None) -> str:
    return "" if value is None else f"{value:.3f}"


def summary(rows: list[list[str]]) -> list[list[str]]:
    """Compute mean and worst of every column of figures."""
    worst = {"area mapped [%]": min, "IoU best": min, "IoU paper": min}
    lines = []
    for name in ("mean", "worst"):
        cells = [name, *[""] * (len(HEAD) - 1)]
        for column in ("area mapped [%]", "ATE [m]", "IoU best", "IoU paper", "wall [s]", "CPU [s]", "peak [MB]"):
            at = HEAD.index(column)
            values = [float(line[at]) for line in rows if line[at]]
            digits = max((len(line[at].partition(".")[2]) for line in rows if line[at]), default=0)
            if values:
                figure = statistics.mean(values) if name == "mean" else worst.get(column, max)(values)
                cells[at] = f"{figure:.{digits}f}"
        at = HEAD.index("tour error closed / baseline / predicted [%]")
        errors = [[float(v) for v in line[at].split(" / ")] for line in rows if line[at]]
        if errors:
            combine = statistics.mean if name == "mean" else max
            cells[at] = " / ".join(f"{combine(column):.1f}" for column in zip(*errors, strict=True))
        lines.append(cells)
    return lines


def write_tables(floors: list[FloorToRun], broken: dict[str, str], out: Path) -> None:
    rows = [row(floor, out) for floor in floors]
    rows += [[name, *[""] * (len(HEAD) - 2), f"not read: {reason}"] for name, reason in broken.items()]
    with (out / "floors.csv").open("w", newline="") as file:
        csv.writer(file).writerows([HEAD, *rows])
    align = ["---", *["---:"] * (len(HEAD) - 2), "---"]
    lines = [f"| {' | '.join(cells)} |" for cells in [list(HEAD), align, *rows, *summary(rows)]]
    (out / "floors.md").write_text("\n".join(lines) + "\n")
    print("\n".join(lines))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--noise", default="medium", choices=("none", "low", "medium", "high"))
    parser.add_argument("--close", type=int, default=5, help="rooms to close, or as many as the floor has")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--limit", type=float, default=1200.0, help="seconds that a process may take")
    parser.add_argument("--smallest-first", action="store_true", help="run the small floors before the large ones")
    parser.add_argument("--only-table", action="store_true", help="run nothing")
    options = parser.parse_args()
    if options.workers < 1 or not math.isfinite(options.limit):
        parser.error("--workers and --limit must be positive")
    options.out.mkdir(parents=True, exist_ok=True)
    start = time.perf_counter()
    try:
        floors, broken = find_floors(options.folder)
    except ClosedroomsError as error:
        sys.exit(str(error))
    if not floors and not broken:
        sys.exit(f"no floor plans: {options.folder}")
    if not options.only_table:
        with ThreadPoolExecutor(options.workers) as pool:
            order = floors[::-1] if options.smallest_first else floors
            for done in [pool.submit(run_floor, floor, options.out, options) for floor in order]:
                done.result()
    write_tables(floors, broken, options.out)
    print(f"{len(floors)} floors, {time.perf_counter() - start:.0f} s", file=sys.stderr)


if __name__ == "__main__":
    main()
