import math
from dataclasses import replace

import numpy as np
import pytest

from closedrooms.core.arrays import FloatArray
from closedrooms.core.grid import OccupancyGrid
from closedrooms.core.pose import Pose2
from closedrooms.mapping.beams import Beams, clean
from closedrooms.mapping.config import MapperConfig
from closedrooms.mapping.glass.before_glass import before_glass
from closedrooms.mapping.glass.scan_view import Views, faces
from closedrooms.mapping.mapper import Mapper
from tests.conftest import SegmentWorld

SEEN = math.radians(15.0)
PANE = (3.0, 6.0, 5.0, 6.0)
HALL = [
    (0.0, 0.0, 8.0, 0.0), (8.0, 0.0, 8.0, 6.0), (0.0, 0.0, 0.0, 6.0), (0.0, 6.0, 3.0, 6.0), (5.0, 6.0, 8.0, 6.0),
    (2.0, 6.0, 2.0, 9.0), (2.0, 9.0, 6.0, 9.0), (6.0, 9.0, 6.0, 6.0), (6.5, 2.0, 6.5, 2.6),
]  # fmt: skip
ROUTE = [(1.0, 1.5), (1.0, 4.6), (7.0, 4.6), (7.0, 1.5)]


class GlassWorld(SegmentWorld):
    """A hall with a pane of glass that returns what meets it near its normal, and a closed room behind."""

    def __init__(self, segments: list[tuple[float, float, float, float]], pane: tuple[float, ...] = PANE) -> None:
        super().__init__(segments)
        self.pane = SegmentWorld([pane])  # type: ignore[list-item]

    def ranges(self, pose: Pose2, angles: FloatArray, range_max: float = 20.0) -> FloatArray:
        solid, pane = super().ranges(pose, angles, range_max), self.pane.ranges(pose, angles, range_max)
        x0, y0, x1, y1 = self.pane.segments[0]
        normal = math.atan2(x1 - x0, y0 - y1)
        incidence = np.abs((angles + pose.theta - normal + math.pi / 2) % math.pi - math.pi / 2)
        return np.where(incidence < SEEN, np.minimum(solid, pane), solid)


def mapped(
    world: SegmentWorld, route: list[tuple[float, float]], *, glass: bool = True, drawn: int = 5
) -> tuple[OccupancyGrid, Pose2]:
    """Map a drive, drawing every so many scans; returns the map and where the world lies in it."""
    (x0, y0), (x1, y1) = route[:2]
    return mapper_of(world, route, glass, drawn).grid(), Pose2(x0, y0, math.atan2(y1 - y0, x1 - x0)).inverse()


def mapper_of(world: SegmentWorld, route: list[tuple[float, float]], glass: bool = True, drawn: int = 5) -> Mapper:
    """Let a mapper take in a drive, drawing every so many scans."""
    drive = world.drive(route, noise=0.01, beams=720)
    mapper = Mapper(MapperConfig(glass=glass))
    for number, (scan, odometry) in enumerate(zip(drive.scans, drive.odometry, strict=True)):
        mapper.process(scan, Pose2(*odometry))
        if number % drawn == 0:
            mapper.grid()
    mapper.finish()
    mapper.grid()
    return mapper


def known_share(grid: OccupancyGrid, map_T_world: Pose2, box: tuple[float, float, float, float]) -> float:
    """How much of a box in the world is known in the map."""
    x, y = np.meshgrid(np.arange(box[0], box[2], 0.1), np.arange(box[1], box[3], 0.1))
    cells = grid.frame.to_cells(map_T_world.transform(np.column_stack((x.ravel(), y.ravel()))))
    inside = grid.frame.contains(cells)
    return float(np.mean([bool(i) and grid.known[r, c] for (r, c), i in zip(cells.tolist(), inside, strict=True)]))


def occupied_share(grid: OccupancyGrid, map_T_world: Pose2, line: tuple[float, ...]) -> float:
    """How much of a line in the world has an occupied cell within 0.1 m."""
    share = np.linspace(0.0, 1.0, 40)[:, None]
    points = map_T_world.transform(np.array(line[:2]) + share * (np.array(line[2:]) - np.array(line[:2])))
    walls = grid.frame.to_points(np.argwhere(grid.occupied))
    return float(np.mean([np.hypot(*(walls - p).T).min() < 0.1 for p in points]))


