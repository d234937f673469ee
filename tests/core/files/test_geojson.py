import json
from pathlib import Path
from typing import Any

import pytest
from shapely.geometry import MultiPolygon, box

from closedrooms.core.door import ClosedDoor
from closedrooms.core.errors import InvalidInputError
from closedrooms.core.files.geojson import read_doors, read_rooms, write_doors, write_rooms
from closedrooms.core.pose import Pose2
from closedrooms.core.remarks import Remark
from closedrooms.core.room import Alternative, Room


def collection(path: Path, *features: dict[str, Any]) -> Path:
    path.write_text(json.dumps({"type": "FeatureCollection", "features": list(features)}))
    return path


def point(x: Any, y: Any, **properties: Any) -> dict[str, Any]:
    geometry = {"type": "Point", "coordinates": [x, y]}
    return {"type": "Feature", "properties": properties, "geometry": geometry}


def test_doors_are_read_back_with_segment_or_midpoint(tmp_path: Path) -> None:
    doors = [
        ClosedDoor("d00", (1.5, 2.0), ((1.0, 2.0), (2.0, 2.0)), 1.0),
        ClosedDoor("d07", (-3.25, 4.0)),
    ]
    write_doors(tmp_path / "doors.geojson", doors)
    assert read_doors(tmp_path / "doors.geojson") == doors
    written = json.loads((tmp_path / "doors.geojson").read_text())
    assert written["frame"] == "map"
    assert written["units"] == "m"


def test_doors_without_an_id_are_numbered_around_those_that_have_one(tmp_path: Path) -> None:
    path = collection(tmp_path / "d", point(0, 0), point(1, 0, id="d00"), point(2, 0))
    assert [door.id for door in read_doors(path)] == ["d01", "d00", "d02"]


def test_open_doors_are_left_out(tmp_path: Path) -> None:
    path = collection(tmp_path / "d", point(0, 0, id="a", state="open"), point(1, 0, id="b", state="closed"))
    assert [door.id for door in read_doors(path)] == ["b"]


def test_rooms_are_read_back(tmp_path: Path) -> None:
    rooms = [
        Room(box(0, 0, 2, 3), ("d00",), "border", 1.25, bounded=True),
        Room(MultiPolygon([box(0, 0, 1, 1), box(5, 5, 6, 6)]), ("d01", "d02"), "dependent", None),
    ]
    write_rooms(tmp_path / "rooms.geojson", rooms)
    again = read_rooms(tmp_path / "rooms.geojson")
    assert [(r.doors, r.kind, r.score, r.bounded) for r in again] == [
        (r.doors, r.kind, r.score, r.bounded) for r in rooms
    ]
    assert all(a.polygon.equals(b.polygon) for a, b in zip(again, rooms, strict=True))


def test_a_bow_tie_is_repaired(tmp_path: Path) -> None:
    ring = [[0, 0], [2, 2], [2, 0], [0, 2], [0, 0]]
    feature = {"type": "Feature", "properties": {}, "geometry": {"type": "Polygon", "coordinates": [ring]}}
    (room,) = read_rooms(collection(tmp_path / "r", feature))
    assert room.polygon.area == pytest.approx(2.0)


@pytest.mark.parametrize(
    ("feature", "message"),
    [
        (point(0, float("nan")), "JSON"),
        (point("a", "b"), "geometry"),
        (point(10**400, 1), "401 digits"),
        (point(1e300, 1), "geometry"),
        ({"type": "Feature", "properties": {}, "geometry": None}, "geometry"),
        (
            {"type": "Feature", "geometry": {"type": "Polygon", "coordinates": [[[0, 0], [1, 0], [0, 1], [0, 0]]]}},
            "Polygon",
        ),
        ({"type": "Feature", "properties": {}, "geometry": {"type": "Point", "coordinates": []}}, "empty"),
        (
            {"type": "Feature", "geometry": {"type": "GeometryCollection", "geometries": []}},
            "geometry",
        ),
        (point([1], [2]), "geometry"),
        (point(0, 0, id=True), "id"),
        (point(0, 0, id="x" * 1001), "id"),
        (point(0, 0, width=1e9), "width"),
        (point(0, 0) | {"properties": ["a"]}, "properties"),
        (point(0, 0, id={"a": 1}), "id"),
        (point(0, 0, width=-1), "width"),
        (point(0, 0, width="wide"), "width"),
        (3, "geometry"),
    ],
)
def test_a_wrong_door_is_one_clear_line(tmp_path: Path, feature: Any, message: str) -> None:
    path = collection(tmp_path / "d.geojson", feature)
    with pytest.raises(InvalidInputError, match=message) as error:
        read_doors(path)
    assert str(error.value).endswith(str(path))


