import io
import subprocess
import sys

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import given
from hypothesis import strategies as st

from closedrooms.experiments.columns import make_table

NUMBERS = st.floats(allow_nan=False)
KINDS = {
    "whole": (st.integers(-(2**63), 2**63 - 1), pa.int64()),
    "number": (NUMBERS, pa.float64()),
    "text": (st.text(st.characters(exclude_categories=["Cs"])), pa.string()),
    "list": (st.lists(st.text(st.characters(exclude_categories=["Cs"]))), pa.list_(pa.string())),
}


@given(data=st.data(), rows=st.integers(1, 40))
def test_columns_are_those_that_pyarrow_makes(data: st.DataObject, rows: int) -> None:
    values = {
        name: [*data.draw(st.lists(st.none() | kind, min_size=rows - 1, max_size=rows - 1)), data.draw(kind)]
        for name, (kind, _) in KINDS.items()
    }
    table = make_table(values)
    table.validate(full=True)
    assert table.equals(pa.table({name: pa.array(values[name], kind) for name, (_, kind) in KINDS.items()}))
    # The bytes of the files too, where nulls and what comes before them count.
    files = [io.BytesIO(), io.BytesIO()]
    pq.write_table(table, files[0])
    pq.write_table(pa.table({name: pa.array(values[name], kind) for name, (_, kind) in KINDS.items()}), files[1])
    assert files[0].getvalue() == files[1].getvalue()


@pytest.mark.parametrize(
    ("values", "kind", "kept"),
    [
        ([1, 2.5], pa.float64(), [1.0, 2.5]),
        ([1, "two", None], pa.string(), ["1", "two", None]),
        ([None, None], pa.string(), [None, None]),
        ([float("nan"), float("inf")], pa.float64(), None),
    ],
)
def test_a_column_is_of_the_kind_that_holds_all_its_values(values: list, kind: pa.DataType, kept: list | None) -> None:
    table = make_table({"a": values})
    assert table.schema.types == [kind]
    if kept is not None:
        assert table.column("a").to_pylist() == kept


def test_later_rows_take_the_kinds_of_the_first() -> None:
    first = make_table({"a": [1.5], "b": [["x"]]})
    assert make_table({"a": [None], "b": [[]]}, first.schema).schema == first.schema


def test_pandas_is_not_loaded() -> None:
    code = "import io, sys, pyarrow.parquet as pq; from closedrooms.experiments.columns import make_table; "
    code += "pq.write_table(make_table({'a': [1, None], 'b': [['x'], []]}), io.BytesIO()); "
    code += "assert 'pandas' not in sys.modules"
    subprocess.run([sys.executable, "-c", code], check=True)
