"""One sample or survey as one row of a table, from which its files come back byte for byte."""

import io
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from closedrooms.core.errors import InvalidInputError
from closedrooms.core.files.incoming import read_bytes, read_json, reading
from closedrooms.core.files.output_folders import MANIFEST

if TYPE_CHECKING:
    import pyarrow as pa

PICTURES = {"map": "map.png", "truth": "truth.png"}
"""Columns with a picture, as Hugging Face's ``datasets`` knows one: its bytes and its name."""
TEXTS = {
    "map_yaml": "map.yaml",
    "truth_yaml": "truth.yaml",
    "doors_geojson": "doors.geojson",
    "truth_rooms_geojson": "truth_rooms.geojson",
    "trajectory_tum": "trajectory.tum",
    "trajectory_truth_tum": "trajectory_truth.tum",
    "run_json": MANIFEST,
}
SCANS = {"scans_npz": "scans.npz"}
SURVEY = {name: TEXTS[name] for name in ("trajectory_tum", "trajectory_truth_tum", "run_json")}
FIGURES = ("doors_seen", "rooms_seen", "area_mapped", "ate_m")
MAX_GROUP = 4_000_000_000
"""Largest group of rows that is read, uncompressed [bytes]: ours have 16 samples, with the scans of a day 3 GB."""
WHAT = "a shard or survey of closedrooms"
MAX_FILE = 200_000_000
"""Largest file that goes into a row [bytes]: the scans of a whole day have less."""


def sample_schema(*, scans: bool) -> "pa.Schema":
    """List the columns of a split: what names a sample, its figures, its files.

    Args:
        scans: With ``scans.npz``.
    """
    import pyarrow as pa

    text, whole, number = pa.string(), pa.int64(), pa.float64()
    fields = [
        ("id", text), ("world", text), ("repetition", whole), ("closed", pa.list_(text)), ("closed_doors", whole),
        ("doors_seen", whole), ("rooms_seen", whole), ("area_mapped", number), ("ate_m", number),
        *((name, pa.struct([("bytes", pa.binary()), ("path", text)])) for name in PICTURES),
        *((name, text) for name in TEXTS),
        *((name, pa.binary()) for name in (SCANS if scans else ())),
    ]  # fmt: skip
    features = {name: {"_type": "Image"} for name in PICTURES}
    about = {"huggingface": json.dumps({"info": {"features": features}})}
    return pa.schema(fields, metadata=about)


def survey_schema() -> "pa.Schema":
    """List the columns of a survey: its files."""
    import pyarrow as pa

    return pa.schema([*((name, pa.string()) for name in SURVEY), *((name, pa.binary()) for name in SCANS)])


def pack_sample(folder: Path, name: str, *, scans: bool) -> "pa.RecordBatch":
    """Read the folder of a sample into one row.

    Args:
        folder: With the files of a sample, none missing.
        name: Its id.
        scans: With ``scans.npz``.

    Raises:
        InvalidInputError: A file is missing.
    """
    import pyarrow as pa

    about = read_json(folder / MANIFEST, what="a sample's run.json")
    row: dict[str, Any] = {
        "id": name,
        "world": about["world"],
        "repetition": about["repetition"],
        "closed": list(about["closed"]),
        "closed_doors": len(about["closed"]),
        **{figure: about["metrics"][figure] for figure in FIGURES},
        **{column: {"bytes": _bytes(folder / file), "path": file} for column, file in PICTURES.items()},
        **{column: _text(folder / file) for column, file in TEXTS.items()},
        **({column: _bytes(folder / file) for column, file in SCANS.items()} if scans else {}),
    }
    return pa.RecordBatch.from_pylist([row], schema=sample_schema(scans=scans))


def pack_survey(folder: Path) -> "pa.RecordBatch":
    """Read the folder of a survey into one row.

    Raises:
        InvalidInputError: A file is missing.
    """
    import pyarrow as pa

    row: dict[str, Any] = {column: _text(folder / file) for column, file in SURVEY.items()}
    row |= {column: _bytes(folder / file) for column, file in SCANS.items()}
    return pa.RecordBatch.from_pylist([row], schema=survey_schema())


def unpack(row: Mapping[str, Any], folder: Path) -> None:
    """Write the files of one row, as they were.

    Args:
        row: Its values by column; columns that hold no file are passed over.
        folder: An empty one.
    """
    for column, file in {**PICTURES, **TEXTS, **SCANS}.items():
        content = row.get(column)
        if content is None:
            continue
        if isinstance(content, Mapping):
            content = content["bytes"]
        (folder / file).write_bytes(content.encode() if isinstance(content, str) else content)


def as_bytes(row: "pa.RecordBatch") -> bytes:
    """Encode a row as an Arrow stream: what lies between a worker that makes a sample and one that fills a shard."""
    import pyarrow as pa

    sink = io.BytesIO()
    options = pa.ipc.IpcWriteOptions(compression="zstd", use_threads=False)
    with pa.ipc.new_stream(sink, row.schema, options=options) as stream:
        stream.write_batch(row)
    return sink.getvalue()


def from_bytes(content: bytes, where: str) -> "pa.Table":
    """Read the row that :func:`as_bytes` has written.

    Raises:
        InvalidInputError: Something else, or cut off.
    """
    import pyarrow as pa

    with reading(where, "a part of a dataset"):
        options = pa.ipc.IpcReadOptions(use_threads=False)
        table = pa.ipc.open_stream(content, options=options).read_all()
    if table.num_rows != 1:  # cut off behind the names of the columns
        raise InvalidInputError(f"{table.num_rows} samples", expected="a part of a dataset, one sample", where=where)
    return table


def read_rows(
    file: Any, where: str, *, group: int | None = None, columns: Sequence[str] | None = None
) -> list[dict[str, Any]]:
    """Read rows of an untrusted Parquet file.

    Args:
        file: Open for reading bytes at any place.
        where: Its name, for messages.
        group: The row group that is wanted; all of them by default.
        columns: What is wanted of them; everything by default.

    Raises:
        InvalidInputError: No Parquet file, broken, without these columns, or of more than :data:`MAX_GROUP` bytes.
    """
    import pyarrow.parquet as pq

    with reading(where, WHAT):
        source = pq.ParquetFile(file)
        about = source.metadata
        missing = [name for name in columns or () if name not in source.schema_arrow.names]
        if missing:
            raise InvalidInputError(f"no column {missing[0]!r}", expected=WHAT, where=where)
        groups = range(about.num_row_groups) if group is None else (group,)
        rows: list[dict[str, Any]] = []
        for number in groups:
            size = about.row_group(number).total_byte_size
            if size > MAX_GROUP:
                raise InvalidInputError(
                    f"{size} bytes in one group of rows", expected=f"at most {MAX_GROUP}", where=where
                )
            rows += source.read_row_group(number, columns=columns, use_threads=False).to_pylist()
        return rows


def _bytes(path: Path) -> bytes:
    return read_bytes(path, what="a file of a sample", max_bytes=MAX_FILE)


def _text(path: Path) -> str:
    # Not as a text file is read, where line ends become one character: it has to come back as it was.
    return _bytes(path).decode()
