"""Doors: what they block, how they open, and when they are seen."""

import dataclasses
import itertools
import math

import numpy as np
import pytest
from shapely.geometry import Polygon, box

from closedrooms.core.errors import InvalidInputError
from closedrooms.core.pose import Pose2
from closedrooms.sim.building import building_solids
from closedrooms.sim.config import LidarConfig, NoiseConfig, SimConfig, noise_level
from closedrooms.sim.door_leaves import door_leaves
from closedrooms.sim.simulation import Simulation
from closedrooms.worlds.geometry import door_gap, door_leaf
from closedrooms.worlds.plan import FloorPlan, Furniture

SWING = math.radians(95)
DOORS = ("hinged", "double", "sliding")


def leaves_of(plan: FloorPlan, name: str, *, furniture: Polygon | None = None) -> list[Polygon]:
    door = next(door for door in plan.doors if door.id == name)
    solids = building_solids(plan) if furniture is None else building_solids(plan).union(furniture)
    return [Polygon(leaf.at(leaf.travel)) for leaf in door_leaves(plan, door, solids, SWING)]


@pytest.mark.parametrize("name", DOORS)
@pytest.mark.simulation
def test_a_closed_door_fills_its_gap(plan: FloorPlan, exact_config: SimConfig, name: str) -> None:
    door = next(door for door in plan.doors if door.id == name)
    with Simulation(plan, [name], exact_config, 0) as sim:
        closed = sim.door_leaves(name)
    area = sum(leaf.area for leaf in closed)
    assert area == pytest.approx(door_leaf(plan, door).area)
    assert sum(leaf.intersection(door_leaf(plan, door)).area for leaf in closed) == pytest.approx(area)


@pytest.mark.parametrize("name", DOORS)
def test_an_open_door_leaves_its_gap_free_for_the_robot(plan: FloorPlan, name: str) -> None:
    door = next(door for door in plan.doors if door.id == name)
    blocked = sum(leaf.intersection(door_gap(plan, door)).area for leaf in leaves_of(plan, name))
    assert blocked < 0.12 * door_gap(plan, door).area


def test_a_hinged_door_swings_95_degrees_into_its_room(plan: FloorPlan) -> None:
    (leaf,) = door_leaves(plan, plan.doors[0], building_solids(plan), SWING)
    assert math.degrees(leaf.travel) == pytest.approx(95.0)
    assert Polygon(leaf.at(leaf.travel)).centroid.y > 4.3


def test_a_double_door_has_two_leaves_that_swing_apart(plan: FloorPlan) -> None:
    left, right = leaves_of(plan, "double")
    assert left.centroid.x == pytest.approx(5.2, abs=0.1)
    assert right.centroid.x == pytest.approx(6.8, abs=0.1)
    assert min(left.centroid.y, right.centroid.y) > 4.3


def test_a_sliding_door_slides_into_the_wall(plan: FloorPlan) -> None:
    (leaf,) = leaves_of(plan, "sliding")
    assert leaf.centroid.x == pytest.approx(10.45 - 0.9)
    assert building_solids(plan).buffer(1e-6).covers(leaf)


def test_a_sliding_door_without_room_in_the_wall_telescopes(plan: FloorPlan) -> None:
    wide = dataclasses.replace(plan.doors[2], segment=((8.6, 4.0), (10.8, 4.0)))
    other = dataclasses.replace(plan, doors=(*plan.doors[:2], wide))
    leaves = leaves_of(other, "sliding")
    assert len(leaves) > 1
    assert building_solids(other).buffer(2e-3).covers(Polygon.union(*leaves[:2]))


def test_furniture_stops_a_swinging_leaf(plan: FloorPlan) -> None:
    cupboard = box(1.0, 4.6, 1.6, 5.2)
    (leaf,) = door_leaves(plan, plan.doors[0], building_solids(plan).union(cupboard), SWING)
    assert 60.0 < math.degrees(leaf.travel) < 94.0
    assert Polygon(leaf.at(leaf.travel)).intersection(cupboard).area < 1e-3
    touching = Polygon(leaf.at(leaf.travel + math.radians(2)))
    assert touching.distance(cupboard) < 5e-3


def test_a_leaf_that_could_not_open_hangs_on_the_other_jamb(plan: FloorPlan) -> None:
    pillar = box(2.0, 4.12, 2.6, 4.2)
    door = dataclasses.replace(plan.doors[0], hinge=1)
    (blocked,) = door_leaves(plan, door, building_solids(plan).union(pillar), SWING)
    assert math.degrees(blocked.travel) >= 60.0


@pytest.mark.simulation
def test_a_door_opens_while_time_passes_and_rays_go_through(plan: FloorPlan, exact_config: SimConfig) -> None:
    front = Pose2(1.95, 3.0, math.pi / 2)
    with Simulation(plan, ["hinged"], exact_config, 0) as sim:
        ahead = exact_config.lidar.beams // 2
        assert sim.true_ranges(front)[ahead] == pytest.approx(1.0 - 0.025, abs=1e-6)
        sim.open_door("hinged")
        seen = [sim.door_states()["hinged"]]
        for _ in range(25):
            sim.step(0.0, 0.0, 0.1)
            seen.append(sim.door_states()["hinged"])
        assert seen[0] == 0.0
        assert all(b >= a for a, b in itertools.pairwise(seen))
        assert 0.0 < seen[5] < 1.0
        assert seen[-1] == 1.0
        assert sim.true_ranges(front)[ahead] == pytest.approx(9.0 - 0.08 - 3.0, abs=1e-6)


