"""How leaves hang and how far they move, against geometry drawn apart from theirs."""

import itertools
import math

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely.affinity import rotate
from shapely.geometry import MultiPolygon, Polygon, box

from closedrooms.sim.door_leaves import PLAY, TRIAL, Leaf, Solids, door_leaves
from closedrooms.worlds.plan import DoorKind, FloorPlan, PlanDoor, PlanRoom, Wall

SWING = math.radians(95.0)
NOTHING = MultiPolygon()
ABOVE, BELOW = PlanRoom("above", "office", box(-5, 0, 5, 4)), PlanRoom("below", "corridor", box(-5, -4, 5, 0))


def wall(x0: float = -3.0, x1: float = 4.0, thickness: float = 0.2) -> FloorPlan:
    """A wall along the x axis between a room above it and one below."""
    return FloorPlan("wall", (ABOVE, BELOW), (Wall("w0", ((x0, 0.0), (x1, 0.0)), thickness),), ())


def hang(
    solids: Solids = NOTHING, *, plan: FloorPlan | None = None, width: float = 0.9, swing: float = SWING, **door: object
) -> tuple[Leaf, ...]:
    """The leaves of a door from the origin along the wall, into the upper room unless said otherwise."""
    settings = {"opens_into": "above", **door}
    made = PlanDoor("d", ((0.0, 0.0), (width, 0.0)), ("below", "above"), **settings)  # type: ignore[arg-type]
    return door_leaves(plan or wall(), made, solids, swing)


def polygons(leaves: tuple[Leaf, ...], share: float) -> list[Polygon]:
    return [Polygon(leaf.at(share * leaf.travel)) for leaf in leaves]


@given(
    st.floats(0.0, 2.0),
    st.sampled_from([0, 1]),
    st.sampled_from(["above", "below"]),
    st.sampled_from([0.02, 0.05, 0.3]),
)
def test_a_hinged_leaf_turns_about_the_corner_of_its_jamb_into_its_room(
    angle: float, hinge: int, into: str, thickness: float
) -> None:
    (leaf,) = hang(plan=wall(thickness=thickness), hinge=hinge, opens_into=into)
    half, up = min(0.05, thickness) / 2.0, 1.0 if into == "above" else -1.0
    jamb = 0.9 * hinge
    # Counter-clockwise from the left jamb upwards, clockwise from the right one.
    turned = rotate(
        box(0.0, -half, 0.9, half), up * (1 - 2 * hinge) * angle, origin=(jamb, up * half), use_radians=True
    )
    assert Polygon(leaf.at(angle)).symmetric_difference(turned).area < 1e-9
    assert leaf.travel == SWING
    assert leaf.direction.tolist() == [0.0, up]
    assert not leaf.slides


@pytest.mark.parametrize("backwards", [False, True])
@pytest.mark.parametrize("rooms", [("below", "above"), ("above", "below"), (None, "above"), ("above", None)])
def test_whichever_way_a_door_is_drawn_it_opens_into_its_room(rooms: tuple[str, str], backwards: bool) -> None:
    segment = ((0.9, 0.0), (0.0, 0.0)) if backwards else ((0.0, 0.0), (0.9, 0.0))
    plan = wall()
    for into in rooms:
        door = PlanDoor("d", segment, rooms, opens_into=into)
        (leaf,) = door_leaves(plan, door, NOTHING, SWING)
        assert (Polygon(leaf.at(SWING)).centroid.y > 0.0) == (into == "above")
        # Outside lies away from the one room there is.
        for share in (0.0, 0.5):
            assert abs(Polygon(leaf.at(share)).distance(shapely.Point(segment[0]))) < 0.05


def test_a_door_between_rooms_that_nobody_drew_opens_to_its_left() -> None:
    door = PlanDoor("d", ((0.0, 0.0), (0.9, 0.0)), (None, "gone"), opens_into="gone")
    (leaf,) = door_leaves(wall(), door, NOTHING, SWING)
    assert Polygon(leaf.at(SWING)).centroid.y > 0.0


def test_a_double_door_has_a_leaf_at_each_jamb_that_meet_in_the_middle() -> None:
    for into, up in (("above", 1.0), ("below", -1.0)):
        leaves = hang(kind="double", opens_into=into, width=1.6)
        assert [leaf.travel for leaf in leaves] == [SWING, SWING]
        assert [leaf.pivot.tolist() for leaf in leaves] == [[0.0, up * 0.025], [1.6, up * 0.025]]
        closed = shapely.union_all(polygons(leaves, 0.0))
        assert closed.symmetric_difference(box(0, -0.025, 1.6, 0.025)).area < 1e-9
        left, right = polygons(leaves, 1.0)
        assert left.intersection(right).is_empty
        assert left.centroid.x + right.centroid.x == pytest.approx(1.6)
        assert up * left.centroid.y == pytest.approx(up * right.centroid.y)
        assert up * left.centroid.y > 0.3