ROOM_BEHIND = (2.3, 6.3, 5.7, 8.7)


def test_nothing_behind_a_pane_is_mapped_and_the_pane_is_a_wall() -> None:
    grid, map_T_world = mapped(GlassWorld(HALL), ROUTE)
    assert known_share(grid, map_T_world, ROOM_BEHIND) < 0.05
    assert occupied_share(grid, map_T_world, PANE) > 0.95


def test_a_pane_is_said_and_where_it_is() -> None:
    mapper = mapper_of(GlassWorld(HALL), ROUTE)
    (remark,) = mapper.events
    assert (remark.action, remark.what, remark.count, remark.loss) == ("guessed", "panes of glass", 1, False)
    # Where it is, in the map, whose origin is where the robot began.
    (x0, y0), (x1, y1) = ROUTE[:2]
    begin = Pose2(x0, y0, math.atan2(y1 - y0, x1 - x0))
    x, y = (float(word) for word in remark.names[0].removeprefix("at ").split(", "))
    middle = begin.transform(np.array([[x, y]]))[0]
    assert middle == pytest.approx([(PANE[0] + PANE[2]) / 2.0, (PANE[1] + PANE[3]) / 2.0], abs=0.15)
    assert mapper_of(GlassWorld(HALL), ROUTE, glass=False).events == ()


def test_without_it_the_room_behind_is_mapped_through_the_pane() -> None:
    grid, map_T_world = mapped(GlassWorld(HALL), ROUTE, glass=False)
    assert known_share(grid, map_T_world, ROOM_BEHIND) > 0.5
    assert occupied_share(grid, map_T_world, PANE) < 0.7


def test_the_last_map_does_not_depend_on_how_often_it_was_drawn_before() -> None:
    pane = (0.8, 6.0, 2.0, 6.0)
    often, seldom = (mapped(GlassWorld(walls_beside(pane), pane), ROUTE, drawn=drawn)[0] for drawn in (5, 10**6))
    assert (often.on(seldom.frame).cells == seldom.cells).all()


def test_a_slanted_pane_is_one_too() -> None:
    turn = Pose2(0.0, 0.0, 0.5)
    segments = [tuple(turn.transform(np.array(s).reshape(2, 2)).ravel().tolist()) for s in [*HALL, PANE]]
    route = [tuple(turn.transform(np.array([p]))[0].tolist()) for p in ROUTE]
    grid, map_T_world = mapped(GlassWorld(segments[:-1], segments[-1]), route)  # type: ignore[arg-type]
    behind = map_T_world @ turn
    assert known_share(grid, behind, ROOM_BEHIND) < 0.05
    assert occupied_share(grid, behind, PANE) > 0.95


def test_where_there_is_no_glass_the_map_is_the_same_with_and_without(office: SegmentWorld) -> None:
    route = [(1.0, 1.0), (11.0, 1.0), (7.4, 1.0), (7.4, -2.0), (7.4, 1.0), (2.5, 1.0), (2.5, 4.0)]
    (with_it, _), (without, _) = mapped(office, route), mapped(office, route, glass=False)
    assert with_it.frame == without.frame
    assert (with_it.cells == without.cells).all()


def test_a_doorway_that_was_seen_from_the_front_stays_open_beside_a_pane() -> None:
    # The pane is the left half of what was one; the right half is a doorway into the room.
    pane = (3.0, 6.0, 4.0, 6.0)
    grid, map_T_world = mapped(GlassWorld(HALL, pane), ROUTE)
    assert occupied_share(grid, map_T_world, pane) > 0.95
    assert occupied_share(grid, map_T_world, (4.25, 6.0, 4.75, 6.0)) == 0.0


def walls_beside(pane: tuple[float, ...]) -> list[tuple[float, float, float, float]]:
    """The hall with a wall from its corners up to a pane in the wall to the room."""
    without = [wall for wall in HALL if wall[1::2] != (6.0, 6.0)]
    return [*without, (0.0, 6.0, pane[0], 6.0), (pane[2], 6.0, 8.0, 6.0)]


