"""Glass, people, clutter and faults: each does what it says, by the seed, and nothing by default."""

import dataclasses
import itertools
import math
from pathlib import Path

import numpy as np
import pytest
import shapely
from shapely.geometry import Point, box

from closedrooms.core.errors import InvalidInputError
from closedrooms.core.pose import Pose2
from closedrooms.sim.building import building_solids
from closedrooms.sim.config import Body, FaultConfig, SimConfig, noise_level
from closedrooms.sim.glass import comes_back, glass_area
from closedrooms.sim.simulation import Simulation
from closedrooms.worlds.formats.native import read_plan, write_plan
from closedrooms.worlds.geometry import wall_area
from closedrooms.worlds.glazing import glazed
from closedrooms.worlds.plan import FloorPlan, PlanRoom, Wall

QUIET = noise_level("none")
DOORS = ["hinged", "double", "sliding"]


@pytest.fixture(params=["wheels", "kinematic"])
def body(request: pytest.FixtureRequest) -> Body:
    which: Body = request.param
    return which


def with_glass(plan: FloorPlan, *walls: str, door: str = "") -> FloorPlan:
    return dataclasses.replace(
        plan,
        walls=tuple(dataclasses.replace(w, material="glass") if w.id in walls else w for w in plan.walls),
        doors=tuple(dataclasses.replace(d, material="glass") if d.id == door else d for d in plan.doors),
    )


def test_a_pane_returns_beams_near_its_normal_alone_and_stops_the_robot(plan: FloorPlan, body: Body) -> None:
    # w4 is the wall between the corridor and the rooms above it.
    world = dataclasses.replace(with_glass(plan, "w4"), start=(3.2, 3.0, math.pi / 2))
    with Simulation(world, DOORS, SimConfig(body=body, noise=QUIET), 0) as sim:
        ranges, lidar = sim.observe().scan.ranges, sim.config.lidar
        for degrees, seen in ((0, True), (8, True), (-8, True), (25, False), (-25, False)):
            beam = lidar.beams // 2 + round(math.radians(degrees) / lidar.angle_increment)
            if seen:
                assert ranges[beam] == pytest.approx(0.92 / math.cos(math.radians(degrees)), abs=2e-3)
            else:
                assert ranges[beam] > 1.3
        for _ in range(30):
            sim.step(0.8, 0.0, 0.1)
        assert sim.world_T_robot.y == pytest.approx(4.0 - 0.08 - 0.2, abs=4e-3)
        assert sim.collided


def test_a_closed_door_of_glass_is_sighted_only_where_it_returns_a_beam(plan: FloorPlan, body: Body) -> None:
    for x, sighted in ((1.95, True), (6.0, False)):
        world = dataclasses.replace(with_glass(plan, door="hinged"), start=(x, 2.0, 0.0))
        with Simulation(world, DOORS, SimConfig(body=body, noise=QUIET), 0) as sim:
            assert ("hinged" in {door.id for door in sim.observe().sightings}) is sighted


def test_what_comes_back_falls_from_all_to_nothing() -> None:
    angles = np.radians([0.0, 9.0, 15.0, 21.0, 90.0])
    draws = np.random.default_rng(0).random((2000, 5))
    shares = np.mean([comes_back(angles, row) for row in draws], axis=0)
    np.testing.assert_allclose(shares, [1.0, 1.0, 0.5, 0.0, 0.0], atol=0.05)


def test_a_share_of_the_walls_is_glazed_by_the_seed_and_grows(plan: FloorPlan) -> None:
    def panes(share: float, seed: int) -> set[str]:
        return {wall.id for wall in glazed(plan, share, seed).walls if wall.material == "glass"}

    assert glazed(plan, 0.0, 1) is plan
    assert panes(0.3, 1) == panes(0.3, 1) != panes(0.3, 2)
    assert panes(0.2, 1) < panes(0.6, 1)
    assert all(wall.material == "glass" for wall in glazed(plan, 1.0, 1).walls)
    assert wall_area(glazed(plan, 0.5, 1)).symmetric_difference(wall_area(plan)).area < 1e-5


