"""Luperto floors: scale, outlines and what portals say, on floors of two rooms."""

import itertools
from pathlib import Path

import pytest

from closedrooms.core.errors import InvalidInputError
from closedrooms.worlds.formats import luperto
from closedrooms.worlds.formats.luperto import read_luperto
from closedrooms.worlds.library import load_world
from closedrooms.worlds.plan import FloorPlan


def scale(pixels: object = 10, real: object = 100, unit: str | None = "cm") -> str:
    um = "" if unit is None else f"<um>{unit}</um>"
    return (
        f"<scale><represented_distance><value>{pixels}</value></represented_distance>"
        f"<real_distance><value>{real}</value>{um}</real_distance></scale>"
    )


def point(x: object, y: object) -> str:
    return f'<point x="{x}" y="{y}"/>'


def segment(name: str, *points: str) -> str:
    return f'<linesegment id="{name}">{"".join(points)}</linesegment>'


def portal(line: str, *targets: str, kind: str = "EXPLICIT") -> str:
    ids = "".join(f"<id>{target}</id>" for target in targets)
    return f"<portal><type>{kind}</type><linesegment>{line}</linesegment><target>{ids}</target></portal>"


def space(name: str, corners: list[str], *, segments: str = "", portals: str = "", label: str = "Office") -> str:
    return (
        f'<space id="{name}"><labels><label>{label}</label></labels>'
        f"<bounding_polygon>{''.join(corners)}</bounding_polygon>"
        f"<space_representation>{segments}</space_representation><portals>{portals}</portals></space>"
    )


def box(x0: float, y0: float, x1: float, y1: float) -> list[str]:
    return [point(x0, y0), point(x1, y0), point(x1, y1), point(x0, y1)]


def read(folder: Path, *spaces: str, size: str | None = None) -> FloorPlan:
    path = folder / "school.xml"
    size = scale() if size is None else size
    path.write_text(f"<building>{size}<floor><spaces>{''.join(spaces)}</spaces></floor></building>")
    return read_luperto(path)


A = space("a", box(0, 0, 80, 40), segments=segment("s", point(30, 40), point(40, 40)), portals=portal("s", "a", "b"))
B = space("b", box(0, 40, 80, 80))


@pytest.mark.parametrize(
    ("size", "metres"),
    [
        (scale(), 0.1),
        (scale(10, 50, "CM"), 0.05),
        (scale(10, 2, " m "), 0.2),
        (scale(10, 500, "mm"), 0.05),
        (scale(10, 5, "inch"), 0.0127),
        (scale(10, 5, "Inches"), 0.0127),
        (scale(10, 5, "in"), 0.0127),
        (scale(10, 5, "feet"), 0.1524),
        (scale(10, 5, "meters"), 0.5),
        (scale(10, 50, "centimetre"), 0.05),
        (scale(10, 5, "px"), None),
        (scale(0, 5), None),
        (scale(10, -5), None),
        (scale(10, "x"), None),
        ("", None),
    ],
)
def test_the_scale_is_a_length_in_pixels(tmp_path: Path, size: str, metres: float | None) -> None:
    if metres is None:
        with pytest.raises(
            InvalidInputError, match="expected a length in mm, cm, m, inches or feet, and pixels above 0"
        ):
            read(tmp_path, A, B, size=size)
    else:
        plan = read(tmp_path, A, B, size=size)
        assert plan.rooms[1].polygon.bounds == pytest.approx((0.0, -80 * metres, 80 * metres, -40 * metres))


def test_a_portal_stands_in_the_middle_of_its_segment(tmp_path: Path) -> None:
    plan = read(tmp_path, A, B)
    assert [(room.id, room.label) for room in plan.rooms] == [("r00", "office"), ("r01", "office")]
    (door,) = plan.doors
    assert door.midpoint == pytest.approx((3.5, -4.0))
    assert (door.width, set(door.rooms)) == (pytest.approx(0.9), {"r00", "r01"})
    assert (plan.remarks, plan.openings) == ((), ())
    assert (plan.name, plan.meta["format"]) == ("school", "luperto")
    wide = A.replace("EXPLICIT", " implicit ")
    (opening,) = read(tmp_path, wide, B).openings
    assert opening.segment[0][0] + opening.segment[1][0] == pytest.approx(7.0)


@pytest.mark.parametrize(
    ("given", "what", "why"),
    [
        (portal("s", "b", "c"), "doors", "they name more than one other room"),
        (portal("t", "b"), "doors", "their line segment is not in the file"),
        (portal("t", "gone"), "doors", "their line segment is not in the file"),
        (portal("s", "gone"), "doors", "their other room is left out"),
        (portal("s", "outside"), "portals", "they name no other room of the file"),
        (portal("s"), "portals", "they name no other room of the file"),
        (portal("s", "a"), "portals", "they name no other room of the file"),
    ],
)
def test_a_portal_that_leads_to_no_single_room_is_named(tmp_path: Path, given: str, what: str, why: str) -> None:
    first = A.replace(portal("s", "a", "b"), portal("s", "b") + given)
    others = [B, space("c", box(80, 0, 120, 80)), space("gone", [point(0, 0)])]
    plan = read(tmp_path, first, *others)
    assert len(plan.doors) == 1
    (remark,) = [remark for remark in plan.remarks if remark.what in ("doors", "portals")]
    assert (remark.action, remark.what, remark.why, remark.loss) == ("dropped", what, why, what == "doors")
    assert remark.names == ("portal 1 of r00 (office)",)


