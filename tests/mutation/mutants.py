"""Changes one operator of a module at a time and looks whether the tests of its folder notice.

    python tests/mutation/mutants.py [FOLDER | FOLDER/MODULE.py ...] [--sample 5 | --each 20] [--seed 0] [--out FILE]

cosmic-ray makes the mutants, in a copy of the checkout; its own runner is not used, since it knows neither our layout
(folders at the root that are imported as ``closedrooms.*``) nor which tests to begin with. Of every module a sample is
drawn with a fixed seed, ``--sample 0`` takes all; ``--each`` draws so many of a folder, spread over its modules. First
the test files that name the module are run, then the rest of its folder. What is told: killed and survived by module,
and the diff of each survivor. ``survivors.csv`` beside this judges those that were looked at: survivors that change
nothing a caller could see are equivalent and count for neither side.
"""

import argparse
import ast
import difflib
import json
import os
import random
import re
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from itertools import groupby, islice, zip_longest
from pathlib import Path

from cosmic_ray.ast import ast_nodes, get_ast
from cosmic_ray.mutating import mutate_code
from cosmic_ray.plugins import get_operator, operator_names

ROOT = Path(__file__).parents[2]
FOLDERS = ("core", "worlds", "sim", "mapping", "navigation", "predictor", "coverage")
# Of the arithmetic those that stay in range: a sum that becomes a power is found by any test.
ARITHMETIC = {
    "Add_Sub", "Sub_Add", "Mul_Div", "Div_Mul", "FloorDiv_Mul", "FloorDiv_Div", "Mod_Sub", "Pow_Mul", "BitAnd_BitOr",
    "BitOr_BitAnd", "BitXor_BitOr",
}  # fmt: skip
# Operators that need arguments, and what no test is for: identity in place of equality, the kind of an exception.
LEFT_OUT = re.compile(r"_Is|Is_|IsNot|_Invert|_UAdd|UAdd_|USub_Not|Variable|ExceptionReplacer|RemoveDecorator")
# Tests that take more processor time than this hang: all of one folder take two minutes [s].
HANGS = 400
# After this time on a busy machine it cannot be told [s].
PATIENCE = 1800


@dataclass(frozen=True)
class Mutant:
    """One change of one module.

    Attributes:
        module: Path in the checkout.
        operator: Name of cosmic-ray's operator.
        occurrence: Which place in the module.
        line: Where, from 1.
        changed: Source of the whole module.
    """

    module: str
    operator: str
    occurrence: int
    line: int
    changed: str


@dataclass(frozen=True)
class Result:
    """What became of a mutant, ``killed``, ``survived`` or ``timeout`` (counts for neither side), and by which test."""

    module: str
    operator: str
    occurrence: int
    line: int
    outcome: str
    noticed: str
    diff: str


def mutants(source: str, module: str, sample: int, rng: random.Random) -> list[Mutant]:
    """A sample of the mutants of a module that are other programs: no annotations, no texts.

    Places are drawn first and then an operator for each, so that operators with many variants do not crowd out the
    others.
    """
    skipped, tree = _annotations(source), get_ast(source)
    places: dict[tuple[int, int], list[tuple[str, int]]] = {}
    for name in operator_names():
        if LEFT_OUT.search(name) or ("BinaryOperator" in name and name.partition("_")[2] not in ARITHMETIC):
            continue
        operator, occurrence = get_operator(name)(), 0
        for node in ast_nodes(tree):
            for start, _ in operator.mutation_positions(node):
                if start not in skipped:
                    places.setdefault(start, []).append((name, occurrence))
                occurrence += 1
    chosen = sorted(places)
    if sample:
        chosen = sorted(rng.sample(chosen, min(sample, len(chosen))))
    found = []
    for place in chosen:
        name, occurrence = rng.choice(places[place])
        changed = mutate_code(source, get_operator(name)(), occurrence)
        if changed is not None and _differs(source, changed):
            found.append(Mutant(module, name.removeprefix("core/"), occurrence, place[0], changed))
    return found


