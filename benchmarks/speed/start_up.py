"""How long commands take on small inputs, most of it start-up: CPU seconds, and how many times quicker than before.

    python benchmarks/speed/start_up.py [--calls N] [--quick] [--baseline SOURCE]

SOURCE is the source of another version of this program, its ``.typing`` folder included; both are called in turn, and
the last column is the median of the ratios of neighbours, before / now: above 1 is quicker. The first row is an empty
Python, to be taken off when machines are compared. ``--quick`` calls each three times and simulates nothing.
"""

import argparse
import os
import resource
import subprocess
import sys
import tempfile
from dataclasses import fields
from pathlib import Path
from statistics import median

from closedrooms.sim.config import SimConfig

HERE = Path(__file__).resolve().parents[2]
# The entry point moved since; the first that a source has is called.
ENTRIES = ("cli/commands.py", "pipeline/commands.py")
SIMULATED = ("run", "dataset", "evaluate")


def commands(folder: Path) -> dict[str, tuple[str, ...]]:
    """List the command lines by name; OUT is where each call writes."""
    doors = str(folder / "doors.geojson")
    truth = str(folder / "truth.yaml")
    # Without physics, where it can be chosen: the same work in every version.
    chosen = any(item.name == "body" for item in fields(SimConfig))
    body = ("--sim.body", "kinematic") if chosen else ()
    quick = ("--repetitions", "1", "--max-closed", "3", "--workers", "1")
    return {
        "--help": ("--help",),
        "worlds list": ("worlds", "list"),
        "predict best": ("predict", truth, "--doors", doors, "--out", "OUT"),
        "predict paper": ("predict", truth, "--doors", doors, "--method", "paper", "--out", "OUT"),
        "cover": ("cover", truth, "--doors", doors, "--out", "OUT"),
        "run": ("run", "office-01", "--no-record", *body, "--out", "OUT"),
        "dataset": ("dataset", "office-01", *quick, "--out", "OUT"),
        "evaluate": ("evaluate", str(folder / "data"), "--workers", "1", "--methods", "best", "--out", "OUT"),
    }


def call(source: Path, words: tuple[str, ...], out: Path) -> float:
    """Measure user and system time of one command [s].

    Raises:
        subprocess.CalledProcessError: It failed; 3 is part of the work.
    """
    entry = next(name for name in ENTRIES if (source / name).exists())
    module = "closedrooms." + entry.removesuffix(".py").replace("/", ".")
    line = [sys.executable, "-m", module, *(str(out) if word == "OUT" else word for word in words)]
    # Older versions know one body only, and no option for it.
    if entry != ENTRIES[0]:
        line = ["--preset" if word == "--method" else word for word in line]
        if "--sim.body" in line:
            at = line.index("--sim.body")
            del line[at : at + 2]
    environment = {**os.environ, "PYTHONPATH": str(source / ".typing"), "OMP_NUM_THREADS": "1"}
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run(line, capture_output=True, text=True, check=False, env=environment, cwd=out.parent)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    if done.returncode not in {0, 3}:
        raise subprocess.CalledProcessError(done.returncode, line, done.stdout, done.stderr)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def prepare_inputs(folder: Path) -> None:
    """Make a map with proposed doors, and three samples to evaluate."""
    words = ("worlds", "convert", "office-02", str(folder / "truth.yaml"), "--to", "rosmap")
    call(HERE, words, folder / "none")
    call(HERE, ("doors", str(folder / "truth.yaml"), "--out", str(folder / "doors.geojson")), folder / "none")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--calls", type=int, default=7)
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--baseline", type=Path)
    options = parser.parse_args()
    calls = 3 if options.quick else options.calls
    sources = [HERE, *([options.baseline.resolve()] if options.baseline else [])]
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        prepare_inputs(folder)
        lines = {name: words for name, words in commands(folder).items() if not (options.quick and name in SIMULATED)}
        if "evaluate" in lines:
            call(HERE, (*lines["dataset"][:-1], str(folder / "data")), folder / "none")
        print(f"{'command':<16}{'CPU s':>8}" + (f"{'before':>9}{'before / now':>14}" if options.baseline else ""))
        for name, words in lines.items():
            times = [
                [
                    call(source, words, folder / f"{name.replace(' ', '-')}-{i}-{number}")
                    for i, source in enumerate(sources)
                ]
                for number in range(calls)
            ]
            now = median(pair[0] for pair in times)
            row = f"{name:<16}{now:8.3f}"
            if options.baseline:
                row += f"{median(p[1] for p in times):9.3f}{median(p[1] / p[0] for p in times):14.2f}"
            print(row, flush=True)


if __name__ == "__main__":
    main()