def test_outlines_are_read_as_far_as_they_go(tmp_path: Path) -> None:
    odd = space("a", [point(0, 0), point("x", 1), point(80, 0), '<point x="1"/>', point(80, 40), point(0, 40)])
    plan = read(tmp_path, odd)
    assert plan.rooms[0].polygon.area == pytest.approx(32.0)
    (remark,) = plan.remarks
    assert (remark.what, remark.count, remark.names) == ("points of outlines", 2, ("space 0 (office)",))


def test_a_room_may_be_made_of_its_segments(tmp_path: Path) -> None:
    corners = [(0, 0), (80, 0), (80, 40), (0, 40), (0, 0)]
    lines = "".join(segment(str(n), point(*a), point(*b)) for n, (a, b) in enumerate(itertools.pairwise(corners)))
    # One that stands for a point, one of three points and one without numbers are none.
    more = segment("p", point(5, 5), point(5, 5)) + segment("q", *box(0, 0, 9, 9)[:3]) + segment("r", point("x", 1))
    plan = read(tmp_path, space("a", [point(0, 0), point(1, 0), point(0, 0)], segments=more + lines))
    assert plan.rooms[0].polygon.area == pytest.approx(32.0)
    assert [(r.action, r.why) for r in plan.remarks] == [("repaired", "outline made of their segments")]
    with pytest.raises(
        InvalidInputError, match=r"neither an outline nor segments that close.*expected spaces with an outline"
    ):
        read(tmp_path, space("a", [point(0, 0)], segments=more))


def test_spaces_of_all_floors_are_read_and_no_more_than_so_many(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "two.xml"
    floors = "".join(f"<floor><spaces>{room}</spaces></floor>" for room in (A, B))
    path.write_text(f"<building>{scale()}{floors}</building>")
    assert len(read_luperto(path).rooms) == 2
    monkeypatch.setattr(luperto, "MAX_SPACES", 2)
    assert len(read_luperto(path).rooms) == 2
    monkeypatch.setattr(luperto, "MAX_SPACES", 1)
    with pytest.raises(InvalidInputError, match="2 spaces; expected at most 1"):
        read_luperto(path)


def test_floors_that_lie_above_each_other_are_named(tmp_path: Path) -> None:
    path = tmp_path / "school.xml"
    ground = f"<floor><name>ground</name><spaces>{A}{B}</spaces></floor>"
    first = f'<floor id="first"><spaces>{space("c", box(10, 10, 60, 50))}</spaces></floor>'
    path.write_text(f"<building>{scale()}{ground}{first}</building>")
    with pytest.raises(InvalidInputError, match="the floors ground, first; expected FILE:LEVEL"):
        read_luperto(path)
    with pytest.raises(InvalidInputError, match="no floor 'attic'; expected one of ground, first"):
        read_luperto(path, "attic")
    assert len(load_world(f"{path}:ground").rooms) == 2
    upper = read_luperto(path, "first")
    assert [room.polygon.area for room in upper.rooms] == pytest.approx([20.0], abs=0.1)
    assert (upper.name, upper.meta["level"]) == ("school-first", "first")


@pytest.mark.parametrize("far_first", [True, False])
def test_a_portal_to_an_id_that_is_used_twice_leads_to_the_nearest_room(tmp_path: Path, far_first: bool) -> None:
    far = space("b", box(200, 40, 280, 80))
    plan = read(tmp_path, *([A, far, B] if far_first else [A, B, far]))
    (door,) = plan.doors
    areas = {room.id: room.polygon.bounds[0] for room in plan.rooms}
    assert max(areas[room] for room in door.rooms if room is not None) < 1.0
    assert ("guessed", "ids of rooms", ("b",)) in [(r.action, r.what, r.names) for r in plan.remarks]


def test_of_lines_with_one_id_the_one_at_the_other_room_is_the_door(tmp_path: Path) -> None:
    lines = segment("s", point(30, 0), point(40, 0)) + segment("s", point(30, 40), point(40, 40))
    plan = read(tmp_path, space("a", box(0, 0, 80, 40), segments=lines, portals=portal("s", "a", "b")), B)
    (door,) = plan.doors
    assert door.midpoint == pytest.approx((3.5, -4.0), abs=0.05)
    assert [remark for remark in plan.remarks if remark.what == "doors"] == []
