import pytest

from closedrooms.core.nearest import LONGEST, MOST_LISTED, nearest, unknown


@pytest.mark.parametrize(
    ("name", "meant"),
    [
        ("predcit", "predict"),
        ("predict", "predict"),
        ("cove", "cover"),
        ("zzz", ""),
        ("", ""),
        # Three letters of five are the same: a likeness of 0.6; two are 0.4.
        ("abcxy", "abcde"),
        ("abxyz", ""),
    ],
)
def test_the_nearest_name_shares_six_tenths_of_its_letters(name: str, meant: str) -> None:
    assert nearest(name, iter(["cover", "predict", "abcde"])) == meant


def test_the_nearest_of_two_near_names_is_taken() -> None:
    assert nearest("room-12", ["room-99", "room-1"]) == "room-1"


def test_a_message_names_what_was_meant_else_all_there_is_up_to_twelve() -> None:
    assert unknown("command", "predcit", ["cover", "predict"]) == "unknown command 'predcit'; did you mean predict?"
    assert unknown("command", "zzz", ["cover", "run"]) == "unknown command 'zzz'; expected one of cover, run"
    names = [f"n{number:02d}" for number in range(MOST_LISTED + 1)]
    assert MOST_LISTED == 12
    assert unknown("door", "zzz", names[:-1]).endswith("n10, n11")
    assert unknown("door", "zzz", names).endswith("n10, n11, ...")
    assert len(unknown("door", "z" * 500, names)) < LONGEST + 100
    assert unknown("door", "z" * 500, names).startswith(f"unknown door '{'z' * (LONGEST - 3)}...'")
