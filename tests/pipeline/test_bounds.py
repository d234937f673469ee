"""A run stays in its building, in memory, and says where the robot does not fit."""

from dataclasses import replace

import pytest
from shapely.geometry import box

from closedrooms.core.errors import InvalidInputError
from closedrooms.core.pose import Pose2
from closedrooms.core.robot import RobotConfig
from closedrooms.navigation.config import NavigationConfig, RobotNavigation
from closedrooms.pipeline.bounds import OUTSIDE_MARGIN, BuildingBounds, check_size, too_narrow
from closedrooms.worlds.plan import FloorPlan, PlanRoom, Wall

START = Pose2(3.0, 1.0)


def robot(radius: float) -> RobotNavigation:
    return NavigationConfig().for_robot(RobotConfig(radius=radius))


@pytest.mark.parametrize("place", [(0.1, 0.1), (11.9, 4.9), (6.0, -1.5), (13.0, 6.0)])
def test_a_robot_in_its_building_or_at_its_walls_is_inside(flat: FloorPlan, place: tuple[float, float]) -> None:
    assert BuildingBounds(flat).check(Pose2(*place)) is None


@pytest.mark.parametrize("place", [(6.0, -3.0), (20.0, 2.0), (-2.5, 2.0)])
def test_a_robot_beyond_the_margin_is_outside_and_the_place_is_said(
    flat: FloorPlan, place: tuple[float, float]
) -> None:
    stop = BuildingBounds(flat).check(Pose2(*place))
    assert stop is not None
    assert stop.status == "outside"
    assert f"({place[0]:.1f}, {place[1]:.1f})" in stop.reason


def test_a_courtyard_is_inside_and_the_yard_between_two_houses_is_not() -> None:
    sides = [box(0, 0, 20, 2), box(0, 18, 20, 20), box(0, 2, 2, 18), box(18, 2, 20, 18)]
    ring = FloorPlan("ring", tuple(PlanRoom(f"r{i}", "corridor", side) for i, side in enumerate(sides)), (), ())
    assert BuildingBounds(ring).check(Pose2(10.0, 10.0)) is None
    houses = FloorPlan("houses", ring.rooms[:2], (), ())
    assert BuildingBounds(houses).check(Pose2(10.0, 10.0)) is not None
    assert BuildingBounds(houses).check(Pose2(10.0, 2.0 + OUTSIDE_MARGIN - 0.1)) is None


def test_walls_belong_to_the_outline(flat: FloorPlan) -> None:
    annexe = replace(flat, walls=(*flat.walls, Wall("w9", ((12.0, 2.0), (20.0, 2.0)), 0.2)))
    assert BuildingBounds(flat).check(Pose2(18.0, 2.0)) is not None
    assert BuildingBounds(annexe).check(Pose2(18.0, 2.0)) is None


def test_a_building_of_too_many_cells_is_refused_before_memory_is_taken(flat: FloorPlan) -> None:
    check_size(flat, 0.05, NavigationConfig())
    with pytest.raises(InvalidInputError, match=r"12 m x 5 m has 6.*e\+09 cells of 0.0001 m; expected at most"):
        check_size(flat, 0.0001, NavigationConfig())
    with pytest.raises(InvalidInputError, match="flat"):
        check_size(flat, 0.05, NavigationConfig(most_cells=1000))


def test_a_robot_that_fits_through_every_door_needs_no_remark(flat: FloorPlan) -> None:
    assert too_narrow(flat, (), START, robot(0.2)) == []
    # d2 alone is too narrow, and r2 and r3 are entered from the corridor.
    assert too_narrow(flat, (), START, robot(0.4)) == []


def test_rooms_behind_passages_that_are_too_narrow_are_named(flat: FloorPlan) -> None:
    (remark,) = too_narrow(flat, (), START, robot(0.45))
    assert remark.names == ("r1", "r2")
    assert "0.96 m" in str(remark)
    assert "radius 0.45" in str(remark)
    assert not remark.loss


def test_rooms_behind_closed_doors_are_not_the_robot_s_fault(flat: FloorPlan) -> None:
    (remark,) = too_narrow(flat, ("d0",), START, robot(0.45))
    assert remark.names == ("r2",)
    (remark,) = too_narrow(flat, ("d1",), START, robot(0.4))
    assert remark.names == ("r2",)  # through d2 alone
