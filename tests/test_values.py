"""Mutable state lives in few places: other dataclasses of the stages are frozen, and none with arrays is compared."""

import ast
import re
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
FOLDERS = ("core", "worlds", "sim", "mapping", "navigation", "predictor", "coverage")
# What is built up step by step, by whoever owns it.
GROWING = {
    "_Claims", "_Open", "_Scan", "Sketch", "SketchPassage", "Keyframe", "PoseGraph", "CarmenLog", "BagMessages",
    "_Link", "EventLog", "Rater", "Growth", "_Branch",
}  # fmt: skip


@cache
def trees(folder: str) -> list[tuple[Path, ast.Module]]:
    return [(path, ast.parse(path.read_text())) for path in sorted((ROOT / folder).rglob("*.py"))]


def dataclasses(folder: str) -> Iterator[tuple[str, dict[str, bool], ast.ClassDef]]:
    """Every dataclass of a folder with what its decorator says."""
    for path, tree in trees(folder):
        for node in ast.walk(tree):
            for decorator in getattr(node, "decorator_list", []) if isinstance(node, ast.ClassDef) else []:
                call = decorator if isinstance(decorator, ast.Call) else None
                if ast.unparse(call.func if call else decorator).split(".")[-1] == "dataclass":
                    said = {word.arg: word.value.value for word in call.keywords} if call else {}
                    yield f"{path.relative_to(ROOT)}: {node.name}", said, node


@pytest.mark.parametrize("folder", FOLDERS)
def test_values_are_frozen(folder: str) -> None:
    found = list(dataclasses(folder))
    assert found
    loose = [name for name, said, node in found if not said.get("frozen") and node.name not in GROWING]
    assert loose == []


# What has no truth when it is compared, no hash, or costs as much to compare as to compute.
WITHOUT_COMPARISON = re.compile(r"\b(\w*Array|ndarray|Field|Mapping|dict|nx\.Graph|TopologicalGraph)\b")
# Compared all the same, by their texts, numbers and shapes.
COMPARED = {"FloorPlan"}


def test_values_with_arrays_are_told_apart_by_what_they_are_not_by_their_numbers() -> None:
    # To compare arrays gives arrays, which have no truth; so it is with whatever holds such a value.
    found = [entry for folder in FOLDERS for entry in dataclasses(folder) if entry[1].get("frozen")]
    held = {
        node.name: [ast.unparse(f.annotation) for f in node.body if isinstance(f, ast.AnnAssign)] for *_, node in found
    }
    apart: set[str] = set()
    while more := {
        name
        for name, types in held.items()
        if name not in apart | COMPARED and any(map(without_comparison(apart), types))
    }:
        apart |= more
    assert [name for name, said, node in found if node.name in apart and said.get("eq", True)] == []


def without_comparison(apart: set[str]) -> Callable[[str], bool]:
    return lambda words: bool(WITHOUT_COMPARISON.search(words) or apart & set(re.findall(r"\w+", words)))


@pytest.mark.parametrize("folder", FOLDERS)
def test_nothing_has_to_be_given_without_its_name(folder: str) -> None:
    nameless = [
        f"{path.relative_to(ROOT)}: {node.name}"
        for path, tree in trees(folder)
        for node in ast.walk(tree)
        if isinstance(node, ast.FunctionDef) and node.args.posonlyargs
    ]
    assert nameless == []


@pytest.mark.parametrize("folder", FOLDERS)
def test_values_have_slots(folder: str) -> None:
    # Settings are the exception: their fields are given by name; and what keeps what it has computed.
    loose = [
        name
        for name, said, node in dataclasses(folder)
        if not said.get("kw_only") and not said.get("slots") and not keeps_something(node)
    ]
    assert loose == []


def keeps_something(node: ast.ClassDef) -> bool:
    return any(
        ast.unparse(decorator) == "cached_property"
        for item in node.body
        for decorator in getattr(item, "decorator_list", [])
    )
