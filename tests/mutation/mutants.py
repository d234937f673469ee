"""Changes one operator of a module at a time and looks whether the tests of its folder notice.

    python tests/mutation/mutants.py [FOLDER | FOLDER/MODULE.py ...] [--sample 5 | --each 20] [--seed 0] [--out FILE]

cosmic-ray makes the mutants, in a copy of the checkout; its own runner is not used, since it knows neither our layout
(folders at the root that are imported as ``closedrooms.*``) nor which tests to begin with. Of every module a sample is
drawn with a fixed seed, ``--sample 0`` takes all; ``--each`` draws so many of a folder, spread over its modules. The
tests of a folder are run once to see which functions each reaches; a mutant then meets those that reach what it
changes, the quickest first. The same command goes on where it stopped. What is told: killed and survived by module, and
the diff of each survivor. ``survivors.csv`` beside this judges those that were looked at: survivors that change nothing
a caller could see are equivalent and count for neither side.
"""

import argparse
import ast
import compileall
import contextlib
import difflib
import hashlib
import importlib
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
import time
import traceback
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from itertools import groupby, islice, zip_longest
from pathlib import Path
from py_compile import PycInvalidationMode

from cosmic_ray.ast import ast_nodes, get_ast
from cosmic_ray.mutating import mutate_code
from cosmic_ray.plugins import get_operator, operator_names

ROOT = Path(__file__).parents[2]
FOLDERS = ("core", "worlds", "sim", "mapping", "navigation", "predictor", "coverage")
# What it says of the classes of every folder is of the source, so no test is seen to reach it.
OF_SOURCES = "tests/test_values.py"
# Of the arithmetic those that stay in range: a sum that becomes a power is found by any test.
ARITHMETIC = {
    "Add_Sub", "Sub_Add", "Mul_Div", "Div_Mul", "FloorDiv_Mul", "FloorDiv_Div", "Mod_Sub", "Pow_Mul", "BitAnd_BitOr",
    "BitOr_BitAnd", "BitXor_BitOr",
}  # fmt: skip
# Operators that need arguments, and what no test is for: identity in place of equality, the kind of an exception.
LEFT_OUT = re.compile(r"_Is|Is_|IsNot|_Invert|_UAdd|UAdd_|USub_Not|Variable|ExceptionReplacer|RemoveDecorator")
# Imported once, before the tests of each mutant are forked off.
LIBRARIES = (
    "numpy", "scipy.ndimage", "scipy.optimize", "scipy.sparse.linalg", "scipy.spatial", "shapely.ops", "cv2",
    "PIL.Image", "yaml", "networkx", "hypothesis.extra.numpy", "_pytest.python", "sklearn.cluster",
    "skimage.morphology", "rich.console", "defusedxml.ElementTree",
)  # fmt: skip
# A test that takes so many times longer than it did, and some seconds, hangs; tests that take more memory never end.
HANGS, MORE, MEMORY = 4, 5.0, 6_000_000_000
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
    """Fate of a mutant, ``killed``, ``survived`` or ``timeout`` (counts for neither side), and the test that told."""

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


@dataclass(frozen=True)
class Reach:
    """Code that a test of a folder reaches.

    Attributes:
        test: Its id.
        seconds: Processor time that it took.
        functions: Where the functions that it ran are defined, as ``module:line``.
        processes: Whether it started any: what they run is not seen.
    """

    test: str
    seconds: float
    functions: frozenset[str]
    processes: bool


