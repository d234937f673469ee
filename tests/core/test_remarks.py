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
