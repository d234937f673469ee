"""No robot leaves a building."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import shapely

from closedrooms.worlds.formats.native import write_plan
from closedrooms.worlds.geometry import wall_area
from closedrooms.worlds.library import bundled_names, load_world, read_world
from closedrooms.worlds.plan import FloorPlan, Opening, PlanDoor, Wall
from closedrooms.worlds.ways_out import has_way_out, wall_up_entrances, wall_up_outline


@pytest.mark.parametrize("name", bundled_names()[::4])
def test_bundled_worlds_are_closed(name: str) -> None:
    plan = load_world(name)
    assert not has_way_out(plan)
    assert wall_up_outline(plan) is plan


@pytest.mark.parametrize("number", range(4))
def test_an_outer_wall_that_is_missing_is_added_and_said(small: FloorPlan, tmp_path: Path, number: int) -> None:
    plan = replace(small, walls=tuple(wall for n, wall in enumerate(small.walls) if n != number))
    assert has_way_out(plan)
    path = tmp_path / "plan.json"
    write_plan(path, plan)
    loaded = load_world(str(path))
    assert not has_way_out(loaded)
    (remark,) = loaded.remarks
    assert (remark.action, remark.what, remark.loss) == ("repaired", "walls", False)
    assert "added along the outline" in remark.why
    assert wall_area(loaded).intersection(wall_area(small)).area > 0.9 * wall_area(small).area
    # What is converted stays as it was read.
    assert read_world(str(path)).walls == plan.walls


def test_a_hole_that_the_robot_fits_through_is_closed_and_a_narrower_one_is_not(small: FloorPlan) -> None:
    for width, leaky in ((0.35, True), (0.25, False)):
        ends = (Wall("w0", ((0.0, 0.0), (6.0, 0.0)), 0.3), Wall("w9", ((6.0 + width, 0.0), (12.0, 0.0)), 0.3))
        plan = replace(small, walls=(*ends, *small.walls[1:]))
        assert has_way_out(plan) == leaky
        closed = wall_up_outline(plan)
        assert not has_way_out(closed)
        assert (closed is plan) != leaky


def test_a_wall_that_stops_short_inside_is_no_leak(small: FloorPlan) -> None:
    plan = replace(small, walls=tuple(wall for wall in small.walls if wall.id != "w5"))
    assert not has_way_out(plan)


def test_rooms_drawn_apart_by_their_walls_are_one_outline(small: FloorPlan) -> None:
    """Rooms on their walls' inner faces, as others draw them: the space between them is wall and not outside."""
    rooms = tuple(replace(room, polygon=room.polygon.buffer(-0.1, join_style="mitre")) for room in small.rooms)
    plan = replace(small, rooms=rooms, walls=small.walls[1:])
    closed = wall_up_outline(plan)
    assert not has_way_out(closed)
    added = [wall for wall in closed.walls if wall not in plan.walls]
    assert all(
        shapely.LineString(wall.segment).distance(shapely.box(0.2, 0.2, 11.8, 4.8).boundary) < 0.3 for wall in added
    )


def test_walls_that_are_added_are_as_thick_as_the_others_and_have_names_of_their_own(small: FloorPlan) -> None:
    inner = tuple(replace(wall, id="outline000" if n == 0 else wall.id) for n, wall in enumerate(small.walls[4:]))
    closed = wall_up_outline(replace(small, walls=inner))
    added = closed.walls[len(inner) :]
    assert closed.walls[: len(inner)] == inner
    assert [wall.id for wall in added] == [f"outline{n:03d}" for n in range(1, len(added) + 1)]
    assert {wall.thickness for wall in added} == {0.2}
    # Where inner walls end on the outline they stand already.
    outline = shapely.box(0, 0, 12, 5).boundary
    assert outline.buffer(1e-6).covers(shapely.MultiLineString([wall.segment for wall in added]))
    length = sum(shapely.LineString(wall.segment).length for wall in added)
    assert 33.0 < length < 34.0
    (remark,) = closed.remarks
    assert remark.count == len(added)
    assert remark.why.startswith(f"{length:.1f} m added")
    assert not has_way_out(closed)


def test_a_robot_gets_out_through_what_is_wider_than_itself(small: FloorPlan) -> None:
    ends = (Wall("w0", ((0.0, 0.0), (6.0, 0.0)), 0.3), Wall("w9", ((7.0, 0.0), (12.0, 0.0)), 0.3))
    plan = replace(small, walls=(*ends, *small.walls[1:]))
    assert [has_way_out(plan, radius) for radius in (0.1, 0.45, 0.55, 2.0)] == [True, True, False, False]


def test_what_lies_far_from_the_origin_is_judged_alike(small: FloorPlan) -> None:
    def moved(plan: FloorPlan, dx: float, dy: float) -> FloorPlan:
        def at(points: np.ndarray) -> np.ndarray:
            return np.asarray(points + np.array([dx, dy]))

        return replace(
            plan,
            rooms=tuple(replace(r, polygon=shapely.transform(r.polygon, at)) for r in plan.rooms),
            walls=tuple(replace(w, segment=tuple(map(tuple, at(np.array(w.segment)).tolist()))) for w in plan.walls),
            doors=(),
            openings=(),
            start=None,
        )

    for dx, dy in ((-300.0, 200.0), (40.0, -500.0)):
        assert not has_way_out(moved(small, dx, dy))
        holed = replace(small, walls=small.walls[1:])
        assert has_way_out(moved(holed, dx, dy))
        assert not has_way_out(wall_up_outline(moved(holed, dx, dy)))


def test_doors_and_openings_to_the_outside_are_walled_up_and_named(small: FloorPlan) -> None:
    assert wall_up_entrances(small) is small
    across = ((4.0, 1.0), (4.0, 1.9))
    entrances = PlanDoor("e0", across, (None, "r0"), "r0"), PlanDoor("e1", across, ("r1", None), "r1")
    out = replace(
        small,
        doors=(entrances[0], *small.doors, entrances[1]),
        openings=(Opening("e2", across, ("r2", None)), *small.openings),
        meta={"source": "here"},
    )
    shut = wall_up_entrances(out)
    assert (shut.doors, shut.openings) == (small.doors, small.openings)
    assert shut.meta == {"source": "here", "sealed": ["e0", "e1", "e2"]}
    assert (shut.rooms, shut.walls, shut.start) == (small.rooms, small.walls, small.start)
