"""What stands at the root of a dataset, and the table in front of each split."""

import contextlib
import heapq
import json
import re
import shutil
import textwrap
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any

from closedrooms.core.errors import InvalidInputError, OutputError
from closedrooms.core.files.incoming import parse_json
from closedrooms.core.files.outgoing import json_text, new_file, write_json
from closedrooms.core.files.output_folders import MANIFEST, PROGRAM
from closedrooms.core.files.schema import KEY, SCHEMA, check_schema
from closedrooms.experiments.columns import make_table
from closedrooms.experiments.dataset.checksums import digest
from closedrooms.experiments.dataset.config import FORMAT, NOT_CONTENT, SURVEYS, DatasetConfig
from closedrooms.experiments.dataset.shard import DATA, PARTS
from closedrooms.experiments.dataset.variants import (
    SPLITS,
    Variant,
    World,
    find_variants,
    sort_buildings,
    world_sources,
)
from closedrooms.experiments.places import Url
from closedrooms.experiments.stores import DATASET_MANIFEST, Store, file_digest, open_store, read_file, write_file
from closedrooms.pipeline.reporting.manifest import resolved, versions

CARD = "README.md"
SUMS = "SHA256SUMS"
METADATA = "metadata.parquet"
LOCK = ".lock"
# Rows of a split's table held and written at a time.
ROWS = 10_000
OURS = {
    "folders": {DATASET_MANIFEST, CARD, SUMS, SURVEYS, LOCK, *SPLITS},
    "shards": {DATASET_MANIFEST, CARD, SUMS, SURVEYS, LOCK, DATA, PARTS},
}
OURS_OF_ANY = set().union(*OURS.values())
# What the manifest names.
NAMED = {"folders": "samples", "shards": "shards"}
# Names of what is being written: folders by tempfile, files by process number.
UNFINISHED = re.compile(r"\..+\.([A-Za-z0-9_]{8}\.(part|old)|([0-9a-f]{8}-)?\d+\.part|lock)")


@dataclass(frozen=True, slots=True)
class Count:
    """Number of buildings, samples and bytes in one split.

    Attributes:
        buildings: With a sample in it.
        samples: That there are.
        size: Their bytes.
    """

    buildings: int
    samples: int
    size: int


def claim_dataset(config: DatasetConfig, worlds: Sequence[World]) -> None:
    """Claim the place before the work, or check that it holds a part of this very dataset.

    Raises:
        OutputError: It holds something that is not ours, or cannot be written.
        InvalidInputError: A dataset of another configuration, or of another version.
    """
    place, wanted = config.out, description(config, worlds)
    begun = {"command": "dataset", **wanted, "complete": False, **read_worlds(config, worlds), NAMED[config.format]: []}
    if isinstance(place, Url):
        store = open_store(place)
        if DATASET_MANIFEST in store.names():
            check_same(read_manifest(place), wanted, place)
        elif store.names():
            raise OutputError(
                f"the output holds something else ({min(store.names())}); expected nothing or a dataset: {place}"
            )
        else:
            write_file(store, DATASET_MANIFEST, json_bytes(begun))
        return
    if place.exists() and not place.is_dir():
        raise OutputError(f"the output is a file; expected a folder: {place}")
    if place.is_dir() and any(place.iterdir()):
        ours = OURS[config.format]
        strange = sorted(path.name for path in place.iterdir() if path.name not in ours and not _unfinished(path))
        if not (place / DATASET_MANIFEST).is_file() or (strange and not set(strange) <= OURS_OF_ANY):
            what = strange[0] if strange else "no manifest.json"
            raise OutputError(
                f"the output folder holds something else ({what}); expected an empty one or a dataset: {place}"
            )
        check_same(read_manifest(place), wanted, place)
        return
    try:
        place.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"cannot write ({error.strerror}): {place}") from error
    write_json(place / DATASET_MANIFEST, begun)


def _unfinished(path: Path) -> bool:
    """Check whether a killed process of ours left this behind while it wrote."""
    return UNFINISHED.fullmatch(path.name) is not None


