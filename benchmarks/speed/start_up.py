"""How long commands take on small inputs, most of it start-up: CPU seconds, and how many times quicker than before.

    python benchmarks/speed/start_up.py [--calls N] [--quick] [--baseline SOURCE] [--samples FOLDER ...] [--csv]

SOURCE is the source of another version of this program, its ``.typing`` folder included; both are called in turn, and
the last column is the median of the ratios of neighbours, before / now: above 1 is quicker. Each command is called once
more before, for the byte code, which an installation has from its beginning. ``--quick`` calls each three times and
simulates nothing. ``--samples`` predicts on the maps of these folders too; ``--csv`` prints rows for docs/results.
"""

import argparse
import itertools
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
    environment |= {"OPENBLAS_NUM_THREADS": "1", "PYTHONPYCACHEPREFIX": str(out.parent / "byte-code")}
    environment.pop("PYTHONDONTWRITEBYTECODE", None)
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


def predictions(samples: list[Path]) -> dict[str, tuple[str, ...]]:
    """List the command lines that predict on samples, by name."""
    return {
        f"predict best, {sample.parent.name[:12]}/{sample.name}": (
            "predict", str(sample / "map.yaml"), "--doors", str(sample / "doors.geojson"), "--out", "OUT",
        )
        for sample in map(Path.resolve, samples)
    }  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--calls", type=int, default=7)
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--baseline", type=Path)
    parser.add_argument("--samples", type=Path, nargs="*", default=[], help="folders with map.yaml and doors.geojson")
    parser.add_argument("--only", nargs="*", help="beginnings of the names of what is called")
    parser.add_argument("--csv", action="store_true")
    options = parser.parse_args()
    calls = 3 if options.quick else options.calls
    sources = [HERE, *([options.baseline.resolve()] if options.baseline else [])]
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        prepare_inputs(folder)
        lines = {name: words for name, words in commands(folder).items() if not (options.quick and name in SIMULATED)}
        lines |= predictions(options.samples)
        if options.only:
            lines = {name: words for name, words in lines.items() if name.startswith(tuple(options.only))}
        if "evaluate" in lines:
            call(HERE, (*commands(folder)["dataset"][:-1], str(folder / "data")), folder / "none")
        print_row(options.csv, "command", "CPU s", *(["before", "before / now"] if options.baseline else []))
        outs = (folder / f"out-{number}" for number in itertools.count())
        for name, words in lines.items():
            for source in sources:
                call(source, words, next(outs))
            times = [[call(source, words, next(outs)) for source in sources] for _ in range(calls)]
            figures = [f"{median(column):.3f}" for column in zip(*times, strict=True)]
            if options.baseline:
                figures.append(f"{median(before / now for now, before in times):.2f}")
            print_row(options.csv, name, *figures)


def print_row(as_csv: bool, name: str, *figures: str) -> None:
    """Print a row of the table, or of the file."""
    text = ",".join([f'"{name}"', *figures]) if as_csv else name.ljust(36) + "".join(f"{f:>14}" for f in figures)
    print(text, flush=True)


if __name__ == "__main__":
    main()
