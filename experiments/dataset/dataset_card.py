"""The dataset card: what is in it, how large, in which units, under which licence, and how it was made."""

from collections.abc import Mapping, Sequence

from closedrooms.core.names import markdown_text
from closedrooms.experiments.dataset.config import DatasetConfig
from closedrooms.experiments.dataset.variants import SPLITS, Split, World
from closedrooms.worlds.library import bundled_names

# Size classes of the Hugging Face hub, by their upper end.
SIZES = ((1_000, "n<1K"), (10_000, "1K<n<10K"), (100_000, "10K<n<100K"), (1_000_000, "100K<n<1M"))
MADE = {
    "erased": (
        "Each building was explored once with all doors open. For a sample, scans taken behind its closed doors were "
        "dropped, every other ray was cut at the closed leaf on the true geometry and ends there as a hit with the "
        "sensor's noise, and the map was drawn anew from the scans at their estimated poses. `surveys/` holds the "
        "explorations."
    ),
    "simulated": "Every sample was explored by a simulated robot while its doors were closed.",
}

POSES = {"erased": "the scans that make the map", "simulated": "every scan"}


def card(
    config: DatasetConfig, worlds: Sequence[World], made: Mapping[Split, int], failed: Mapping[str, str], size: int
) -> str:
    """Compose the text of ``README.md``.

    Args:
        config: As given.
        worlds: The buildings.
        made: How many samples there are in each split.
        failed: Why others are missing, by id.
        size: Bytes of all samples and surveys.
    """
    bundled = set(bundled_names())
    ours = all(world.source in bundled for world in worlds)
    licence = "mit" if ours else "other"
    size_class = next((name for limit, name in SIZES if sum(made.values()) < limit), "n>1M")
    head = [
        "---",
        f"license: {licence}",
        "pretty_name: Maps with closed doors",
        "task_categories: [image-to-image]",
        "tags: [robotics, occupancy-grid, floor-plan, slam]",
        f"size_categories: [{size_class}]",
        *(_data_files(made) if config.format == "shards" else []),
        "---",
    ]
    return "\n".join([*head, "", *_body(config, worlds, made, failed, size, ours=ours), ""])


def _data_files(made: Mapping[Split, int]) -> list[str]:
    """List where Hugging Face's ``datasets`` finds the splits."""
    lines = ["configs:", "- config_name: default", "  data_files:"]
    for split in SPLITS:
        if made[split]:
            lines += [f"  - split: {split}", f"    path: data/{split}-*.parquet"]
    return lines


def _body(
    config: DatasetConfig,
    worlds: Sequence[World],
    made: Mapping[Split, int],
    failed: Mapping[str, str],
    size: int,
    *,
    ours: bool,
) -> list[str]:
    """Write the card below its head."""
    rights = (
        "The buildings are closedrooms' own; the dataset is under the MIT licence."
        if ours
        else "The buildings come from files: their licences hold for what was made of them."
    )
    return [
        "# Maps with closed doors",
        "",
        "Occupancy grids of a robot that explored a building while some doors were closed, with the doors that it saw "
        "and the true building: ground truth for predicting the rooms behind closed doors.",
        "",
        f"{sum(made.values())} samples of {len(worlds)} buildings, {size / 1e6:.1f} MB; seed {config.seed}, noise "
        f"`{config.noise}`, maps `{config.maps}`, {config.repetitions} orders of closing, at most {config.max_closed} "
        "closed doors.",
        "",
        "| split | buildings | samples |",
        "| --- | ---: | ---: |",
        *(_split_row(split, worlds, made) for split in SPLITS),
        "",
        "No building is in two splits.",
        "",
        "## A sample",
        "",
        *(_columns(config) if config.format == "shards" else _files(config)),
        "",
        "Metres, radians, seconds; pictures at "
        f"{config.mapper.resolution:g} m a cell: white is free, black is occupied, grey is unknown. The map frame is "
        "the robot's first pose, x forward, y left.",
        "",
        *(_loading(config)),
        "",
        "## How it was made",
        "",
        MADE[config.maps],
        "`manifest.json` has versions, seeds and the whole configuration.",
        "",
        rights,
        *_failures(failed),
    ]


NAMES = "order of closing RR, NN closed doors. A door closed among n stays closed among n + 1 of the same order."


def _files(config: DatasetConfig) -> list[str]:
    """Describe what a sample's folder holds."""
    return [
        f"A folder `SPLIT/BUILDING/rRR-cNN`: {NAMES}",
        "",
        "| file | what |",
        "| --- | --- |",
        "| `map.png`, `map.yaml` | the robot's map, as ROS map_server reads it |",
        "| `truth.png`, `truth.yaml` | the true map, on the same frame |",
        "| `doors.geojson` | the closed doors that the robot saw, map frame |",
        "| `truth_rooms.geojson` | the rooms behind the closed doors, map frame |",
        f"| `trajectory.tum`, `trajectory_truth.tum` | estimated and true poses of {POSES[config.maps]} |",
        *(["| `scans.npz` | the scans with odometry, estimated and true pose |"] if config.keep_scans else []),
        *(["| `run.rrd` | recording for the rerun viewer |"] if config.record else []),
        "| `run.json` | configuration, seed, versions, figures, SHA-256 of the files |",
    ]


def _columns(config: DatasetConfig) -> list[str]:
    """Describe what a row of a shard holds."""
    return [
        f"A row of `data/SPLIT-NNNNN.parquet`, its `id` is `SPLIT/BUILDING/rRR-cNN`: {NAMES}",
        "",
        "| column | what |",
        "| --- | --- |",
        "| `map`, `truth` | the robot's map and the true one on the same frame, PNG |",
        "| `map_yaml`, `truth_yaml` | where they lie, as ROS map_server reads it |",
        "| `doors_geojson` | the closed doors that the robot saw, map frame |",
        "| `truth_rooms_geojson` | the rooms behind the closed doors, map frame |",
        f"| `trajectory_tum`, `trajectory_truth_tum` | estimated and true poses of {POSES[config.maps]} |",
        *(["| `scans_npz` | the scans with odometry, estimated and true pose |"] if config.keep_scans else []),
        "| `run_json` | configuration, seed, versions, figures, SHA-256 of the files |",
        "| `world`, `repetition`, `closed`, `closed_doors` | building, order, doors that are closed |",
        "| `doors_seen`, `rooms_seen`, `area_mapped`, `ate_m` | figures of the map |",
    ]


def _loading(config: DatasetConfig) -> list[str]:
    """Describe how others read the dataset."""
    if config.format == "shards":
        return [
            "Hugging Face's `datasets` loads and streams the folder as it is: `load_dataset(DIR)`, "
            "`load_dataset(DIR, streaming=True)`. `sha256sum -c SHA256SUMS` checks the files."
        ]
    return [
        "Each split has a `metadata.parquet`, so that Hugging Face's `datasets` loads the folder as it is: "
        '`load_dataset("imagefolder", data_dir=...)` gives the columns `map`, `truth` and the figures. '
        "`sha256sum -c SHA256SUMS` checks the files."
    ]


def _split_row(split: Split, worlds: Sequence[World], made: Mapping[Split, int]) -> str:
    names = [world.name for world in worlds if world.split == split]
    return f"| {split} | {markdown_text(', '.join(names)) or 'none'} | {made[split]} |"


def _failures(failed: Mapping[str, str]) -> list[str]:
    if not failed:
        return []
    lines = [f"- {markdown_text(name)}: {markdown_text(reason)}" for name, reason in sorted(failed.items())]
    return ["", "## Missing samples", "", *lines]
