"""Columns of Parquet tables from plain values.

``pyarrow.array`` imports pandas wherever that is installed, 0.3 s, only to ask whether it was given one of its objects.
Here the buffers of the four kinds of columns that tables have are filled in directly.
"""

from collections.abc import Mapping, Sequence
from itertools import accumulate
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    import pyarrow as pa


def make_table(columns: Mapping[str, Sequence[Any]], schema: "pa.Schema | None" = None) -> "pa.Table":
    """Make a table.

    Args:
        columns: Values by name: whole numbers, numbers, text, or lists of text; ``None`` is empty. Other values are
            written as text.
        schema: Kinds of the columns, of a table made before; by their values where not given.
    """
    import pyarrow as pa

    kinds = schema.types if schema else [kind_of(values) for values in columns.values()]
    arrays = [_column(values, kind) for values, kind in zip(columns.values(), kinds, strict=True)]
    return pa.Table.from_arrays(arrays, names=list(columns))


def kind_of(values: Sequence[Any]) -> "pa.DataType":
    """Choose the kind of column that holds all of some values."""
    import pyarrow as pa

    present = [value for value in values if value is not None]
    if present and all(isinstance(value, int) for value in present):
        return pa.int64()
    if present and all(isinstance(value, int | float) for value in present):
        return pa.float64()
    if present and all(isinstance(value, list) for value in present):
        return pa.list_(pa.string())
    return pa.string()


def _column(values: Sequence[Any], kind: "pa.DataType") -> "pa.Array":
    """Fill in a column of a kind of :func:`kind_of`."""
    import pyarrow as pa

    there = np.array([value is not None for value in values], dtype=np.bool_)
    present = None if there.all() else _buffer(np.packbits(there, bitorder="little"))
    if kind in {pa.int64(), pa.float64()}:
        dtype = np.int64 if kind == pa.int64() else np.float64
        numbers = np.array([0 if value is None else value for value in values], dtype=dtype)
        return pa.Array.from_buffers(kind, len(values), [present, _buffer(numbers)])
    if kind == pa.string():
        texts = [b"" if value is None else str(value).encode() for value in values]
        buffers = [present, _ends(texts), pa.py_buffer(b"".join(texts))]
        return pa.Array.from_buffers(kind, len(values), buffers)
    lists = [value or [] for value in values]
    inner = _column([item for value in lists for item in value], pa.string())
    return pa.Array.from_buffers(kind, len(values), [present, _ends(lists)], children=[inner])


def _ends(parts: Sequence[Any]) -> "pa.Buffer":
    """List where each part begins in what they are joined to, and where the last one ends."""
    return _buffer(np.array([0, *accumulate(map(len, parts))], dtype=np.int32))


def _buffer(numbers: Any) -> "pa.Buffer":
    import pyarrow as pa

    return pa.py_buffer(numbers)