def reaches(root: Path, folder: str, kept: Path) -> list[Reach]:
    """What each test of a folder reaches, by running them once; taken from ``kept`` where nothing has changed since.

    Where only tests have changed, only the files that did are run again.

    Raises:
        RuntimeError: The tests do not run.
    """
    tests = sorted((root / "tests" / folder).rglob("*.py"))
    files = [path for path in tests if path.name.startswith("test_")]
    key = _digest([*sorted((root / folder).rglob("*.py")), *(path for path in tests if path not in files)])
    known = json.loads(kept.read_text()) if kept.exists() else {}
    own = known.get(folder, {})
    own = own if own.get("key") == key else {"key": key, "files": {}}
    digests = {path.relative_to(root).as_posix(): _digest([path]) for path in files}
    own["files"] = {name: kept for name, kept in own["files"].items() if kept["key"] == digests.get(name)}
    if new := [name for name in digests if name not in own["files"]]:
        seen = root / "reached.json"
        seen.unlink(missing_ok=True)
        _, said = run_tests(root, ["-p", "reached", *new], seen=seen)
        if not seen.exists():
            raise RuntimeError(f"the tests of {folder} do not run:\n{said}")
        own["files"] |= {name: {"key": digests[name], "tests": []} for name in new}
        for test in json.loads(seen.read_text()):
            if test["passed"]:
                own["files"][test["test"].partition("::")[0]]["tests"].append(test)
        known[folder] = own
        kept.write_text(json.dumps(known))
    return [
        Reach(test["test"], test["seconds"], frozenset(test["functions"]), test["processes"])
        for file in own["files"].values()
        for test in file["tests"]
    ]


def _digest(paths: Sequence[Path]) -> str:
    return hashlib.sha256(b"".join(path.read_bytes() for path in paths)).hexdigest()


def lots(source: str, mutant: Mutant, tests: Sequence[Reach]) -> list[list[str]]:
    """The tests of a mutant in two lots, the quickest first.

    First those that reach the function that it changes; what it changes outside of functions is reached by all that
    reach the module. Then the others of their files, with which they may share a set-up, and those that start
    processes. Nothing else of the folder runs the line, but for what a cache remembers: a mutant that lives is to be
    looked at.
    """
    inside = [
        node
        for node in ast.walk(ast.parse(source))
        if isinstance(node, ast.FunctionDef | ast.Lambda) and _first(node) <= mutant.line <= (node.end_lineno or 0)
    ]
    place = f"{mutant.module}:{max(map(_first, inside), default=0)}"
    reaching = {test.test for test in tests if place in test.functions}
    if not inside or not reaching:
        reaching = {test.test for test in tests if any(f.startswith(f"{mutant.module}:") for f in test.functions)}
    files = {test.partition("::")[0] for test in reaching}
    quickest = sorted(tests, key=lambda test: test.seconds)
    # Heads of functions, as all that is outside of them, are held to rules.
    ruled = not inside or any(mutant.line < node.body[0].lineno for node in inside if isinstance(node, ast.FunctionDef))
    first = [*([OF_SOURCES] if ruled else []), *(test.test for test in quickest if test.test in reaching)]
    others = [
        test.test
        for test in quickest
        if test.test not in reaching and (test.processes or test.test.partition("::")[0] in files)
    ]
    return [lot for lot in (first, others) if lot]


def _first(node: ast.FunctionDef | ast.Lambda) -> int:
    # As the interpreter counts: a decorated function begins at its first decorator.
    decorators = node.decorator_list if isinstance(node, ast.FunctionDef) else []
    return min([node.lineno, *(decorator.lineno for decorator in decorators)])


def fate(root: Path, mutant: Mutant, tests: Sequence[Reach]) -> tuple[str, str]:
    """Put a mutant in its place, run the tests and put the module back.

    Returns:
        What became of it, and the test that noticed.
    """
    path = root / mutant.module
    original = path.read_text()
    try:
        path.write_text(mutant.changed)
        for lot in lots(original, mutant, tests):
            listed = root / "lot.txt"
            listed.write_text("\n".join(lot))
            status, said = run_tests(root, ["-x", f"@{listed}"], usual={test.test: test.seconds for test in tests})
            if status is None:
                return "timeout", ""
            if status not in {0, 5}:
                noticed = re.search(r"^(?:FAILED|ERROR) (.+?)(?: - |$)", said, re.MULTILINE)
                return "killed", noticed[1] if noticed else f"status {status}"
        return "survived", ""
    finally:
        path.write_text(original)


