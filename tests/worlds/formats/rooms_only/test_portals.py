"""Portals between rooms: both lists of one passage become one, and each finds its place in the wall."""

import itertools
import math

import pytest
from shapely.geometry import Polygon, box

from closedrooms.core.remarks import Remark
from closedrooms.worlds.formats.rooms_only.portals import DeepDoor, Portal, pair_portals, plan_of_portals
from closedrooms.worlds.plan import FloorPlan, PlanRoom


def rooms_of(*rooms: tuple[str, Polygon]) -> tuple[PlanRoom, ...]:
    return tuple(PlanRoom(f"r{number:02d}", label, polygon) for number, (label, polygon) in enumerate(rooms))


def two_rooms(length: float = 10.0, first: str = "office", second: str = "office") -> tuple[PlanRoom, ...]:
    """Two rooms that share the wall from (0, 4) to (length, 4)."""
    return rooms_of((first, box(0.0, 0.0, length, 4.0)), (second, box(0.0, 4.0, length, 8.0)))


def door_at(x: float, y: float = 4.0, width: float | None = None, *, has_door: bool = True) -> Portal:
    return Portal((x, y), (0, 1), has_door, width)


def stretch(plan: FloorPlan, number: int = 0) -> tuple[float, float]:
    """From where to where a passage stands in the wall at y = 4."""
    (x0, y0), (x1, y1) = plan.passages[number].segment
    assert y0 == y1 == 4.0
    return (min(x0, x1), max(x0, x1))


@pytest.mark.parametrize(("apart", "within", "count"), [(1.99, 2.0, 1), (2.0, 2.0, 2), (0.5, 0.6, 1), (0.6, 0.6, 2)])
def test_what_both_rooms_list_is_one_portal_up_to_a_distance(apart: float, within: float, count: int) -> None:
    listed = [(0, Portal((0.0, 1.0), (0, 1), True, 0.8, "a")), (1, Portal((apart, 1.0), (0, 1), True, 1.2, "b"))]
    pairs = pair_portals(listed, within=within)
    assert len(pairs) == count
    if count == 1:
        assert pairs[0] == Portal((apart / 2, 1.0), (0, 1), True, 0.8, "a")


def test_portals_are_paired_within_2_metres_where_nothing_else_is_said() -> None:
    for apart, count in ((1.9, 1), (2.1, 2)):
        assert len(pair_portals([(0, door_at(0.0)), (1, door_at(apart))])) == count


@pytest.mark.parametrize(("first", "second"), [(True, True), (True, False), (False, True), (False, False)])
def test_a_pair_has_a_door_when_both_rooms_say_so(first: bool, second: bool) -> None:
    (pair,) = pair_portals([(0, door_at(1.0, 4.0, has_door=first)), (1, door_at(1.0, 4.4, has_door=second))])
    assert pair.point == pytest.approx((1.0, 4.2))
    assert pair.has_door == (first and second)


def test_portals_without_a_partner_stay_and_those_after_them_are_paired() -> None:
    listed = [(0, door_at(0.0)), (0, door_at(5.0)), (0, door_at(9.0)), (1, door_at(5.5)), (1, door_at(20.0))]
    assert [portal.point[0] for portal in pair_portals(listed)] == [0.0, 5.25, 9.0, 20.0]
    assert [portal.point[0] for portal in pair_portals(listed[:3])] == [0.0, 5.0, 9.0]


def test_each_portal_is_paired_once_with_the_nearest_and_rooms_are_in_order() -> None:
    listed = [
        (2, Portal((9.0, 9.0), (1, 2), True)),
        (0, Portal((0.0, 0.0), (0, 1), True)),
        (0, Portal((1.5, 0.0), (0, 1), True)),
        (1, Portal((1.9, 0.0), (0, 1), True)),
        (1, Portal((0.2, 0.0), (0, 1), True)),
        (1, Portal((7.0, 0.0), (0, 1), True)),
    ]
    points = [portal.point for portal in pair_portals(listed)]
    assert points == [pytest.approx(point) for point in ((0.1, 0.0), (1.7, 0.0), (7.0, 0.0), (9.0, 9.0))]


