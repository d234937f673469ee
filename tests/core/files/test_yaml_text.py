"""YAML is looked through before anything is built from it."""

from pathlib import Path
from typing import Any

import pytest

from closedrooms.core.errors import InvalidInputError
from closedrooms.core.files.incoming import MAX_DEPTH
from closedrooms.core.files.yaml_text import MAX_ALIASED, parse_yaml


def parsed(folder: Path, text: str, *, plain: bool = False) -> dict[str, Any]:
    (folder / "x.yaml").write_text(text)
    return parse_yaml(folder / "x.yaml", what="a world", plain=plain)


def test_honest_yaml_is_read_aliases_included(tmp_path: Path) -> None:
    text = "a: &wall [1, 2.5, {b: c}]\nd: *wall\ne: '<<'\n"
    assert parsed(tmp_path, text) == {"a": [1, 2.5, {"b": "c"}], "d": [1, 2.5, {"b": "c"}], "e": "<<"}
    shared = "x: &x [" + ", ".join("1" for _ in range(99)) + "]\n"
    most = MAX_ALIASED // 100
    assert len(parsed(tmp_path, shared + "y: [" + ", ".join(["*x"] * most) + "]\n")["y"]) == most
    with pytest.raises(InvalidInputError, match=f"more than {MAX_ALIASED}"):
        parsed(tmp_path, shared + "y: [" + ", ".join(["*x"] * (most + 1)) + "]\n")


def test_plain_scalars_stay_as_they_stand_there(tmp_path: Path) -> None:
    text = "a: 5e-2\nb: '5'\nc: yes\nd: [1, .nan]\n"
    assert parsed(tmp_path, text, plain=True) == {"a": "5e-2", "b": "5", "c": "yes", "d": ["1", ".nan"]}


def bomb(levels: int) -> str:
    lines = ["a0: &a0 [x, x, x, x, x, x, x, x, x, x]"]
    lines += [f"a{n}: &a{n} [{', '.join([f'*a{n - 1}'] * 10)}]" for n in range(1, levels)]
    return "\n".join(lines) + "\n"


@pytest.mark.parametrize("plain", [False, True])
@pytest.mark.parametrize(
    ("text", "found"),
    [
        (bomb(9), "aliases"),
        ("a: " + "[" * (MAX_DEPTH + 1), "nested"),
        ("a: " + "[" * 100_000 + "]" * 100_000, "nested"),
        ("a: " + "{b: " * 100_000, "nested"),
        ("a:\n" + "".join(f"{' ' * n}-\n" for n in range(1, 300)), "nested"),
        ("- " * 3000 + "x", "nested"),
        ("a: &a [*a]", "inside itself"),
        ("a: &a {b: 1}\nc:\n  <<: *a\n", "merge key"),
        ("a: " + "1" * 5000, "digits"),
        ("a: -" + "1_" * 3000, "digits"),
        ("a: *nothing", "broken YAML"),
        ("a: !!python/object/apply:os.system [echo]", "broken YAML|without fields") ,
        ("? [a]\n: b\n", "broken|without fields"),
        ("a: [", "broken YAML"),
        ("- a", "without fields"),
        ("a: b\n---\nc: d\n", "broken YAML"),
        ("a: \x07", "broken YAML"),
        ("", "without fields"),
    ],
)  # fmt: skip
def test_yaml_that_would_take_stack_memory_or_time_is_refused(
    tmp_path: Path, text: str, found: str, *, plain: bool
) -> None:
    if plain and "python" in text:
        pytest.skip("texts have no types")
    with pytest.raises(InvalidInputError, match=found) as error:
        parsed(tmp_path, text, plain=plain)
    assert str(error.value).endswith("x.yaml")


@pytest.mark.parametrize("text", ["a: 2001-99-99", "a: !!binary 'ä'", "a: !!int x", "a: !!set [1]", "a: !!float []"])
def test_values_that_the_loader_cannot_make_are_broken(tmp_path: Path, text: str) -> None:
    with pytest.raises(InvalidInputError, match=r"broken.*x\.yaml$"):
        parsed(tmp_path, text)


@pytest.mark.parametrize("text", ["a: 1\nb: 2\na: 3\n", "x: {a: 1, 'a': 1}\n", "- x\n- {b: {c: 1, d: 2, c: 3}}\n"])
def test_a_key_that_stands_twice_is_refused(tmp_path: Path, text: str) -> None:
    # The last one counts here, the first one for map_server (yaml-cpp).
    with pytest.raises(InvalidInputError, match=r"the key '[ac]' twice; expected a world: .*x\.yaml"):
        parsed(tmp_path, text)


def test_the_same_key_in_two_mappings_and_a_value_like_a_key_are_honest(tmp_path: Path) -> None:
    text = "a: a\nb: [a, a, {a: a}]\nc: {a: {a: b}, b: a}\n"
    assert parsed(tmp_path, text) == {"a": "a", "b": ["a", "a", {"a": "a"}], "c": {"a": {"a": "b"}, "b": "a"}}
