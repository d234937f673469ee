"""What fails by the seed: how often, for how long, and what is left as it was."""

import itertools
import math

import numpy as np
import pytest
import shapely
from shapely.geometry import box

from closedrooms.core.pose import Pose2
from closedrooms.core.scan import LaserScan
from closedrooms.sim.config import FaultConfig
from closedrooms.sim.faults import PHANTOM_RANGE, PHANTOM_SHARE, PHANTOM_WIDTH, Faults, phantom_places
from closedrooms.worlds.plan import FloorPlan, PlanRoom, Wall

SEGMENTS = (((0.0, 0.0), (9.0, 0.0)), ((9.0, 0.0), (9.0, 6.0)), ((9.0, 6.0), (0.0, 6.0)), ((0.0, 6.0), (0.0, 0.0)),
            ((4.0, 0.0), (4.0, 3.0)), ((7.0, 3.0), (7.5, 3.0)))  # fmt: skip
HALL = FloorPlan(
    "hall", (PlanRoom("r0", "hall", box(0, 0, 9, 6)),), tuple(Wall(f"w{i}", s, 0.1) for i, s in enumerate(SEGMENTS)), ()
)
STEP = Pose2(0.05, 0.0, 0.02)


def told(config: FaultConfig, count: int, seed: int = 0, period: float = 0.1) -> tuple[list[Pose2], list[Pose2]]:
    """What the odometry says, and what it counted, of a robot that drives in circles."""
    faults, pose = Faults(config, HALL, seed), Pose2()
    said, true = [], []
    for number in range(1, count + 1):
        pose = pose @ STEP
        true.append(pose)
        said.append(faults.odometry(pose, period * number))
    return said, true


def steps(poses: list[Pose2]) -> list[Pose2]:
    return [a.inverse() @ b for a, b in itertools.pairwise([Pose2(), *poses])]


def is_step(step: Pose2, times: int = 1) -> bool:
    wanted = Pose2()
    for _ in range(times):
        wanted = wanted @ STEP
    return step.distance(wanted) < 1e-6 and abs(step.theta - wanted.theta) < 1e-6


def test_without_faults_the_odometry_is_what_was_counted() -> None:
    said, true = told(FaultConfig(), 50)
    assert max(a.distance(b) for a, b in zip(said, true, strict=True)) < 1e-9


@pytest.mark.parametrize("per_minute", [6.0, 30.0])
def test_a_dropped_motion_is_never_counted_and_the_others_are(per_minute: float) -> None:
    count = 3000
    said, _ = told(FaultConfig(odometry_drops=per_minute), count)
    dropped = [is_step(step, 0) for step in steps(said)]
    assert all(is_step(step) for step, gone in zip(steps(said), dropped, strict=True) if not gone)
    expected = per_minute * 0.1 * count / 60.0
    assert sum(dropped) == pytest.approx(expected, abs=4.0 * math.sqrt(expected))


def test_drops_come_as_often_in_time_however_often_the_odometry_is_read() -> None:
    for period in (0.02, 0.5):
        said, _ = told(FaultConfig(odometry_drops=12.0), round(300.0 / period), period=period)
        dropped = sum(is_step(step, 0) for step in steps(said))
        assert dropped == pytest.approx(60.0, abs=4.0 * math.sqrt(60.0))


@pytest.mark.parametrize(("seconds", "readings"), [(0.45, 5), (1.05, 11)])
def test_a_frozen_odometry_stands_still_for_its_time_and_then_tells_all_at_once(seconds: float, readings: int) -> None:
    said, true = told(FaultConfig(odometry_freezes=20.0, freeze_seconds=seconds), 3000)
    runs = [len(list(group)) for _, group in itertools.groupby(said)]
    # Whenever it tells anything it tells all.
    starts = np.cumsum([0, *runs[:-1]]).tolist()
    assert max(said[start].distance(true[start]) for start in starts) < 1e-6
    frozen = [length for length in runs[:-1] if length > 1]
    # From the reading at which it freezes on for so many; it may freeze again as soon as it has told.
    assert set(frozen) == {readings}
    # So often in the time that it is not frozen.
    free = 300.0 - len(frozen) * seconds
    assert len(frozen) == pytest.approx(20.0 * free / 60.0, abs=4.0 * math.sqrt(20.0 * free / 60.0))


def test_what_freezes_does_not_change_what_is_dropped() -> None:
    drops = FaultConfig(odometry_drops=30.0)
    both = FaultConfig(odometry_drops=30.0, odometry_freezes=10.0, freeze_seconds=0.3)
    alone, together = told(drops, 1000)[0], told(both, 1000)[0]
    assert sum(a == b for a, b in zip(alone, together, strict=True)) > 700


def scan_at(
    world_T_robot: Pose2, mount: tuple[float, float, float] = (0.0, 0.0, 0.0), view: float = 360.0
) -> LaserScan:
    """Exact ranges to the walls' centre lines, half a degree apart."""
    beams = round(view * 2)
    angles = math.radians(-view / 2) + math.radians(0.5) * np.arange(beams)
    sensor = world_T_robot @ Pose2(*mount)
    ends = np.column_stack((np.cos(angles + sensor.theta), np.sin(angles + sensor.theta))) * 20.0
    rays = shapely.linestrings(np.stack((np.zeros_like(ends), ends), axis=1) + np.array([sensor.x, sensor.y]))
    walls = shapely.MultiLineString([list(segment) for segment in SEGMENTS])
    ranges = shapely.distance(shapely.intersection(rays, walls), shapely.Point(sensor.x, sensor.y))
    return LaserScan(ranges, math.radians(-view / 2), math.radians(0.5), 20.0, stamp=7.0, robot_T_sensor=mount)


