"""Settings of frontiers, path planning, path following and recovery."""

from dataclasses import dataclass

from closedrooms.core.errors import InvalidInputError


@dataclass(frozen=True, kw_only=True)
class NavigationConfig:
    """How the robot chooses where to go and how it drives there."""

    robot_radius: float = 0.20
    """Radius of the robot's footprint [m]."""

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
    """Unknown patches from this size on are worth any way [m2]; closed rooms and the outside are such."""

    worth: float = 15.0
    """How far the robot goes for a smaller patch, per square metre of it [m/m2]."""

    approach: float = 0.50
    """How close to a frontier a goal is put, measured through free space [m]."""

    far_approach: float = 1.20
    """The same for frontiers that cannot be approached any closer (behind furniture, in corners) [m]."""

    fruitless_radius: float = 0.80
    """Frontier cells this close to a goal that was reached without learning anything are given up [m]."""

    max_speed: float = 1.0
    """Fastest drive command [m/s]."""

    max_turn_rate: float = 2.0
    """Fastest turn command [rad/s]."""

    acceleration: float = 1.2
    """Deceleration used to plan stopping distances [m/s2]."""

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
    """Simulated time after which exploration ends with the status ``limit`` [s]."""

    def __post_init__(self) -> None:
        for name in (
            "robot_radius",
            "preferred_clearance",
            "planning_resolution",
            "frontier_resolution",
            "max_speed",
            "max_turn_rate",
            "acceleration",
            "lookahead",
            "time_limit",
        ):
            if not getattr(self, name) > 0.0:
                raise InvalidInputError(f"navigation {name} {getattr(self, name)}", expected="a number above 0")

    @property
    def required_clearance(self) -> float:
        """Least distance of the robot's centre from a mapped obstacle [m]."""
        return self.robot_radius + self.clearance_margin