@settings(max_examples=30, deadline=None)
@given(st.floats(-1.5, 1.2), st.floats(0.08, 1.0), st.floats(0.05, 1.0), st.floats(0.05, 1.0))
def test_a_leaf_goes_until_it_would_touch(x: float, y: float, width: float, depth: float) -> None:
    block = box(x, y, x + width, y + depth)
    (leaf, _) = hang(block, kind="double", width=1.8)
    # A little smaller than its frame, and turned about the corner of the left jamb.
    eased = shapely.get_coordinates(box(PLAY, -0.025 + PLAY, 0.9 - PLAY, 0.025 - PLAY))[:4] - [0.0, 0.025]
    way = np.arange(0.0, SWING, 2e-3)
    turned = eased @ np.array([(1.0, 1.0j)]).T * np.exp(1j * way)
    met = shapely.intersects(block, shapely.polygons(np.stack((turned.T.real, turned.T.imag + 0.025), axis=-1)))
    if not met.any():
        assert leaf.travel > SWING - 3e-3
        return
    first = way[int(np.argmax(met))]
    assert leaf.travel >= first - 3e-3
    # Between two trials of 2 cm at the leaf's end it may pass a corner, no more.
    if met[way >= first][: math.ceil(TRIAL / 0.9 / 2e-3) + 1].all():
        assert leaf.travel <= first


def test_where_a_leaf_stops_is_found_to_a_thousandth() -> None:
    # A wall across its way, 0.5 m above: the leaf's end meets it at sin(angle) of about 0.5 / 0.9.
    (leaf, _) = hang(box(-3, 0.5, 3, 1.0), kind="double", width=1.8)
    tip, low = 0.9 - PLAY, -PLAY
    # Upper corner of the eased leaf, from the pivot: (tip, low).
    angle = math.asin((0.5 - 0.025) / math.hypot(tip, low)) - math.atan2(low, tip)
    assert leaf.travel == pytest.approx(angle, abs=2e-4)
    assert leaf.travel <= angle


def test_a_leaf_that_is_blocked_from_the_start_stays() -> None:
    leaves = hang(box(-1, -1, 2, 1), kind="double")
    assert [leaf.travel for leaf in leaves] == [0.0, 0.0]


def test_a_door_that_would_bar_its_passage_hangs_on_the_other_jamb_or_opens_to_the_other_side() -> None:
    def across(pillar: Polygon) -> Polygon:
        """The pillar on the other side of the wall, for the leaf on the other jamb."""
        return rotate(pillar, 180, origin=(0.45, 0.0))

    def hung(*pillars: Polygon, hinge: int = 0) -> tuple[float, float]:
        (leaf,) = hang(shapely.union_all(pillars), hinge=hinge)
        return (float(leaf.pivot[0]), float(np.sign(leaf.direction[1])))

    # In the way of a leaf that hangs on the left jamb at some 30 degrees, and of one on the right jamb.
    left, right = box(0.7, 0.4, 0.75, 0.45), box(0.15, 0.4, 0.2, 0.45)
    assert hung() == (0.0, 1.0)
    assert hung(hinge=1) == (0.9, 1.0)
    assert hung(left) == (0.9, 1.0)
    assert hung(right) == (0.0, 1.0)
    assert hung(right, hinge=1) == (0.0, 1.0)
    assert hung(left, right) == (0.0, -1.0)
    assert hung(left, right, hinge=1) == (0.9, -1.0)
    assert hung(left, right, across(right)) == (0.9, -1.0)
    assert hung(left, right, across(left)) == (0.0, -1.0)
    # Where all are barred, the leaf that opens furthest: what stands nearer to the wall stops it earlier.
    near_left, near_right = box(0.75, 0.2, 0.8, 0.25), box(0.1, 0.2, 0.15, 0.25)
    assert hung(left, near_right, across(near_left), across(near_right)) == (0.0, 1.0)
    assert hung(near_left, right, across(near_left), across(near_right)) == (0.9, 1.0)
    assert hung(near_left, near_right, across(left), across(near_right)) == (0.9, -1.0)
    assert hung(near_left, near_right, across(near_left), across(right)) == (0.0, -1.0)


def test_a_door_that_is_to_open_little_need_not_open_far() -> None:
    # 50 degrees are all that is asked for, and all that there is room for.
    pillar = box(0.5, 0.75, 0.6, 0.85)
    swing = math.radians(50.0)
    (leaf,) = hang(pillar, swing=swing)
    assert leaf.pivot[0] == 0.0
    assert leaf.travel == swing


