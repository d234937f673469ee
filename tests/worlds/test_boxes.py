"""Walls and leaves as boxes, against the areas that everything else is built from."""

import math
from dataclasses import replace

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from shapely.affinity import rotate
from shapely.geometry import Polygon, box

from closedrooms.worlds.boxes import IN_WALL, SHORTEST, Box, box_leaves, open_leaf, wall_boxes
from closedrooms.worlds.geometry import door_leaf, wall_area
from closedrooms.worlds.plan import DoorKind, FloorPlan, Opening, PlanDoor, PlanRoom, Wall

ROOM = PlanRoom("r0", "hall", box(0, 0, 4, 3))


def outline(b: Box) -> Polygon:
    flat = box(-b.length / 2, -b.thickness / 2, b.length / 2, b.thickness / 2)
    return shapely.transform(
        rotate(flat, b.angle, origin=(0, 0), use_radians=True), lambda points: points + np.array([b.x, b.y])
    )


def area(plan: FloorPlan) -> shapely.Geometry:
    return shapely.union_all([outline(b) for b in wall_boxes(plan)])


def walls(*segments: tuple[tuple[float, float], tuple[float, float]], thickness: float = 0.2) -> FloorPlan:
    return FloorPlan("w", (ROOM,), tuple(Wall(f"w{i}", s, thickness) for i, s in enumerate(segments)), ())


def test_boxes_of_a_plan_at_right_angles_are_its_walls(small: FloorPlan) -> None:
    # Outer walls of 0.3 m, inner ones of 0.2 m, with doors and an opening.
    assert area(small).symmetric_difference(wall_area(small)).area < 1e-6
    turned = replace(
        small,
        rooms=tuple(replace(r, polygon=rotate(r.polygon, 40, origin=(0, 0))) for r in small.rooms),
        walls=tuple(replace(w, segment=turn(w.segment, 40)) for w in small.walls),
        doors=tuple(replace(d, segment=turn(d.segment, 40)) for d in small.doors),
        openings=tuple(replace(o, segment=turn(o.segment, 40)) for o in small.openings),
    )
    assert area(turned).symmetric_difference(wall_area(turned)).area < 1e-4


def turn(segment: tuple[tuple[float, float], ...], degrees: float) -> tuple[tuple[float, float], ...]:
    return tuple(rotate(shapely.LineString(segment), degrees, origin=(0, 0)).coords)


def test_a_free_end_stays_where_it_is_and_a_corner_reaches_the_other_walls_face() -> None:
    (alone,) = wall_boxes(walls(((0.0, 0.0), (4.0, 0.0))))
    assert (alone.x, alone.y, alone.angle, alone.length, alone.thickness) == (2.0, 0.0, 0.0, 4.0, 0.2)
    ends = walls(((0.0, 0.0), (4.0, 0.0)), ((4.0, 0.0), (4.0, 3.0)))
    thick = replace(ends, walls=(ends.walls[0], replace(ends.walls[1], thickness=0.4)))
    along, across = wall_boxes(thick)
    # Both by half of the thinner one.
    assert (along.length, along.x) == (pytest.approx(4.1), pytest.approx(2.05))
    assert (across.length, across.y, across.angle) == (pytest.approx(3.1), pytest.approx(1.45), math.pi / 2)
    # Ends that are a millimetre apart at most are one corner.
    for off, length in ((0.0004, 4.1), (0.01, 4.0)):
        near = walls(((0.0, 0.0), (4.0, 0.0)), ((4.0, off), (4.0, 3.0)))
        assert wall_boxes(near)[0].length == pytest.approx(length)


