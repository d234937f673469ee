"""People and boxes: where they may walk or stand, by which path, and how they keep off the robot."""

import math
from collections.abc import Iterator
from itertools import pairwise

import networkx as nx
import numpy as np
import pytest
import shapely
from scipy import ndimage
from shapely.geometry import Point, box

from closedrooms.sim.bystanders import AWAY, BOX, CELL, ELBOWS, PERSON_RADIUS, Floor, MovedBox, Person
from closedrooms.sim.contacts import Obstacles
from closedrooms.sim.physics_world import PhysicsWorld
from closedrooms.worlds.geometry import wall_area
from closedrooms.worlds.plan import FloorPlan, PlanRoom, Wall

# Two rooms of 6 x 5 m beside each other, with a gap of 1.2 m in the wall between them; a third room has no way in.
ROOMS = (
    PlanRoom("a", "room", box(-1, 2, 5, 7)),
    PlanRoom("b", "room", box(5, 2, 11, 7)),
    PlanRoom("c", "room", box(11, 2, 14, 7)),
)
LINES = (
    ((-1, 2), (14, 2)),
    ((-1, 7), (14, 7)),
    ((-1, 2), (-1, 7)),
    ((5, 2), (5, 4)),
    ((5, 5.2), (5, 7)),
    ((11, 2), (11, 7)),
    ((14, 2), (14, 7)),
)
PLAN = FloorPlan("x", ROOMS, tuple(Wall(f"w{i}", line, 0.2) for i, line in enumerate(LINES)), ())
WALLS = wall_area(PLAN)
START = (0.5, 3.0)
FAR = (500.0, 500.0, 0.2)


@pytest.fixture
def floor() -> Floor:
    return Floor(PLAN, WALLS, START)


@pytest.fixture
def physics() -> Iterator[PhysicsWorld]:
    with PhysicsWorld() as physics:
        yield physics


def nowhere() -> Obstacles:
    return Obstacles(np.zeros((0, 4)), 0.5)


def test_people_walk_where_there_is_room_for_their_elbows_and_the_robot_can_get(floor: Floor) -> None:
    rooms = shapely.union_all([room.polygon for room in ROOMS])
    x0, y0, x1, y1 = rooms.bounds
    rows, cols = math.ceil((y1 - y0) / CELL), math.ceil((x1 - x0) / CELL)
    assert floor.free.shape == (rows, cols)
    free = np.zeros((rows, cols), dtype=bool)
    for row in range(rows):
        for col in range(cols):
            middle = Point(x0 + (col + 0.5) * CELL, y0 + (row + 0.5) * CELL)
            assert floor.point((row, col)) == pytest.approx((middle.x, middle.y))
            free[row, col] = rooms.contains(middle) and WALLS.distance(middle) > ELBOWS
    # Rounded corners of the buffer differ by a hair.
    parts = ndimage.label(free)[0]
    own = parts == parts[int((START[1] - y0) / CELL), int((START[0] - x0) / CELL)]
    assert np.array_equal(floor.free, own)
    assert floor.cells.tolist() == np.argwhere(own).tolist()
    # The second room is reached through the gap, the third is not.
    columns = x0 + (np.argwhere(own)[:, 1] + 0.5) * CELL
    assert 10.0 < columns.max() < 11.0
    # Somebody who is within a body's breadth of a wall would touch it.
    assert PERSON_RADIUS < ELBOWS


def test_a_floor_begins_at_the_free_cell_nearest_to_the_robot() -> None:
    # In the wall before the third room: that is as near as the second.
    inside = Floor(PLAN, WALLS, (13.0, 4.0))
    assert inside.point((0, int(inside.cells[:, 1].min())))[0] > 11.0
    beside = Floor(PLAN, WALLS, (10.9, 4.0))
    assert beside.point((0, int(beside.cells[:, 1].max())))[0] < 11.0


def test_cells_are_drawn_from_all_that_are_free(floor: Floor) -> None:
    rng = np.random.default_rng(0)
    drawn = {floor.sample(rng) for _ in range(30 * len(floor.cells))}
    assert drawn == {tuple(cell) for cell in floor.cells.tolist()}


