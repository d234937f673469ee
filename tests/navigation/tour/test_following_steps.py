"""Following a tour on maps that are given, by a robot that goes along its path as it is told, without any scan."""

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pytest
from shapely.geometry import box

from closedrooms.core.door import ClosedDoor
from closedrooms.core.grid import FREE, OCCUPIED, UNKNOWN, GridFrame, OccupancyGrid
from closedrooms.core.pose import Pose2
from closedrooms.core.robot import RobotConfig
from closedrooms.core.room import Room
from closedrooms.core.scan import LaserScan
from closedrooms.coverage.config import CoverageConfig, GraphConfig
from closedrooms.coverage.tour.tour_planner import plan_coverage
from closedrooms.navigation.config import NavigationConfig
from closedrooms.navigation.decider import Situation
from closedrooms.navigation.tour.tour_follower import AT_DOOR, DOOR_WAIT, MAX_ATTEMPTS, TourFollower, TourPlan
from closedrooms.predictor.inpainting import inpaint
from closedrooms.predictor.prediction import Prediction

FRAME = GridFrame(0.05, 0.0, 0.0, 170, 300)
CONFIG = NavigationConfig().for_robot(RobotConfig())
PLAIN = CoverageConfig(graph=GraphConfig(clutter_filter=False))
# A corridor from (1, 1) to (14, 3), three rooms above it behind doorways at x = 2 to 2.9, 6.3 to 7.2, 10.6 to 11.5.
ROOMS = tuple(box(1.0 + 4.3 * n, 3.2, 5.0 + 4.3 * n, 7.2) for n in range(3))
DOORS = tuple(
    ClosedDoor(f"d{n}", (2.45 + 4.3 * n, 3.1), ((2.0 + 4.3 * n, 3.1), (2.9 + 4.3 * n, 3.1)), 0.9) for n in range(3)
)
START = Pose2(2.0, 2.0, 0.0)


def floor(seen: Sequence[int] = (), shut: Sequence[int] = ()) -> OccupancyGrid:
    """What is known: the corridor, the doorways of open doors, and the rooms that were seen."""
    cells = np.full(FRAME.shape, UNKNOWN, dtype=np.int8)
    cells[16:64, 16:284] = OCCUPIED
    cells[20:60, 20:280] = FREE
    for number in range(3):
        left = 20 + 86 * number
        if number not in shut:
            cells[60:64, left + 20 : left + 38] = FREE
        if number in seen:
            cells[60:148, left - 4 : left + 84] = np.where(cells[60:148, left - 4 : left + 84] == FREE, FREE, OCCUPIED)
            cells[64:144, left : left + 80] = FREE
    return OccupancyGrid(FRAME, cells)


def predict(grid: OccupancyGrid, doors: Sequence[ClosedDoor]) -> Prediction:
    """All rooms as they are."""
    by_id = dict(zip(("d0", "d1", "d2"), ROOMS, strict=True))
    rooms = tuple(Room(by_id[door.id], (door.id,), "independent") for door in doors)
    gaps = [box(a[0], 2.9, b[0], 3.4) for a, b in (door.segment for door in doors if door.segment)]
    return Prediction(inpaint(grid, [room.polygon for room in rooms], gaps), rooms)


def following(count: int = 3, *, unsure: float = 0.0, confidence: Sequence[float | None] = (None,) * 3) -> TourFollower:
    prediction = predict(floor(), DOORS[:count])
    rooms = tuple(
        Room(room.polygon, room.doors, room.kind, confidence=sure)
        for room, sure in zip(prediction.rooms, confidence, strict=False)
    )
    prediction = Prediction(prediction.grid, rooms)
    tour = plan_coverage(prediction.grid, config=PLAIN, start=(START.x, START.y))
    return TourFollower(TourPlan(prediction, tour, DOORS[:count], unsure), CONFIG, predict, PLAIN)


def situation(pose: Pose2, stamp: float, grid: OccupancyGrid) -> Situation:
    scan = LaserScan(np.full(8, np.inf), -math.pi, math.pi / 4, 20.0, stamp=stamp)
    return Situation(pose, scan, lambda: grid)