def test_a_pane_between_walls_may_be_short() -> None:
    pane = (3.7, 6.0, 4.3, 6.0)
    grid, map_T_world = mapped(GlassWorld(walls_beside(pane), pane), ROUTE)
    assert known_share(grid, map_T_world, ROOM_BEHIND) < 0.01
    assert occupied_share(grid, map_T_world, pane) > 0.95


def test_a_pane_that_was_seen_from_the_front_in_part_goes_on_to_the_wall() -> None:
    # The robot comes up to its left end alone; the whole of it was seen through from the side.
    route = [(7.0, 3.0), (3.4, 3.0), (3.4, 5.2), (3.4, 3.0)]
    grid, map_T_world = mapped(GlassWorld(HALL), route)
    assert known_share(grid, map_T_world, ROOM_BEHIND) < 0.01
    assert occupied_share(grid, map_T_world, PANE) > 0.95


def test_the_last_look_may_come_before_the_end_and_moves_no_pose() -> None:
    drive = GlassWorld(HALL).drive([(7.0, 3.0), (3.4, 3.0), (3.4, 5.2), (3.4, 3.0)], noise=0.01, beams=720)
    mapper = Mapper()
    for scan, odometry in zip(drive.scans, drive.odometry, strict=True):
        mapper.process(scan, Pose2(*odometry))
    pose = mapper.pose
    mapper.look_for_glass()
    assert known_share(mapper.grid(), Pose2(7.0, 3.0, math.pi).inverse(), ROOM_BEHIND) < 0.01
    assert len(mapper.panes) == 1
    assert mapper.pose == pose
    found = mapper.panes
    mapper.look_for_glass()
    mapper.grid()
    assert np.array_equal(mapper.panes, found)


@pytest.mark.parametrize("short", [False, True])
def test_a_pane_that_was_found_when_all_was_seen_stays_as_it_is_while_the_robot_goes_on(short: bool) -> None:
    # Of the long one only the left end was met.
    pane = (3.7, 6.0, 4.3, 6.0) if short else PANE
    world = GlassWorld(walls_beside(pane) if short else HALL, pane)
    route = ROUTE if short else [(7.0, 3.0), (3.4, 3.0), (3.4, 5.2), (3.4, 3.0)]
    drive = world.drive([*route, (7.0, 3.0), (1.0, 1.0)], beams=720)
    turn = len(world.drive(route, beams=720).scans)
    mapper = Mapper()
    for scan, odometry in zip(drive.scans[:turn], drive.odometry[:turn], strict=True):
        mapper.process(scan, Pose2(*odometry))
    mapper.finish()
    mapper.grid()
    found = mapper.panes
    assert len(found) == 1
    for scan, odometry in zip(drive.scans[turn:], drive.odometry[turn:], strict=True):
        mapper.process(scan, Pose2(*odometry))
        mapper.grid()
        assert len(mapper.panes) == 1
        assert np.abs(mapper.panes - found).max() < 0.1


def test_a_doorway_beside_a_pane_that_the_robot_drove_through_stays_open() -> None:
    # At an angle, so that nothing else tells that there is no glass.
    pane = (3.0, 6.0, 4.0, 6.0)
    grid, map_T_world = mapped(GlassWorld(HALL, pane), [(1.0, 5.0), (3.5, 5.0), (4.5, 6.0), (5.5, 7.0)])
    assert occupied_share(grid, map_T_world, pane) > 0.95
    assert occupied_share(grid, map_T_world, (4.3, 6.0, 4.7, 6.0)) == 0.0
    assert known_share(grid, map_T_world, ROOM_BEHIND) > 0.9


def test_a_pane_before_which_a_robot_turned_for_long_is_one() -> None:
    # All these scans from one place hit it, those that come from elsewhere and went through are few.
    turns = [(4.0, 5.4), (4.0, 5.3)] * 3
    grid, map_T_world = mapped(GlassWorld(HALL), [(1.0, 3.0), (4.0, 3.0), *turns])
    assert known_share(grid, map_T_world, ROOM_BEHIND) < 0.01
    assert occupied_share(grid, map_T_world, PANE) > 0.95