@pytest.mark.parametrize("seed", range(4))
def test_a_path_is_as_short_as_any_over_eight_neighbours_and_cuts_no_corner(floor: Floor, seed: int) -> None:
    graph = nx.Graph()
    free = {tuple(cell) for cell in floor.cells.tolist()}
    for row, col in free:
        for dr, dc in ((0, 1), (1, -1), (1, 0), (1, 1)):
            if {(row + dr, col + dc), (row + dr, col), (row, col + dc)} <= free:
                graph.add_edge((row, col), (row + dr, col + dc), weight=math.hypot(dr, dc))
    rng = np.random.default_rng(seed)
    for _ in range(5):
        start, goal = floor.sample(rng), floor.sample(rng)
        path = floor.path(start, goal)
        assert (path[0], path[-1]) == (start, goal)
        length = sum(graph.edges[a, b]["weight"] for a, b in pairwise(path))
        assert length == pytest.approx(nx.dijkstra_path_length(graph, start, goal))


def test_where_there_is_no_path_the_start_alone_is_left(floor: Floor) -> None:
    start = tuple(floor.cells[0].tolist())
    blocked = (0, 0)
    assert not floor.free[blocked]
    assert floor.path(start, blocked) == [start]
    assert floor.path(start, start) == [start]


def test_a_person_is_round_and_as_wide_as_people_are(floor: Floor, physics: PhysicsWorld) -> None:
    obstacles = nowhere()
    person = Person(0, floor, physics, obstacles, 1)
    x, y = person.outline.centroid.coords[0]
    around = np.array(person.outline.exterior.coords)
    assert np.hypot(*(around - (x, y)).T) == pytest.approx(np.full(len(around), PERSON_RADIUS))
    assert np.hypot(*np.diff(around, axis=0).T) == pytest.approx(
        np.full(12, 2 * PERSON_RADIUS * math.sin(math.pi / 12))
    )
    # Rays meet it at the height of a lidar, and wheels its edges.
    for height, met in ((0.3, True), (0.7, True), (1.8, False)):
        rays = np.array([[x, y, height]])
        _, bodies = physics.cast(np.array([x - 2.0, y, height]), rays)
        assert (bodies[0] >= 0) == met
    assert len(obstacles.near(x, y)) == 12


def test_a_person_walks_a_metre_a_second_and_rests_between_walks(floor: Floor, physics: PhysicsWorld) -> None:
    person = Person(0, floor, physics, nowhere(), 3)
    places, step = [], 0.06
    for _ in range(4000):
        person.advance(step, *FAR)
        places.append(person.outline.centroid.coords[0])
    moved = np.hypot(*np.diff(np.array(places), axis=0).T)
    assert moved.max() <= step + 1e-9
    walking = moved > 1e-12
    # At each cell it may be held up for the rest of a step.
    assert moved[walking].mean() == pytest.approx(step, rel=0.15)
    edges = np.flatnonzero(np.diff(walking.astype(int)))
    lengths = np.diff(edges) * step
    rests = lengths[(~walking[edges + 1])[:-1]]
    assert len(rests) >= 5
    assert rests.min() >= 1.0 - 2 * step
    assert rests.max() <= 8.0 + 2 * step
    assert np.ptp(rests) > 1.0
    # Where it stops is the middle of a cell, and it stays on the floor.
    offsets = (np.array(places) - floor.origin) / CELL - 0.5
    resting = offsets[1:][~walking]
    assert np.abs(resting - np.rint(resting)).max() < 1e-6
    cells = np.rint(offsets[:, ::-1]).astype(int)
    assert floor.free[cells[:, 0], cells[:, 1]].all()


def test_a_person_begins_to_walk_at_once_and_in_every_run_of_a_seed_alike(floor: Floor, physics: PhysicsWorld) -> None:
    ways = []
    for number, seed in ((0, 5), (0, 5), (1, 5), (0, 6)):
        person = Person(number, floor, physics, nowhere(), seed)
        begin = person.outline.centroid
        person.advance(0.1, *FAR)
        person.advance(0.1, *FAR)
        assert begin.distance(person.outline.centroid) > 0.05
        ways.append([begin.coords[0], person.outline.centroid.coords[0]])
    assert ways[0] == ways[1]
    assert len({tuple(map(tuple, way)) for way in ways}) == 3


