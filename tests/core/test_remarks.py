import pytest

from closedrooms.core.errors import InvalidInputError
from closedrooms.core.remarks import Remark, remark_rows


def test_a_remark_reads_as_one_line_with_its_first_names():
    names = tuple(f"d{i:02d}" for i in range(8))
    remark = Remark(action="dropped", what="doors", why="no wall within 1 m", names=names, count=8)
    assert str(remark) == "dropped 8 doors (d00, d01, d02, d03, d04, d05, ...): no wall within 1 m"
    assert str(Remark(action="guessed", what="resolution", why="0.05 m")) == "guessed resolution: 0.05 m"


def test_losses_come_first_in_tables():
    guess = Remark(action="guessed", what="scale", why="the median door is 0.9 m wide")
    loss = Remark(action="dropped", what="door", why="on no wall", loss=True)
    assert [row[1] for row in remark_rows([guess, loss])] == [str(loss), str(guess)]


def test_rejects_a_remark_about_nothing():
    with pytest.raises(InvalidInputError, match="at least 1"):
        Remark(action="dropped", what="doors", why="-", count=0)


@pytest.mark.parametrize(
    ("number", "named"), [(1, "1 doors (d0)"), (6, "6 doors (d0, d1, d2, d3, d4, d5)"), (0, "doors")]
)
def test_up_to_six_names_are_told_and_one_thing_is_not_counted(number, named):
    names = tuple(f"d{i}" for i in range(number))
    remark = Remark(action="repaired", what="doors", why="turned", names=names, count=max(number, 1))
    assert str(remark) == f"repaired {named}: turned"


def test_a_remark_is_kept_whole_in_a_run():
    remark = Remark(action="guessed", what="scale", why="doors", names=("a",), count=3, loss=True)
    assert remark.as_json() == {
        "action": "guessed", "what": "scale", "why": "doors", "names": ["a"], "count": 3, "loss": True,
    }  # fmt: skip
    assert Remark(action="guessed", what="scale", why="doors").as_json()["count"] == 1
    assert str(Remark(action="dropped", what="doors", why="far", count=2)) == "dropped 2 doors: far"
    with pytest.raises(TypeError):
        Remark("guessed", "scale", "doors")