def test_rejects_two_doors_of_one_id_and_other_json(tmp_path: Path) -> None:
    with pytest.raises(InvalidInputError, match="two doors"):
        read_doors(collection(tmp_path / "d", point(0, 0, id="a"), point(1, 0, id="a")))
    (tmp_path / "x").write_text("[1, 2]")
    with pytest.raises(InvalidInputError, match="FeatureCollection"):
        read_doors(tmp_path / "x")
    (tmp_path / "x").write_text('{"type": "Topology"}')
    with pytest.raises(InvalidInputError, match="no FeatureCollection but 'Topology'"):
        read_doors(tmp_path / "x")
    (tmp_path / "x").write_text("{")
    with pytest.raises(InvalidInputError, match="broken JSON"):
        read_doors(tmp_path / "x")


def test_a_door_at_the_bound_of_coordinates_is_read(tmp_path: Path) -> None:
    ends = [[9.9e7, 9.9e7], [9.9e7 - 1.0, 9.9e7]]
    line = {"type": "Feature", "properties": {}, "geometry": {"type": "LineString", "coordinates": ends}}
    (door,) = read_doors(collection(tmp_path / "d", line))
    assert door.midpoint == pytest.approx((9.9e7 - 0.5, 9.9e7))


@pytest.mark.parametrize("wrong", [{"midpoint": (float("nan"), 0.0)}, {"segment": ((0.0, 0.0), (float("inf"), 1.0))}])
def test_a_door_without_finite_coordinates_is_refused(wrong: dict[str, Any]) -> None:
    with pytest.raises(InvalidInputError, match="finite coordinates"):
        ClosedDoor(**({"id": "a", "midpoint": (0.5, 0.5)} | wrong))


def test_a_moved_door_keeps_its_width() -> None:
    door = ClosedDoor("d", (1.0, 0.0), ((0.5, 0.0), (1.5, 0.0)), 1.0).moved(Pose2(0.0, 0.0, 1.5707963267948966))
    assert door.midpoint == pytest.approx((0.0, 1.0))
    assert door.segment is not None
    assert door.segment[1] == pytest.approx((0.0, 1.5))


@pytest.mark.parametrize("alone", [point(1, 2), point(1, 2)["geometry"]])
def test_a_bare_feature_or_geometry_is_a_collection_of_one(tmp_path: Path, alone: dict[str, Any]) -> None:
    (tmp_path / "d").write_text(json.dumps(alone))
    assert [door.midpoint for door in read_doors(tmp_path / "d")] == [(1.0, 2.0)]


def multi(form: str, coordinates: list[Any], **properties: Any) -> dict[str, Any]:
    return {"type": "Feature", "properties": properties, "geometry": {"type": form, "coordinates": coordinates}}


def test_multi_forms_are_read_part_by_part_and_what_was_named_here_is_told(tmp_path: Path) -> None:
    told: list[Remark] = []
    features = [
        multi("MultiPoint", [[0, 0]], id="one"),
        multi("MultiLineString", [[[0, 5], [1, 5]]], id="line"),
        multi("MultiLineString", [[[0, 7], [0.5, 7]], [[0.5, 7], [1, 7]]], id="pieces"),
        multi("MultiPoint", [[3, 0], [5, 0]], id="two"),
    ]
    doors = read_doors(collection(tmp_path / "d", *features), remarks=told)
    assert [door.id for door in doors] == ["one", "line", "pieces", "two", "two-2"]
    assert [door.midpoint for door in doors] == [(0, 0), (0.5, 5), (0.5, 7), (3, 0), (5, 0)]
    assert doors[2].width == pytest.approx(1.0)
    assert [str(remark) for remark in told] == ["guessed 1 id (two-2): one feature holds several doors"]


def test_the_id_of_a_feature_counts_where_its_properties_have_none(tmp_path: Path) -> None:
    features = [point(0, 0) | {"id": 7}, point(1, 0, id=3.0), point(2, 0, id="") | {"id": "north"}]
    features.append(point(3, 0) | {"id": 0})
    assert [door.id for door in read_doors(collection(tmp_path / "d", *features))] == ["7", "3", "d02", "0"]


def test_null_geometries_and_open_doors_in_any_case_are_left_out_and_counted(tmp_path: Path) -> None:
    told: list[Remark] = []
    nothing = {"type": "Feature", "properties": {"id": "x"}, "geometry": None}
    features = [nothing, point(0, 0, id="a", state="OPEN"), point(1, 0, id="b", state="Closed"), nothing]
    doors = read_doors(collection(tmp_path / "d", *features), remarks=told)
    assert [door.id for door in doors] == ["b"]
    assert [(remark.action, remark.what, remark.count, remark.loss) for remark in told] == [
        ("dropped", "features", 2, False),
        ("dropped", "door", 1, False),
    ]