@settings(max_examples=40, deadline=None)
@given(
    st.sampled_from(["hinged", "double", "sliding"]),
    st.floats(0.5, 3.0),
    st.floats(0.0, 1.0),
    st.sampled_from([-0.5, -3.0]),
)
def test_a_leaf_never_leaves_its_box_and_moves_without_changing(
    kind: DoorKind, width: float, share: float, x0: float
) -> None:
    for leaf in hang(kind=kind, width=width, plan=wall(x0, 3.5)):
        places = leaf.at(np.linspace(0.0, share, 6).reshape(2, 3) * leaf.travel)
        assert places.shape == (2, 3, 4, 2)
        low, high = leaf.reach.min(axis=0), leaf.reach.max(axis=0)
        assert (places >= low - 1e-9).all()
        assert (places <= high + 1e-9).all()
        sides = np.linalg.norm(np.diff(places, axis=2), axis=3)
        assert np.allclose(sides, np.linalg.norm(np.diff(leaf.corners, axis=0), axis=1))
        assert np.allclose(places[0, 0], leaf.corners)
        assert np.allclose(places[1, 2], leaf.at(share * leaf.travel))
        # No wider than a turn needs, and no longer than the slide.
        length = float(np.linalg.norm(leaf.corners - leaf.pivot, axis=1).max())
        most = max(2.0 * length, np.ptp(leaf.corners, axis=0).max() + leaf.travel if leaf.slides else 0.0)
        assert (high - low).max() <= most + 1e-9


def test_a_sliding_leaf_goes_to_its_hinge_where_there_is_wall_enough() -> None:
    for hinge, way in ((0, -1.0), (1, 1.0)):
        (leaf,) = hang(kind="sliding", hinge=hinge)
        assert leaf.slides
        assert leaf.travel == pytest.approx(0.9)
        moved = Polygon(leaf.at(leaf.travel))
        assert moved.symmetric_difference(box(way * 0.9, -0.025, way * 0.9 + 0.9, 0.025)).area < 1e-9


def test_a_sliding_leaf_goes_to_the_side_with_more_wall() -> None:
    for hinge in (0, 1):
        (leaf,) = hang(kind="sliding", hinge=hinge, plan=wall(-0.4, 4.0))
        assert leaf.direction[0] == pytest.approx(1.0)
        assert leaf.travel == pytest.approx(0.9)


@pytest.mark.parametrize(
    ("width", "x0", "x1", "count", "clear"),
    [
        (0.9, -0.5, 0.9 + 0.2, 2, 0.9),  # two that telescope into half a metre
        (2.0, -0.7, 2.7, 4, 2.0),  # two to each side, each of them half a metre
        (2.0, -1.0, 2.1, 2, 2.0),  # two to the left
        (2.0, -0.3, 2.0, 4, 1.8),  # four to the left, as far as there is wall
        (0.9, 0.0, 0.9, 4, 0.675),  # no wall at all: four behind one another
        (1.0, -0.6, 1.6, 2, 1.0),  # one to each side
    ],
)
def test_a_wide_sliding_door_has_as_many_panels_as_open_it_furthest(
    width: float, x0: float, x1: float, count: int, clear: float
) -> None:
    leaves = hang(kind="sliding", width=width, plan=wall(x0, x1))
    assert len(leaves) == count
    gap = box(0, -0.1, width, 0.1)
    closed, opened = (shapely.union_all(polygons(leaves, share)) for share in (0.0, 1.0))
    assert closed.symmetric_difference(box(0, -0.025, width, 0.025)).area < 1e-9
    free = width - opened.intersection(gap).area / 0.05
    # Pockets are felt out by steps.
    assert free == pytest.approx(clear, abs=0.09)
    assert box(x0, -0.1, x1, 0.1).buffer(1e-3).covers(opened)
    # Panels go on behind each other: none leaves a slit to the next on the way.
    for share in np.linspace(0.0, 1.0, 7).tolist():
        panels = shapely.union_all([panel.buffer(1e-6) for panel in polygons(leaves, share)])
        assert len(shapely.get_parts(panels)) <= 2


@settings(max_examples=30, deadline=None)
@given(st.floats(0.05, 2.0), st.sampled_from([0.05, 0.16, 0.3]))
def test_a_pocket_is_as_deep_as_the_wall_to_a_step(beside: float, thickness: float) -> None:
    # There is no wall to the right.
    leaves = hang(kind="sliding", width=0.9, plan=wall(-beside, 0.9, thickness))
    moved = [leaf.travel for leaf in leaves]
    first = min(moved)
    panel = 0.9 / len(leaves)
    assert first <= min(beside, panel) + 2e-3
    assert first >= min(beside, panel) - TRIAL - 1e-3
    assert sorted(moved) == pytest.approx([first + panel * k for k in range(len(leaves))])


def test_all_positions_of_a_sliding_door_together_are_the_gap_and_the_pocket() -> None:
    leaves = hang(kind="sliding", width=0.9)
    swept = shapely.union_all([p for share in np.linspace(0, 1, 30) for p in polygons(leaves, float(share))])
    assert swept.symmetric_difference(box(-0.9, -0.025, 0.9, 0.025)).area < 1e-6
    assert all(a.travel <= b.travel for a, b in itertools.pairwise(leaves))
