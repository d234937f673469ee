"""Settings of frontiers, path planning, path following, recovery and the limits of a run."""

from dataclasses import dataclass, fields

from closedrooms.core.errors import InvalidInputError
from closedrooms.core.numbers import bounded
from closedrooms.core.robot import RobotConfig

# Distances that were set for a small robot are at least so much longer than the clearance that a wide one needs [m].
WIDE_ROBOT = 0.3


@dataclass(frozen=True, kw_only=True)
class NavigationConfig:
    """Settings of exploring and driving; the robot itself is described in ``RobotConfig``."""

    clearance_margin: float = 0.03
    """Least distance kept between footprint and mapped obstacles [m]; a 0.8 m door must stay passable."""

    preferred_clearance: float = 0.60
    """Distance from obstacles beyond which a path pays nothing for being close [m]."""

    clearance_weight: float = 4.0
    """How many times a metre along an obstacle costs more than a metre in the open."""

    planning_resolution: float = 0.20
    """Cell size of the planning grid [m]; rounded to whole map cells."""

    frontier_resolution: float = 0.10
    """Cell size on which frontiers are found [m]; rounded to whole map cells."""

    min_frontier: float = 0.30
    """Shortest frontier worth a visit [m]."""

    min_unknown_area: float = 0.12
    """Smallest patch of unknown cells worth a look [m2]; smaller ones are gaps between beams."""

    large_area: float = 2.0
    """Unknown patches from this size on are worth any distance [m2]; closed rooms and the outside are such."""

    worth: float = 15.0
    """How far the robot goes for a smaller patch, per square metre of it [m/m2]."""

    approach: float = 0.50
    """How close to a frontier a goal is put, measured through free space [m]."""

    far_approach: float = 1.20
    """The same for frontiers that cannot be approached any closer (behind furniture, in corners) [m]."""

    fruitless_radius: float = 0.80
    """Frontier cells this close to a goal that was reached without learning anything are given up [m]."""

    braking_reserve: float = 1.25
    """How many times harder the robot can brake than is planned with; at least 1."""

    lookahead: float = 0.55
    """Distance of the pure-pursuit target along the path [m]."""

    turn_in_place: float = 1.2
    """Heading error above which the robot stops and turns [rad]."""

    goal_tolerance: float = 0.20
    """Distance at which a goal counts as reached [m]."""

    check_interval: float = 0.5
    """Time between checks whether the goal is still unknown and the path still free [s]."""

    replan_interval: float = 2.0
    """Time between searches for a clearly nearer goal on the way [s]."""

    switch_ratio: float = 0.5
    """A new goal replaces the current one only when its path costs less than this share of what is left."""

    max_switches: int = 3
    """Times the goal may be replaced on the way before it must be reached or resolved."""

    max_attempts: int = 3
    """Times the same place may be chosen as a goal before it is given up."""

    stuck_time: float = 2.0
    """Time without progress after which the robot recovers [s]."""

    back_off: float = 0.25
    """Distance the robot backs off when stuck [m]."""

    max_recoveries: int = 8
    """Recoveries in a row without a goal reached after which the run ends as ``stuck``."""

    time_limit: float = 7200.0
    """Simulated time after which a run ends with the status ``limit`` [s]."""

    cpu_limit: float = 900.0
    """The same in processor time, exploring and driving together [s]: half of the half hour that a run may take at
    most; reading a large plan, predicting and planning take their part. A run that ends by it may end elsewhere the
    next time."""

    most_cells: int = 40_000_000
    """Cells of the map from which on a run ends with the status ``limit``: 100,000 m2 at 0.05 m."""

    def __post_init__(self) -> None:
        for name in (
            "preferred_clearance",
            "lookahead",
            "time_limit",
            "cpu_limit",
            "most_cells",
        ):
            if not getattr(self, name) > 0:
                raise InvalidInputError(f"navigation {name} {getattr(self, name)}", expected="a number above 0")
        for name in ("planning_resolution", "frontier_resolution"):
            # Finer cells of a building are more than the memory holds, coarser ones wider than its doors.
            bounded(getattr(self, name), 0.02, 1.0, name=f"navigation {name}", unit="m")
        if not self.braking_reserve >= 1.0:
            raise InvalidInputError(f"navigation braking_reserve {self.braking_reserve}", expected="a number from 1 on")

    def for_robot(self, robot: RobotConfig) -> "RobotNavigation":
        """Combine these settings with the robot that drives by them."""
        settings = {item.name: getattr(self, item.name) for item in fields(NavigationConfig)}
        return RobotNavigation(**settings, robot=robot)


@dataclass(frozen=True, kw_only=True)
class RobotNavigation(NavigationConfig):
    """Settings and robot, as planning and driving read them."""

    robot: RobotConfig
    """Whose radius and speeds are planned with."""

    @property
    def required_clearance(self) -> float:
        """Least distance of the robot's centre from a mapped obstacle [m]."""
        return self.robot.radius + self.clearance_margin

    @property
    def passage_width(self) -> float:
        """Width of the narrowest passage that is planned through [m]."""
        return 2.0 * self.required_clearance

    @property
    def open_clearance(self) -> float:
        """Distance from obstacles beyond which a path pays nothing [m]: as preferred, or what a wide robot needs."""
        return max(self.preferred_clearance, self.required_clearance + WIDE_ROBOT)

    @property
    def farthest_approach(self) -> float:
        """How far off a frontier may be looked at from [m]: as set, or as near as a wide robot gets to a wall."""
        return max(self.far_approach, self.required_clearance + WIDE_ROBOT)

    @property
    def deceleration(self) -> float:
        """Deceleration used to plan stopping distances [m/s2]."""
        return self.robot.max_acceleration / self.braking_reserve