@pytest.mark.parametrize("start", [(2.4, 4.4), (3.2, 4.6)])
def test_a_pane_that_nearly_all_scans_met_is_one(start: tuple[float, float]) -> None:
    # The robot drives to and fro in front of it: next to no scan goes through.
    pane, turns = (3.5, 6.0, 4.5, 6.0), [(4.0, 5.4), (4.0, 4.4)] * 4
    grid, map_T_world = mapped(GlassWorld(walls_beside(pane), pane), [start, (4.0, start[1]), *turns])
    assert known_share(grid, map_T_world, ROOM_BEHIND) < 0.01
    assert occupied_share(grid, map_T_world, pane) > 0.95


def test_a_pane_of_which_half_a_metre_is_in_view_beside_something_is_one() -> None:
    # An open door's leaf hides the rest of it, and the wall beyond.
    pane, leaf = (3.0, 6.0, 4.5, 6.0), (3.5, 5.7, 4.6, 5.7)
    route = [(1.0, 3.0), (1.0, 4.9), (3.2, 5.2), (3.2, 3.0), (5.0, 3.0)]
    grid, map_T_world = mapped(GlassWorld([*walls_beside(pane), leaf], pane), route)
    assert known_share(grid, map_T_world, ROOM_BEHIND) < 0.05
    assert occupied_share(grid, map_T_world, (3.0, 6.0, 3.5, 6.0)) > 0.95


def test_a_pane_is_found_from_close_by() -> None:
    # Half a metre away, beams to either side of what is met askew meet the pane near its normal.
    pane, beside = (3.5, 6.0, 4.5, 6.0), [(0.0, 6.0, 3.5, 6.0), (4.5, 6.0, 8.0, 6.0)]
    route = [(1.0, 4.0), (3.7, 5.5), (4.4, 5.5), (3.7, 5.5), (4.4, 5.5), (7.0, 4.0)]
    grid, map_T_world = mapped(GlassWorld([wall for wall in HALL if wall[1::2] != (6.0, 6.0)] + beside, pane), route)
    assert known_share(grid, map_T_world, ROOM_BEHIND) < 0.05
    assert occupied_share(grid, map_T_world, pane) > 0.95


def test_somebody_who_stood_there_and_left_is_no_pane() -> None:
    person = [(3.8, 3.0, 4.2, 3.0), (3.8, 3.4, 4.2, 3.4), (3.8, 3.0, 3.8, 3.4), (4.2, 3.0, 4.2, 3.4)]
    route = [(1.0, 1.5), (1.0, 4.6), (4.0, 4.6), (6.0, 4.6), (6.0, 2.0)]
    solid = [*HALL, PANE]
    there, gone = SegmentWorld([*solid, *person]).drive(route, beams=720), SegmentWorld(solid).drive(route, beams=720)
    mapper, left = Mapper(), len(there.scans) // 2
    for scan, odometry in zip([*there.scans[:left], *gone.scans[left:]], there.odometry, strict=True):
        mapper.process(scan, Pose2(*odometry))
        mapper.grid()
    start = Pose2(1.0, 1.5, math.pi / 2).inverse()
    assert occupied_share(mapper.grid(), start, (3.9, 3.2, 4.1, 3.2)) == 0.0


@pytest.mark.parametrize(
    ("start", "step", "walks"),
    [
        ((3.0, 4.0), (0.02, 0.0), (10, 40)),
        ((4.0, 2.6), (0.02, 0.01), (20, 60)),
        ((2.0, 3.5), (0.05, 0.0), (10, 40)),
    ],
)
def test_somebody_who_walks_beside_the_robot_leaves_no_pane_behind(
    start: tuple[float, float], step: tuple[float, float], walks: tuple[int, int]
) -> None:
    world = SegmentWorld([*HALL, PANE])
    route = [(1.0, 1.5), (7.0, 1.5), (7.0, 4.5), (1.0, 4.5)]
    drive = world.drive(route, beams=720)
    mapper, world_T_start = Mapper(), Pose2(1.0, 1.5, 0.0)
    for number, (scan, odometry, truth) in enumerate(zip(drive.scans, drive.odometry, drive.truth, strict=True)):
        if number < walks[1] + 20:
            steps = min(max(number - walks[0], 0), walks[1] - walks[0])
            x, y = start[0] + step[0] * steps, start[1] + step[1] * steps
            corners = [(x - 0.2, y - 0.15), (x + 0.2, y - 0.15), (x + 0.2, y + 0.15), (x - 0.2, y + 0.15)]
            body = SegmentWorld([(*a, *b) for a, b in zip(corners, [*corners[1:], corners[0]], strict=True)])
            angles = scan.angle_min + scan.angle_increment * np.arange(scan.ranges.size)
            before = body.ranges(world_T_start @ Pose2(*truth), angles)
            scan = replace(scan, ranges=np.minimum(scan.ranges, before))  # noqa: PLW2901
        mapper.process(scan, Pose2(*odometry))
        if number % 5 == 0:
            mapper.grid()
    mapper.finish()
    mapper.grid()
    assert len(mapper.panes) == 0


