"""Maps redrawn with closed doors, against rays that are cast while the doors are really closed."""

from functools import cache

import numpy as np
import pytest
from shapely.geometry import box

from closedrooms.core.errors import InvalidInputError
from closedrooms.core.pose import Pose2
from closedrooms.experiments.dataset import erase as erase_module
from closedrooms.experiments.dataset.erase import Eraser, erase
from closedrooms.experiments.dataset.open_survey import OpenSurvey, survey_open
from closedrooms.experiments.dataset.rays import first_hits
from closedrooms.mapping.config import MapperConfig
from closedrooms.navigation.config import NavigationConfig
from closedrooms.sim.config import LidarConfig, SimConfig, noise_level
from closedrooms.sim.simulation import Simulation
from closedrooms.worlds.plan import FloorPlan, Furniture, PlanDoor, PlanRoom, Wall

QUICK = LidarConfig(beams=240)


def small_plan() -> FloorPlan:
    """A corridor with two rooms; one door swings into its room, the other into the corridor."""
    rooms = (
        PlanRoom("corridor", "corridor", box(0, 0, 8, 2)),
        PlanRoom("left", "office", box(0, 2, 4, 6)),
        PlanRoom("right", "office", box(4, 2, 8, 6)),
    )
    lines = [((0, 0), (8, 0)), ((8, 0), (8, 6)), ((8, 6), (0, 6)), ((0, 6), (0, 0)), ((0, 2), (8, 2)), ((4, 2), (4, 6))]
    walls = tuple(
        Wall(f"w{i}", ((float(a[0]), float(a[1])), (float(b[0]), float(b[1]))), 0.12) for i, (a, b) in enumerate(lines)
    )
    doors = (
        PlanDoor("into-room", ((1.5, 2.0), (2.4, 2.0)), ("corridor", "left"), opens_into="left"),
        PlanDoor("into-corridor", ((5.5, 2.0), (6.4, 2.0)), ("corridor", "right"), opens_into="corridor"),
    )
    return FloorPlan(
        "two-rooms", rooms, walls, doors, (), (4.0, 1.0, 0.2), (Furniture("desk", box(0.4, 4.5, 1.4, 5.4)),)
    )


@cache
def surveyed(noise: str) -> OpenSurvey:
    config = SimConfig(noise=noise_level(noise), lidar=QUICK)
    return survey_open(small_plan(), config, MapperConfig(), NavigationConfig(), 3)


@pytest.mark.parametrize("closed", [("into-room",), ("into-corridor",), ("into-corridor", "into-room")])
@pytest.mark.simulation
def test_every_ray_ends_where_it_does_when_the_doors_are_really_closed(closed: tuple[str, ...]) -> None:
    survey = surveyed("none")
    erased = erase(survey, closed)
    assert 0 < len(erased.keyframes) < len(survey.poses)
    changed = 0
    with Simulation(survey.plan, closed, survey.sim, 0) as sim:
        for index, scan in zip(erased.keyframes, erased.scans, strict=True):
            true = sim.true_ranges(sim.world_T_map @ Pose2(*survey.keyframe_true_poses[index]))
            true = np.where(true < QUICK.range_min, np.nan, np.where(true >= QUICK.range_max, np.inf, true))
            np.testing.assert_allclose(scan.ranges, true, atol=1e-3)
            changed += int((scan.ranges != survey.keyframes.scans[index].ranges).sum())
    assert changed > 100


@pytest.mark.simulation
def test_the_map_knows_nothing_of_a_closed_room_and_everything_else() -> None:
    survey = surveyed("medium")
    erased = erase(survey, ("into-room",))
    frame = erased.grid.frame
    world_T_map = survey.world_T_map

    def known_share(x0: float, y0: float, x1: float, y1: float) -> float:
        xs, ys = np.meshgrid(np.arange(x0, x1, 0.1), np.arange(y0, y1, 0.1))
        cells = frame.to_cells(world_T_map.inverse().transform(np.column_stack((xs.ravel(), ys.ravel()))))
        inside = frame.contains(cells)
        return float(erased.grid.known[tuple(cells[inside].T)].sum() / len(cells))

    assert known_share(0.3, 2.3, 3.7, 5.7) < 0.01
    assert known_share(4.3, 2.3, 7.7, 5.7) > 0.97
    assert known_share(0.3, 0.3, 7.7, 1.7) > 0.97


