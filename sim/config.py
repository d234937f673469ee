"""What the simulated robot is like: its lidar, its drive, its noise, and how doors move."""

import ctypes
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Literal

from closedrooms.core.errors import InvalidInputError
from closedrooms.core.robot import RobotConfig

FULL_TURN = 2.0 * math.pi
# Physics steps a second: a multiple of every lidar's rate of 5, 10, 40 and 50 Hz [1/s].
STEPS = 200

Body = Literal["wheels", "kinematic"]


def _check(owner: str, condition: bool, what: str, expected: str) -> None:
    if not condition:
        raise InvalidInputError(f"{owner} {what}", expected=expected)


def _finite(*values: float) -> bool:
    return all(map(math.isfinite, values))


@dataclass(frozen=True, kw_only=True)
class LidarConfig:
    """A planar laser scanner that looks horizontally.

    Its angles and times between beams are single-precision numbers, as sensor_msgs/LaserScan carries them.
    """

    beams: int = 720
    """Rays of one sweep."""
    field_of_view: float = FULL_TURN
    """Angle from the first beam to the last, centred on the forward axis [rad]; a full turn has no double beam."""
    range_min: float = 0.1
    """Shortest distance that is measured [m]; nearer things give no measurement (NaN)."""
    range_max: float = 20.0
    """Longest distance that is measured [m]; beyond it there is no return (infinity)."""
    rate: float = 10.0
    """Sweeps a second [Hz]."""
    height: float = 0.3
    """Height of the scan plane above the floor [m]; below every wall, door and piece of furniture."""
    sweep: Literal["instant", "rolling"] = "instant"
    """Whether all beams of a sweep are of one instant, or measured one after the other as the sensor turns."""
    turns: Literal["left", "right"] = "left"
    """Direction in which the sensor turns, seen from above: left is counter-clockwise."""
    mount: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Where the sensor sits on the robot: x, y [m] and heading [rad]."""

    def __post_init__(self) -> None:
        numbers = (self.field_of_view, self.range_min, self.range_max, self.rate, self.height, *self.mount)
        _check("lidar", _finite(*numbers), "with a setting that is not finite", "finite numbers")
        _check("lidar", 1 <= self.beams <= 100_000, f"with {self.beams} beams", "1 to 100000")
        _check("lidar", 0 < self.field_of_view <= FULL_TURN + 1e-9, f"field of view {self.field_of_view:g}",
               "above 0, at most a full turn (6.2832 rad)")  # fmt: skip
        _check("lidar", 0 <= self.range_min < self.range_max, f"range {self.range_min:g} to {self.range_max:g} m",
               "0 <= range_min < range_max")  # fmt: skip
        _check("lidar", self.rate > 0, f"rate {self.rate:g} Hz", "above 0")
        _check("lidar", 0 < self.height < 0.7, f"height {self.height:g} m", "above 0, below 0.7 (furniture's top)")

    @property
    def angle_increment(self) -> float:
        """Angle from one beam to the next [rad]."""
        if self.field_of_view > FULL_TURN - 1e-6:
            return _single(FULL_TURN / self.beams)
        return _single(self.field_of_view / max(self.beams - 1, 1))

    @property
    def beam_times(self) -> tuple[float, float]:
        """When the first and the last beam are measured, against the end of the sweep [s]."""
        if self.sweep == "instant":
            return (0.0, 0.0)
        took = _single(self.angle_increment / FULL_TURN / self.rate) * (self.beams - 1)
        return (-took, 0.0) if self.turns == "left" else (0.0, -took)

    @property
    def angle_min(self) -> float:
        """Angle of the first beam [rad]."""
        return _single(-self.field_of_view / 2.0)


def _single(value: float) -> float:
    """Round to single precision (this module imports nothing heavy)."""
    return ctypes.c_float(value).value


# Figures of the makers' data sheets: field of view, angular step, distances and sweeps a second.
LIDAR_PRESETS: Mapping[str, LidarConfig] = MappingProxyType(
    {
        "default": LidarConfig(),
        # Hokuyo UTM-30LX: 270 deg in steps of 0.25 deg, 0.1 to 30 m, 25 ms a scan.
        "hokuyo-utm-30lx": LidarConfig(
            beams=1081, field_of_view=math.radians(270), range_min=0.1, range_max=30.0, rate=40.0
        ),
        # Hokuyo URG-04LX-UG01: 240 deg in 683 steps of 360/1024 deg, 0.02 to 5.6 m, 100 ms a scan.
        "hokuyo-urg-04lx": LidarConfig(
            beams=683, field_of_view=math.radians(682 * 360 / 1024), range_min=0.02, range_max=5.6, rate=10.0
        ),
        # SICK LMS111: 270 deg in steps of 0.5 deg at 50 Hz, 0.5 to 20 m.
        "sick-lms111": LidarConfig(
            beams=541, field_of_view=math.radians(270), range_min=0.5, range_max=20.0, rate=50.0
        ),
        # Slamtec RPLIDAR A2M8: 360 deg, 8000 samples a second at 10 Hz, 0.2 to 12 m; clockwise, the others are not.
        "rplidar-a2": LidarConfig(beams=800, range_min=0.2, range_max=12.0, rate=10.0, turns="right"),
        # Robotis LDS-01 (TurtleBot3): 360 beams of 1 deg, 0.12 to 3.5 m, 300 turns a minute.
        "robotis-lds-01": LidarConfig(beams=360, range_min=0.12, range_max=3.5, rate=5.0),
    }
)


@dataclass(frozen=True, kw_only=True)
class NoiseConfig:
    """Errors of lidar and odometry.

    The odometry's figures are standard deviations after one metre driven or one full turn. Errors have zero mean and a
    variance that grows linearly with the travelled distance (Thrun, Burgard, Fox: Probabilistic Robotics, section 5.4,
    with its variances per metre and per radian), so that they do not depend on the length of a step. What is
    systematic is a bias of its own.
    """

    range_sd: float = 0.03
    """Standard deviation of a measured distance [m]."""
    dropouts: float = 0.005
    """Share of beams that give no measurement (NaN) [0..1]."""
    outliers: float = 0.002
    """Share of beams that give a distance drawn uniformly over the sensor's range [0..1]."""
    distance: float = 0.03
    """Error of the travelled distance after 1 m [m]."""
    turn_per_metre: float = math.radians(1.5)
    """Error of the heading after 1 m driven [rad]."""
    turn: float = 0.03
    """Error of the heading after one full turn, as a share of that turn."""
    distance_per_turn: float = 0.0
    """Error of the travelled distance after one full turn [m]."""
    bias_distance: float = 0.0
    """Systematic error of the travelled distance, the same the whole run, as a share of it."""
    bias_turn_per_metre: float = 0.0
    """Systematic turn for each metre driven, the same the whole run [rad]."""
    bias_turn: float = 0.0
    """Systematic error of turns, the same the whole run, as a share of the turn."""

    def __post_init__(self) -> None:
        for name in ("range_sd", "distance", "turn_per_metre", "turn", "distance_per_turn"):
            value = getattr(self, name)
            _check("noise", math.isfinite(value) and value >= 0, f"{name} {value:g}", "a finite number, at least 0")
        for name in ("dropouts", "outliers"):
            value = getattr(self, name)
            _check("noise", 0 <= value <= 1, f"{name} {value:g}", "a share from 0 to 1")
        biases = (self.bias_distance, self.bias_turn_per_metre, self.bias_turn)
        _check("noise", _finite(*biases), "with a bias that is not finite", "finite numbers")

    @property
    def alphas(self) -> tuple[float, float, float, float]:
        """The motion model's alpha 1 to 4 (Probabilistic Robotics, table 5.6) for variances linear in the motion.

        Variance of the heading per radian turned [rad], of the heading per metre driven [rad^2/m], of the distance per
        metre driven [m], of the distance per radian turned [m^2/rad].
        """
        return (
            (self.turn * FULL_TURN) ** 2 / FULL_TURN,
            self.turn_per_metre**2,
            self.distance**2,
            self.distance_per_turn**2 / FULL_TURN,
        )


