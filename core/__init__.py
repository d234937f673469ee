"""The words every stage shares (poses, grids, scans, doors, rooms, errors) and the files they are kept in.

This is the public face: ``from closedrooms.core import OccupancyGrid, read_map``. A name is imported when it is first
asked for, so that ``import closedrooms.core`` stays quick and loads no library.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from closedrooms.core.door import ClosedDoor, DoorSighting
    from closedrooms.core.errors import ClosedroomsError, InvalidInputError, OutputError
    from closedrooms.core.geojson import (
        read_doors,
        read_features,
        read_rooms,
        write_doors,
        write_features,
        write_rooms,
    )
    from closedrooms.core.grid import FREE, OCCUPIED, UNKNOWN, GridFrame, OccupancyGrid
    from closedrooms.core.pose import Pose2
    from closedrooms.core.remarks import Remark
    from closedrooms.core.room import Alternative, Room
    from closedrooms.core.rosmap import RosMap, read_map, read_ros_map, write_map
    from closedrooms.core.scan import LaserScan
    from closedrooms.core.tum import read_trajectory, write_trajectory

    __version__: str

_HOMES = {
    "door": ("ClosedDoor", "DoorSighting"),
    "errors": ("ClosedroomsError", "InvalidInputError", "OutputError"),
    "geojson": ("read_doors", "read_features", "read_rooms", "write_doors", "write_features", "write_rooms"),
    "grid": ("FREE", "OCCUPIED", "UNKNOWN", "GridFrame", "OccupancyGrid"),
    "pose": ("Pose2",),
    "remarks": ("Remark",),
    "room": ("Alternative", "Room"),
    "rosmap": ("RosMap", "read_map", "read_ros_map", "write_map"),
    "scan": ("LaserScan",),
    "tum": ("read_trajectory", "write_trajectory"),
}
_HOME = {name: module for module, names in _HOMES.items() for name in names}

__all__ = [
    "FREE",
    "OCCUPIED",
    "UNKNOWN",
    "Alternative",
    "ClosedDoor",
    "ClosedroomsError",
    "DoorSighting",
    "GridFrame",
    "InvalidInputError",
    "LaserScan",
    "OccupancyGrid",
    "OutputError",
    "Pose2",
    "Remark",
    "Room",
    "RosMap",
    "__version__",
    "read_doors",
    "read_features",
    "read_map",
    "read_rooms",
    "read_ros_map",
    "read_trajectory",
    "write_doors",
    "write_features",
    "write_map",
    "write_rooms",
    "write_trajectory",
]


def __getattr__(name: str) -> Any:
    if name == "__version__":
        from importlib.metadata import version

        return version("closedrooms")
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_HOME[name]}"), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