def test_plans_carry_materials_and_plain_ones_stay_as_they_were(tmp_path: Path, plan: FloorPlan) -> None:
    write_plan(tmp_path / "plain.json", plan)
    assert "material" not in (tmp_path / "plain.json").read_text()
    glass = with_glass(plan, "w4", door="double")
    write_plan(tmp_path / "glass.json", glass)
    again = read_plan(tmp_path / "glass.json")
    assert [wall.material for wall in again.walls] == [wall.material for wall in glass.walls]
    assert [door.material for door in again.doors] == [door.material for door in glass.doors]
    broken = (tmp_path / "glass.json").read_text().replace('"glass"', '"paper"')
    (tmp_path / "broken.json").write_text(broken)
    with pytest.raises(InvalidInputError, match="paper"):
        read_plan(tmp_path / "broken.json")


def test_people_walk_through_doors_and_through_nothing_else(plan: FloorPlan, body: Body) -> None:
    with Simulation(plan, ["sliding"], SimConfig(body=body, noise=QUIET, people=3), 2) as sim:
        solids = building_solids(plan).union(plan.furniture[0].polygon)
        rooms: set[str] = set()
        scans = []
        for _ in range(300):
            sim.step(0.0, 0.0, 0.2)
            for person in sim.movers:
                assert person.outline.distance(solids) > 0.0
                rooms |= {room.id for room in plan.rooms if room.polygon.contains(person.outline.centroid)}
                assert person.outline.distance(Point(sim.world_T_robot.x, sim.world_T_robot.y)) > 0.2
            scans.append(sim.observe().scan.ranges)
        assert {"corridor", "left", "middle"} <= rooms
        assert "right" not in rooms
        assert sum(float(np.abs(a - b).max()) > 0.5 for a, b in itertools.pairwise(scans)) > 50


def test_the_robot_does_not_pass_through_people(plan: FloorPlan, body: Body) -> None:
    with Simulation(plan, DOORS, SimConfig(body=body, noise=QUIET, people=6, clutter=6), 3) as sim:
        rng = np.random.default_rng(1)
        touched = 0
        for _ in range(150):
            v, w = rng.choice([1.0, -0.5]), rng.uniform(-2, 2)
            for _ in range(4):
                sim.step(v, w, 0.1)
                here = Point(sim.world_T_robot.x, sim.world_T_robot.y)
                assert min(mover.outline.distance(here) for mover in sim.movers) > 0.2 - 5e-3
                touched += sim.collided
        assert touched > 10


def test_boxes_are_moved_while_the_robot_is_away(plan: FloorPlan) -> None:
    with Simulation(plan, [], SimConfig(noise=QUIET, clutter=4), 0) as sim:
        before = [mover.outline.centroid for mover in sim.movers]
        sim.step(0.0, 0.0, 400.0)
        moved = [a.distance(m.outline.centroid) > 0.5 for a, m in zip(before, sim.movers, strict=True)]
        here = Point(sim.world_T_robot.x, sim.world_T_robot.y)
        assert sum(moved) >= 2
        assert all(m.outline.distance(here) > 3.5 for m, is_moved in zip(sim.movers, moved, strict=True) if is_moved)


def test_the_same_seed_moves_everything_the_same(plan: FloorPlan, body: Body) -> None:
    faults = FaultConfig(lost_scans=0.1, odometry_freezes=10, odometry_drops=10, phantom_doors=3, unequal_wheels=0.01)
    config = SimConfig(body=body, glass=0.3, people=2, clutter=2, faults=faults)

    def seen(seed: int) -> bytes:
        kept = b""
        with Simulation(plan, DOORS, config, seed) as sim:
            for i in range(40):
                o = sim.observe()
                kept += o.scan.ranges.tobytes() + repr((o.odometry, o.sightings, o.bumps)).encode()
                sim.step(0.6, math.sin(i / 5), 0.1)
        return kept

    assert seen(1) == seen(1)
    assert seen(1) != seen(2)


def follow(plan: FloorPlan, faults: FaultConfig, seconds: float = 20.0) -> tuple[list[Pose2], list[Pose2], list[int]]:
    """Odometry, true poses and the number of beams that measured, driving in a circle."""
    told, true, beams = [], [], []
    with Simulation(
        dataclasses.replace(plan, start=(3.0, 1.5, 0.0)), DOORS, SimConfig(noise=QUIET, faults=faults), 0
    ) as sim:
        for _ in range(round(seconds / 0.1)):
            sim.step(0.5, 0.8, 0.1)
            seen = sim.observe()
            told.append(seen.odometry)
            true.append(sim.map_T_robot)
            beams.append(int(np.isfinite(seen.scan.ranges).sum()))
    return told, true, beams


