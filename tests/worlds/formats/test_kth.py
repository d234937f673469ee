"""KTH floors: scale, contours and doors, on floors of two rooms."""

import math
from collections.abc import Iterable
from pathlib import Path

import pytest

from closedrooms.core.errors import InvalidInputError
from closedrooms.worlds.formats import kth
from closedrooms.worlds.formats.kth import read_kth
from closedrooms.worlds.plan import FloorPlan

Line = tuple[object, object, object, object, str]
SCALE = '<scale PixelDistance="100" RealDistance="5"/>'


def wall(x1: object, y1: object, x2: object, y2: object) -> Line:
    return (x1, y1, x2, y2, 'type="Wall"')


def portal(x1: object, y1: object, x2: object, y2: object, target: str) -> Line:
    return (x1, y1, x2, y2, f'type="Portal" target="{target}"')


def rectangle(x0: float, y0: float, x1: float, y1: float) -> list[Line]:
    return [wall(x0, y0, x1, y0), wall(x1, y0, x1, y1), wall(x1, y1, x0, y1), wall(x0, y1, x0, y0)]


def space(name: str, lines: Iterable[Line], kind: str = "Office") -> str:
    body = "".join(f'<linesegment x1="{a}" y1="{b}" x2="{c}" y2="{d}" {more}/>' for a, b, c, d, more in lines)
    return f'<space name="{name}" type="{kind}"><contour>{body}</contour></space>'


def read(folder: Path, *spaces: str, scale: str = SCALE) -> FloorPlan:
    path = folder / "floor 1.xml"
    path.write_text(f"<floor>{scale}{''.join(spaces)}</floor>")
    return read_kth(path)


def with_door(low: float, high: float, target: str, y: float = 80, *, name: str, top: bool) -> str:
    """A room of 160 x 80 pixels (8 x 4 m) above or below y = 80, with a portal in that wall."""
    far = 160 if top else 0
    lines = [
        wall(0, far, 160, far), wall(160, far, 160, y), wall(160, y, high, y), portal(high, y, low, y, target),
        wall(low, y, 0, y), wall(0, y, 0, far),
    ]  # fmt: skip
    return space(name, lines)


def two_rooms(folder: Path, low: float = 60, high: float = 78, *, both: bool = True) -> FloorPlan:
    back = with_door(low, high, "A", name="b", top=True) if both else space("b", rectangle(0, 80, 160, 160))
    return read(folder, with_door(low, high, "B", name="a", top=False), back)


def test_pixels_become_metres_with_y_up(tmp_path: Path) -> None:
    plan = two_rooms(tmp_path)
    assert [room.polygon.bounds for room in plan.rooms] == [(0.0, -4.0, 8.0, 0.0), (0.0, -8.0, 8.0, -4.0)]
    assert [(room.id, room.label) for room in plan.rooms] == [("r00", "office"), ("r01", "office")]
    assert (plan.name, plan.meta) == ("floor 1", {"source": "floor 1.xml", "format": "kth"})
    (door,) = plan.doors
    assert door.midpoint == pytest.approx((69 * 0.05, -4.0))
    assert door.width == pytest.approx(0.9)
    assert set(door.rooms) == {"r00", "r01"}
    assert plan.remarks == ()


@pytest.mark.parametrize(
    ("scale", "metres"),
    [
        ('<scale PixelDistance="100" RealDistance="10"/>', 0.1),
        ("<Scale><pixeldistance>50</pixeldistance><REALDISTANCE> 5 </REALDISTANCE></Scale>", 0.1),
        ('<scale PixelDistance="0" RealDistance="10"/>', None),
        ('<scale PixelDistance="10" RealDistance="-1"/>', None),
        ('<scale PixelDistance="10" RealDistance="nan"/>', None),
        ('<scale PixelDistance="10"/>', None),
        ("", None),
    ],
)
def test_the_scale_is_a_pair_of_numbers_above_0(tmp_path: Path, scale: str, metres: float | None) -> None:
    room = space("a", rectangle(0, 0, 50, 40))
    if metres is None:
        with pytest.raises(InvalidInputError, match="expected two numbers above 0"):
            read(tmp_path, room, scale=scale)
    else:
        assert read(tmp_path, room, scale=scale).rooms[0].polygon.bounds == (0.0, -40 * metres, 50 * metres, 0.0)


@pytest.mark.parametrize(("pixels", "width"), [(8, 0.6), (12, 0.6), (14, 0.7), (44, 2.2), (48, 2.4), (60, 2.4)])
def test_doors_are_as_wide_as_drawn_within_what_a_door_can_be(tmp_path: Path, pixels: float, width: float) -> None:
    plan = two_rooms(tmp_path, 80 - pixels / 2, 80 + pixels / 2)
    assert plan.doors[0].width == pytest.approx(width)
    assert plan.doors[0].midpoint == pytest.approx((4.0, -4.0))
    changed = ["drawn narrower" in remark.why for remark in plan.remarks if remark.what == "doors"]
    assert any(changed) == (abs(pixels * 0.05 - width) > 1e-9)