NOISE_LEVELS: Mapping[str, NoiseConfig] = MappingProxyType(
    {
        "none": NoiseConfig(range_sd=0.0, dropouts=0.0, outliers=0.0, distance=0.0, turn_per_metre=0.0, turn=0.0),
        "low": NoiseConfig(
            range_sd=0.01, dropouts=0.001, outliers=0.0, distance=0.01, turn_per_metre=math.radians(0.5), turn=0.01
        ),
        "medium": NoiseConfig(),
        "high": NoiseConfig(
            range_sd=0.05, dropouts=0.02, outliers=0.01, distance=0.08, turn_per_metre=math.radians(4.0), turn=0.08
        ),
    }
)


def noise_level(name: str) -> NoiseConfig:
    """Look up the noise of a level: ``none``, ``low``, ``medium`` or ``high``.

    Raises:
        InvalidInputError: No such level.
    """
    if name not in NOISE_LEVELS:
        raise InvalidInputError(f"unknown noise level {name!r}", expected=f"one of {', '.join(NOISE_LEVELS)}")
    return NOISE_LEVELS[name]


def lidar_preset(name: str) -> LidarConfig:
    """Look up a lidar of ``LIDAR_PRESETS`` by its name.

    Raises:
        InvalidInputError: No such lidar.
    """
    if name not in LIDAR_PRESETS:
        raise InvalidInputError(f"unknown lidar {name!r}", expected=f"one of {', '.join(LIDAR_PRESETS)}")
    return LIDAR_PRESETS[name]


