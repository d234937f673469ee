"""Floors in the manner of the KTH data, turned by any angle and drawn by a hand that trembles: no wall may be lost."""

import math
from pathlib import Path

import numpy as np
import pytest
import shapely
from hypothesis import example, given, settings
from hypothesis import strategies as st

from closedrooms.core.errors import InvalidInputError
from closedrooms.worlds.formats.kth import read_kth
from closedrooms.worlds.geometry import room_interior, solid_walls, wall_area
from closedrooms.worlds.plan import FloorPlan
from closedrooms.worlds.ways_out import has_way_out

PIXELS, GAP, DOOR = 20.0, 0.16, 0.9
Corner = tuple[float, float]


def floor_xml(angle: float, jitter: float, seed: int, rooms: int = 4) -> str:
    """A corridor and a row of offices, 20 pixels a metre, a wall's thickness apart; each door on both contours."""
    rng = np.random.default_rng(seed)
    c, s = math.cos(angle), math.sin(angle)

    def place(corner: Corner) -> Corner:
        dx, dy = rng.normal(0.0, jitter, 2)
        x, y = corner
        return (c * x - s * y + dx) * PIXELS, -(s * x + c * y + dy) * PIXELS

    def line(a: Corner, b: Corner, kind: str, target: str = "") -> str:
        return (
            f'<linesegment x1="{a[0]:.6f}" y1="{a[1]:.6f}" x2="{b[0]:.6f}" y2="{b[1]:.6f}" type="{kind}" '
            f'target="{target}"/>'
        )

    def space(name: str, kind: str, low: Corner, high: Corner, doors: list[tuple[float, str]]) -> str:
        """A box whose first side has doors: where they begin, and where they lead."""
        (x0, y0), (x1, y1) = low, high
        corners = [place(p) for p in ((x0, y0), (x1, y0), (x1, y1), (x0, y1))]
        at, lines = corners[0], ""
        for x, target in doors:
            a, b = place((x, y0)), place((x + DOOR, y0))
            lines += line(at, a, "Wall") + line(a, b, "Portal", target)
            at = b
        for corner in (*corners[1:], corners[0]):
            lines += line(at, corner, "Wall")
            at = corner
        return f'<space name="{name}" type="{kind}"><contour>{lines}</contour></space>'

    starts = [number * (4.0 + GAP) for number in range(rooms)]
    # The corridor hangs below its first side.
    corridor = space(
        "K", "KORRIDOR", (0.0, 0.0), (starts[-1] + 4.0, -2.2), [(x + 1.5, f"A{n}") for n, x in enumerate(starts)]
    )
    offices = [space(f"A{n}", "KONTOR", (x, GAP), (x + 4.0, GAP + 3.5), [(x + 1.5, "K")]) for n, x in enumerate(starts)]
    return f'<floor><Scale PixelDistance="{PIXELS}" RealDistance="1"/>{corridor}{"".join(offices)}</floor>'


def check_floor(plan: FloorPlan) -> None:
    """Five rooms, four doors, a wall on every edge of every room, and no way out for a robot of 0.15 m."""
    assert len(plan.rooms) == 5
    assert len(plan.doors) == 4
    walls = solid_walls(plan.walls)
    for room in plan.rooms:
        assert room.polygon.boundary.difference(walls.buffer(1e-3)).length < 1e-3, room.id
    assert not has_way_out(plan)
    assert wall_area(plan).is_valid
    assert not [remark for remark in plan.remarks if remark.loss]


@pytest.mark.parametrize("degrees", [0.0, 0.05, 45.0, 89.95, 90.0, 180.0, 270.0])
@pytest.mark.parametrize("jitter", [0.0, 1e-4, 5e-4, 1e-3, 2e-3])
def test_walls_near_the_axes_stay(tmp_path: Path, degrees: float, jitter: float) -> None:
    path = tmp_path / "floor.xml"
    path.write_text(floor_xml(math.radians(degrees), jitter, 7 * int(degrees)))
    check_floor(read_kth(path))


@settings(max_examples=25, deadline=None)
@given(
    degrees=st.one_of(st.sampled_from([0.0, 90.0, 180.0, 270.0]), st.floats(0.0, 360.0)),
    jitter=st.floats(0.0, 0.02),
    seed=st.integers(0, 10_000),
)
@example(degrees=0.015884154249354094, jitter=0.015884154249354094, seed=1317)  # a sliver along the corridor's end
def test_walls_cover_every_edge_of_every_room_at_any_angle(
    tmp_path_factory: pytest.TempPathFactory, degrees: float, jitter: float, seed: int
) -> None:
    path = tmp_path_factory.mktemp("floor") / "floor.xml"
    path.write_text(floor_xml(math.radians(degrees), jitter, seed))
    check_floor(read_kth(path))