def drive(
    follower: TourFollower, known: Callable[[Pose2], OccupancyGrid], *, most: int = 4000
) -> tuple[list[tuple[float, float]], float]:
    """Go along the path in steps of up to 0.15 m; where the robot was, and the time at the end [s]."""
    pose, stamp, way = START, 0.0, []
    for _ in range(most):
        follower.command(situation(pose, stamp, known(pose)))
        way.append((pose.x, pose.y))
        if follower.status is not None:
            return way, stamp
        ahead = follower._driver.ahead(0.15)
        if len(ahead) and not follower.is_waiting(stamp):
            step = ahead[-1] - (pose.x, pose.y)
            heading = math.atan2(step[1], step[0]) if np.hypot(*step) > 1e-3 else pose.theta
            pose = Pose2(float(ahead[-1, 0]), float(ahead[-1, 1]), heading)
        stamp += 0.1
    raise AssertionError("the tour does not end")


def test_the_robot_waits_for_its_doors_and_then_visits_everything_and_comes_home() -> None:
    follower = following()
    count = len(follower._stops)
    assert follower.is_waiting(99.0)
    for stamp in (5.0, 5.0 + DOOR_WAIT - 0.01):
        assert follower.command(situation(START, stamp, floor())) == (0.0, 0.0)
        assert follower.is_waiting(stamp)
    assert not follower.is_waiting(5.0 + DOOR_WAIT)
    assert follower.outcome().visited == 0
    follower = following()
    way, _ = drive(follower, lambda _: floor((0, 1, 2)))
    outcome = follower.outcome()
    assert follower.status == "complete"
    assert len(outcome.unreachable) == 0
    assert len(follower._stops) == 0
    # Every vertex was come by, or was in sight of where the robot was, and it is back where it set out from.
    vertices = plan_coverage(follower.prediction.grid, config=PLAIN, start=(START.x, START.y)).graph.vertices
    path = np.array(way)
    assert max(np.hypot(*(path - vertex).T).min() for vertex in vertices) < 1.3
    assert math.dist(way[-1], follower._stops.home) <= 1.0
    assert outcome.visited >= count / 2


def test_what_was_predicted_rightly_is_told_as_looked_into_and_plans_nothing_anew_for_it() -> None:
    follower = following(1)
    way, _ = drive(follower, lambda pose: floor((0,) if pose.y > 3.2 else ()))
    outcome = follower.outcome()
    looked_into = [revision for revision in outcome.revisions if revision.doors]
    assert [revision.doors for revision in looked_into] == [("d0",)]
    assert not looked_into[0].replanned
    assert looked_into[0].changed == ()
    assert [room.doors for room in looked_into[0].after] == [("d0",)]
    assert max(y for _, y in way) > 4.0
    # The last look before home plans what is left once more.
    assert outcome.replans >= 1


def test_a_door_that_stays_shut_leaves_its_room_out_and_the_rest_is_driven() -> None:
    follower = following(2)
    way, _ = drive(follower, lambda pose: floor((0,) if pose.y > 3.2 else (), shut=(1,)))
    assert follower.status == "complete"
    beyond = follower.outcome().unreachable
    assert len(beyond) > 0
    assert (beyond[:, 0] > 5.0).all()
    assert (beyond[:, 1] > 3.1).all()
    assert not any(x > 5.1 and y > 3.1 for x, y in way)
    assert any(y > 4.0 for _, y in way)
    assert any(x > 8.0 for x, _ in way)


def test_rooms_that_nobody_is_sure_of_come_first_the_least_sure_one_before_the_others() -> None:
    def order(confidence: Sequence[float | None], unsure: float) -> list[int]:
        follower = following(unsure=unsure, confidence=confidence)
        way, _ = drive(follower, lambda _: floor((0, 1, 2)))
        entered: list[int] = []
        for x, y in way:
            for number, room in enumerate(ROOMS):
                if room.bounds[0] < x < room.bounds[2] and y > 4.0 and number not in entered:
                    entered.append(number)
        return entered

    assert order((0.9, 0.2, 0.4), 0.5) == [1, 2, 0]
    assert order((None, 0.6, 0.4), 0.5)[0] == 2


def test_the_doors_of_unsure_rooms_with_stops_left_are_listed_the_least_sure_one_first() -> None:
    follower = following(unsure=0.5, confidence=(0.3, 0.1, 0.5))
    assert follower.doors_first() == ("d1", "d0")
    assert following(unsure=0.5).doors_first() == ()
    assert following(unsure=0.0, confidence=(0.3, 0.1, 0.5)).doors_first() == ()
    # What is visited needs no opening.
    while len(follower._stops):
        follower._stops.reach()
    assert follower.doors_first() == ()


