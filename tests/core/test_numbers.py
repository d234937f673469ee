"""Numbers of files: what is one, and bounds that are themselves allowed."""

import math

import pytest

from closedrooms.core.errors import InvalidInputError
from closedrooms.core.numbers import bounded, check_count, is_number, repr_of


@pytest.mark.parametrize("value", [0, -1, 2.5, 10**300, -1e307, 5e-324])
def test_numbers_that_a_float_holds_are_numbers(value: float) -> None:
    assert is_number(value)


@pytest.mark.parametrize("value", [True, False, "1", None, [1], math.nan, math.inf, -math.inf, 1e308, -1e308, 10**400])
def test_what_no_float_holds_and_what_is_no_number_is_none(value: object) -> None:
    assert not is_number(value)


def test_both_bounds_are_allowed_and_nothing_beyond() -> None:
    assert bounded(1, 1.0, 2.0, name="width") == 1.0
    assert isinstance(bounded(1, 1.0, 2.0, name="width"), float)
    assert bounded(2.0, 1.0, 2.0, name="width") == 2.0
    for value in (math.nextafter(1.0, 0.0), math.nextafter(2.0, 3.0), math.nan, "1", True, None):
        with pytest.raises(InvalidInputError):
            bounded(value, 1.0, 2.0, name="width")


def test_a_number_out_of_bounds_is_told_with_its_bounds_its_unit_and_its_file() -> None:
    with pytest.raises(InvalidInputError) as error:
        bounded(7, 0.5, 2.0, name="door width", unit="m", where="a.json")
    assert str(error.value) == "door width 7; expected a number from 0.5 to 2 m: a.json"
    with pytest.raises(InvalidInputError) as error:
        bounded("x", 0.5, 2.0, name="share")
    assert str(error.value) == "share 'x'; expected a number from 0.5 to 2"


def test_as_many_as_allowed_may_be_there() -> None:
    check_count(3, 3, "doors")
    with pytest.raises(InvalidInputError, match=r"^4 doors; expected at most 3: d\.json$"):
        check_count(4, 3, "doors", "d.json")


def test_values_are_written_short() -> None:
    assert repr_of("wide") == "'wide'"
    assert repr_of(1.5) == "1.5"
    assert len(repr_of("x" * 500)) == 60
    assert repr_of("x" * 58) == f"'{'x' * 58}'"
    assert repr_of("x" * 59) != f"'{'x' * 59}'"
    assert len(repr_of(type("Long", (), {"__repr__": lambda _: "y" * 500})())) == 60
    assert len(repr_of([[[[[[[[[[1]]]]]]]]]])) <= 60
    assert repr_of(10**5000) == "with thousands of digits"