def test_frozen_odometry_stands_still_and_then_tells_all(plan: FloorPlan) -> None:
    told, true, _ = follow(plan, FaultConfig(odometry_freezes=20.0))
    still = [a == b for a, b in itertools.pairwise(told)]
    assert 10 < sum(still) < 150
    right = [a.distance(b) < 1e-6 for a, b in zip(told, true, strict=True)]
    assert right[-1] or any(right[len(right) // 2 :])


def test_dropped_odometry_never_counts_a_piece(plan: FloorPlan) -> None:
    told, true, _ = follow(plan, FaultConfig(odometry_drops=20.0))
    assert abs(math.remainder(told[-1].theta - true[-1].theta, 2 * math.pi)) > 0.1
    steps = [a.distance(b) for a, b in itertools.pairwise(told)]
    assert 2 <= sum(step < 1e-9 for step in steps) < 20


def test_lost_scans_measure_nothing_and_show_no_doors(plan: FloorPlan) -> None:
    _, _, beams = follow(plan, FaultConfig(lost_scans=0.2))
    assert 0.1 < np.mean(np.array(beams) == 0) < 0.3


def test_unequal_wheels_bend_the_way_that_the_odometry_tells(plan: FloorPlan) -> None:
    world = dataclasses.replace(plan, start=(1.0, 2.0, 0.0))
    config = SimConfig(noise=QUIET, faults=FaultConfig(unequal_wheels=0.03))
    with Simulation(world, DOORS, config, 0) as sim:
        sim.step(1.0, 0.0, 5.0)
        odometry, true = sim.observe().odometry, sim.map_T_robot
    assert odometry.theta - true.theta == pytest.approx(0.03 / 0.3 * true.x, rel=1e-3)


def test_phantoms_are_reported_on_walls_in_sight_and_never_behind_them(plan: FloorPlan) -> None:
    config = SimConfig(noise=QUIET, faults=FaultConfig(phantom_doors=40))
    with Simulation(plan, [], config, 0) as sim:
        walls = building_solids(plan).buffer(0.05)
        seen = {s.id: s for _ in range(10) for s in sim.observe().sightings}
        assert seen
        for sighting in seen.values():
            ends = sim.world_T_robot.transform(np.array(sighting.segment_robot))
            middle = Point(*ends.mean(axis=0))
            assert box(-0.2, -0.2, 12.2, 4.2).contains(middle)
            assert walls.distance(middle) < 0.5
        assert len(seen) < 40


def test_disturbances_that_make_no_sense_are_refused() -> None:
    for make in (
        lambda: SimConfig(glass=1.5),
        lambda: SimConfig(people=-1),
        lambda: SimConfig(clutter=1000),
        lambda: FaultConfig(lost_scans=2.0),
        lambda: FaultConfig(odometry_drops=math.nan),
        lambda: FaultConfig(unequal_wheels=0.9),
        lambda: FaultConfig(phantom_doors=-1),
    ):
        with pytest.raises(InvalidInputError):
            make()


def test_a_plan_of_glass_alone_is_glass_all_over_and_other_walls_that_meet_it_stay_whole() -> None:
    walls = tuple(Wall(f"w{i}", segment, 0.2) for i, segment in enumerate((((0, 0), (4, 0)), ((4, 0), (4, 3)))))
    room = PlanRoom("r0", "hall", shapely.box(0, 0, 4, 3))
    plan = FloorPlan(name="l", rooms=(room,), walls=walls, doors=(), openings=(), start=(1.0, 1.0, 0.0))
    solid = shapely.box(-1, -1, 5, 4)
    all_glass = dataclasses.replace(plan, walls=tuple(dataclasses.replace(w, material="glass") for w in walls))
    both = glass_area(all_glass, solid).area
    one = glass_area(with_glass(plan, "w0"), solid).area
    # Two strips, 4 and 3 m by 0.2 m, that share a corner of 0.1 x 0.1 m.
    assert both == pytest.approx(0.8 + 0.6 - 0.01)
    assert one == pytest.approx(0.8 - 0.01)
    assert glass_area(plan, solid).is_empty
