"""Options of ``closedrooms robustness``."""

import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal, get_args

import tyro

from closedrooms.core.errors import InvalidInputError
from closedrooms.core.runtime.options import check_least
from closedrooms.experiments.scheduler_address import check_scheduler
from closedrooms.mapping.config import MapperConfig
from closedrooms.navigation.config import NavigationConfig
from closedrooms.predictor.methods import DEFAULT_METHOD, find_method
from closedrooms.sim.config import SimConfig

Factor = Literal[
    "lidar", "dropouts", "odometry", "missed", "shift", "turn", "resolution", "furniture", "glass", "people", "clutter",
    "lost", "freezes", "drops", "unequal", "phantoms", "together",
]  # fmt: skip
FACTORS: tuple[Factor, ...] = get_args(Factor)
# What ``together`` leaves as it is: another map, another building, a broken robot.
ALONE = (
    "resolution", "glass", "people", "clutter", "lost", "freezes", "drops", "unequal", "phantoms",
)  # fmt: skip
COUNTS = ("people", "clutter", "phantoms")
MOST = {"people": 200.0, "clutter": 200.0, "phantoms": 1000.0, "unequal": 0.4}
SHARES = ("dropouts", "missed", "furniture", "glass", "lost")


@dataclass(frozen=True, kw_only=True)
class RobustnessConfig:
    """Disturbances and their levels. The first level of every factor is the one that the others are held against."""

    worlds: tyro.conf.Positional[tuple[str, ...]]
    """Names of bundled worlds or files that the importers read; ``all`` names the 20 bundled worlds."""

    out: Path
    """Folder to write; the same command again goes on where it stopped."""

    factors: tuple[Factor, ...] = FACTORS
    """What to disturb, one at a time; ``together`` disturbs lidar, odometry, doors and furniture at once."""

    repetitions: int = 3
    """Sets of closed doors drawn for each world."""

    closed: int = 6
    """Closed rooms in each set, or as many as the world has."""

    method: str = DEFAULT_METHOD
    """How rooms are predicted."""

    lidar: tuple[float, ...] = (0.0, 0.01, 0.03, 0.06, 0.12)
    """Standard deviations of a measured distance [m]."""

    dropouts: tuple[float, ...] = (0.0, 0.05, 0.2, 0.5, 0.8)
    """Shares of the beams that give no measurement [0..1]."""

    odometry: tuple[float, ...] = (0.0, 1.0, 2.0, 4.0, 8.0)
    """Odometry errors in multiples of the noise level ``medium`` (0.03 m and 1.5 degrees after 1 m)."""

    missed: tuple[float, ...] = (0.0, 0.1, 0.2, 0.4)
    """Shares of the closed doors that are not detected [0..1]."""

    shift: tuple[float, ...] = (0.0, 0.05, 0.1, 0.2, 0.3, 0.5)
    """How far detected doors are from where they are, in any direction [m]."""

    turn: tuple[float, ...] = (0.0, 2.0, 5.0, 10.0)
    """How far detected doors are turned about their middle, to either side [degrees]."""

    resolution: tuple[float, ...] = (0.05, 0.025, 0.1, 0.15, 0.2)
    """Cells of the map [m]."""

    furniture: tuple[float, ...] = (0.0, 0.5, 1.0)
    """Shares of the pieces of furniture that fill the rooms [0..1]."""

    glass: tuple[float, ...] = (0.0, 0.05, 0.1, 0.2)
    """Shares of the walls that are of glass [0..1]."""

    people: tuple[float, ...] = (0.0, 2.0, 4.0, 8.0)
    """People who walk from room to room."""

    clutter: tuple[float, ...] = (0.0, 5.0, 10.0)
    """Boxes that are put elsewhere while the robot is away."""

    lost: tuple[float, ...] = (0.0, 0.05, 0.2, 0.5)
    """Shares of the sweeps that arrive without a measurement [0..1]."""

    freezes: tuple[float, ...] = (0.0, 2.0, 6.0, 20.0)
    """How often the odometry stands still for a second and then reports the whole motion at once [1/min]."""

    drops: tuple[float, ...] = (0.0, 1.0, 3.0, 10.0)
    """How often the motion between two sweeps is never counted [1/min]."""

    unequal: tuple[float, ...] = (0.0, 0.005, 0.01, 0.02)
    """How much larger one wheel is than the other, as a share, below 0.5."""

    phantoms: tuple[float, ...] = (0.0, 2.0, 5.0, 10.0)
    """Places on plain walls where a closed door is reported."""

    tours: bool = True
    """Plan coverage tours too."""

    seed: int = 0
    """The one seed: closed doors, furniture and every source of noise."""

    workers: int = 2
    """Local processes; each takes one world after the other."""

    scheduler: str | None = None
    """A Dask scheduler, ``tcp://host:port``, that does the work instead; its workers must see the same folders."""

    resamples: int = 2000
    """Resamples of the bootstrap intervals."""

    sim: SimConfig = field(default_factory=SimConfig)
    """Robot and lidar; their noise is what the levels say."""

    mapper: MapperConfig = field(default_factory=MapperConfig)
    """The mapper."""

    navigation: NavigationConfig = field(default_factory=NavigationConfig)
    """Exploration."""

    def __post_init__(self) -> None:
        if not self.worlds:
            raise InvalidInputError("no world", expected="names of bundled worlds, files, or all")
        if not self.factors or len(set(self.factors)) != len(self.factors):
            raise InvalidInputError(f"factors {self.factors}", expected=f"each once, of {', '.join(FACTORS)}")
        find_method(self.method)
        check_least(self, repetitions=1, closed=1, workers=1, resamples=1, seed=0)
        check_scheduler(self.scheduler)
        for factor in FACTORS[:-1]:
            levels: tuple[float, ...] = getattr(self, factor)
            share = factor in SHARES
            most = 1.0 if share else MOST.get(factor, math.inf)
            fit = all(math.isfinite(v) and 0.0 <= v <= most for v in levels)
            fit &= factor not in COUNTS or all(value == int(value) for value in levels if math.isfinite(value))
            if not levels or not fit or (factor == "resolution" and min(levels) <= 0.0):
                expected = "shares from 0 to 1" if share else "finite numbers, none below 0"
                if factor in MOST:
                    expected = f"{'whole ' if factor in COUNTS else ''}numbers from 0 to {MOST[factor]:g}"
                raise InvalidInputError(f"--{factor} {' '.join(map(str, levels))}", expected=expected)
            if len(set(levels)) != len(levels):
                raise InvalidInputError(f"--{factor} {' '.join(map(str, levels))}", expected="each level once")