def test_what_is_left_to_drive_is_the_path_ahead_and_then_the_stops() -> None:
    follower = following()
    stops = follower._stops.path()
    assert np.array_equal(follower.path_left(), stops)
    for number in range(40):
        follower.command(situation(START, 0.1 * number, floor((0, 1, 2))))
    ahead = follower._driver.ahead(math.inf)
    left = follower.path_left()
    assert len(ahead) > 0
    assert np.array_equal(left[: len(ahead)], ahead)
    assert np.array_equal(left[len(ahead) :], follower._stops.path())
    assert left[-1].tolist() == list(follower._stops.home)


@pytest.mark.parametrize(("away", "was"), [(AT_DOOR - 0.05, True), (AT_DOOR + 0.05, False)])
def test_the_robot_was_at_a_door_where_it_came_close(away: float, was: bool) -> None:
    follower = following()
    follower._note_place(Pose2(DOORS[1].midpoint[0], DOORS[1].midpoint[1] - away, 0.0))
    assert follower._was_at("d1") == was
    assert not follower._was_at("d2")
    assert not follower._was_at("d9")


def test_places_are_noted_every_tenth_of_a_metre_and_stops_on_the_way_struck_off() -> None:
    follower = following()
    first = follower._stops.next
    for off in (2.0, 2.05, 2.11, 2.3):
        follower._note_place(Pose2(first[0] + off, first[1]))
    assert [round(x - first[0], 2) for x, _ in follower._driven] == [2.0, 2.11, 2.3]
    count = len(follower._stops)
    follower._goal = first
    follower._note_place(Pose2(*first))
    # It is passed: the next one is headed for.
    assert len(follower._stops) < count
    assert follower._goal is None
    # On a way back it is struck off, and the way back goes on.
    follower = following()
    follower._goal, follower._going_back = first, True
    follower._note_place(Pose2(*follower._stops.next))
    assert follower._goal == first


def stuck(follower: TourFollower, times: int) -> None:
    """Let the driver be held up on the way to the next stop, so many times."""
    grid, driver = floor((0, 1, 2)), follower._driver
    for number in range(times):
        stamp = 3.0 + number
        follower.command(situation(START, stamp, grid))
        assert follower._goal is not None
        driver.state = "driving"
        command = driver.command

        def held(*_: Any) -> tuple[float, float]:
            driver.state = "stuck"
            return (0.0, 0.0)

        driver.command = held  # type: ignore[method-assign]
        follower.command(situation(START, stamp + 0.5, grid))
        driver.command = command  # type: ignore[method-assign]
        driver.state = "idle"
        assert follower._goal is None


def test_a_stop_that_the_robot_is_held_up_on_the_way_to_is_given_up_after_a_few_attempts() -> None:
    follower = following()
    follower.command(situation(START, 0.0, floor((0, 1, 2))))
    stuck(follower, MAX_ATTEMPTS)
    first = follower._stops.next
    assert follower.outcome().unreachable.shape == (0, 2)
    follower.command(situation(START, 9.0, floor((0, 1, 2))))
    assert follower.outcome().unreachable.tolist() == [list(first)]
    assert follower._stops.next != first
    assert follower._goal == follower._stops.next


def test_a_path_that_is_shut_is_planned_anew() -> None:
    follower = following()
    open_floor = floor((0, 1, 2))
    follower.command(situation(START, 0.0, open_floor))
    follower.command(situation(START, 3.0, open_floor))
    assert follower._goal is not None
    # Held against the map every second.
    cells = open_floor.cells.copy()
    ahead = follower._driver.ahead(2.0)
    row, col = FRAME.to_cells(ahead[-1])
    cells[row - 2 : row + 3, col - 2 : col + 3] = OCCUPIED
    blocked = OccupancyGrid(FRAME, cells)
    before = follower._driver.ahead(math.inf)
    follower.command(situation(START, 3.9, blocked))
    assert np.array_equal(follower._driver.ahead(math.inf), before)
    follower.command(situation(START, 4.0, blocked))
    after = follower._driver.ahead(math.inf)
    assert not np.array_equal(after, before)
    middle = FRAME.to_points(np.array([row, col]))
    assert np.hypot(*(after - middle).T).min() > 0.25