@given(st.lists(st.tuples(st.floats(-1.0, 5.0), st.floats(0.3, 2.0), st.booleans()), max_size=5), st.floats(-180, 180))
def test_what_passages_leave_of_a_wall_is_boxed(gaps: list[tuple[float, float, bool]], degrees: float) -> None:
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))

    def at(x: float, y: float = 0.0) -> tuple[float, float]:
        return (c * x - s * y, s * x + c * y)

    openings = tuple(
        Opening(f"o{i}", (at(low + width), at(low)) if back else (at(low), at(low + width)), ("r0", None))
        for i, (low, width, back) in enumerate(gaps)
    )
    beside = Opening("beside", (at(1.0, IN_WALL + 0.001), at(2.0, IN_WALL + 0.001)), ("r0", None))
    crossing = Opening("crossing", (at(3.0, -0.5), at(3.0, 0.5)), ("r0", None))
    plan = replace(walls((at(0.0), at(4.0))), openings=(*openings, beside, crossing))
    left = shapely.LineString([(0, 0), (4, 0)])
    for low, width, _ in gaps:
        left = left.difference(shapely.LineString([(low, 0), (low + width, 0)]))
    pieces = [line for line in shapely.get_parts(left) if isinstance(line, shapely.LineString) and line.length > 1e-6]
    found = wall_boxes(plan)
    sure = [line for line in pieces if abs(line.length - SHORTEST) > 1e-6]
    lengths = sorted(line.length for line in sure if line.length > SHORTEST)
    assert sorted(b.length for b in found if abs(b.length - SHORTEST) > 1e-6) == pytest.approx(lengths)
    boxed = shapely.union_all([rotate(outline(b), -degrees, origin=(0, 0)) for b in found])
    assert boxed.intersection(shapely.LineString([(0, 0), (4, 0)])).length == pytest.approx(sum(lengths), abs=0.01)
    assert all(boxed.buffer(1e-6).covers(line) for line in sure if line.length > SHORTEST)


ABOVE, BELOW = PlanRoom("above", "office", box(-5, 0, 5, 4)), PlanRoom("below", "corridor", box(-5, -4, 5, 0))
WALL = FloorPlan("wall", (ABOVE, BELOW), (Wall("w0", ((-3.0, 0.0), (4.0, 0.0)), 0.2),), ())


@pytest.mark.parametrize("kind", ["hinged", "double"])
@pytest.mark.parametrize("hinge", [0, 1])
@pytest.mark.parametrize("backwards", [False, True])
@pytest.mark.parametrize(
    ("rooms", "into", "up"),
    [
        (("below", "above"), "above", 1.0), (("above", "below"), "below", -1.0), (("above", None), "above", 1.0),
        ((None, "below"), "below", -1.0), (("above", None), None, -1.0), ((None, "below"), None, 1.0),
    ],
)  # fmt: skip
def test_leaves_fill_the_door_and_swing_into_its_room(
    kind: DoorKind, hinge: int, backwards: bool, rooms: tuple[str, str], into: str | None, up: float
) -> None:
    ends = ((0.9, 0.0), (0.0, 0.0)) if backwards else ((0.0, 0.0), (0.9, 0.0))
    door = PlanDoor("d", ends, rooms, kind, hinge, into)  # type: ignore[arg-type]
    plan = replace(WALL, doors=(door,))
    leaves = box_leaves(plan, door)
    closed = [outline(leaf.box) for leaf in leaves]
    assert shapely.union_all(closed).symmetric_difference(door_leaf(plan, door)).area < 1e-9
    if kind == "double":
        assert [leaf.hinge for leaf in leaves] == [ends[0], ends[1]]
    else:
        assert [leaf.hinge for leaf in leaves] == [ends[hinge]]
    for leaf, shut in zip(leaves, closed, strict=True):
        assert leaf.hinge is not None
        for angle in (0.3, math.pi / 2, 1.8):
            opened = outline(open_leaf(leaf, angle))
            turned = rotate(shut, leaf.turn * angle, origin=leaf.hinge, use_radians=True)
            assert opened.symmetric_difference(turned).area < 1e-9
            assert up * opened.centroid.y > 0.0
        assert outline(open_leaf(leaf)).equals_exact(outline(open_leaf(leaf, math.pi / 2)), 1e-12)


def test_a_leaf_slides_aside_by_its_own_length_along_its_wall() -> None:
    for end in ((0.9, 0.0), (0.54, 0.72), (-0.9, 0.0)):
        door = PlanDoor("d", ((0.0, 0.0), end), ("below", "above"), "sliding", opens_into="above")
        (leaf,) = box_leaves(WALL, door)
        assert leaf.hinge is None
        moved, shut = outline(open_leaf(leaf)), outline(leaf.box)
        step = np.array([moved.centroid.x - shut.centroid.x, moved.centroid.y - shut.centroid.y])
        assert step == pytest.approx(np.array(end))
        assert moved.area == pytest.approx(shut.area)


def test_a_leaf_is_as_thick_as_a_leaf_or_as_its_wall_where_that_is_thinner() -> None:
    door = PlanDoor("d", ((0.0, 0.0), (0.9, 0.0)), ("below", "above"), opens_into="above")
    for thickness, leaf in ((0.2, 0.05), (0.03, 0.03)):
        plan = replace(WALL, walls=(replace(WALL.walls[0], thickness=thickness),))
        assert box_leaves(plan, door)[0].box.thickness == leaf
    assert box_leaves(replace(WALL, walls=()), door)[0].box.thickness == 0.05