@dataclass(frozen=True, kw_only=True)
class FaultConfig:
    """Failures of the robot's sensors and odometry; none by default."""

    lost_scans: float = 0.0
    """Share of sweeps that arrive without a measurement [0..1]."""
    odometry_freezes: float = 0.0
    """How often the odometry stands still for a while and then reports the whole motion at once [1/min]."""
    freeze_seconds: float = 1.0
    """How long it does [s]."""
    odometry_drops: float = 0.0
    """How often the motion between two sweeps is never counted [1/min]."""
    unequal_wheels: float = 0.0
    """How much larger the right wheel is than the left, unknown to the odometry, as a share of it."""
    phantom_doors: int = 0
    """Places on plain walls where the detector often reports a closed door."""

    def __post_init__(self) -> None:
        for name in ("odometry_freezes", "freeze_seconds", "odometry_drops"):
            value = getattr(self, name)
            _check("faults", math.isfinite(value) and value >= 0, f"{name} {value:g}", "a finite number, at least 0")
        _check("faults", 0 <= self.lost_scans <= 1, f"lost_scans {self.lost_scans:g}", "a share from 0 to 1")
        _check("faults", abs(self.unequal_wheels) < 0.5, f"unequal_wheels {self.unequal_wheels:g}", "within +-0.5")
        _check("faults", 0 <= self.phantom_doors <= 1000, f"{self.phantom_doors} phantom_doors", "0 to 1000")


@dataclass(frozen=True, kw_only=True)
class SimConfig:
    """The simulated world and the robot in it."""

    lidar: LidarConfig = field(default_factory=LidarConfig)
    """The laser scanner."""
    robot: RobotConfig = field(default_factory=RobotConfig)
    """Body and drive."""
    noise: NoiseConfig = field(default_factory=NoiseConfig)
    """Errors of lidar and odometry; the default is the level ``medium``."""
    gui: bool = False
    """Show the bodies in PyBullet's window while they move (wheels); needs a display."""
    body: Body = "kinematic"
    """What the robot is: a body on driven wheels with contacts and friction, or a disc that code moves exactly."""
    robot_urdf: Path | None = None
    """A robot of one's own (URDF) that drives on two sides: its size, wheels and lidar in place of those set here."""
    robot_wheels: str | None = None
    """Its driven wheels, names of joints with commas between them; found by themselves where not given."""
    doors: Literal["latched", "unlatched"] = "latched"
    """How closed doors open: ``latched`` by their motor alone, ``unlatched`` also when the robot (wheels) pushes."""
    glass: float = 0.0
    """Share of the walls, drawn by the seed, that are of glass beside those that the plan says are [0..1]."""
    people: int = 0
    """People who walk from room to room."""
    clutter: int = 0
    """Boxes that somebody puts elsewhere about every minute while the robot is away."""
    faults: FaultConfig = field(default_factory=FaultConfig)
    """What fails."""
    heading: float | None = None
    """Heading of the start, and so of the map frame, against the building [rad]; the plan's where not given."""
    swing: float = math.radians(95.0)
    """How far hinged doors open where nothing blocks them [rad]."""
    door_seconds: float = 2.0
    """Time that a door takes to open wholly [s]; 0 opens it at once."""

    def __post_init__(self) -> None:
        heading_ok = self.heading is None or math.isfinite(self.heading)
        _check("simulation", heading_ok, f"heading {self.heading}", "a finite angle [rad]")
        _check("simulation", 0 < self.swing <= math.pi, f"swing {self.swing:g} rad", "above 0, at most half a turn")
        seconds_ok = math.isfinite(self.door_seconds) and self.door_seconds >= 0
        _check("simulation", seconds_ok, f"door_seconds {self.door_seconds:g}", "a finite time, at least 0")
        _check("simulation", 0 <= self.glass <= 1, f"glass {self.glass:g}", "a share from 0 to 1")
        for name in ("people", "clutter"):
            value = getattr(self, name)
            _check("simulation", 0 <= value <= 200, f"{name} {value}", "0 to 200")
        _check(
            "simulation",
            not self.gui or self.body == "wheels",
            "with a window and a kinematic body",
            "--sim.body wheels",
        )
        if self.robot_urdf is not None or self.robot_wheels is not None:
            _check("simulation", self.body == "wheels", "of a robot_urdf with a kinematic body", "--sim.body wheels")
            _check("simulation", self.robot_urdf is not None, f"wheels {self.robot_wheels!r} of no robot",
                   "a robot_urdf that has them")  # fmt: skip
        if self.body == "wheels":
            steps = STEPS / self.lidar.rate
            _check("simulation", abs(steps - round(steps)) < 1e-9 and steps >= 1.0,
                   f"lidar rate {self.lidar.rate:g} Hz on a body that is stepped {STEPS} times a second",
                   f"a rate that divides {STEPS}, or --sim.body kinematic")  # fmt: skip
        else:
            _check("simulation", self.doors == "latched", "of a kinematic robot with unlatched doors",
                   "--sim.body wheels: only a body pushes doors open")  # fmt: skip
        x, y, _ = self.lidar.mount
        _check("simulation", math.hypot(x, y) <= self.robot.radius, f"lidar mounted at ({x:g}, {y:g}) m",
               f"a place on the robot (radius {self.robot.radius:g} m)")  # fmt: skip
