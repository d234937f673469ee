"""Options of ``closedrooms run``."""

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, ClassVar, Literal

import tyro

from closedrooms.core.errors import InvalidInputError
from closedrooms.coverage.config import CoverageConfig
from closedrooms.mapping.config import MapperConfig
from closedrooms.navigation.config import NavigationConfig
from closedrooms.pipeline.options.cover import check_completions
from closedrooms.predictor.config import MethodConfig
from closedrooms.predictor.methods import DEFAULT_METHOD, find_method
from closedrooms.sim.config import Body, SimConfig, lidar_preset, noise_level

NoiseName = Literal["none", "low", "medium", "high"]
LidarName = Literal["default", "hokuyo-utm-30lx", "hokuyo-urg-04lx", "sick-lms111", "rplidar-a2", "robotis-lds-01"]


@dataclass(frozen=True, kw_only=True)
class RunConfig:
    """Options of ``closedrooms run``."""

    BODY: ClassVar[Body] = "wheels"

    world: tyro.conf.Positional[str] = "office-07"
    """Name of a bundled world (see ``closedrooms worlds list``) or a file that the importers read."""

    more_worlds: tyro.conf.Positional[tuple[str, ...]] = ()
    """Further worlds: a run directory each in the folder ``--out`` (``runs``), and one table."""

    seeds: tuple[int, ...] = ()
    """Several seeds, e.g. ``--seeds 0 1 2``: a run of every world for each, in place of ``--seed``."""

    close: int | None = None
    """How many rooms to close, drawn by the seed; 5, or as many as the world has, if ``--close-doors`` is not given
    either."""

    close_doors: str | None = None
    """Doors to close by name, with commas between them, e.g. ``d03,d07``."""

    several_doors: bool = False
    """Also close rooms that have more than one door."""

    noise: NoiseName = "medium"
    """Noise of lidar and odometry; each of its numbers can be set by itself under ``--sim.noise``."""

    lidar: LidarName = "default"
    """Laser scanner: 720 beams all round, 20 m, 10 Hz, or a real sensor; its numbers are under ``--sim.lidar``."""

    seed: int = 0
    """The one seed of the run: which rooms are closed, and every source of noise."""

    method: str = DEFAULT_METHOD
    """How rooms are predicted: ``best``, ``learned``, ``paper`` (as the authors describe and ran it), ``rose``,
    ``line-of-sight`` or ``geometric``."""

    completions: int = 0
    """Estimate the cost of coverage as a distribution, from so many draws of what the rooms may be; 0 leaves it out."""

    drive: bool = False
    """After the prediction, open the doors and drive the tour that was planned on the predicted map."""

    unsure_first: float = 0.0
    """With ``--drive``, open and visit first the rooms of a confidence below this (0 to 1), one after the other, the
    least sure one first; the other doors open when these have been seen."""

    record: bool = True
    """Write the recording ``run.rrd`` for the rerun viewer."""

    live: bool = False
    """Open the rerun viewer and stream the recording to it while it is written."""

    web: bool = False
    """As ``--live``, served to a browser on this machine; needs no desktop."""

    keep_scans: bool = False
    """Write ``scans.npz``: every scan with odometry, estimated and true pose."""

    bag: bool = False
    """Write what the robot sensed as a rosbag 2, ``sensed/`` (MCAP: LaserScan, Odometry, tf)."""

    out: Path | None = None
    """The run directory; ``runs/<world>-<seed>`` when not given. Of several runs the folder that holds theirs."""

    gui: bool = False
    """Watch the bodies in PyBullet's window while the robot drives; needs a display."""

    level: str | None = None
    """Which level of a file with several."""

    sim: SimConfig = field(default=None)  # type: ignore[assignment]
    """Robot, lidar and odometry; where not given, with the noise and the lidar named above."""

    mapper: MapperConfig = field(default_factory=MapperConfig)
    """The mapper."""

    navigation: NavigationConfig = field(default_factory=NavigationConfig)
    """Exploration and driving."""

    predictor: Annotated[MethodConfig | None, tyro.conf.Suppress] = None
    """Settings of the method, of its own class; its defaults when not given."""

    coverage: CoverageConfig = field(default_factory=CoverageConfig)
    """Graph and tour."""

    def __post_init__(self) -> None:
        if self.close is not None and self.close_doors is not None:
            raise InvalidInputError("both --close and --close-doors", expected="one of them")
        if self.close is not None and self.close < 0:
            raise InvalidInputError(f"--close {self.close}", expected="a number of rooms of at least 0")
        for name, seed in (("--seed", self.seed), *(("--seeds", seed) for seed in self.seeds)):
            if seed < 0:
                raise InvalidInputError(f"{name} {seed}", expected="a whole number of at least 0")
        check_completions(self.completions)
        if not 0.0 <= self.unsure_first <= 1.0:
            raise InvalidInputError(f"--unsure-first {self.unsure_first}", expected="a confidence, 0 to 1")
        if self.unsure_first and not self.drive:
            raise InvalidInputError("--unsure-first without a drive", expected="--drive")
        if (self.live or self.web) and not self.record:
            raise InvalidInputError("--live without a recording", expected="no --no-record")
        if self.sim is None:
            object.__setattr__(self, "sim", named_sim(self.noise, self.lidar, self.BODY))
        if self.gui:
            object.__setattr__(self, "sim", replace(self.sim, gui=True))
        object.__setattr__(self, "predictor", find_method(self.method).checked(self.predictor))


def named_sim(noise: str = "medium", lidar: str = "default", body: Body = "kinematic") -> SimConfig:
    """Make settings of the simulation with the numbers that a level of noise and a lidar stand for.

    Raises:
        InvalidInputError: No such level or lidar.
    """
    return SimConfig(noise=noise_level(noise), lidar=lidar_preset(lidar), body=body)