def test_a_door_on_one_contour_only_is_told(tmp_path: Path) -> None:
    plan = two_rooms(tmp_path, both=False)
    assert len(plan.doors) == 1
    (remark,) = plan.remarks
    assert (remark.action, remark.what, remark.why, remark.count) == (
        "guessed", "doors", "they stand on one contour only", 1,
    )  # fmt: skip


@pytest.mark.parametrize(("apart", "doors"), [(12, 1), (20, 2)])
def test_doors_of_two_contours_are_one_up_to_80_centimetres(tmp_path: Path, apart: float, doors: int) -> None:
    first = with_door(20, 38, "b", name="a", top=False)
    second = with_door(20 + apart, 38 + apart, "a", name="b", top=True)
    assert len(read(tmp_path, first, second).doors) == doors


def test_portals_to_nowhere_are_counted_and_widths_tell_the_scale(tmp_path: Path) -> None:
    lines = [*rectangle(0, 0, 160, 80), portal(10, 0, 16, 0, ""), portal(20, 0, 26, 0, "Z"), portal(30, 0, 36, 0, "a")]
    plan = read(tmp_path, space("a", lines), space("b", rectangle(0, 80, 160, 160)))
    portals, scale = (next(r for r in plan.remarks if r.what == what) for what in ("portals", "scale"))
    assert (portals.count, portals.names, portals.loss) == (3, ("a to nowhere", "a to Z", "a to a"), False)
    assert "the median door is 0.30 m wide" in scale.why


def test_of_rooms_of_one_name_the_nearest_is_meant_and_none_beyond_2_metres(tmp_path: Path) -> None:
    middle = with_door(60, 78, "x", name="m", top=False)
    near, far = (space("X", rectangle(0, y, 160, y + 60)) for y in (80, 200))
    for rooms in ((middle, near, far), (middle, far, near)):
        plan = read(tmp_path, *rooms)
        other = next(room.id for room in plan.rooms if room.polygon.bounds[3] == -4.0)
        assert [set(door.rooms) for door in plan.doors] == [{"r00", other}]
    # 1.9 m away it is meant, but no wall is shared; 2.1 m away the portal leads nowhere.
    for y, what in ((118, "doors"), (122, "portals")):
        plan = read(tmp_path, middle, space("X", rectangle(0, y, 160, y + 60)))
        assert not plan.doors
        assert what in {remark.what for remark in plan.remarks}


def test_lines_out_of_order_or_broken_are_put_right(tmp_path: Path) -> None:
    sides = rectangle(0, 0, 160, 80)
    plan = read(tmp_path, space("a", [sides[0], sides[2], sides[1], sides[3]]))
    assert plan.rooms[0].polygon.area == pytest.approx(32.0)
    assert [(r.action, r.what, r.why) for r in plan.remarks] == [("repaired", "rooms", "contour put in order")]
    broken = [*sides, wall("x", 0, 1, 1), wall(0, 0, "inf", 1)]
    plan = read(tmp_path, space("a", broken))
    (remark,) = plan.remarks
    assert (remark.what, remark.count, remark.names) == ("contour lines", 2, ("a (office)",))
    assert plan.rooms[0].polygon.area == pytest.approx(32.0)


def test_a_space_without_a_contour_is_lost_and_unnamed_ones_are_counted(tmp_path: Path) -> None:
    plan = read(tmp_path, space("", [wall(0, 0, 9, 9)], ""), space("", rectangle(0, 0, 160, 80), ""))
    (lost,) = plan.remarks
    assert (lost.what, lost.names, lost.loss) == ("rooms", ("0 (room)",), True)
    assert [room.label for room in plan.rooms] == ["room"]
    with pytest.raises(
        InvalidInputError, match=r"a plan without rooms .*fewer than 3 points.*expected spaces with a contour"
    ):
        read(tmp_path, space("", [wall(0, 0, 9, 9)]))


def test_so_many_spaces_and_no_more_are_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(kth, "MAX_SPACES", 2)
    rooms = [space(str(n), rectangle(200 * n, 0, 200 * n + 160, 80)) for n in range(3)]
    assert len(read(tmp_path, *rooms[:2]).rooms) == 2
    with pytest.raises(InvalidInputError, match="3 spaces; expected at most 2"):
        read(tmp_path, *rooms)


def test_a_wall_between_rooms_that_leave_room_for_one_is_shared(tmp_path: Path) -> None:
    plan = read(tmp_path, space("a", rectangle(0, 0, 160, 80)), space("b", rectangle(0, 83, 160, 160)))
    (gap,) = [remark for remark in plan.remarks if remark.what == "gaps between rooms"]
    assert gap.count == 1
    assert math.isclose(sum(room.polygon.area for room in plan.rooms), 64.0, abs_tol=0.01)
