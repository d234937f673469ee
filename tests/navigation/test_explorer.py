"""When an exploration keeps, drops and changes its goal: with a search and a driver that do as they are told."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from closedrooms.core.grid import FREE, OCCUPIED, UNKNOWN, GridFrame, OccupancyGrid
from closedrooms.core.pose import Pose2
from closedrooms.core.robot import RobotConfig
from closedrooms.core.scan import LaserScan
from closedrooms.navigation.config import NavigationConfig
from closedrooms.navigation.decider import Situation
from closedrooms.navigation.driving.costmap import NavigationMap
from closedrooms.navigation.driving.planner import PlannedPath
from closedrooms.navigation.explorer import CHANCES, HELD_UP, SAME_PLACE, SETTLE, WAIT, Explorer
from closedrooms.navigation.goal_search import Goal

CONFIG = NavigationConfig().for_robot(RobotConfig())
HERE = Pose2(1.0, 2.0, 0.0)


def hall(known: float = 6.0, *walls: tuple[float, float, float, float]) -> OccupancyGrid:
    """A hall of 10 x 4 m from the origin, free up to x = ``known`` [m] and unknown from there, with walls."""
    cells = np.full((80, 200), UNKNOWN, dtype=np.int8)
    cells[:, : round(known / 0.05)] = FREE
    for x0, y0, x1, y1 in walls:
        cells[round(y0 / 0.05) : round(y1 / 0.05), round(x0 / 0.05) : round(x1 / 0.05)] = OCCUPIED
    return OccupancyGrid(GridFrame(0.05, 0.0, 0.0, 80, 200), cells)


FRONTIER = np.array([(5.95, y) for y in np.arange(1.05, 3.0, 0.1)])


def goal(x: float, y: float = 2.0, *, cost: float | None = None, frontier: np.ndarray = FRONTIER) -> Goal:
    length = math.dist((x, y), (HERE.x, HERE.y))
    return Goal((x, y), frontier, PlannedPath(np.array([(HERE.x, HERE.y), (x, y)]), length if cost is None else cost))


class Map(NavigationMap):
    """Notes what is added."""

    def __init__(self) -> None:
        super().__init__(CONFIG)
        self.obstacles: list[np.ndarray] = []

    def add_obstacles(self, points: np.ndarray) -> None:
        self.obstacles.append(points)


class Search:
    """Goals in the order in which they are found."""

    def __init__(self, *goals: Goal | None, again: int = 0, enclosed: bool = False) -> None:
        self.goals, self.again, self.enclosed = list(goals), again, enclosed
        self.count = 0
        self.map = Map()
        self.frontiers = FRONTIER
        self.put: list[np.ndarray] = []
        self.given_up: list[np.ndarray] = []

    def find(self, pose: Pose2, grid: OccupancyGrid) -> Goal | None:  # noqa: ARG002
        self.count += 1
        return self.goals.pop(0) if self.goals else None

    def try_again(self) -> bool:
        self.again -= 1
        return self.again >= 0

    def put_off(self, points: np.ndarray) -> None:
        self.put.append(points)

    def give_up(self, points: np.ndarray) -> None:
        self.given_up.append(points)


class Driver:
    """Driver in a state that is set; it turns as long as it is told to."""

    def __init__(self) -> None:
        self.state, self.recoveries, self.remaining, self.turn = "driving", 0, 4.0, None
        self.followed: list[Any] = []
        self.faced: list[Any] = []
        self.stops = 0

    def follow(self, points: np.ndarray, stamp: float) -> None:
        self.followed.append((points.tolist(), stamp))

    def command(self, *_: Any) -> tuple[float, float]:
        return (0.5, 0.0)

    def ahead(self, distance: float) -> np.ndarray:
        return np.array([(HERE.x + s, HERE.y) for s in np.arange(0.0, min(distance, 4.0) + 1e-9, 0.1)])

    def face(self, pose: Pose2, place: tuple[float, float]) -> Any:
        self.faced.append((pose, place))
        return self.turn

    def stop(self) -> None:
        self.stops += 1


def exploring(search: Search) -> tuple[Explorer, Any]:
    explorer = Explorer(CONFIG)
    explorer._search = search  # type: ignore[assignment]
    explorer._driver = Driver()  # type: ignore[assignment]
    return explorer, explorer._driver


def at(stamp: float, grid: OccupancyGrid | None = None, bumps: tuple[float, ...] = ()) -> Situation:
    scan = LaserScan(np.full(8, 4.0), -math.pi, math.pi / 4, 20.0, stamp=stamp)
    return Situation(HERE, scan, lambda: hall() if grid is None else grid, bumps)


def test_the_first_goal_is_taken_and_driven_to() -> None:
    explorer, driver = exploring(Search(goal(5.0)))
    assert explorer.command(at(2.0)) == (0.5, 0.0)
    assert explorer.goal is not None
    assert explorer.goal.place == (5.0, 2.0)
    assert driver.followed == [([[1.0, 2.0], [5.0, 2.0]], 2.0)]
    assert (explorer.searches, explorer.status) == (1, None)
    assert explorer.frontiers is FRONTIER


@pytest.mark.parametrize(("enclosed", "status"), [(False, "complete"), (True, "stuck")])
def test_without_a_goal_it_is_done_or_stuck(enclosed: bool, status: str) -> None:
    explorer, driver = exploring(Search(None, enclosed=enclosed))
    assert explorer.command(at(0.0)) == (0.0, 0.0)
    assert explorer.status == status
    assert driver.followed == []


def test_before_it_ends_it_tries_again_what_kept_it_from_somewhere_a_few_times() -> None:
    search = Search(None, None, None, again=9)
    explorer, driver = exploring(search)
    driver.recoveries = 2
    for number in range(CHANCES + 1):
        assert explorer.status is None
        for stamp in (0.0, 0.5 * WAIT):
            assert explorer.command(at(number * WAIT + stamp)) == (0.0, 0.0)
        assert search.count == number + 1
    assert explorer.status == "complete"
    assert driver.recoveries == 0
    # Where there is nothing to try again it ends at once.
    search = Search(None, None)
    exploring(search)[0].command(at(0.0))
    assert search.count == 1


def test_the_goal_is_looked_at_every_half_second_and_kept_while_it_is_unknown() -> None:
    explorer, driver = exploring(Search(goal(5.0)))
    explorer.command(at(0.0))
    known = hall(9.0)
    explorer.command(at(CONFIG.check_interval - 0.05, known))
    assert explorer.goal is not None
    explorer.command(at(CONFIG.check_interval))
    assert explorer.goal is not None
    explorer.command(at(2 * CONFIG.check_interval - 0.05, known))
    assert explorer.goal is not None
    assert driver.stops == 0
    explorer.command(at(2 * CONFIG.check_interval, known))
    assert driver.stops == 1
    # It is known by now, and no other one is left.
    assert explorer.goal is None
    assert explorer.status == "complete"


@pytest.mark.parametrize(("left", "kept"), [(3, True), (2, False)])
def test_a_frontier_shorter_than_is_worth_a_visit_is_dropped(left: int, kept: bool) -> None:
    # So many of its cells are still beside unknown ones.
    few = np.concatenate((FRONTIER[:left], FRONTIER[left:] - (3.0, 0.0)))
    explorer, _ = exploring(Search(goal(5.0, frontier=few), goal(4.0)))
    explorer.command(at(0.0))
    explorer.command(at(1.0))
    assert explorer.goal is not None
    assert explorer.goal.place[0] == (5.0 if kept else 4.0)


def test_a_path_that_is_blocked_ahead_is_planned_anew() -> None:
    for wall, goals in (((3.0, 1.9, 3.1, 2.1), 2), ((4.8, 1.9, 4.9, 2.1), 1)):
        # 2 m and 3.8 m ahead: 3 m are looked at.
        search = Search(goal(5.0), goal(5.0, 2.5))
        explorer, driver = exploring(search)
        explorer.command(at(0.0))
        explorer.command(at(1.0, hall(6.0, wall)))
        assert search.count == goals
        assert len(driver.followed) == goals
        assert driver.stops == 0


def reconsidered(*others: Goal | None, stamp: float = 2.0, remaining: float = 4.0) -> tuple[Explorer, Any, Search]:
    """On the way to a goal 4 m away, others are found when it is time to."""
    search = Search(goal(5.0), *others)
    explorer, driver = exploring(search)
    explorer.command(at(0.0))
    driver.remaining = remaining
    explorer.command(at(stamp))
    return explorer, driver, search


def test_a_goal_that_is_clearly_nearer_is_taken_on_the_way() -> None:
    for cost, taken in ((1.9, True), (2.1, False)):
        explorer, driver, search = reconsidered(goal(2.0, 3.5, cost=cost))
        assert search.count == 2
        assert explorer.goal is not None
        assert (explorer.goal.place == (2.0, 3.5)) == taken
        assert len(driver.followed) == (2 if taken else 1)
    # Not before it is time.
    assert reconsidered(goal(2.0, 3.5, cost=0.1), stamp=1.95)[2].count == 1
    # Half of what is left of the cost: of 4 m 2 m are left, and a metre cost as much as it is long.
    for cost, taken in ((0.9, True), (1.1, False)):
        explorer, *_ = reconsidered(goal(2.0, 3.5, cost=cost), remaining=2.0)
        assert explorer.goal is not None
        assert (explorer.goal.place == (2.0, 3.5)) == taken


def test_what_is_left_is_reckoned_by_the_cost_of_the_way() -> None:
    # 4 m that cost 12, of which 1 m is left: a goal is taken below half of 3.
    for cost, taken in ((1.4, True), (1.6, False)):
        search = Search(goal(5.0, cost=12.0), goal(2.0, 3.5, cost=cost))
        explorer, driver = exploring(search)
        explorer.command(at(0.0))
        driver.remaining = 1.0
        explorer.command(at(2.0))
        assert explorer.goal is not None
        assert (explorer.goal.place == (2.0, 3.5)) == taken


def test_the_path_to_the_same_place_is_refreshed_whatever_it_costs_and_counts_as_no_change() -> None:
    near = [goal(5.0, 2.0 + off, cost=9.0) for off in (0.1, 0.2, 0.3, 0.2, 0.1)]
    search = Search(goal(5.0), *near)
    explorer, driver = exploring(search)
    for number in range(6):
        explorer.command(at(2.0 * number))
    assert search.count == 6
    assert len(driver.followed) == 6
    # A place half a metre away is another one.
    for off, taken in ((SAME_PLACE - 0.01, True), (SAME_PLACE + 0.01, False)):
        explorer, *_ = reconsidered(goal(5.0, 2.0 + off, cost=9.0))
        assert explorer.goal is not None
        assert (explorer.goal.place[1] > 2.0) == taken


def test_the_goal_changes_so_many_times_on_the_way_and_then_stays_until_it_is_reached() -> None:
    nearer = [goal(4.0 - 0.6 * n, 3.5, cost=1.5 * 0.4**n) for n in range(9)]
    search = Search(goal(5.0), *nearer)
    explorer, driver = exploring(search)
    for number in range(12):
        explorer.command(at(2.0 * number))
    assert len(driver.followed) == 1 + CONFIG.max_switches
    # It does not even search any more.
    assert search.count == 1 + CONFIG.max_switches


def test_no_other_goal_leaves_the_one_there_is() -> None:
    explorer, driver, _ = reconsidered(None)
    assert explorer.goal is not None
    assert len(driver.followed) == 1


def test_a_place_is_chosen_so_many_times_and_then_put_off() -> None:
    search = Search(*(goal(5.0, 2.0 + 0.05 * n) for n in range(8)), goal(3.0))
    explorer, _ = exploring(search)
    for number in range(CONFIG.max_attempts):
        explorer.command(at(0.1 * number))
        assert explorer.goal is not None
        explorer.goal = None
    assert search.put == []
    explorer.command(at(1.0))
    assert explorer.goal is not None
    assert explorer.goal.place == (3.0, 2.0)
    assert len(search.put) == 8 - CONFIG.max_attempts
    assert all(points is FRONTIER for points in search.put)


def test_far_places_are_counted_apart() -> None:
    search = Search(*(goal(2.0 + 0.6 * n) for n in range(4)), *(goal(2.0 + 0.6 * n) for n in range(4)))
    explorer, _ = exploring(search)
    for number in range(8):
        explorer.command(at(0.1 * number))
        explorer.goal = None
    assert search.put == []


def arrived(search: Search, turn: Any = None) -> tuple[Explorer, Any]:
    explorer, driver = exploring(search)
    explorer.command(at(9.9))
    driver.state = "arrived"
    assert explorer.command(at(10.0)) == (0.5, 0.0)
    driver.state, driver.turn = "idle", turn
    return explorer, driver


def test_at_its_goal_the_robot_turns_to_the_nearest_cell_of_the_frontier_for_half_a_turn_at_most() -> None:
    # At its fastest a whole turn takes 2 pi by the turn rate.
    long = 2.0 * math.pi / CONFIG.robot.max_turn_rate
    explorer, driver = arrived(
        Search(goal(5.0, frontier=np.array([(5.95, 2.9), (5.95, 1.3), (5.95, 0.2)]))), (0.0, 1.0)
    )
    for stamp in (10.1, 10.0 + SETTLE + 0.1, 10.0 + long - 0.01):
        assert explorer.command(at(stamp)) == (0.0, 1.0)
    assert all(faced == (HERE, (5.95, 1.3)) for faced in driver.faced)
    assert explorer.goal is not None
    explorer.command(at(10.0 + long + 0.01))
    assert explorer.goal is None


def test_facing_its_goal_the_robot_waits_for_the_map_and_gives_up_what_stays_unknown_nearby() -> None:
    frontier = np.array([(5.95, y) for y in np.arange(0.55, 4.0, 0.1)])
    search = Search(goal(5.5, frontier=frontier), goal(3.0))
    explorer, driver = arrived(search)
    assert explorer.command(at(10.0 + SETTLE - 0.01)) == (0.0, 0.0)
    assert search.given_up == []
    assert explorer.command(at(10.0 + SETTLE)) == (0.0, 0.0)
    (points,) = search.given_up
    away = np.hypot(*(frontier - (5.5, 2.0)).T)
    assert points.tolist() == frontier[away <= CONFIG.fruitless_radius].tolist()
    assert 3 <= len(points) < len(frontier)
    assert driver.stops == 1
    # And then on to the next one, which is driven to at once.
    assert explorer.command(at(10.5)) == (0.5, 0.0)
    assert explorer.goal is not None
    assert explorer.goal.place == (3.0, 2.0)


def test_of_a_frontier_that_lies_farther_off_its_nearest_cell_is_given_up() -> None:
    search = Search(goal(4.0))
    explorer, _ = arrived(search)
    explorer.command(at(11.0))
    (points,) = search.given_up
    assert sorted(points.tolist()) == pytest.approx(np.array([(5.95, 1.95), (5.95, 2.05)]))


@pytest.mark.parametrize(("left", "given_up"), [(3, True), (2, False)])
def test_what_is_left_is_given_up_where_it_is_as_long_as_a_frontier(left: int, given_up: bool) -> None:
    few = np.concatenate((FRONTIER[:left], FRONTIER[left:] - np.array([3.0, 0.0])))
    search = Search(goal(5.5, frontier=few))
    explorer, _ = arrived(search)
    explorer.command(at(10.0 + SETTLE))
    assert (len(search.given_up) == 1) == given_up
    assert explorer.goal is None


def test_what_has_become_known_is_not_given_up() -> None:
    search = Search(goal(5.0))
    explorer, driver = arrived(search)
    explorer.command(at(10.45, hall(9.0)))
    assert search.given_up == []
    assert explorer.goal is None
    assert driver.stops == 1
    # On the way to the end of its turn too, when the goal is looked at again.
    search = Search(goal(5.0))
    explorer, driver = arrived(search, (0.0, 1.0))
    explorer.command(at(10.6, hall(9.0)))
    assert driver.stops == 1
    assert explorer.status == "complete"


def test_while_it_looks_the_path_and_other_goals_do_not_matter() -> None:
    search = Search(goal(5.0), goal(2.0, 3.5, cost=0.1))
    explorer, _ = arrived(search, (0.0, 1.0))
    assert explorer.command(at(12.5, hall(6.0, (3.0, 1.9, 3.1, 2.1)))) == (0.0, 1.0)
    assert search.count == 1


def stuck(
    explorer: Explorer,
    driver: Any,
    recoveries: int,
    stamp: float,
    scan: LaserScan | None = None,
    pose: Pose2 = HERE,
) -> None:
    """Let the driver find that it is stuck, something pressing from ahead."""

    def command(*_: Any) -> tuple[float, float]:
        driver.state, driver.recoveries = "stuck", recoveries
        return (0.0, 0.0)

    driver.command = command
    now = at(stamp, bumps=(0.0,))
    explorer.command(replace(now, scan=now.scan if scan is None else scan, pose=pose))


@pytest.mark.parametrize("recoveries", range(1, 2 * HELD_UP + 1))
def test_what_holds_the_robot_is_noted_and_a_barrier_across_the_way_when_it_happens_again_and_again(
    recoveries: int,
) -> None:
    search = Search(goal(5.0))
    explorer, driver = exploring(search)
    explorer.command(at(0.0))
    stuck(explorer, driver, recoveries, 0.1)
    assert explorer.goal is None
    felt, *barrier = search.map.obstacles
    # What presses from ahead, at its radius.
    assert felt == pytest.approx(np.array([(HERE.x + CONFIG.robot.radius, HERE.y)]))
    assert len(barrier) == (recoveries % HELD_UP == 0)
    if barrier:
        # Right across its way, which leads along x.
        assert np.ptp(barrier[0][:, 0]) < 1e-9
        assert barrier[0][:, 0].min() > HERE.x


@pytest.mark.parametrize(("recoveries", "again", "status"), [(8, 1, None), (9, 1, None), (9, 0, "stuck")])
def test_a_robot_that_is_held_up_too_often_gets_another_chance_where_something_may_have_walked_on(
    recoveries: int, again: int, status: str | None
) -> None:
    explorer, driver = exploring(Search(goal(5.0), again=again))
    explorer.command(at(0.0))
    stuck(explorer, driver, recoveries, 0.1)
    assert explorer.status == status
    assert driver.recoveries == (0 if recoveries > CONFIG.max_recoveries and again else recoveries)


def test_a_bump_that_shows_what_the_map_does_not_counts_neither_as_recovery_nor_as_attempt() -> None:
    attempts = CONFIG.max_attempts + 2
    search = Search(*[goal(5.0) for _ in range(attempts)], None)
    explorer, driver = exploring(search)
    for attempt in range(attempts):
        driver.state, driver.command = "driving", lambda *_: (0.5, 0.0)
        assert explorer.command(at(float(attempt))) == (0.5, 0.0)
        # A wall 1 m ahead, in what the map shows as free, farther along each time.
        scan = LaserScan(np.full(8, 0.6 + 0.45 * attempt), -math.pi, math.pi / 4, 20.0, stamp=attempt + 0.1)
        stuck(explorer, driver, CONFIG.max_recoveries + 1, attempt + 0.1, scan)
        assert (explorer.status, driver.recoveries) == (None, 0)
    assert search.put == []


@pytest.mark.parametrize(("moved", "status"), [(SAME_PLACE - 0.01, "stuck"), (SAME_PLACE + 0.01, None)])
def test_a_goal_that_it_never_gets_to_is_put_off_by_a_robot_that_can_move(moved: float, status: str | None) -> None:
    search = Search(goal(5.0))
    explorer, driver = exploring(search)
    explorer.command(at(0.0))
    stuck(explorer, driver, 1, 0.1)
    explorer.goal = goal(5.0)
    driver.state = "driving"
    stuck(explorer, driver, CONFIG.max_recoveries + 1, 9.0, pose=Pose2(HERE.x, HERE.y + moved, 0.0))
    assert explorer.status == status
    assert [points.tolist() for points in search.put] == ([] if status else [FRONTIER.tolist()])