@pytest.mark.simulation
def test_a_cut_ray_shows_the_door_where_it_is() -> None:
    survey = surveyed("medium")
    erased = erase(survey, ("into-room", "into-corridor"))
    assert [door.id for door in erased.doors] == ["into-corridor", "into-room"]
    for door in erased.doors:
        plan_door = next(d for d in survey.plan.doors if d.id == door.id)
        expected = survey.world_T_map.inverse().transform(np.array(plan_door.midpoint))
        np.testing.assert_allclose(door.midpoint, expected, atol=0.05)
        assert door.width == pytest.approx(0.9, abs=0.02)


@pytest.mark.simulation
def test_cut_rays_carry_the_noise_of_the_sensor() -> None:
    survey = surveyed("medium")
    errors = []
    for door in ("into-room", "into-corridor"):
        erased = erase(survey, (door,))
        with Simulation(survey.plan, (door,), survey.sim, 0) as sim:
            for index, scan in zip(erased.keyframes, erased.scans, strict=True):
                cut = (scan.ranges != survey.keyframes.scans[index].ranges) & np.isfinite(scan.ranges)
                true = sim.true_ranges(sim.world_T_map @ Pose2(*survey.keyframe_true_poses[index]))
                errors += list((scan.ranges - true)[cut])
    assert len(errors) > 300
    # A beam that meets the very end of a leaf may go past it in one of the two.
    near = [error for error in errors if abs(error) < 0.2]
    assert len(near) >= len(errors) - 3
    assert np.std(near) == pytest.approx(survey.sim.noise.range_sd, rel=0.15)
    assert abs(np.mean(near)) < 0.01


@pytest.mark.simulation
def test_no_door_closed_leaves_every_scan_as_it_was() -> None:
    survey = surveyed("medium")
    erased = erase(survey, ())
    assert len(erased.keyframes) == len(survey.poses)
    assert all(a is b for a, b in zip(erased.scans, survey.keyframes.scans, strict=True))
    assert erased.doors == []


@pytest.mark.simulation
def test_a_map_does_not_depend_on_what_was_erased_before() -> None:
    eraser = Eraser(surveyed("medium"))
    eraser.erase(("into-corridor",))
    again = eraser.erase(("into-room",))
    fresh = erase(surveyed("medium"), ("into-room",))
    np.testing.assert_array_equal(again.grid.cells, fresh.grid.cells)
    assert again.doors == fresh.doors


@pytest.mark.simulation
@pytest.mark.simulation
def test_little_memory_changes_no_map(monkeypatch: pytest.MonkeyPatch) -> None:
    survey = surveyed("medium")
    orders = [("into-room",), ("into-corridor", "into-room"), (), ("into-corridor",), ("into-room",)]
    plenty = Eraser(survey)
    expected = [plenty.erase(closed) for closed in orders]
    own = [drawn.size for drawn in plenty._known.values()]
    assert sum(own) == plenty._kept
    monkeypatch.setattr(erase_module, "KEPT", sum(own) // 4)
    little = Eraser(survey)
    for closed, full in zip(orders, expected, strict=True):
        erased = little.erase(closed)
        assert np.array_equal(erased.grid.cells, full.grid.cells)
        assert erased.doors == full.doors
        assert sum(drawn.size for drawn in little._known.values()) == little._kept <= sum(own) // 4
    assert len(little._known) < len(plenty._known) / 2


def test_refuses_a_door_that_does_not_exist() -> None:
    with pytest.raises(InvalidInputError, match="unknown door 'attic'"):
        erase(surveyed("medium"), ("attic",))


def test_rays_meet_the_nearest_edge_or_none() -> None:
    edges = np.array([(2.0, -1.0, 2.0, 1.0), (3.0, -1.0, 3.0, 1.0), (-1.0, 5.0, 1.0, 5.0)])
    origins = np.zeros((4, 2))
    directions = np.array([(1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (np.cos(0.4), np.sin(0.4))])
    np.testing.assert_allclose(first_hits(origins, directions, edges), [2.0, 5.0, np.inf, 2.0 / np.cos(0.4)])
    assert np.isinf(first_hits(origins, directions, np.zeros((0, 4)))).all()
