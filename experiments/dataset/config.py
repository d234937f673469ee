"""Options of ``closedrooms dataset``."""

from dataclasses import dataclass, field
from typing import Literal

import tyro

from closedrooms.core.errors import InvalidInputError
from closedrooms.core.runtime.options import check_least
from closedrooms.experiments.places import Place, Url
from closedrooms.experiments.scheduler_address import check_scheduler
from closedrooms.mapping.config import MapperConfig
from closedrooms.navigation.config import NavigationConfig
from closedrooms.pipeline.options.run import NoiseName, named_sim
from closedrooms.sim.config import SimConfig

# Of what stands in a dataset.
FORMAT = 1
SURVEYS = "surveys"
# Options that say nothing about a sample's content.
NOT_CONTENT = ("out", "worlds", "workers", "scheduler", "repetitions", "max_closed", "format", "shard_mb")

MapSource = Literal["erased", "simulated"]
Format = Literal["folders", "shards"]
# A shard is sent to an object store as a whole, and read into a viewer: Hugging Face asks for at most 5 GB.
MOST_MB = 5000.0


@dataclass(frozen=True, kw_only=True)
class DatasetConfig:
    """Choice of buildings, how often each, with how many doors closed, and how their maps are made."""

    worlds: tyro.conf.Positional[tuple[str, ...]]
    """Names of bundled worlds or files that the importers read; ``all`` names the 20 bundled worlds."""

    out: Place
    """Folder, or with shards an address that fsspec knows (``s3://bucket/folder``); the same command goes on there."""

    format: Format = "folders"
    """``folders``: nine files a sample; ``shards``: Parquet files of many samples each, for large datasets."""

    shard_mb: float = 256.0
    """Size of a shard, in MB: it ends with the sample that reaches it."""

    repetitions: int = 15
    """Orders in which the doors of a world are closed one after the other (paper, section 5: 15)."""

    max_closed: int = 15
    """Largest number of closed doors in a map; fewer where a world has fewer rooms to close (paper, table 1: 15)."""

    seed: int = 0
    """The one seed: orders of closing, splits and every source of noise."""

    noise: NoiseName = "medium"
    """Noise of lidar and odometry."""

    maps: MapSource = "erased"
    """``simulated`` explores every variant; ``erased`` explores each world once with all doors open and redraws the map
    as it would be with some closed."""

    workers: int = 2
    """Local processes."""

    scheduler: str | None = None
    """A Dask scheduler, ``tcp://host:port``, that does the work instead; its workers must see the same folders."""

    keep_scans: bool = False
    """Write ``scans.npz`` into every sample: the scans that made its map, with odometry, estimated and true pose."""

    record: bool = False
    """Write the recording ``run.rrd`` into every sample."""

    sim: SimConfig = field(default=None)  # type: ignore[assignment]
    """Robot, lidar and odometry; where not given, with the noise named above."""

    mapper: MapperConfig = field(default_factory=MapperConfig)
    """The mapper."""

    navigation: NavigationConfig = field(default_factory=NavigationConfig)
    """Exploration."""

    def __post_init__(self) -> None:
        if not self.worlds:
            raise InvalidInputError("no world", expected="names of bundled worlds, files, or all")
        if self.sim is None:
            object.__setattr__(self, "sim", named_sim(self.noise))
        if isinstance(self.out, Url) and self.format == "folders":
            raise InvalidInputError("--format folders at an address", expected="--format shards", where=self.out)
        if self.format == "shards" and self.record:
            raise InvalidInputError(
                "--record with --format shards, whose bytes are repeatable (those of recordings are not)",
                expected="--format folders",
            )
        if not 0 < self.shard_mb <= MOST_MB:
            raise InvalidInputError(f"--shard-mb {self.shard_mb:g}", expected=f"above 0, at most {MOST_MB:g}")
        check_least(self, repetitions=1, max_closed=1, workers=1, seed=0)
        check_scheduler(self.scheduler)