def spread(modules: Sequence[str], root: Path, each: int, seed: int) -> list[Mutant]:
    """So many mutants of a folder: one of each module in turn, in an order and at places that the seed draws."""
    order = list(modules)
    random.Random(f"{seed} {Path(order[0]).parts[0]}").shuffle(order)
    piles = []
    for module in order:
        rng = random.Random(f"{seed} {module}")
        pile = mutants((root / module).read_text(), module, -(-each // len(order)) * 2, rng)
        rng.shuffle(pile)
        piles.append(pile)
    rounds = (mutant for turn in zip_longest(*piles) for mutant in turn if mutant is not None)
    return list(islice(rounds, each))


def _annotations(source: str) -> set[tuple[int, int]]:
    """Positions (line, column) inside annotations and type aliases."""
    found: set[tuple[int, int]] = set()
    for node in ast.walk(ast.parse(source)):
        inner = [getattr(node, "annotation", None), getattr(node, "returns", None)]
        for annotation in inner:
            if annotation is not None:
                lines = range(annotation.lineno, (annotation.end_lineno or annotation.lineno) + 1)
                for line in lines:
                    first = annotation.col_offset if line == lines[0] else 0
                    last = annotation.end_col_offset if line == lines[-1] else 200
                    found |= {(line, column) for column in range(first, last or 0)}
    return found


def _differs(source: str, changed: str) -> bool:
    try:
        return ast.dump(ast.parse(source)) != ast.dump(ast.parse(changed))
    except SyntaxError:
        return False


def test_files(root: Path, module: str) -> list[list[Path]]:
    """The tests of a module in two lots: the files that name it, then the others of its folder."""
    path = Path(module)
    folder = root / "tests" / path.parts[0]
    dotted = "closedrooms." + ".".join(path.with_suffix("").parts)
    everything = sorted(folder.rglob("test_*.py"))
    first = [file for file in everything if dotted in file.read_text() or file.stem == f"test_{path.stem}"]
    return [first, [file for file in everything if file not in first]]


def fate(root: Path, mutant: Mutant, pytest: str) -> tuple[str, str]:
    """Put a mutant in its place, run the tests and put the module back.

    Returns:
        What became of it, and the test that noticed.
    """
    path = root / mutant.module
    original = path.read_text()
    environment = os.environ | {
        "PYTHONPATH": str(root / ".typing"),
        "PYTHONDONTWRITEBYTECODE": "1",
        "OMP_NUM_THREADS": "1",
        "OPENBLAS_NUM_THREADS": "1",
    }
    try:
        path.write_text(mutant.changed)
        for lot in test_files(root, mutant.module):
            if not lot:
                continue
            words = [pytest, "-x", "-q", "-p", "no:cacheprovider", *map(str, lot)]
            try:
                done = subprocess.run(
                    words, cwd=root, env=environment, capture_output=True, timeout=PATIENCE, check=False,
                    preexec_fn=_end_hangs,
                )  # fmt: skip
            except subprocess.TimeoutExpired:
                return "timeout", ""
            if done.returncode not in {0, 5}:
                noticed = re.search(rb"^(?:FAILED|ERROR) (\S+)", done.stdout, re.MULTILINE)
                return "killed", noticed[1].decode() if noticed else f"status {done.returncode}"
        return "survived", ""
    finally:
        path.write_text(original)


def _end_hangs() -> None:
    # A job in the background of a script ignores Ctrl-C, and so would the tests of it.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    resource.setrlimit(resource.RLIMIT_CPU, (HANGS, HANGS))


def _copy(root: Path) -> None:
    """The files of the checkout that git knows, or would take."""
    listing = subprocess.run(
        ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"],
        cwd=ROOT,
        capture_output=True,
        check=True,
    )
    for name in listing.stdout.decode().split("\0"):
        source = ROOT / name
        if name and source.is_file():
            target = root / name
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(source, target)
    (root / ".typing").mkdir(exist_ok=True)
    if not (root / ".typing" / "closedrooms").exists():
        (root / ".typing" / "closedrooms").symlink_to("..")


def _modules(wanted: list[str]) -> list[str]:
    paths = [ROOT / name for name in wanted]
    files = [file for path in paths for file in ([path] if path.is_file() else sorted(path.rglob("*.py")))]
    return [file.relative_to(ROOT).as_posix() for file in files if file.name != "__init__.py"]


def main() -> int:
    """Try the mutants, print a table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("wanted", nargs="*", default=list(FOLDERS))
    parser.add_argument("--sample", type=int, default=5, help="places a module; 0 for all")
    parser.add_argument("--each", type=int, default=0, help="places a folder, in place of --sample")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--pytest", default=str(Path(sys.executable).with_name("pytest")))
    parser.add_argument("--out", type=Path, default=Path("mutants.json"))
    options = parser.parse_args()
    # The same command goes on where it stopped.
    results = [Result(**value) for value in json.loads(options.out.read_text())] if options.out.exists() else []
    done = {(result.module, result.operator, result.occurrence) for result in results}
    with tempfile.TemporaryDirectory(prefix="mutants-") as scratch:
        root = Path(scratch)
        _copy(root)
        for mutant in _drawn(root, options):
            if (mutant.module, mutant.operator, mutant.occurrence) in done:
                continue
            outcome, noticed = fate(root, mutant, options.pytest)
            before = (root / mutant.module).read_text()
            lines = difflib.unified_diff(before.splitlines(), mutant.changed.splitlines(), n=0, lineterm="")
            diff = "\n".join(line for line in lines if not line.startswith(("---", "+++", "@@")))
            place = (mutant.module, mutant.operator, mutant.occurrence, mutant.line)
            results.append(Result(*place, outcome, noticed, diff))
            sys.stdout.write(f"{outcome:<8} {mutant.module}:{mutant.line} {mutant.operator}\n")
            sys.stdout.write(f"{diff}\n" if outcome != "killed" else "")
            sys.stdout.flush()
            options.out.write_text(json.dumps([asdict(result) for result in results], indent=1) + "\n")
    for place in [*dict.fromkeys(result.module for result in results), *FOLDERS]:
        own = [result.outcome for result in results if result.module == place or result.module.startswith(f"{place}/")]
        if own:
            killed, decided = own.count("killed"), len(own) - own.count("timeout")
            sys.stdout.write(f"{place:<50} {killed:4d} of {decided:4d} killed, {len(own) - decided} without answer\n")
    return 0


def _drawn(root: Path, options: argparse.Namespace) -> Iterator[Mutant]:
    """The mutants that are asked for, with ``--each`` one of each folder in turn."""
    modules = _modules(options.wanted)
    if options.each:
        folders = [list(own) for _, own in groupby(modules, key=lambda module: Path(module).parts[0])]
        piles = [spread(own, root, options.each, options.seed) for own in folders]
        yield from (mutant for turn in zip_longest(*piles) for mutant in turn if mutant is not None)
        return
    for module in modules:
        # Of its own for each module: what one holds does not change the draw of the next.
        rng = random.Random(f"{options.seed} {module}")
        yield from mutants((root / module).read_text(), module, options.sample, rng)


if __name__ == "__main__":
    sys.exit(main())
