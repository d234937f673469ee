"""How long the command line takes to show its help: CPU seconds, medians of several calls.

    python benchmarks/start_up.py [--calls N]

The first row is an empty Python, to be taken off when machines are compared.
"""

import argparse
import resource
import subprocess
import sys
from statistics import median

from closedrooms.cli.table import COMMANDS

PROGRAM = (sys.executable, "-m", "closedrooms.cli")


def cpu_seconds(words: tuple[str, ...], calls: int) -> float:
    """Median of user and system time of a command [s]."""
    seconds = []
    for _ in range(calls):
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        subprocess.run(words, check=True, capture_output=True)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        seconds.append(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)
    return median(seconds)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--calls", type=int, default=9)
    calls = parser.parse_args().calls
    print(f"{'an empty Python':<24}{cpu_seconds((sys.executable, '-c', 'pass'), calls):6.3f} s")
    print(f"{'--help':<24}{cpu_seconds((*PROGRAM, '--help'), calls):6.3f} s")
    for command in COMMANDS:
        print(f"{command.name:<24}{cpu_seconds((*PROGRAM, *command.name.split(), '--help'), calls):6.3f} s")


if __name__ == "__main__":
    main()
