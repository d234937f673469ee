"""What a dataset costs by who makes it: local workers, and a Dask cluster of this machine.

    python benchmarks/speed/dataset_throughput.py [WORLD ...] [--repetitions 6] [--rounds 3] [--format folders]
                                                [--quick]

Each round makes the same dataset once with each, in turn; figures are medians over the rounds. CPU time is user and
system time of all processes that take part, of the cluster (scheduler, two workers with one thread each, their
nannies) what they use while the command runs: a cluster is there before and after. The last column is "ours / best
known", CPU time against one local worker, which has nobody to talk to. The cluster's first dataset, in which its
workers import what they need, stands in a line of its own: it is paid once.
"""

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from statistics import median

COMMAND = [sys.executable, "-c", "import sys; from closedrooms.cli.commands import main; sys.exit(main())"]
TICKS = os.sysconf("SC_CLK_TCK")
FIRST, CLUSTER = "Dask, first", "Dask, 2 workers"


@dataclass(frozen=True)
class Cost:
    """User and system time of all processes, and what a clock says [s]."""

    cpu: float
    wall: float


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("worlds", nargs="*", default=["office-01", "office-02"])
    parser.add_argument("--repetitions", type=int, default=6)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--format", default="folders", choices=("folders", "shards"))
    parser.add_argument("--quick", action="store_true", help="one building, one round")
    options = parser.parse_args()
    if options.quick:
        options.worlds, options.repetitions, options.rounds = ["office-01"], 2, 1
    words = ["dataset", *options.worlds, "--repetitions", str(options.repetitions), "--format", options.format, "-q"]
    found: dict[str, list[Cost]] = {}
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        with cluster(folder) as (address, pids):
            who = {"1 worker": ["--workers", "1"], "2 workers": ["--workers", "2"], CLUSTER: ["--scheduler", address]}
            found[FIRST] = [make_dataset([*words, *who[CLUSTER]], folder / "first", pids)]
            for number in range(options.rounds):
                for name, chosen in who.items():
                    cost = make_dataset([*words, *chosen], folder / f"{number}-{name.replace(' ', '-')}", pids)
                    found.setdefault(name, []).append(cost)
        samples = len(json.loads((folder / "first" / "manifest.json").read_text()).get("samples", ())) or None
    best = median(cost.cpu for cost in found["1 worker"])
    print(f"{samples or '?'} samples, {', '.join(options.worlds)}, {options.format}, {options.rounds} rounds")
    print(f"{'who':<18}{'CPU s':>8}{'wall s':>8}{'ours / best known':>20}")
    for name, costs in found.items():
        cpu, wall = median(c.cpu for c in costs), median(c.wall for c in costs)
        print(f"{name:<18}{cpu:>8.2f}{wall:>8.2f}{cpu / best:>20.2f}")


def make_dataset(words: list[str], out: Path, pids: list[int]) -> Cost:
    """Make a dataset; whatever the cluster uses meanwhile counts."""
    own = resource.getrusage(resource.RUSAGE_CHILDREN)
    others = {pid: used(pid) for pid in everybody(pids)}
    begin = time.perf_counter()
    subprocess.run([*COMMAND, *words, "--out", str(out)], check=True, stderr=subprocess.DEVNULL)
    wall = time.perf_counter() - begin
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu = after.ru_utime + after.ru_stime - own.ru_utime - own.ru_stime
    return Cost(cpu + sum(used(pid) - others.get(pid, 0.0) for pid in everybody(pids)), wall)


def everybody(pids: list[int]) -> list[int]:
    """List processes and all that they have begun."""
    found = []
    for pid in pids:
        found.append(pid)
        for tasks in Path(f"/proc/{pid}/task").glob("*/children"):
            found += everybody([int(child) for child in tasks.read_text().split()])
    return found


def used(pid: int) -> float:
    """Measure user and system time of a process so far [s]."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(") ")[2].split()
    return (int(fields[11]) + int(fields[12])) / TICKS


@contextmanager
def cluster(folder: Path) -> Iterator[tuple[str, list[int]]]:
    """Start a scheduler and two workers of one thread, as docs/datasets.md does; yield address and processes."""
    where = folder / "scheduler.json"
    common = ["--no-dashboard", "--scheduler-file", str(where)]
    scheduler = [sys.executable, "-m", "dask", "scheduler", "--host", "127.0.0.1", "--port", "0", *common]
    processes = [subprocess.Popen(scheduler, stderr=subprocess.DEVNULL)]
    try:
        while not where.exists() or not where.read_text().strip().endswith("}"):
            time.sleep(0.05)
        address = json.loads(where.read_text())["address"]
        line = [sys.executable, "-m", "dask", "worker", address, "--nworkers", "2", "--nthreads", "1"]
        line += ["--no-dashboard", "--host", "127.0.0.1", "--local-directory", str(folder / "dask")]
        processes.append(subprocess.Popen(line, stderr=subprocess.DEVNULL))
        yield address, [process.pid for process in processes]
    finally:
        for process in reversed(processes):
            process.terminate()
            process.wait()


if __name__ == "__main__":
    main()
