"""What is told without tyro or typeguard is what they would tell."""

from pathlib import Path
from typing import Any, Literal

import pytest
import typeguard
from tyro import _resolver as resolver

from closedrooms.cli.options import _Named, _read_named
from closedrooms.cli.quick_types import tell_quickly


@pytest.mark.parametrize("kind", [Path | None, tuple[str, ...], tuple[int, ...] | None, tuple[float, str], int | str])
@pytest.mark.parametrize("value", [None, "a", 1, Path("a"), ("a",), ("a", 1), (1, 2), (), (0.5, "a"), ["a"]], ids=repr)
def test_types_are_told_as_typeguard_tells_them(kind: Any, value: Any) -> None:
    tell_quickly()
    tell_quickly()  # once is enough
    try:
        typeguard.check_type(value, kind, collection_check_strategy=typeguard.CollectionCheckStrategy.ALL_ITEMS)
        expected = True
    except typeguard.TypeCheckError:
        expected = False
    assert resolver.is_instance(kind, value) is expected


def test_other_types_are_still_tyros() -> None:
    tell_quickly()
    assert resolver.is_instance(Literal["a", "b"] | None, "a")
    assert not resolver.is_instance(Literal["a", "b"] | None, "c")
    assert not resolver.is_instance(dict[str, int], {"a": "b"})


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        ([], _Named()),
        (["office-01", "--method", "paper"], _Named(method="paper")),
        (["--method=paper", "--method", "rose"], _Named(method="rose")),
        (["--close_doors", "d1,d2", "--noise", "low"], _Named(close_doors="d1,d2", noise="low")),
        (["--config", "a b.json", "--close", "3"], _Named(config=Path("a b.json"), close="3")),
        (["--method", "--json"], _Named()),
        (["--method"], _Named()),
        (["--", "--method", "paper"], _Named()),
        (["--sim.noise", "x", "--predictor.method", "y"], _Named()),
        (["--method="], _Named(method="")),
    ],
)
def test_what_decides_about_other_options_is_found_on_the_line(words: list[str], expected: _Named) -> None:
    assert _read_named(words) == expected
