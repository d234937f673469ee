import numpy as np
import pytest
import shapely
from hypothesis import example, given, settings
from hypothesis import strategies as st
from shapely.geometry import box

from closedrooms.core.errors import InvalidInputError
from closedrooms.core.pose import Pose2
from closedrooms.worlds.closing import closable_rooms
from closedrooms.worlds.formats.native import plan_text
from closedrooms.worlds.generation.bundled import MOST_CLOSED, RECIPES, bundled_plan
from closedrooms.worlds.generation.corridors import SHAPES, Run, Skeleton
from closedrooms.worlds.generation.generator import GENERATOR_VERSION, KINDS, SIZES, VERSIONS, generate
from closedrooms.worlds.generation.sketch import sketch_rooms
from closedrooms.worlds.geometry import room_interior, wall_area
from closedrooms.worlds.library import DEFAULT_WORLD, PLANS, bundled_names, load_world
from closedrooms.worlds.plan import FloorPlan
from closedrooms.worlds.truth import true_rooms

TABLE_1 = [7, 9, 10, 11, 11, 12, 12, *[13] * 4, *[15] * 9]


def check_building(plan: FloorPlan) -> None:
    assert {wall.thickness for wall in plan.walls} <= {0.1, 0.12, 0.15, 0.2, 0.24, 0.25, 0.3}
    assert all(0.8 - 1e-3 <= door.width <= 1.0 + 1e-3 for door in plan.doors)
    assert all(door.opens_into in door.rooms and None not in door.rooms for door in plan.doors)
    inside = shapely.union_all([room.polygon for room in plan.rooms])
    assert sum(room.polygon.area for room in plan.rooms) == pytest.approx(inside.area, rel=1e-4)
    assert inside.geom_type == "Polygon"
    closable = closable_rooms(plan)
    assert closable
    doors = [door for room in closable.values() for door in room]
    assert len(true_rooms(plan, doors, Pose2())) == len(closable)
    reached = {room for passage in plan.passages for room in passage.rooms}
    assert reached == {room.id for room in plan.rooms}


@settings(max_examples=20, deadline=None)
@example("office", 334913832, "small")  # drawn first with two rooms that open into each other
@given(st.sampled_from(KINDS), st.integers(0, 2**32 - 1), st.sampled_from(["small", None]))
def test_every_seed_gives_a_sound_building(kind: str, seed: int, size: str | None) -> None:
    check_building(generate(kind, seed, size=size))


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("kind", KINDS)
def test_every_shape_can_be_asked_for(kind: str, shape: str) -> None:
    plan = generate(kind, 5, shape=shape, size="small", angle=20.0)
    check_building(plan)
    assert (plan.meta["shape"], plan.meta["angle"]) == (shape, 20.0)


def test_the_same_seed_gives_the_same_bytes_and_another_one_another_building() -> None:
    assert plan_text(generate("office", 3)) == plan_text(generate("office", 3))
    assert plan_text(generate("office", 3)) != plan_text(generate("office", 4, name="office-3"))


def test_an_angle_turns_the_building_as_a_whole() -> None:
    straight, turned = generate("office", 3, angle=0.0), generate("office", 3, angle=30.0)
    assert wall_area(turned).area == pytest.approx(wall_area(straight).area, rel=1e-4)
    assert len(turned.rooms) == len(straight.rooms)


def test_furniture_leaves_every_door_free_and_is_no_part_of_the_walls() -> None:
    plan, bare = generate("school", 2, size="small", furniture=True), generate("school", 2, size="small")
    assert plan.furniture
    assert plan.walls == bare.walls
    walls = wall_area(plan)
    for thing in plan.furniture:
        assert not walls.intersects(thing.polygon)
        for passage in plan.passages:
            assert thing.polygon.distance(shapely.LineString(passage.segment)) > 0.5
    for room in plan.rooms:
        things = shapely.union_all([t.polygon for t in plan.furniture]).buffer(0.2)
        free = shapely.difference(room_interior(plan, room.id).buffer(-0.2), things)
        largest = max(shapely.get_parts(free), key=lambda part: part.area)
        for passage in plan.passages:
            if room.id in passage.rooms:
                assert largest.distance(shapely.LineString(passage.segment)) < 0.5, (room.id, passage.id)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"kind": "castle"}, "unknown kind 'castle'; expected one of office, school"),
        ({"shape": "X"}, "unknown shape 'X'; expected one of bar, L, U, T, ring, slant"),
        ({"size": "huge"}, "unknown size 'huge'"),
        ({"version": 99}, "unknown generator version 99"),
        ({"seed": -1}, "seed -1"),
    ],
)
def test_wrong_requests_are_clear_errors(change: dict[str, object], message: str) -> None:
    request: dict[str, object] = {"kind": "office", "seed": 0} | change
    with pytest.raises(InvalidInputError, match=message):
        generate(**request)  # type: ignore[arg-type]


def test_the_latest_version_is_among_those_kept() -> None:
    assert GENERATOR_VERSION in VERSIONS
    assert SIZES == ("small", "medium", "large")


@pytest.mark.parametrize("name", RECIPES)
def test_the_generator_reproduces_the_bundled_worlds_byte_for_byte(name: str) -> None:
    assert plan_text(bundled_plan(name)) == (PLANS / f"{name}.json").read_text()


def test_the_bundled_worlds_follow_table_1_of_the_paper() -> None:
    names = bundled_names()
    assert names == sorted(RECIPES)
    counts = {name: min(len(closable_rooms(load_world(name))), MOST_CLOSED) for name in names}
    assert counts == {name: recipe.closed for name, recipe in RECIPES.items()}
    assert sorted(counts.values()) == TABLE_1


def test_the_bundled_worlds_hold_every_shape_and_some_are_turned() -> None:
    assert {recipe.shape for recipe in RECIPES.values()} == set(SHAPES)
    assert sum(recipe.angle != 0.0 for recipe in RECIPES.values()) >= 4


def test_the_default_world_measures_about_40_by_30_metres() -> None:
    plan = load_world(DEFAULT_WORLD)
    x0, y0, x1, y1 = wall_area(plan).bounds
    assert np.hypot(x1 - x0 - 40.0, y1 - y0 - 30.0) < 3.0
    assert len(closable_rooms(plan)) >= 5


@pytest.mark.parametrize(("length", "rooms"), [(1.9, False), (2.1, True), (12.0, True)])
def test_along_less_than_two_metres_of_a_corridor_there_are_no_rooms(length: float, rooms: bool) -> None:
    runs = (Run((0.0, 0.0), 0.0, 1, length, 5.0, deepest=6.0),)
    skeleton = Skeleton(box(0.0, -2.0, length, 0.0), runs, (), 2.0)
    for seed in range(5):
        sketch = sketch_rooms(np.random.default_rng(seed), "office", skeleton)
        assert (len(sketch.labels) > 1) == rooms
