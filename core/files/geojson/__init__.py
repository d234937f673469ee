"""Doors, rooms and other features in the map frame as GeoJSON (metres, not degrees).

``features`` reads and writes any, ``doors`` and ``rooms`` those that mean something; ``geometry`` is what all share.
"""

from typing import TYPE_CHECKING

from closedrooms.core.runtime.lazy import lazy_face

if TYPE_CHECKING:
    from closedrooms.core.files.geojson.doors import read_doors as read_doors
    from closedrooms.core.files.geojson.doors import write_doors as write_doors
    from closedrooms.core.files.geojson.features import GeoFeature as GeoFeature
    from closedrooms.core.files.geojson.features import read_features as read_features
    from closedrooms.core.files.geojson.features import write_features as write_features
    from closedrooms.core.files.geojson.rooms import read_rooms as read_rooms
    from closedrooms.core.files.geojson.rooms import write_rooms as write_rooms

__getattr__, __dir__, __all__ = lazy_face(
    __name__,
    {
        "doors": ("read_doors", "write_doors"),
        "features": ("GeoFeature", "read_features", "write_features"),
        "rooms": ("read_rooms", "write_rooms"),
    },
)