@pytest.mark.parametrize(
    ("labels", "has_door", "width", "made"),
    [
        (("office", "office"), True, None, 0.9),
        (("corridor", "corridor"), True, None, 0.9),
        (("office", "office"), True, 1.2, 1.2),
        (("office", "office"), False, None, 1.5),
        (("corridor", "office"), False, None, 1.5),
        (("corridor", "hallway"), False, None, 5.0),
        (("corridor", "hallway"), False, 2.0, 2.0),
    ],
)
def test_a_passage_is_as_wide_as_its_file_says_or_as_usual(
    labels: tuple[str, str], has_door: bool, width: float | None, made: float
) -> None:
    remarks: list[Remark] = []
    plan = plan_of_portals(two_rooms(10.0, *labels), [door_at(5.0, width=width, has_door=has_door)], remarks)
    assert stretch(plan) == pytest.approx((5.0 - made / 2, 5.0 + made / 2))
    assert (len(plan.doors), len(plan.openings)) == ((1, 0) if has_door else (0, 1))
    assert plan.passages[0].id == ("d00" if has_door else "o00")
    assert plan.passages[0].rooms == ("r00", "r01")
    assert not remarks


@pytest.mark.parametrize(("width", "kind"), [(0.9, "hinged"), (1.29, "hinged"), (1.31, "double"), (2.0, "double")])
def test_wide_doors_have_two_leaves(width: float, kind: str) -> None:
    plan = plan_of_portals(two_rooms(), [door_at(5.0, width=width)], [])
    assert plan.doors[0].kind == kind
    deep = DeepDoor(((5.0, 4.0), (5.0 + width, 4.0)), (0, 1), 0.5, 0.2)
    assert plan_of_portals(two_rooms(), [], [], deep_doors=[deep]).doors[0].kind == kind
    widest = DeepDoor(((0.0, 4.0), (1.3, 4.0)), (0, 1), 0.5, 0.2)
    assert plan_of_portals(two_rooms(), [], [], deep_doors=[widest]).doors[0].kind == "hinged"


@pytest.mark.parametrize(
    ("at", "low"), [(-3.0, 0.12), (0.0, 0.12), (0.57, 0.12), (3.0, 2.55), (9.8, 8.98), (14.0, 8.98)]
)
def test_a_door_keeps_its_margin_from_the_corners(at: float, low: float) -> None:
    plan = plan_of_portals(two_rooms(), [door_at(at)], [])
    assert stretch(plan) == pytest.approx((low, low + 0.9))


@pytest.mark.parametrize(
    ("length", "width", "why"),
    [
        (1.2, 0.9, None),
        (1.14, 0.9, None),
        (1.1, 0.86, "made narrower to fit their wall"),
        (0.95, 0.71, "made narrower to fit their wall"),
        # From here on with less wall beside it.
        (0.93, 0.77, "made narrower to fit their wall"),
        (0.77, 0.61, "made narrower to fit their wall"),
        (0.75, None, "their rooms share no wall long enough"),
    ],
)
def test_a_door_in_a_short_wall_is_narrower_or_left_out(length: float, width: float | None, why: str | None) -> None:
    remarks: list[Remark] = []
    plan = plan_of_portals(two_rooms(length), [door_at(length / 2)], remarks)
    if width is None:
        assert not plan.passages
    else:
        assert stretch(plan) == pytest.approx((length / 2 - width / 2, length / 2 + width / 2))
    assert [remark.why for remark in remarks] == ([] if why is None else [why])
    assert [(remark.names, remark.loss) for remark in remarks] == [(("r00-r01",), width is None)] * len(remarks)