@settings(max_examples=8, deadline=None)
@given(degrees=st.floats(0.0, 360.0), jitter=st.floats(0.0, 0.05), seed=st.integers(0, 10_000))
@example(degrees=90.0, jitter=0.05, seed=1)
@example(degrees=0.0, jitter=0.02, seed=0)
def test_doors_stay_where_they_are_drawn_however_the_hand_trembles(
    tmp_path_factory: pytest.TempPathFactory, degrees: float, jitter: float, seed: int
) -> None:
    path = tmp_path_factory.mktemp("floor") / "floor.xml"
    path.write_text(floor_xml(math.radians(degrees), jitter, seed))
    plan = read_kth(path)
    check_floor(plan)
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    for number in range(4):
        x, y = number * (4.0 + GAP) + 1.5 + DOOR / 2, GAP / 2
        drawn = (c * x - s * y, s * x + c * y)
        # The border lies on one side of the wall; corners stray by three standard deviations.
        assert min(math.dist(door.midpoint, drawn) for door in plan.doors) < GAP / 2 + 3 * jitter + 0.02
    assert not [remark for remark in plan.remarks if remark.what == "doors"]


def test_a_wall_that_is_missing_from_a_plan_lets_a_robot_out(tmp_path: Path) -> None:
    from dataclasses import replace

    path = tmp_path / "floor.xml"
    path.write_text(floor_xml(0.3, 0.001, 1))
    plan = read_kth(path)
    longest = max(plan.walls, key=lambda wall: math.dist(*wall.segment))
    assert has_way_out(replace(plan, walls=tuple(wall for wall in plan.walls if wall is not longest)))


def test_a_scale_that_makes_doors_too_narrow_is_said_with_the_one_that_fits(tmp_path: Path) -> None:
    path = tmp_path / "floor.xml"
    # A third of the true size: doors of 0.3 m.
    text = floor_xml(0.0, 0.0, 0).replace('RealDistance="1"', 'RealDistance="0.3333333"')
    path.write_text(text)
    (remark,) = [remark for remark in read_kth(path).remarks if remark.what == "scale"]
    assert "the median door is 0.30 m wide; all lengths times 3 would fit" in remark.why
    path.write_text(text.replace("0.3333333", "0.8"))
    assert not [remark for remark in read_kth(path).remarks if remark.what == "scale"]


def test_rooms_of_an_absurd_size_are_said_too(tmp_path: Path) -> None:
    path = tmp_path / "floor.xml"
    text = floor_xml(0.0, 0.0, 0).replace('RealDistance="1"', 'RealDistance="12"').replace("Portal", "Wall")
    path.write_text(text)
    (remark,) = [remark for remark in read_kth(path).remarks if remark.what == "scale"]
    assert "square metres" in remark.why


def test_what_the_plan_lost_of_the_files_walls_is_measured(tmp_path: Path) -> None:
    from closedrooms.worlds.formats.import_checks import Source, settle

    path = tmp_path / "floor.xml"
    path.write_text(floor_xml(0.0, 0.0, 0))
    plan = read_kth(path)
    lines = shapely.union_all([shapely.LineString([(0.0, 0.0), (16.0, 0.0)]), shapely.LineString([(20, 0), (22.5, 0)])])
    (remark,) = settle(plan, (), Source(walls=lines, within=0.6), path).remarks
    assert remark.loss
    assert "2.50 m are in the file but not in the plan" in remark.why
    (remark,) = settle(plan, (), Source(rooms=7, doors=4), path).remarks
    assert (remark.what, remark.count, remark.loss) == ("rooms", 2, True)
    (remark,) = settle(plan, (), Source(rooms=5, doors=6), path).remarks
    assert (remark.what, remark.count, remark.loss) == ("doors", 2, True)


def test_a_scale_that_leaves_no_room_or_none_on_earth_is_refused_with_the_one_that_fits(tmp_path: Path) -> None:
    path = tmp_path / "floor.xml"
    text = floor_xml(0.0, 0.0, 0)
    path.write_text(text.replace('RealDistance="1"', 'RealDistance="0.05"'))
    with pytest.raises(
        InvalidInputError, match=r"without rooms \(5 with an area below .* all lengths times 24 would fit"
    ):
        read_kth(path)
    path.write_text(text.replace('RealDistance="1"', 'RealDistance="1e6"'))
    with pytest.raises(InvalidInputError, match=r"no usable coordinates.*all lengths times 1e-06 would fit") as caught:
        read_kth(path)
    assert str(caught.value).endswith(f": {path}")


def test_gaps_between_rooms_close_at_any_angle(tmp_path: Path) -> None:
    """The walls between offices are inner ones, not two outer ones with a gap."""
    for degrees in (0.0, 33.0, 71.0):
        path = tmp_path / "floor.xml"
        path.write_text(floor_xml(math.radians(degrees), 0.004, 5))
        plan = read_kth(path)
        offices = [room_interior(plan, room.id) for room in plan.rooms if room.label == "kontor"]
        apart = sorted(a.distance(b) for n, a in enumerate(offices) for b in offices[n + 1 :])[:3]
        assert apart == pytest.approx([0.15] * 3, abs=0.03)


def test_coordinates_that_are_no_numbers_are_the_reason(tmp_path: Path) -> None:
    path = tmp_path / "floor.xml"
    head, mark, rest = floor_xml(0.0, 0.0, 0).partition("/>")
    path.write_text(head + mark + rest.replace(".", ","))
    with pytest.raises(InvalidInputError, match="with their contour lines have no four numbers"):
        read_kth(path)
