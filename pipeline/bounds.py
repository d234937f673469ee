"""What a run stays within: its building's outline, a size that fits into memory, doors as wide as the robot."""

import shapely
from shapely.geometry import Polygon

from closedrooms.core.errors import InvalidInputError
from closedrooms.core.pose import Pose2
from closedrooms.core.remarks import Remark
from closedrooms.core.robot import RobotConfig
from closedrooms.navigation.config import NavigationConfig, RobotNavigation
from closedrooms.navigation.control_loop import EarlyEnd
from closedrooms.worlds.connectivity import connected_parts
from closedrooms.worlds.geometry import areal, wall_area
from closedrooms.worlds.plan import FloorPlan
from closedrooms.worlds.truth import truth_bounds

# A robot this far out of the building's outline has left it [m]: what lies between two rooms that a plan draws apart is
# closer as a rule.
OUTSIDE_MARGIN = 2.0


class BuildingBounds:
    """Watchdog over a robot: a building's outline with a margin around it; courtyards are inside."""

    def __init__(self, plan: FloorPlan) -> None:
        floor = areal(shapely.union_all([*(room.polygon for room in plan.rooms), wall_area(plan)]))
        filled = [Polygon(part.exterior) for part in shapely.get_parts(floor) if isinstance(part, Polygon)]
        self._area = shapely.union_all(filled).buffer(OUTSIDE_MARGIN)
        shapely.prepare(self._area)

    def check(self, world_T_robot: Pose2) -> EarlyEnd | None:
        """End the run of a robot that is outside; its true pose in the building frame."""
        x, y = world_T_robot.x, world_T_robot.y
        if shapely.contains_xy(self._area, x, y):
            return None
        return EarlyEnd("outside", f"the robot left the building at ({x:.1f}, {y:.1f}): its outline has a gap")


def check_size(plan: FloorPlan, resolution: float, limits: NavigationConfig) -> None:
    """Refuse a building whose map would have too many cells before any memory is taken.

    Args:
        plan: The building.
        resolution: Metres per cell of the map.
        limits: With ``most_cells``.

    Raises:
        InvalidInputError: It is too large.
    """
    x_min, y_min, x_max, y_max = truth_bounds(plan, Pose2())
    cells = (x_max - x_min) / resolution * (y_max - y_min) / resolution
    # The map of a building that lies at an angle to it takes up to twice as much.
    most = limits.most_cells / 2
    if cells > most:
        raise InvalidInputError(
            f"a building of {x_max - x_min:.0f} m x {y_max - y_min:.0f} m has {cells:.2g} cells of {resolution:g} m",
            expected=f"at most {most:.2g} (a larger --mapper.resolution)", where=plan.name,
        )  # fmt: skip


def check_width(plan: FloorPlan, robot: RobotConfig) -> None:
    """Refuse a robot that no passage between two rooms lets through: it would map the room that it starts in.

    Args:
        plan: The building; one without passages is left to its one room.
        robot: Its radius counts, as it counts for the planner.

    Raises:
        InvalidInputError: It is wider than every passage.
    """
    widths = [shapely.LineString(passage.segment).length for passage in plan.passages if None not in passage.rooms]
    if widths and max(widths) < 2.0 * robot.radius:
        raise InvalidInputError(
            f"a robot {2.0 * robot.radius:.2f} m wide where the widest passage measures {max(widths):.2f} m",
            expected="one that fits through a door", where=plan.name,
        )  # fmt: skip


def too_narrow(plan: FloorPlan, closed: tuple[str, ...], start: Pose2, config: RobotNavigation) -> list[Remark]:
    """Say which rooms a robot cannot enter because no passage to them is wide enough, closed doors aside.

    Args:
        plan: The building.
        closed: Doors that are closed.
        start: Where the robot starts, building frame.
        config: The robot.
    """
    place = shapely.Point(start.x, start.y)
    home = next((room.id for room in plan.rooms if room.polygon.covers(place)), None)
    if home is None:
        return []
    names = [room.id for room in plan.rooms]
    open_passages = [passage for passage in plan.passages if passage.id not in closed]
    wide = [p.rooms for p in open_passages if shapely.LineString(p.segment).length >= config.passage_width]
    reached, entered = (
        next(part for part in connected_parts(names, sides) if home in part)
        for sides in ([p.rooms for p in open_passages], wide)
    )
    shut_off = tuple(name for name in names if name in reached - entered)
    if not shut_off:
        return []
    why = (
        f"no passage there is {config.passage_width:.2f} m wide, which a robot of radius {config.robot.radius:g} m "
        "needs; they are seen from outside at best"
    )
    what = "room" if len(shut_off) == 1 else "rooms"
    return [Remark(action="dropped", what=what, why=why, names=shut_off, count=len(shut_off))]