@pytest.mark.simulation
def test_a_half_open_leaf_is_where_geometry_says(plan: FloorPlan, exact_config: SimConfig) -> None:
    with Simulation(plan, ["hinged"], exact_config, 0) as sim:
        sim.open_door("hinged")
        for _ in range(6):
            sim.step(0.0, 0.0, 0.1)
        (leaf,) = sim.door_leaves("hinged")
        pose = Pose2(1.6, 3.0, math.pi / 2)
        exact = leaf.exterior.intersection(box(1.6, 3.0, 1.6 + 1e-9, 9.0)).bounds[1] - 3.0
        assert sim.true_ranges(pose)[exact_config.lidar.beams // 2] == pytest.approx(exact, abs=1e-3)


@pytest.mark.simulation
def test_an_opening_door_waits_for_the_robot_in_its_way(plan: FloorPlan) -> None:
    into_corridor = dataclasses.replace(plan.doors[0], opens_into="corridor")
    world = dataclasses.replace(plan, doors=(into_corridor,), start=(1.95, 3.4, math.pi))
    with Simulation(world, ["hinged"], SimConfig(noise=noise_level("none")), 0) as sim:
        sim.open_door("hinged")
        for _ in range(40):
            sim.step(0.0, 0.0, 0.1)
        waiting = sim.door_states()["hinged"]
        (leaf,) = sim.door_leaves("hinged")
        assert 0.0 < waiting < 1.0
        assert leaf.distance(Polygon.from_bounds(1.95, 3.4, 1.95, 3.4)) >= 0.2
        for _ in range(60):
            sim.step(-0.6, 0.0, 0.1)
        assert sim.door_states()["hinged"] == 1.0


@pytest.mark.simulation
def test_only_closed_doors_that_a_ray_hits_within_range_are_sighted(plan: FloorPlan) -> None:
    near = SimConfig(lidar=LidarConfig(range_max=3.0), noise=noise_level("none"))
    far = SimConfig(noise=noise_level("none"))
    with Simulation(plan, ["hinged", "sliding"], near, 0) as sim:
        assert [door.id for door in sim.observe().sightings] == ["hinged"]
    with Simulation(plan, ["hinged", "sliding"], far, 0) as sim:
        assert {door.id for door in sim.observe().sightings} == {"hinged", "sliding"}
    with Simulation(plan, [], far, 0) as sim:
        assert sim.observe().sightings == ()


@pytest.mark.simulation
def test_a_sighting_gives_the_jambs_in_the_robot_frame(plan: FloorPlan) -> None:
    config = SimConfig(noise=noise_level("none"), heading=math.pi / 2)
    with Simulation(plan, ["hinged"], config, 0) as sim:
        (sighting,) = sim.observe().sightings
        jambs = sim.world_T_robot.transform(np.array(sighting.segment_robot))
    np.testing.assert_allclose(jambs, plan.doors[0].segment, atol=1e-9)
    np.testing.assert_allclose(sighting.segment_robot, [(2.0, 0.5), (2.0, -0.4)], atol=1e-9)


@pytest.mark.simulation
def test_a_door_that_opens_is_sighted_no_more(plan: FloorPlan, exact_config: SimConfig) -> None:
    with Simulation(plan, ["hinged"], exact_config, 0) as sim:
        assert sim.observe().sightings
        sim.open_door("hinged")
        sim.step(0.0, 0.0, 0.1)
        assert not sim.observe().sightings


@pytest.mark.simulation
def test_a_lidar_that_measures_nothing_sees_no_door(plan: FloorPlan) -> None:
    for noise in (NoiseConfig(dropouts=1.0), NoiseConfig(outliers=1.0, dropouts=0.0)):
        with Simulation(plan, ["hinged"], SimConfig(noise=noise), 0) as sim:
            assert sim.observe().sightings == ()


@pytest.mark.simulation
def test_an_unknown_door_and_an_entrance_are_refused(plan: FloorPlan) -> None:
    for name in ("d99", "entrance"):
        with (
            pytest.raises(InvalidInputError, match=name),
            Simulation(plan, [name], SimConfig(), 0),
        ):
            pass
    with Simulation(plan, [], SimConfig(), 0) as sim, pytest.raises(InvalidInputError, match="d99"):
        sim.open_door("d99")


@pytest.mark.simulation
def test_furniture_blocks_rays_but_is_below_no_scan_plane(plan: FloorPlan, exact_config: SimConfig) -> None:
    bare = dataclasses.replace(plan, furniture=())
    pose = Pose2(1.0, 6.0, math.pi / 2)
    ahead = exact_config.lidar.beams // 2
    with Simulation(plan, [], exact_config, 0) as sim:
        assert sim.true_ranges(pose)[ahead] == pytest.approx(1.5, abs=1e-6)
    with Simulation(bare, [], exact_config, 0) as sim:
        assert sim.true_ranges(pose)[ahead] == pytest.approx(3.0 - 0.08, abs=1e-6)
    assert isinstance(plan.furniture[0], Furniture)
