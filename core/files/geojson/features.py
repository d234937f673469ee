"""Features of any geometry in the map frame as GeoJSON (metres, not degrees)."""

import json
import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import shapely
from shapely.geometry.base import BaseGeometry

from closedrooms.core.errors import InvalidInputError
from closedrooms.core.files.geojson.geometry import LISTS, geometry_from, geometry_json, has_open_ring
from closedrooms.core.files.incoming import read_json, reading
from closedrooms.core.files.outgoing import write_bytes
from closedrooms.core.names import shown
from closedrooms.core.numbers import FARTHEST, check_count, repr_of
from closedrooms.core.remarks import Remark

GeoFeature = tuple[BaseGeometry, dict[str, Any]]
MAX_FEATURES = 1_000_000
# Properties that others spell in capitals (shapefiles, GDAL), as isOpen or door-state, by how they are spelt here.
SPELT = ("id", "state", "status", "width", "open", "opened", "closed", "is_open", "is_closed")
METRES = ("m", "metre", "metres", "meter", "meters")
DEGREES = ("CRS84", "4326", "4979", "WGS84", "WGS 84")


def write_features(path: Path, features: Iterable[GeoFeature]) -> None:
    """Write geometries [m, map frame] with their properties, a line each, coordinates rounded to 0.1 mm.

    Raises:
        OutputError: The folder cannot be written.
    """
    lines = [
        json.dumps(
            {"type": "Feature", "properties": properties, "geometry": geometry_json(geometry)},
            allow_nan=False,
        )
        for geometry, properties in features
    ]
    head = '{"type": "FeatureCollection", "frame": "map", "units": "m", "features": ['
    write_bytes(path, ("\n".join([head, ",\n".join(lines), "]}"]) + "\n").encode())


def read_features(
    path: Path, *, what: str = "a GeoJSON FeatureCollection", remarks: list[Remark] | None = None
) -> list[GeoFeature]:
    """Read geometries and properties of an untrusted file, as we, QGIS or geopandas write it.

    A bare Feature or geometry counts as a collection of one. The ``id`` of a Feature stands in its properties when
    these have none. Features without a geometry (``null``, or an empty one as shapely writes it) are skipped.

    Args:
        path: The file.
        what: What it should be, for the message.
        remarks: Told what was skipped or closed.

    Raises:
        InvalidInputError: No GeoJSON, a feature without a valid geometry (named by its number), units other than
            metres, coordinates that are not finite or too far away, too many features.
    """
    data = read_json(path, what=what)
    features = _features(data)
    if features is None:
        kind = data.get("type") if isinstance(data, dict) else type(data).__name__
        raise InvalidInputError(f"no FeatureCollection but {repr_of(kind)}", expected=what, where=path)
    if data.get("units", "m") not in METRES:
        raise InvalidInputError(f"units {repr_of(data['units'])}", expected="metres in the map frame ('m')", where=path)
    check_count(len(features), MAX_FEATURES, "features", path)
    if remarks is not None:
        remarks += _frame_remarks(data)
    null = sum(map(_is_null, features))
    if null == len(features) > 0:
        raise InvalidInputError(f"{null} features without a geometry (null or empty)", expected=what, where=path)
    if null and remarks is not None:
        why = "they have no geometry (null or empty)" if null > 1 else "it has no geometry (null or empty)"
        remarks.append(Remark(action="dropped", what="features" if null > 1 else "feature", why=why, count=null))
    with reading(path, what):
        given = [(number, feature) for number, feature in enumerate(features) if not _is_null(feature)]
        read = [read_feature(number, feature, path) for number, feature in given]
        unclosed = sum(has_open_ring(feature["geometry"]) for _, feature in given)
    if unclosed and remarks is not None:
        why = "the last point is not the first, closed"
        remarks.append(Remark(action="repaired", what="rings" if unclosed > 1 else "ring", why=why, count=unclosed))
    return read


def _is_null(feature: Any) -> bool:
    """Check whether a feature has no geometry, or an empty one."""
    geometry = feature.get("geometry", feature) if isinstance(feature, dict) else feature
    return geometry is None or (
        isinstance(geometry, dict) and [] in (geometry.get("coordinates"), geometry.get("geometries"))
    )


def _frame_remarks(data: dict[str, Any]) -> list[Remark]:
    """Say which other frame a file claims, while its coordinates are taken as metres in the map frame."""
    frame = data.get("frame", "map")
    claims = [] if frame == "map" else [f"frame {repr_of(frame)}"]
    system = data.get("crs")
    named = system.get("properties") if isinstance(system, dict) else None
    system = shown((named.get("name") if isinstance(named, dict) else system) or "", longest=60)
    # The editor's default for a layer whose maker did not choose one.
    claims += [f"crs {system} (degrees)"] if any(name in system.upper() for name in DEGREES) else []
    why = "taken as metres in the map frame"
    return [Remark(action="guessed", what="coordinates", why=f"the file says {claim}; {why}") for claim in claims]


def _features(data: Any) -> list[Any] | None:
    """Find the features that parsed GeoJSON holds, ``None`` when it is none."""
    kind = data.get("type") if isinstance(data, dict) else None
    if kind == "FeatureCollection" and isinstance(data.get("features"), list):
        return list(data["features"])
    if kind == "Feature":
        return [data]
    if isinstance(kind, str) and kind in LISTS:
        return [{"type": "Feature", "properties": {}, "geometry": data}]
    return None


def read_feature(number: int, feature: Any, path: Path) -> GeoFeature:
    """Read the geometry and the properties of one feature of an untrusted file."""
    try:
        made = geometry_from(feature["geometry"])
        properties = feature.get("properties") or {}
    except (KeyError, TypeError, ValueError, AttributeError, IndexError, shapely.errors.ShapelyError) as error:
        raise InvalidInputError(
            f"feature {number} has no readable geometry",
            expected=f"GeoJSON, finite metres up to {FARTHEST:g}",
            where=path,
        ) from error
    if not isinstance(properties, dict):
        raise InvalidInputError(
            f"feature {number} with properties {repr_of(properties)}", expected="names and values", where=path
        )
    if made.is_empty:
        raise InvalidInputError(f"feature {number} is empty", expected="a geometry in metres", where=path)
    plain = {_spelling(str(key)): value for key, value in properties.items()}
    properties = {**properties, **{key: plain[key] for key in SPELT if key in plain and key not in properties}}
    if properties.get("id") is None and feature.get("id") is not None:
        properties = {**properties, "id": feature["id"]}
    return made, properties


def _spelling(key: str) -> str:
    """Spell the name of a property as here: ``isOpen``, ``Is open``, ``door-state`` and ``doorState`` are one each."""
    words = re.sub("(?<=[a-z])(?=[A-Z])", "_", key.strip()).lower()
    return re.sub("[ -]+", "_", words).removeprefix("door_")