def run_tests(
    root: Path, words: Sequence[str], *, seen: Path | None = None, usual: Mapping[str, float] | None = None
) -> tuple[int | None, str]:
    """Run pytest in a child of this process, which has the libraries already.

    Args:
        root: The copy of the checkout.
        words: Arguments of pytest.
        seen: Where the plugin ``reached`` writes.
        usual: Processor time that each test takes as a rule; the child ends at the first that hangs.

    Returns:
        Its status, ``None`` where there was no answer in time, and what it said.
    """
    with tempfile.TemporaryFile("w+") as said:
        child = os.fork()
        if child == 0:
            try:
                _become_tests(root, said.fileno(), seen)
                import pytest

                # hypothesis, which pytest would rewrite, is imported already.
                words = ["-W", "ignore::pytest.PytestAssertRewriteWarning", *words]
                words = ["-q", "-p", "no:cacheprovider", "-p", "no:xdist", *words]
                status = int(pytest.main(words, plugins=[] if usual is None else [_Watch(usual)]))
            except BaseException:
                traceback.print_exc()
                status = 99
            sys.stdout.flush()
            os._exit(status)
        end = time.monotonic() + PATIENCE
        while (ended := os.waitpid(child, os.WNOHANG))[0] == 0 and time.monotonic() < end:
            time.sleep(0.1)
        if ended[0] == 0:
            os.killpg(child, signal.SIGKILL)
            os.waitpid(child, 0)
        said.seek(0)
        return (os.waitstatus_to_exitcode(ended[1]) if ended[0] else None), said.read()


class _Watch:
    """Plugin of pytest: a test that hangs ends the process by SIGPROF."""

    def __init__(self, usual: Mapping[str, float]) -> None:
        self._usual = usual

    def pytest_runtest_logstart(self, nodeid: str) -> None:
        signal.setitimer(signal.ITIMER_PROF, HANGS * self._usual.get(nodeid, 30.0) + MORE)

    def pytest_runtest_logfinish(self, nodeid: str) -> None:  # noqa: ARG002 (pytest gives it)
        signal.setitimer(signal.ITIMER_PROF, 0)


def _become_tests(root: Path, said: int, seen: Path | None) -> None:
    os.setsid()
    os.dup2(said, 1)
    os.dup2(said, 2)
    os.chdir(root)
    sys.path.insert(0, str(root / ".typing"))
    os.environ |= {
        "PYTHONPATH": str(root / ".typing"), "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1",
        "REACHED": str(seen or ""),
    }  # fmt: skip
    # A job in the background of a script ignores Ctrl-C, and so would the tests of it.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))


def _warm() -> None:
    """Import what the tests import, but for our own."""
    for name in LIBRARIES:
        with contextlib.suppress(ImportError):
            importlib.import_module(name)


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
    # By the content of the source, not by its time: a mutant of the same second and size is compiled again.
    compileall.compile_dir(root, quiet=1, invalidation_mode=PycInvalidationMode.CHECKED_HASH)


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
    parser.add_argument("--out", type=Path, default=Path("mutants.json"))
    options = parser.parse_args()
    results = [Result(**value) for value in json.loads(options.out.read_text())] if options.out.exists() else []
    done = {(result.module, result.operator, result.occurrence) for result in results}
    kept, reach = options.out.with_suffix(".reached.json"), dict[str, list[Reach]]()
    _warm()
    with tempfile.TemporaryDirectory(prefix="mutants-") as scratch:
        root = Path(scratch).resolve()
        _copy(root)
        for mutant in _drawn(root, options):
            if (mutant.module, mutant.operator, mutant.occurrence) in done:
                continue
            folder = Path(mutant.module).parts[0]
            if folder not in reach:
                reach[folder] = reaches(root, folder, kept)
            outcome, noticed = fate(root, mutant, reach[folder])
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
