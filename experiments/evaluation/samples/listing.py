"""Which samples a dataset holds: as its manifest lists them, or every folder with the files of one."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path, PurePosixPath
from typing import Any

from closedrooms.core.errors import InvalidInputError
from closedrooms.core.files.incoming import is_file, is_folder, read_text
from closedrooms.core.files.output_folders import MANIFEST
from closedrooms.core.numbers import repr_of
from closedrooms.experiments.evaluation.samples.sample_path import SamplePath
from closedrooms.experiments.evaluation.samples.shard_rows import list_rows
from closedrooms.experiments.places import Url
from closedrooms.experiments.stores import DATASET_MANIFEST

FILES = ("map.yaml", "doors.geojson", "truth.yaml")
MAX_REPETITION = 1_000_000


def find_samples(datasets: Sequence[Path | Url]) -> list[SamplePath]:
    """Find every sample of the datasets, by name.

    Raises:
        InvalidInputError: A dataset that is no folder, holds no sample or is of another version; two samples of one
            name.
    """
    found: dict[str, SamplePath] = {}
    for dataset in datasets:
        if isinstance(dataset, Path) and not is_folder(dataset):
            raise InvalidInputError("no such folder", expected="a dataset", where=dataset)
        samples = list(_samples_of(dataset))
        if not samples:
            raise InvalidInputError("no sample", expected=f"folders with {', '.join(FILES)}", where=dataset)
        for sample in samples:
            if sample.name in found:
                raise InvalidInputError(
                    f"two samples named {sample.name!r}", expected="one folder a name", where=sample.folder
                )
            found[sample.name] = sample
    return [sample for _, sample in sorted(found.items())]


def _samples_of(dataset: Path | Url) -> Iterator[SamplePath]:
    """Yield the samples of a dataset: of shards, as its manifest lists them, or every folder that looks like one."""
    if isinstance(dataset, Path) and not is_file(dataset / DATASET_MANIFEST):
        yield from _folders(dataset)
        return
    from closedrooms.experiments.dataset.layout import read_manifest

    manifest = read_manifest(dataset)
    if manifest.get("layout") == "shards":
        yield from list_rows(dataset.resolve() if isinstance(dataset, Path) else dataset, manifest)
    elif isinstance(dataset, Path):
        yield from _listed(dataset, manifest)
    else:
        raise InvalidInputError("a dataset of folders at an address", expected="one of shards", where=dataset)


def _folders(dataset: Path) -> Iterator[SamplePath]:
    """Find every folder with the files of a sample, at any depth."""
    for folder in sorted(path.parent for path in dataset.rglob(FILES[0])):
        if all((folder / name).is_file() for name in FILES):
            name = folder.relative_to(dataset).as_posix()
            yield SamplePath(dataset.resolve().name if name == "." else name, folder)


def _listed(dataset: Path, manifest: Mapping[str, Any]) -> Iterator[SamplePath]:
    """List the samples of a manifest, those that failed included."""
    path = dataset / DATASET_MANIFEST
    entries = manifest.get("samples")
    if not isinstance(entries, list):
        raise InvalidInputError("no list of samples", expected="the manifest of a dataset", where=path)
    if not entries and not manifest.get("complete", True):
        raise InvalidInputError("a dataset that is not finished", expected="closedrooms dataset to end", where=dataset)
    digests = _digests(dataset)
    for number, entry in enumerate(entries):
        yield _entry(dataset, entry, number, digests)


def _digests(dataset: Path) -> dict[str, str]:
    """Read the SHA-256 of files by path, as far as ``SHA256SUMS`` tells."""
    from closedrooms.experiments.dataset.layout import SUMS

    path = dataset / SUMS
    if not is_file(path):
        return {}
    lines = [line.split("  ", 1) for line in read_text(path, what="checksums").splitlines()]
    return {line[1]: line[0] for line in lines if len(line) == 2}


def _entry(dataset: Path, entry: Any, number: int, digests: dict[str, str]) -> SamplePath:
    """Read one sample of a manifest."""
    name = entry.get("id") if isinstance(entry, dict) else None
    if not isinstance(name, str) or not _stays_inside(name):
        where = dataset / DATASET_MANIFEST
        raise InvalidInputError(f"sample {number} with the id {name!r}", expected="a folder below it", where=where)
    folder = dataset / name
    problem = ""
    if entry.get("status", "ok") != "ok":
        problem = f"failed when the dataset was made: {entry.get('reason') or 'no reason given'}"
    elif not is_folder(folder):
        problem = f"listed in {DATASET_MANIFEST} but missing"
    repetition = entry.get("repetition", -1)
    if isinstance(repetition, bool) or not isinstance(repetition, int) or not -1 <= repetition <= MAX_REPETITION:
        raise InvalidInputError(
            f"sample {number} with the repetition {repr_of(repetition)}",
            expected=f"a whole number up to {MAX_REPETITION}",
            where=dataset / DATASET_MANIFEST,
        )
    return SamplePath(
        name,
        folder,
        problem,
        listed=True,
        digest=digests.get(f"{name}/{MANIFEST}", ""),
        world=str(entry.get("world") or ""),
        repetition=repetition,
    )


def _stays_inside(name: str) -> bool:
    path = PurePosixPath(name)
    return bool(name) and path.as_posix() == name and not path.is_absolute() and not {"..", "."} & set(path.parts)