def test_a_lost_scan_says_nothing_and_the_others_are_left_alone() -> None:
    scan = scan_at(Pose2(2.0, 1.0, 0.3), (0.1, 0.0, 0.2))
    faults = Faults(FaultConfig(lost_scans=0.25), HALL, 3)
    after = [faults.scan(scan) for _ in range(2000)]
    lost = [other for other in after if other is not scan]
    assert len(lost) == pytest.approx(500, abs=4 * math.sqrt(375))
    assert all(np.isnan(other.ranges).all() and other.ranges.shape == scan.ranges.shape for other in lost)
    assert all((other.stamp, other.robot_T_sensor) == (7.0, (0.1, 0.0, 0.2)) for other in lost)
    assert all(Faults(FaultConfig(), HALL, 3).scan(scan) is scan for _ in range(20))
    assert all(Faults(FaultConfig(lost_scans=1.0), HALL, 3).scan(scan) is not scan for _ in range(20))


def test_phantoms_stand_on_long_walls_by_their_length() -> None:
    places = phantom_places(HALL, 2000, 1)
    assert len(places) == 2000
    walls = [shapely.LineString(segment) for segment in SEGMENTS]
    lengths = np.array([wall.length for wall in walls])
    on = np.zeros(len(walls))
    for a, b in places:
        assert math.dist(a, b) == pytest.approx(PHANTOM_WIDTH)
        line = shapely.LineString([a, b])
        on[
            int(np.argmin([wall.hausdorff_distance(line) + 9 * (not wall.buffer(1e-6).covers(line)) for wall in walls]))
        ] += 1
    # The last wall is shorter than a door.
    assert on[-1] == 0
    expected = 2000 * lengths[:-1] / lengths[:-1].sum()
    assert (np.abs(on[:-1] - expected) < 4 * np.sqrt(expected)).all()
    # All along the wall: its ends come within a tenth of a metre.
    along = [a[0] for a, b in places if a[1] == b[1] == 0.0]
    assert min(along) == pytest.approx(0.0, abs=0.1)
    assert max(along) == pytest.approx(9.0 - PHANTOM_WIDTH, abs=0.1)


def test_more_phantoms_leave_the_first_ones_where_they_are() -> None:
    assert phantom_places(HALL, 3, 5) == phantom_places(HALL, 10, 5)[:3]
    assert phantom_places(HALL, 3, 5) != phantom_places(HALL, 3, 6)
    assert phantom_places(HALL, 0, 5) == []
    short = FloorPlan("short", HALL.rooms, HALL.walls[-1:], ())
    assert phantom_places(short, 4, 5) == []


@pytest.mark.parametrize("mount", [(0.0, 0.0, 0.0), (0.15, -0.1, 1.0)])
@pytest.mark.parametrize("view", [360.0, 180.0])
def test_phantoms_are_seen_where_the_wall_they_stand_on_is(mount: tuple[float, float, float], view: float) -> None:
    config = FaultConfig(phantom_doors=60)
    places = phantom_places(HALL, 60, 2)
    walls = shapely.MultiLineString([list(segment) for segment in SEGMENTS])
    for pose in (Pose2(2.0, 1.5, 0.4), Pose2(6.0, 2.0, 2.5), Pose2(8.5, 5.5, -2.0)):
        faults, scan = Faults(config, HALL, 2), scan_at(pose, mount, view)
        times = {f"phantom{number:02d}": 0 for number in range(60)}
        for _ in range(60):
            for sighting in faults.phantoms(scan, pose):
                times[sighting.id] += 1
                place = places[int(sighting.id.removeprefix("phantom"))]
                assert pose.transform(np.array(sighting.segment_robot)) == pytest.approx(np.array(place))
                assert sighting.stamp == 7.0
        sensor = pose @ Pose2(*mount)
        for number, (a, b) in enumerate(places):
            middle = np.array([(a[0] + b[0]) / 2, (a[1] + b[1]) / 2])
            away = math.dist(middle, (sensor.x, sensor.y))
            bearing = math.atan2(middle[1] - sensor.y, middle[0] - sensor.x) - sensor.theta
            aside = abs(math.degrees(math.remainder(bearing, math.tau)))
            ray = shapely.LineString([(sensor.x, sensor.y), middle + 1e-6 * (middle - (sensor.x, sensor.y))])
            first = shapely.Point(sensor.x, sensor.y).distance(ray.intersection(walls))
            seen = times[f"phantom{number:02d}"]
            # Not judged: at the border of the range or the view, and grazing beams beside the one through the middle.
            if abs(away - PHANTOM_RANGE) < 0.01 or abs(aside - view / 2) < 1.0 or abs(first - away) > 0.1:
                continue
            expected = 60 * PHANTOM_SHARE if away < PHANTOM_RANGE and aside < view / 2 else 0
            assert seen == pytest.approx(expected, abs=4 * math.sqrt(15) if expected else 0)


def test_a_phantom_is_not_reported_where_the_beam_ends_well_before_or_behind_its_wall() -> None:
    config, pose = FaultConfig(phantom_doors=1), Pose2(4.5, 4.5)
    ((a, b),) = phantom_places(HALL, 1, 2)
    away = math.dist(((a[0] + b[0]) / 2, (a[1] + b[1]) / 2), (pose.x, pose.y))
    assert away < PHANTOM_RANGE
    for off, seen in ((0.0, True), (0.39, True), (-0.39, True), (0.41, False), (-0.41, False)):
        scan = LaserScan(np.full(720, away + off), -math.pi, math.tau / 720, 20.0)
        faults = Faults(config, HALL, 2)
        assert any(faults.phantoms(scan, pose) for _ in range(30)) == seen