def on_the_way(floor: Floor, physics: PhysicsWorld) -> tuple[Person, np.ndarray]:
    """A person in the middle of a straight walk, and the direction of it."""
    for seed in range(50):
        person = Person(0, floor, physics, nowhere(), seed)
        places = []
        for _ in range(20):
            person.advance(0.05, *FAR)
            places.append(person.outline.centroid.coords[0])
        way = np.diff(np.array(places), axis=0)
        if len(person._path) > 8 and np.ptp(np.arctan2(way[:, 1], way[:, 0])) < 1e-6:
            return person, way[-1] / np.hypot(*way[-1])
    raise AssertionError("nobody walks straight on")


def test_a_person_waits_for_a_robot_in_its_way_and_then_goes_elsewhere(floor: Floor, physics: PhysicsWorld) -> None:
    polite = 0.2 + PERSON_RADIUS + 0.35
    for ahead, waits in ((polite + 0.03, True), (polite + 0.07, False), (-polite / 2, False)):
        person, way = on_the_way(floor, physics)
        here = np.array(person.outline.centroid.coords[0])
        robot = here + ahead * way
        person.advance(0.05, float(robot[0]), float(robot[1]), 0.2)
        assert (here.tolist() == pytest.approx(list(person.outline.centroid.coords[0]), abs=1e-9)) == waits
    # It waits for three seconds and then has another path.
    person, way = on_the_way(floor, physics)
    here = np.array(person.outline.centroid.coords[0])
    robot = here + 0.5 * way
    path = list(person._path)
    for _ in range(27):
        person.advance(0.11, float(robot[0]), float(robot[1]), 0.2)
        assert person._path == path
    person.advance(0.11, float(robot[0]), float(robot[1]), 0.2)
    assert person._path == []
    # Somebody who got on in between waits as long again.
    person, way = on_the_way(floor, physics)
    robot = np.array(person.outline.centroid.coords[0]) + 0.5 * way
    for _ in range(20):
        person.advance(0.1, float(robot[0]), float(robot[1]), 0.2)
    person.advance(0.01, *FAR)
    path = list(person._path)
    for _ in range(25):
        person.advance(0.1, float(robot[0]), float(robot[1]), 0.2)
    assert person._path == path


def test_whoever_begins_keeps_off_the_robot(floor: Floor, physics: PhysicsWorld) -> None:
    for seed in range(12):
        for made in (Person(0, floor, physics, nowhere(), seed), MovedBox(0, floor, physics, nowhere(), seed)):
            before = made.outline.centroid
            made.keep_off(before.x, before.y, 2.5)
            assert before.distance(made.outline.centroid) >= 2.5
            there = made.outline.centroid
            made.keep_off(before.x, before.y, 2.5)
            assert made.outline.centroid == there


def test_a_box_stays_about_a_minute_and_is_moved_while_the_robot_is_far_from_both_places(
    floor: Floor, physics: PhysicsWorld
) -> None:
    obstacles = nowhere()
    thing = MovedBox(0, floor, physics, obstacles, 2)
    x0, y0, x1, y1 = thing.outline.bounds
    assert (x1 - x0, y1 - y0) == (pytest.approx(BOX), pytest.approx(BOX))
    stays = []
    for _ in range(60):
        before, waited = thing.outline.centroid, 0.0
        while thing.outline.centroid == before:
            thing.advance(0.5, *FAR)
            waited += 0.5
        stays.append(waited)
        assert len(obstacles.near(thing.outline.centroid.x, thing.outline.centroid.y)) == 4
    assert np.mean(stays) == pytest.approx(60.0, abs=4 * 60.0 / math.sqrt(60))
    # A robot within 4 m of where it stands keeps it there, and it is not put within 4 m of the robot either.
    here = thing.outline.centroid
    for _ in range(2000):
        thing.advance(1.0, here.x + AWAY - 0.01, here.y, 0.2)
    assert thing.outline.centroid == here
    robot = Point(2.0, 4.5) if here.x > 6.5 else Point(9.5, 4.5)
    for _ in range(2000):
        before = thing.outline.centroid
        thing.advance(1.0, robot.x, robot.y, 0.2)
        if thing.outline.centroid != before:
            assert min(robot.distance(before), robot.distance(thing.outline.centroid)) >= AWAY
            break
    assert thing.outline.centroid != here