@pytest.mark.parametrize("wrong", [{"kind": []}, {"doors": [{}]}, {"doors": "d00"}, {"score": "high"}])
def test_a_room_with_wrong_properties_is_one_clear_line(tmp_path: Path, wrong: dict[str, Any]) -> None:
    path = collection(tmp_path / "r", multi("Polygon", [[[0, 0], [1, 0], [1, 1], [0, 0]]], **wrong))
    with pytest.raises(InvalidInputError, match="room 0"):
        read_rooms(path)


def test_a_room_is_read_with_its_confidence_and_alternatives(tmp_path: Path) -> None:
    others = (Alternative(box(0, 0, 3, 3), 0.25), Alternative(box(0, 0, 5, 3), 0.125))
    room = Room(box(0, 0, 4, 3), ("d",), "border", 1.5, confidence=0.75, alternatives=others, outside=0.125)
    write_rooms(tmp_path / "rooms.geojson", [room])
    (read,) = read_rooms(tmp_path / "rooms.geojson")
    assert read == room


@pytest.mark.parametrize(
    ("name", "value", "match"),
    [
        ("confidence", 1.5, "confidence"),
        ("confidence", "high", "confidence"),
        ("outside", -0.1, "outside"),
        ("alternatives", {"probability": 1}, "alternatives"),
        ("alternatives", [3], "alternatives"),
        ("alternatives", [{"probability": 0.5}], "geometry"),
        ("alternatives", [{"probability": 0.5, "geometry": {"type": "Point", "coordinates": [0, 0]}}], "Point"),
        ("alternatives", [{"geometry": {"type": "Polygon", "coordinates": [[[0, 0], [1, 0], [1, 1], [0, 0]]]}}], "no"),
    ],
)
def test_a_confidence_or_alternative_that_is_none_is_refused(
    tmp_path: Path, name: str, value: object, match: str
) -> None:
    path = tmp_path / "rooms.geojson"
    write_rooms(path, [Room(box(0, 0, 4, 3), ("d",), "border", 1.5, confidence=0.75)])
    data = json.loads(path.read_text())
    data["features"][0]["properties"][name] = value
    path.write_text(json.dumps(data))
    with pytest.raises(InvalidInputError, match=match):
        read_rooms(path)


def told(path: Path) -> tuple[list[ClosedDoor], list[str]]:
    remarks: list[Remark] = []
    return read_doors(path, remarks=remarks), [str(remark) for remark in remarks]


def test_heights_and_measures_of_positions_are_left_out(tmp_path: Path) -> None:
    line = {"type": "LineString", "coordinates": [[1, 2, 0.5, 7], [1, 3, 0.5, 8]]}
    doors = read_doors(collection(tmp_path / "d", {"type": "Feature", "properties": {"id": "a"}, "geometry": line}))
    assert doors == [ClosedDoor("a", (1.0, 2.5), ((1.0, 2.0), (1.0, 3.0)), 1.0)]


def test_a_collection_of_one_kind_is_read_as_its_multi_form(tmp_path: Path) -> None:
    points = [{"type": "Point", "coordinates": [x, 0]} for x in (1, 4)]
    feature = {"type": "Feature", "properties": {"id": "a"}, "geometry": {"type": "GeometryCollection"}}
    feature["geometry"]["geometries"] = points  # type: ignore[index]
    assert [(d.id, d.midpoint) for d in read_doors(collection(tmp_path / "d", feature))] == [
        ("a", (1.0, 0.0)),
        ("a-2", (4.0, 0.0)),
    ]
    feature["geometry"]["geometries"] = [points[0], {"type": "LineString", "coordinates": [[0, 0], [1, 0]]}]  # type: ignore[index]
    with pytest.raises(InvalidInputError, match="feature 0 has no readable geometry"):
        read_doors(collection(tmp_path / "d", feature))


def test_properties_are_read_however_they_are_spelt(tmp_path: Path) -> None:
    path = collection(tmp_path / "d", point(0, 0, ID="a", Width="0.85"), point(1, 0, Id=7, STATE="Open"))
    assert read_doors(path) == [ClosedDoor("a", (0.0, 0.0), None, 0.85)]
    assert read_doors(collection(tmp_path / "d", point(0, 0, id="a", width=" ")))[0].width is None
    for width in ("0,9", "0.9 m", 0):
        with pytest.raises(InvalidInputError, match="door 'a' of width"):
            read_doors(collection(tmp_path / "d", point(0, 0, id="a", width=width)))


