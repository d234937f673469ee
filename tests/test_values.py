"""Mutable state lives in few places: other dataclasses of the stages are frozen, and none with arrays is compared."""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
FOLDERS = ("core", "worlds", "sim", "mapping", "navigation", "predictor", "coverage")
# What is built up step by step, by whoever owns it.
GROWING = {
    "_Claims", "_Open", "_Scan", "Sketch", "SketchPassage", "Keyframe", "PoseGraph", "CarmenLog", "BagMessages",
    "_Link", "EventLog", "Rater", "Growth", "_Branch",
}  # fmt: skip


def dataclasses(folder: str) -> Iterator[tuple[str, dict[str, bool], ast.ClassDef]]:
    """Every dataclass of a folder with what its decorator says."""
    for path in sorted((ROOT / folder).rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text())):
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


@pytest.mark.parametrize("folder", FOLDERS)
def test_values_with_arrays_are_told_apart_by_what_they_are_not_by_their_numbers(folder: str) -> None:
    # To compare arrays gives arrays, which have no truth.
    compared = [
        name
        for name, said, node in dataclasses(folder)
        if said.get("frozen") and said.get("eq", True) and any(holds_array(field) for field in node.body)
    ]
    assert compared == []


def holds_array(field: ast.stmt) -> bool:
    return isinstance(field, ast.AnnAssign) and ast.unparse(field.annotation).split(" | ")[0].endswith("Array")


@pytest.mark.parametrize("folder", FOLDERS)
def test_values_have_slots(folder: str) -> None:
    # Settings are the exception: their fields are given by name; and what keeps what it has computed.
    loose = [
        name
        for name, said, node in dataclasses(folder)
        if said.get("frozen") and not said.get("kw_only") and not said.get("slots") and not keeps_something(node)
    ]
    assert loose == []


def keeps_something(node: ast.ClassDef) -> bool:
    return any(
        ast.unparse(decorator) == "cached_property"
        for item in node.body
        for decorator in getattr(item, "decorator_list", [])
    )
