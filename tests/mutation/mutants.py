"""Changes one operator of a module at a time and looks whether the tests of its folder notice.

    python tests/mutation/mutants.py [FOLDER | FOLDER/MODULE.py ...] [--sample 5] [--seed 0] [--out mutants.json]

cosmic-ray makes the mutants, in a copy of the checkout; its own runner is not used, since it knows neither our layout
(folders at the root that are imported as ``closedrooms.*``) nor which tests to begin with. Of every module a sample is
drawn with a fixed seed, ``--sample 0`` takes all. First the test files that name the module are run, then the rest of
its folder. What is told: killed and survived by module, and the diff of each survivor.
"""

import argparse
import ast
import difflib
import json
import os
import random
import re
import shutil
import subprocess
import sys
import tempfile
from dataclasses import asdict, dataclass
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
# A mutant that hangs is killed after this time [s].
PATIENCE = 240


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
    """What became of a mutant: ``killed``, ``survived`` or ``timeout`` (counted as killed)."""

    module: str
    operator: str
    occurrence: int
    line: int
    outcome: str
    diff: str


def mutants(path: Path, module: str, sample: int, rng: random.Random) -> list[Mutant]:
    """A sample of the mutants of a module that are other programs: no annotations, no texts.

    Places are drawn first and then an operator for each, so that operators with many variants do not crowd out the
    others.
    """
    source = path.read_text()
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


def fate(root: Path, mutant: Mutant, pytest: str) -> str:
    """Put a mutant in its place, run the tests and put the module back."""
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
                    words, cwd=root, env=environment, capture_output=True, timeout=PATIENCE, check=False
                )
            except subprocess.TimeoutExpired:
                return "timeout"
            if done.returncode not in {0, 5}:
                return "killed"
        return "survived"
    finally:
        path.write_text(original)


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
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--pytest", default=str(Path(sys.executable).with_name("pytest")))
    parser.add_argument("--out", type=Path, default=Path("mutants.json"))
    options = parser.parse_args()
    results: list[Result] = []
    with tempfile.TemporaryDirectory(prefix="mutants-") as scratch:
        root = Path(scratch)
        _copy(root)
        for module in _modules(options.wanted):
            # Of its own for each module: what one holds does not change the draw of the next.
            rng = random.Random(f"{options.seed} {module}")
            own: list[Result] = []
            source = (root / module).read_text()
            for mutant in mutants(root / module, module, options.sample, rng):
                outcome = fate(root, mutant, options.pytest)
                lines = difflib.unified_diff(source.splitlines(), mutant.changed.splitlines(), n=0, lineterm="")
                diff = "\n".join(line for line in lines if not line.startswith(("---", "+++", "@@")))
                own.append(Result(module, mutant.operator, mutant.occurrence, mutant.line, outcome, diff))
                if outcome == "survived":
                    sys.stdout.write(f"survived {module}:{mutant.line} {mutant.operator}\n{diff}\n")
                    sys.stdout.flush()
            if own:
                killed = sum(result.outcome != "survived" for result in own)
                sys.stdout.write(f"{module:<50} {killed} of {len(own)} killed\n")
                sys.stdout.flush()
            results += own
            options.out.write_text(json.dumps([asdict(result) for result in results], indent=1) + "\n")
    for folder in FOLDERS:
        own = [result for result in results if result.module.startswith(f"{folder}/")]
        if own:
            killed = sum(result.outcome != "survived" for result in own)
            sys.stdout.write(f"{folder:<12} {killed:4d} of {len(own):4d} killed, {killed / len(own):.0%}\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