@contextlib.contextmanager
def alone(folder: Path | Url) -> Iterator[None]:
    """Work on a dataset as the only process, and without what killed ones left behind half-written.

    An object store knows no locks, and shows nothing half-written: nothing is done for an address.

    Raises:
        OutputError: Another process works on it.
    """
    import fcntl

    if isinstance(folder, Url):
        yield
        return
    try:
        with (folder / LOCK).open("w") as lock:
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError as error:
                raise OutputError(f"another closedrooms works on this dataset: {folder}") from error
            _clear_unfinished(folder)
            try:
                yield
            finally:
                # What workers that were ended, or lost their parent, had under way.
                _clear_unfinished(folder)
    except OSError as error:
        raise OutputError(f"cannot write ({error.strerror}): {error.filename or folder}") from error


def _clear_unfinished(folder: Path) -> None:
    """Remove what killed processes left at any depth of a dataset."""
    for depth in ("*", "*/*", "*/*/*", "*/*/*/*"):
        for path in filter(_unfinished, folder.glob(depth)):
            shutil.rmtree(path) if path.is_dir() else path.unlink()


def read_manifest(place: Path | Url) -> dict[str, Any]:
    """Read the manifest of a dataset.

    Raises:
        InvalidInputError: No dataset, or one of another format.
    """
    store = open_store(place)
    where, manifest = store.where(DATASET_MANIFEST), read_stored_json(store, DATASET_MANIFEST)
    if not isinstance(manifest, dict) or manifest.get("program") != PROGRAM:
        raise InvalidInputError("not written by closedrooms", expected="a dataset's manifest.json", where=where)
    check_schema(manifest, where)
    if manifest.get("format") != FORMAT:
        raise InvalidInputError(
            f"a dataset of format {manifest.get('format')!r}",
            expected=f"format {FORMAT}, which this version reads",
            where=where,
        )
    return manifest


def read_stored_json(store: Store, name: str) -> Any:
    """Parse a JSON file of a dataset.

    Raises:
        InvalidInputError: It cannot be read, or is no JSON.
    """
    return parse_json(read_file(store, name), what=f"a dataset's {name}", where=store.where(name))


def json_bytes(value: Any) -> bytes:
    """Encode a value as the JSON that a dataset holds."""
    return json_text(value).encode()


def description(config: DatasetConfig, worlds: Sequence[World]) -> dict[str, Any]:
    """Describe what tells one dataset from another; whoever resumes must want the same."""
    return {
        "program": PROGRAM,
        KEY: SCHEMA,
        "format": FORMAT,
        "seed": config.seed,
        "repetitions": config.repetitions,
        "max_closed": config.max_closed,
        **({"layout": "shards", "shard_mb": config.shard_mb} if config.format == "shards" else {}),
        "configuration": resolved(config, leave_out=NOT_CONTENT),
        "versions": versions(),
        "worlds": {
            world.name: {"split": world.split, "closable": len(world.closable), "sha256": world.digest}
            for world in worlds
        },
    }


def read_worlds(config: DatasetConfig, worlds: Sequence[World]) -> dict[str, Any]:
    """Collect where the plans were read from, and what was said then; they do not tell one dataset from another."""
    remarks = [remark.as_json() for world in worlds for remark in world.remarks]
    paths = {"paths": {"worlds": world_sources(config.worlds)}}
    return paths | ({"remarks": remarks} if remarks else {})


def early_end(sample: str, about: Mapping[str, Any]) -> dict[str, str]:
    """Explain why a sample holds less than its building, by its id; nothing of one that was explored whole.

    Args:
        sample: Its id.
        about: Its ``run.json``.
    """
    exploration = about["exploration"]
    if exploration["status"] == "complete":
        return {}
    why = f", {exploration['reason']}" if exploration.get("reason") else ""
    return {sample: f"exploration ended early: {exploration['status']}{why}"}


def check_same(found: Mapping[str, Any], wanted: Mapping[str, Any], place: Path | Url) -> None:
    """Refuse to mix two datasets.

    Raises:
        InvalidInputError: Names the first entry that differs.
    """
    wanted = json.loads(json.dumps(wanted))
    for key in ("layout", *wanted):
        if found.get(key) != wanted.get(key):
            raise InvalidInputError(
                f"the dataset there has other {key}",
                expected="the command that began it, the same worlds and versions, or an empty folder",
                where=place,
            )