def test_somebody_who_stood_in_a_doorway_is_no_pane() -> None:
    # Who stands in it is seen from the front; when they have left it is only seen at an angle.
    doorway, person = (3.5, 6.0, 4.5, 6.0), [(3.8, 5.9, 4.2, 5.9), (4.2, 5.9, 4.2, 6.2), (3.8, 5.9, 3.8, 6.2)]
    world = walls_beside(doorway)
    route = [(1.0, 3.5), (4.0, 3.5), (4.0, 4.2), (6.0, 4.2), (7.0, 5.0), (6.0, 4.0), (7.5, 5.2)]
    there, gone = SegmentWorld([*world, *person]).drive(route, beams=720), SegmentWorld(world).drive(route, beams=720)
    mapper, left = Mapper(), next(i for i, pose in enumerate(there.truth) if pose[0] > 4.0)
    for number, odometry in enumerate(there.odometry):
        mapper.process((there if number < left else gone).scans[number], Pose2(*odometry))
    mapper.finish()
    mapper.grid()
    assert len(mapper.panes) == 0


@pytest.mark.parametrize("lateral", [0.0, 0.12])
def test_a_view_tells_how_far_beams_went_beyond_a_place(office: SegmentWorld, lateral: float) -> None:
    views = Views()
    views.add(clean(office.scan(Pose2(6.0, 1.0, 0.0), beams=720), max_range=25.0))
    places = np.array([[3.0, 0.0], [5.95, 0.0], [6.6, 0.0]])
    assert views.beyond(np.zeros(3, dtype=np.int64), places, lateral) == pytest.approx([3.0, 0.05, -0.6], abs=0.03)


def test_a_view_looks_at_all_beams_beside_a_place_and_no_others(office: SegmentWorld) -> None:
    beams = clean(office.scan(Pose2(6.0, 1.0, 0.3), beams=720), max_range=25.0)
    ranges, bearings = np.hypot(*beams.outline.T), np.arctan2(beams.outline[:, 1], beams.outline[:, 0])
    draws = np.random.default_rng(3).uniform(size=(3, 200))
    bearing, distance, lateral = np.pi * (1.8 * draws[0] - 0.9), 1.0 + 3.0 * draws[1], 0.02 + 0.2 * draws[2]
    places = distance[:, None] * np.column_stack((np.cos(bearing), np.sin(bearing)))
    views = Views()
    views.add(beams)
    beyond = views.beyond(np.zeros(200, dtype=np.int64), places, lateral)
    off, step = np.abs(bearings - bearing[:, None]), 2.0 * np.pi / len(bearings)
    nearest_in = [np.where(off <= (lateral / distance)[:, None] + slack, ranges, np.inf).min(axis=1) - distance
                  for slack in (-step, 2.0 * step)]  # fmt: skip
    assert (nearest_in[1] - 1e-9 <= beyond).all()
    assert (beyond <= nearest_in[0] + 1e-9).all()