@pytest.mark.parametrize(("away", "told"), [(0.0, False), (0.99, False), (1.01, True), (3.0, True)])
def test_a_door_that_is_moved_by_more_than_a_metre_is_told(away: float, told: bool) -> None:
    remarks: list[Remark] = []
    named = Portal((5.0, 4.0 + away), (0, 1), True, name="portal 7")
    plan = plan_of_portals(two_rooms(), [named], remarks)
    assert stretch(plan) == pytest.approx((4.55, 5.45))
    assert [(r.action, r.what, r.names, r.loss) for r in remarks] == [
        ("repaired", "doors", ("portal 7",), False)
    ] * told
    assert all(remark.why == "moved by more than 1 m to the wall between their rooms" for remark in remarks)


def test_doors_at_one_place_stand_side_by_side_and_are_numbered_in_order() -> None:
    portals = [door_at(5.0), door_at(5.1), door_at(5.0, has_door=False)]
    plan = plan_of_portals(two_rooms(), portals, [])
    assert [passage.id for passage in plan.passages] == ["d00", "d01", "o00"]
    places = sorted(stretch(plan, number) for number in range(3))
    assert [high - low for low, high in places] == pytest.approx([1.5, 0.9, 0.9])
    for (_, high), (low, _) in itertools.pairwise(places):
        assert low - high == pytest.approx(0.12)
    assert stretch(plan, 0) == pytest.approx((4.55, 5.45))
    assert stretch(plan, 1) == pytest.approx((5.57, 6.47))


@pytest.mark.parametrize(("ends", "low"), [(1.85, 1.97), (2.1, 0.12)])
def test_a_place_of_full_width_is_preferred_to_one_nearer_by_2_metres(ends: float, low: float) -> None:
    # The second room meets the first on both sides of a third one: 1 m, and all of the wall beyond ``ends``.
    third = box(1.0, 4.0, ends, 6.0)
    second = Polygon([(0, 4), (1, 4), (1, 6), (ends, 6), (ends, 4), (10, 4), (10, 8), (0, 8)])
    first = Polygon([(0, 0), (10, 0), (10, 4), (ends, 4), (1, 4), (0, 4)])
    rooms = rooms_of(("office", first), ("office", second), ("store", third))
    remarks: list[Remark] = []
    plan = plan_of_portals(rooms, [door_at(0.5)], remarks)
    assert stretch(plan)[0] == pytest.approx(low)
    assert math.dist(*plan.doors[0].segment) == pytest.approx(0.9 if low > 1.0 else 0.76)
    assert remarks[0].why.startswith("moved" if low > 1.0 else "made narrower")


def test_walls_have_the_thickness_of_their_side() -> None:
    plan = plan_of_portals(two_rooms(), [], [])
    assert {wall.thickness for wall in plan.walls if {y for _, y in wall.segment} == {4.0}} == {0.15}
    assert {wall.thickness for wall in plan.walls if {y for _, y in wall.segment} != {4.0}} == {0.3}
    plan = plan_of_portals(two_rooms(), [], [], outer=0.5, inner=0.25)
    assert {wall.thickness for wall in plan.walls} == {0.5, 0.25}


def test_a_deep_door_brings_its_own_piece_of_wall() -> None:
    rooms = rooms_of(("office", box(0.0, 0.0, 10.0, 4.0)), ("office", box(0.0, 4.5, 10.0, 8.0)))
    shared = plan_of_portals(rooms, [], [])
    deep = DeepDoor(((4.0, 4.25), (5.0, 4.25)), (0, 1), 0.7, 0.2)
    plan = plan_of_portals(rooms, [], [], deep_doors=[deep])
    assert plan.walls[:-1] == shared.walls
    assert plan.walls[-1].id == f"w{len(shared.walls):03d}"
    assert plan.walls[-1].thickness == 0.7
    (x0, y0), (x1, y1) = plan.walls[-1].segment
    assert (x0, y0, x1, y1) == pytest.approx((3.8, 4.25, 5.2, 4.25))
    (door,) = plan.doors
    assert (door.id, door.segment, door.rooms) == ("d00", deep.segment, ("r00", "r01"))
