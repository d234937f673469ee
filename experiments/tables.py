"""Tables as CSV for people and Parquet for programs."""

import csv
import io
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from closedrooms.core.files.outgoing import write_bytes

# Values of one line by column.
Row = dict[str, Any]


def write_table(stem: Path, rows: Sequence[Row], columns: Sequence[str] | None = None) -> None:
    """Write ``<stem>.csv`` and ``<stem>.parquet``.

    Args:
        stem: Path without suffix.
        rows: Values by column; one that is absent or ``None`` is empty.
        columns: Order of the columns; as they first appear in the rows when not given.

    Raises:
        OutputError: The folder cannot be written.
    """
    names = list(columns or dict.fromkeys(name for row in rows for name in row))
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(names)
    writer.writerows(["" if row.get(name) is None else row[name] for name in names] for row in rows)
    write_bytes(stem.with_suffix(".csv"), text.getvalue().encode())
    write_bytes(stem.with_suffix(".parquet"), _parquet(names, rows))


def _parquet(names: Sequence[str], rows: Sequence[Row]) -> bytes:
    import pyarrow as pa
    import pyarrow.parquet as pq

    columns = [_typed([row.get(name) for row in rows]) for name in names]
    data = io.BytesIO()
    pq.write_table(pa.table(columns, names=list(names)), data)
    return data.getvalue()


def _typed(values: list[Any]) -> Any:
    """Convert a column to whole numbers, numbers, or text: what holds all its values."""
    import pyarrow as pa

    present = [value for value in values if value is not None]
    if present and all(isinstance(value, int) for value in present):
        return pa.array(values, pa.int64())
    if present and all(isinstance(value, int | float) for value in present):
        return pa.array(values, pa.float64())
    return pa.array([None if value is None else str(value) for value in values], pa.string())