def write_manifest(config: DatasetConfig, worlds: Sequence[World], failed: Mapping[str, str]) -> None:
    """Write the manifest of a dataset of folders, sample by sample: of a million of them it has 200 MB.

    Raises:
        OutputError: It cannot be written.
    """
    assert isinstance(config.out, Path), "folders are of this machine"
    head = {
        "command": "dataset",
        **description(config, worlds),
        "complete": True,
        **read_worlds(config, worlds),
        "samples": [],
    }
    empty = b"[]\n}\n"
    with new_file(config.out / DATASET_MANIFEST) as file:
        file.write(json_bytes(head).removesuffix(empty) + b"[")
        between = b"\n"
        for variant in (
            v for split in sorted(SPLITS) for w in sort_buildings(worlds, split) for v in find_variants(w, config)
        ):
            entry = {
                "id": variant.id,
                "split": variant.world.split,
                "world": variant.world.name,
                "repetition": variant.repetition,
                "closed": list(variant.closed),
                "status": "failed" if variant.id in failed else "ok",
                "reason": failed.get(variant.id, ""),
            }
            file.write(between + textwrap.indent(json.dumps(entry, indent=2), "    ").encode())
            between = b",\n"
        file.write(b"\n  ]\n}\n")


def row(variant: Variant, about: Mapping[str, Any]) -> dict[str, Any]:
    """Describe a sample in its split's metadata: file names relative to the split, then figures."""
    base = f"{variant.world.name}/{Path(variant.id).name}"
    metrics = about["metrics"]
    return {
        "map_file_name": f"{base}/map.png",
        "truth_file_name": f"{base}/truth.png",
        "id": variant.id,
        "world": variant.world.name,
        "repetition": variant.repetition,
        "closed": list(about["closed"]),
        "closed_doors": len(about["closed"]),
        "doors_seen": metrics["doors_seen"],
        "rooms_seen": metrics["rooms_seen"],
        "area_mapped": metrics["area_mapped"],
        "ate_m": metrics["ate_m"],
        "map_yaml": f"{base}/map.yaml",
        "truth_yaml": f"{base}/truth.yaml",
        "doors_geojson": f"{base}/doors.geojson",
        "truth_rooms_geojson": f"{base}/truth_rooms.geojson",
        "trajectory_tum": f"{base}/trajectory.tum",
        "trajectory_truth_tum": f"{base}/trajectory_truth.tum",
        "run_json": f"{base}/{MANIFEST}",
    }


def write_metadata(folder: Path, rows: Iterable[Mapping[str, Any]]) -> None:
    """Write the table of one split, ``metadata.parquet``: a Hugging Face image folder reads it beside the pictures.

    No more than ``ROWS`` rows are held at a time.

    Args:
        folder: Of the split.
        rows: See :func:`row`; at least one.

    Raises:
        OutputError: It cannot be written.
    """
    import pyarrow.parquet as pq

    source = iter(rows)
    with new_file(folder / METADATA) as file, contextlib.ExitStack() as stack:
        writer = None
        while batch := list(islice(source, ROWS)):
            columns = {name: [entry[name] for entry in batch] for name in batch[0]}
            table = make_table(columns, writer.schema if writer else None)
            writer = writer or stack.enter_context(pq.ParquetWriter(file, table.schema))
            writer.write_table(table)


def write_sums(folder: Path, sums: Iterable[tuple[str, str]]) -> None:
    """Write ``SHA256SUMS`` as ``sha256sum -c`` reads it, over every repeatable file of the dataset but itself.

    Args:
        folder: The dataset.
        sums: Path relative to the dataset and SHA-256 of each file of the surveys and samples, in order of the paths.

    Raises:
        OutputError: It cannot be written.
    """
    others = [folder / DATASET_MANIFEST, folder / CARD, *(folder / split / METADATA for split in SPLITS)]
    own = sorted((path.relative_to(folder).as_posix(), digest(path)) for path in others if path.is_file())
    with new_file(folder / SUMS) as file:
        for name, value in heapq.merge(sums, own):
            file.write(f"{value}  {name}\n".encode())


def file_sums(folder: Path, name: str, about: Mapping[str, Any]) -> list[tuple[str, str]]:
    """List the path relative to the dataset and the SHA-256 of each file of one survey or sample, in order.

    Args:
        folder: The dataset.
        name: The survey's or sample's folder, relative to it.
        about: Its ``run.json``.
    """
    sums = {**about["checksums"], MANIFEST: digest(folder / name / MANIFEST)}
    return sorted((f"{name}/{file}", value) for file, value in sums.items())


def fingerprint(place: Path | Url) -> str:
    """Hash ``SHA256SUMS``: one line that says whether two datasets are equal."""
    return file_digest(open_store(place), SUMS)