@pytest.mark.parametrize(
    ("members", "claim"),
    [
        ({"crs": {"type": "name", "properties": {"name": "urn:ogc:def:crs:OGC:1.3:CRS84"}}}, "CRS84 (degrees)"),
        ({"crs": {"type": "name", "properties": {"name": "urn:ogc:def:crs:EPSG::4326"}}}, "EPSG::4326 (degrees)"),
        ({"crs": "EPSG:4326"}, "EPSG:4326 (degrees)"),
        ({"frame": "odom"}, "frame 'odom'"),
        ({"crs": {"type": "name", "properties": {"name": "urn:ogc:def:crs:EPSG::3857"}}}, None),
        ({"crs": {"properties": []}}, None),
        ({"frame": "map"}, None),
    ],
)
def test_another_frame_than_the_maps_is_told(tmp_path: Path, members: dict[str, Any], claim: str | None) -> None:
    path = tmp_path / "d"
    path.write_text(json.dumps({"type": "FeatureCollection", "features": [point(1, 2, id="a")], **members}))
    doors, remarks = told(path)
    assert [door.midpoint for door in doors] == [(1.0, 2.0)]
    assert len(remarks) == (claim is not None)
    assert all(str(claim) in remark and "metres in the map frame" in remark for remark in remarks)


def test_doors_in_degrees_or_centimetres_are_found_out(tmp_path: Path) -> None:
    degrees = point(9.1912345, 45.4642345, id="a"), point(9.1912445, 45.4642395, id="b")
    with pytest.raises(InvalidInputError, match=r"2 doors within 1e-05 m \(degrees\?\)"):
        read_doors(collection(tmp_path / "d", *degrees))
    _, remarks = told(collection(tmp_path / "d", point(0, 0, id="a", width=90), point(3, 0, id="b", width=0.9)))
    assert remarks == ["guessed 1 widths (a): above 10; taken as metres (they look like centimetres)"]


def test_states_of_any_form_are_read_and_unknown_ones_told(tmp_path: Path) -> None:
    left_out = ({"state": "Opened"}, {"state": False}, {"open": True}, {"Open": 1}, {"closed": False}, {"closed": "no"})
    kept = ({"state": True}, {"state": "Shut"}, {"open": False}, {"closed": True}, {"state": None}, {"state": ""})
    opened = [point(i, 0, id=f"o{i}", **state) for i, state in enumerate(left_out)]
    closed = [point(i, 5, id=f"c{i}", **state) for i, state in enumerate(kept)]
    doors, remarks = told(collection(tmp_path / "d", *opened, *closed))
    assert [door.id for door in doors] == [f"c{i}" for i in range(len(kept))]
    assert [remark.partition(" (")[0] for remark in remarks] == ["dropped 6 doors"]
    doors, remarks = told(collection(tmp_path / "d", point(0, 0, id="a", state="offen"), point(3, 0, id="b")))
    assert [door.id for door in doors] == ["a", "b"]
    assert remarks == ["guessed 1 state (a): 'offen' taken as closed"]


def test_closed_lines_and_leaves_in_degrees_are_refused(tmp_path: Path) -> None:
    ring = multi("LineString", [[1, 1], [2, 1], [2, 1.1], [1, 1.1], [1, 1]], id="a")
    with pytest.raises(InvalidInputError, match="door 'a' is a closed line"):
        read_doors(collection(tmp_path / "d", ring))
    leaf = multi("LineString", [[8.68, 49.41], [8.680012, 49.41]], id="a")
    with pytest.raises(InvalidInputError, match=r"door 'a' of 1.2e-05 m \(degrees\?\)"):
        read_doors(collection(tmp_path / "d", leaf))


@pytest.mark.parametrize(
    "empty", [{"type": "Point", "coordinates": []}, {"type": "GeometryCollection", "geometries": []}]
)
def test_empty_geometries_are_skipped_as_null_ones_are(tmp_path: Path, empty: dict[str, Any]) -> None:
    feature = {"type": "Feature", "properties": {"id": "x"}, "geometry": empty}
    doors, remarks = told(collection(tmp_path / "d", feature, point(0, 0, id="a")))
    assert [door.id for door in doors] == ["a"]
    assert remarks == ["dropped feature: it has no geometry (null or empty)"]


