"""Samples in shards: which there are, and their files where a sample is read from a folder."""

import contextlib
import tempfile
from collections.abc import Iterator, Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any

from closedrooms.core.errors import InvalidInputError
from closedrooms.experiments.evaluation.samples.sample_path import SamplePath, ShardRow
from closedrooms.experiments.places import Url
from closedrooms.experiments.stores import DATASET_MANIFEST, file_digest, open_store

COLUMNS = ("id", "world", "repetition")


def list_rows(dataset: Path | Url, manifest: Mapping[str, Any]) -> Iterator[SamplePath]:
    """Yield the samples of a dataset of shards; shards of this machine are compared with their checksums.

    Args:
        dataset: Where it is, absolute.
        manifest: Its manifest.

    Raises:
        InvalidInputError: It is not finished; a shard is missing, broken, or was changed since it was written.
    """
    import pyarrow.parquet as pq

    from closedrooms.core.files.incoming import reading
    from closedrooms.experiments.dataset.packing import read_rows
    from closedrooms.experiments.dataset.shard import read_shard

    store = open_store(dataset)
    if not manifest.get("complete"):
        raise InvalidInputError("a dataset that is not finished", expected="closedrooms dataset to end", where=dataset)
    for entry in manifest.get("shards") or ():
        shard = read_shard(entry, store.where(DATASET_MANIFEST))
        for name, why in shard.failures.items():
            yield SamplePath(name, Path(name), listed=True, problem=f"failed when the dataset was made: {why}")
        if not shard.rows:
            continue
        where = store.where(shard.name)
        if isinstance(dataset, Path) and file_digest(store, shard.name) != shard.sha256:
            raise InvalidInputError(
                "changed since it was written", expected="its SHA-256 in manifest.json", where=where
            )
        with store.opened(shard.name) as file:
            rows = read_rows(file, where, columns=COLUMNS)
            with reading(where, "a shard"):
                about = pq.ParquetFile(file).metadata
                sizes = [about.row_group(number).num_rows for number in range(about.num_row_groups)]
        places = [(group, row) for group, size in enumerate(sizes) for row in range(size)]
        if len(rows) != shard.rows or len(places) != shard.rows:
            raise InvalidInputError(
                f"{len(rows)} samples", expected=f"{shard.rows}, as manifest.json says", where=where
            )
        for (group, number), row in zip(places, rows, strict=True):
            place = ShardRow(str(dataset), shard.name, group, number)
            sample, world = _text(row["id"], where), _text(row["world"], where)
            folder = Path(f"{shard.name}/{sample}")
            yield SamplePath(
                sample, folder, listed=True, world=world, repetition=_whole(row["repetition"]), shard=place
            )


def _text(value: Any, where: str) -> str:
    """Check an id or a world: a relative path that stays inside."""
    if not isinstance(value, str) or not value or value.startswith("/") or ".." in value.split("/"):
        raise InvalidInputError(
            f"a sample with the id or world {value!r}", expected="split/building/rRR-cNN", where=where
        )
    return value


def _whole(value: Any) -> int:
    """Read a repetition, -1 for what is none."""
    return value if isinstance(value, int) and not isinstance(value, bool) and value >= 0 else -1


@contextlib.contextmanager
def unpacked(row: ShardRow) -> Iterator[Path]:
    """Yield a folder with the files of a sample, for as long as the block lasts.

    Raises:
        InvalidInputError: The shard cannot be read.
    """
    from closedrooms.experiments.dataset.packing import unpack

    with tempfile.TemporaryDirectory(prefix="closedrooms-") as scratch:
        unpack(_group(row.dataset, row.name, row.group)[row.row], Path(scratch))
        yield Path(scratch)


@lru_cache(maxsize=2)
def _group(dataset: str, name: str, group: int) -> list[dict[str, Any]]:
    """Read the rows of a group: whoever wants one of them wants its neighbours next."""
    from closedrooms.experiments.dataset.packing import read_rows
    from closedrooms.experiments.places import read_place

    store = open_store(read_place(dataset))
    with store.opened(name) as file:
        return read_rows(file, store.where(name), group=group)
