"""Tables as CSV for people and Parquet for programs."""

import csv
import io
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from closedrooms.core.files.outgoing import write_bytes
from closedrooms.experiments.columns import make_table

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
    import pyarrow.parquet as pq

    data = io.BytesIO()
    pq.write_table(make_table({name: [row.get(name) for row in rows] for name in names}), data)
    return data.getvalue()