@pytest.mark.parametrize(("given", "doors"), [('[ "d01", "d02" ]', ("d01", "d02")), (None, ()), (["d01"], ("d01",))])
def test_doors_of_rooms_are_read_from_tables_without_lists(tmp_path: Path, given: Any, doors: tuple[str, ...]) -> None:
    room = multi("Polygon", [[[0, 0], [1, 0], [1, 1], [0, 0]]], doors=given)
    assert read_rooms(collection(tmp_path / "r", room))[0].doors == doors


def test_a_door_with_a_bend_and_one_on_another_are_told(tmp_path: Path) -> None:
    def line(*points: list[float], **properties: Any) -> dict[str, Any]:
        return {"type": "Feature", "properties": properties, "geometry": {"type": "LineString", "coordinates": points}}

    path = collection(
        tmp_path / "d",
        line([0.0, 0.0], [1.0, 0.0], [1.0, 1.0], id="bent"),
        line([3.0, 0.0], [3.4, 0.0], [4.0, 0.0], id="straight"),
        point(7, 7, id="a"),
        point(7, 7, id="b"),
    )
    remarks: list[Remark] = []
    assert [door.id for door in read_doors(path, remarks=remarks)] == ["bent", "straight", "a", "b"]
    assert [(remark.action, remark.names) for remark in remarks] == [("guessed", ("bent",)), ("guessed", ("b",))]


@pytest.mark.parametrize(("opened", "noun"), [(0, None), (1, "ring"), (2, "2 rings")])
def test_rings_that_are_not_closed_are_closed_and_said(tmp_path: Path, opened: int, noun: str | None) -> None:
    square = [[0, 0], [4, 0], [4, 3], [0, 3], [0, 0]]
    geometries = [
        {"type": "Polygon", "coordinates": [square[:-1] if opened > 0 else square]},
        {"type": "MultiPolygon", "coordinates": [[square[:-1] if opened > 1 else [[*p, 1.0] for p in square]]]},
    ]
    features = [{"type": "Feature", "geometry": g, "properties": {"doors": []}} for g in geometries]
    remarks: list[Remark] = []
    rooms = read_rooms(collection(tmp_path / "r", *features), remarks=remarks)
    assert [room.polygon.area for room in rooms] == [12.0, 12.0]
    said = [] if noun is None else [f"repaired {noun}: the last point is not the first, closed"]
    assert [str(remark) for remark in remarks] == said
    assert not any(remark.loss for remark in remarks)


@pytest.mark.parametrize(
    "key", ["status", "is_open", "IS_OPEN", "is_closed", "Status", "isOpen", "Is open", "isClosed", "doorState"]
)
def test_doors_that_are_open_by_another_property_are_left_out_and_said(tmp_path: Path, key: str) -> None:
    kinds = {"status": ("open", "closed"), "open": (True, False), "closed": (0, 1), "state": ("open", "closed")}
    words = next(words for end, words in kinds.items() if key.lower().endswith(end))
    features = [point(0, 0, id="a", **{key: words[0]}), point(3, 0, id="b", **{key: words[1]})]
    doors, remarks = told(collection(tmp_path / "d", *features))
    assert [door.id for door in doors] == ["b"]
    assert remarks == ["dropped 1 door (a): the file says open"]


@pytest.mark.parametrize(
    ("units", "read"), [("m", True), ("meters", True), ("metre", True), ("cm", False), ([], False)]
)
def test_units_are_metres_in_any_spelling(tmp_path: Path, units: object, read: bool) -> None:
    path = tmp_path / "d.geojson"
    path.write_text(json.dumps({"type": "FeatureCollection", "units": units, "features": [point(0, 0, id="a")]}))
    if read:
        assert len(read_doors(path)) == 1
    else:
        with pytest.raises(InvalidInputError, match="units"):
            read_doors(path)


@pytest.mark.parametrize("key", ["type", "Category", "layer"])
def test_what_the_file_calls_a_wall_or_a_room_is_no_door(tmp_path: Path, key: str) -> None:
    square = [[0, 0], [4, 0], [4, 3], [0, 0]]
    room = {"type": "Feature", "properties": {key: "Room"}, "geometry": {"type": "Polygon", "coordinates": [square]}}
    others = [point(0, 0, **{key: "outer_wall"}), room, point(9, 0, **{key: "window"})]
    honest = [
        point(1, 0, id="a", **{key: "bathroom door"}),
        point(5, 0, id="b", **{key: "hinged"}),
        point(7, 0, id="c"),
    ]
    doors, remarks = told(collection(tmp_path / "d", *others, *honest))
    assert [door.id for door in doors] == ["a", "b", "c"]
    assert remarks == ["dropped 3 features: the file calls them room, wall, window, not doors"]
