"""The levels of every factor as settings."""

from dataclasses import dataclass, replace

from closedrooms.experiments.robustness.config import ALONE, FACTORS, Factor, RobustnessConfig

UNITS: dict[Factor, str] = {
    "lidar": "standard deviation of a distance [m]",
    "dropouts": "share of beams without a measurement",
    "odometry": "odometry error [times medium]",
    "missed": "share of closed doors missed",
    "shift": "doors shifted by [m]",
    "turn": "doors turned by [degrees]",
    "resolution": "cell of the map [m]",
    "furniture": "share of the furniture",
    "glass": "share of the walls of glass",
    "people": "people who walk",
    "clutter": "boxes that are moved",
    "lost": "share of sweeps lost",
    "freezes": "freezes of the odometry [1/min]",
    "drops": "motions never counted [1/min]",
    "unequal": "difference of the wheels, as a share",
    "phantoms": "phantom doors",
    "together": "all factors at their n-th level",
}
FIRST = "first"


@dataclass(frozen=True, slots=True)
class Setting:
    """Strength of every disturbance; units as in the configuration."""

    lidar: float
    dropouts: float
    odometry: float
    missed: float
    shift: float
    turn: float
    resolution: float
    furniture: float
    glass: float = 0.0
    people: float = 0.0
    clutter: float = 0.0
    lost: float = 0.0
    freezes: float = 0.0
    drops: float = 0.0
    unequal: float = 0.0
    phantoms: float = 0.0

    @property
    def place(self) -> "Setting":
        """What of it decides how the drive goes, everything else at nothing."""
        return Setting(
            0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, self.furniture, self.glass, self.people, self.clutter
        )  # fmt: skip


@dataclass(frozen=True, slots=True)
class Case:
    """One level of one factor, all others at their first.

    Attributes:
        factor: What is disturbed.
        number: Place of the level in the configuration; 0 is what the others are held against.
        level: Its value; of ``together`` the number.
        setting: What that means.
    """

    factor: Factor
    number: int
    level: float
    setting: Setting

    @property
    def name(self) -> str:
        """A name for files; the first levels of all factors are one."""
        return f"{self.factor}-{self.number}" if self.number else FIRST


def first_setting(config: RobustnessConfig) -> Setting:
    """Set every factor to its first level."""
    return Setting(**{factor: getattr(config, factor)[0] for factor in FACTORS[:-1]})


def cases(config: RobustnessConfig) -> list[Case]:
    """List every level of every factor asked for; the first levels of all factors are one and the same setting."""
    first = first_setting(config)
    found: list[Case] = []
    for factor in config.factors:
        if factor == "together":
            disturbed = [name for name in FACTORS[:-1] if name not in ALONE]
            for number in range(max(len(getattr(config, name)) for name in disturbed)):
                values = {name: getattr(config, name)[: number + 1][-1] for name in disturbed}
                found.append(Case(factor, number, float(number), replace(first, **values)))
            continue
        for number, level in enumerate(getattr(config, factor)):
            found.append(Case(factor, number, level, replace(first, **{factor: level})))
    return found