def test_faces_of_a_wall_point_across_it(office: SegmentWorld) -> None:
    beams = clean(office.scan(Pose2(10.0, 1.0, 0.0), beams=720), max_range=25.0)
    normals, incidence = faces(beams.points, np.arange(len(beams.points)), beams.points - beams.origin)
    on_wall = (np.abs(beams.points[:, 1] - 1.0) < 0.01) & (np.abs(beams.points[:, 0]) < 1.5)
    assert on_wall.sum() > 50
    assert np.abs(normals[on_wall, 1]) == pytest.approx(1.0, abs=1e-3)
    expected = np.abs(np.arctan2(beams.points[on_wall, 0], beams.points[on_wall, 1]))
    assert incidence[on_wall] == pytest.approx(expected, abs=0.02)


@pytest.mark.parametrize("seed", range(8))
def test_beams_end_at_the_nearest_pane_that_they_went_through(seed: int) -> None:
    # Panes near and far, some beyond all beams, around a sensor beside the robot's middle.
    rng = np.random.default_rng(seed)
    pose, origin = Pose2(*rng.uniform(-2.0, 2.0, 3)), rng.uniform(-0.3, 0.3, 2)
    angles, ranges = np.arange(0.0, 2 * math.pi, 0.05), rng.uniform(1.0, 6.0, 126)
    ends = origin + ranges[:, None] * np.column_stack((np.cos(angles), np.sin(angles)))
    panes = rng.uniform(-12.0, 12.0, (20, 1, 2)) + np.stack(
        (np.zeros((20, 2)), rng.uniform(-2.0, 2.0, (20, 2))), axis=1
    )
    local = pose.inverse().transform(panes.reshape(-1, 2)).reshape(-1, 2, 2) - origin
    expected = ranges.copy()
    for k, angle in enumerate(angles):
        beam = np.array([math.cos(angle), math.sin(angle)])
        for a, b in local:
            away, share = np.linalg.solve(np.column_stack((beam, a - b)), a)
            if away > 0.0 and 0.0 < share < 1.0 and expected[k] - away > 0.15:
                expected[k] = away
    found = before_glass(Beams(ends, ends, origin), pose, panes)
    assert np.hypot(*(found.outline - origin).T) == pytest.approx(expected, abs=1e-9)


def test_a_pane_behind_an_open_door_goes_on_to_the_wall() -> None:
    # The leaf hides all but its first third from the front; beams slip in between from the side.
    pane, leaf = (3.0, 6.0, 4.2, 6.0), (3.4, 5.55, 4.3, 5.55)
    route = [(1.5, 3.0), (3.1, 4.6), (3.1, 5.3), (2.0, 3.5), (3.1, 5.2), (5.5, 3.0)]
    grid, map_T_world = mapped(GlassWorld([*walls_beside(pane), leaf], pane), route)
    assert known_share(grid, map_T_world, ROOM_BEHIND) < 0.01
    assert occupied_share(grid, map_T_world, pane) > 0.9


def test_a_pane_of_half_a_metre_beside_a_doorway_is_one_once_it_was_passed_again() -> None:
    pane = (3.0, 6.0, 3.6, 6.0)
    grid, map_T_world = mapped(GlassWorld(HALL, pane), [*ROUTE, (7.0, 4.6), (1.0, 4.6)])
    assert occupied_share(grid, map_T_world, pane) > 0.9
    assert occupied_share(grid, map_T_world, (3.9, 6.0, 4.8, 6.0)) == 0.0


def test_who_stood_between_walls_at_first_and_left_is_no_pane() -> None:
    # Half a metre wide, seen from the front; afterwards only at an angle.
    before = [(2.0, 3.0), (4.0, 3.0), (4.0, 4.8)]
    route = [*before, (2.0, 4.6), (1.0, 5.6), (7.0, 5.6)]
    gap = walls_beside((3.6, 6.0, 4.4, 6.0))
    there, gone = (SegmentWorld(walls) for walls in ([*gap, (3.75, 6.0, 4.25, 6.0)], gap))
    count = len(there.drive(before, beams=720).scans)
    first, second = there.drive(route, beams=720), gone.drive(route, beams=720)
    mapper = Mapper()
    scans = [*first.scans[:count], *second.scans[count:]]
    for scan, odometry in zip(scans, second.odometry, strict=True):
        mapper.process(scan, Pose2(*odometry))
    mapper.finish()
    assert occupied_share(mapper.grid(), Pose2(2.0, 3.0, 0.0).inverse(), (3.85, 6.0, 4.15, 6.0)) == 0.0
