"""The words every stage shares, and the files they are kept in. Nothing here imports another folder of ours.

- Words: ``pose``, ``grid``, ``scan``, ``observation``, ``door``, ``room``, ``robot`` (radius and speeds, said once).
- Cells: ``shapes`` (which cells a polygon, its outline or a doorway holds), ``arrays``.
- For people: ``errors``, ``remarks`` (what was dropped, repaired, guessed), ``report``, ``names``, ``numbers``,
  ``nearest``.
- ``random`` streams of one seed; ``files/`` in and out; ``runtime/``: missing packages, signals, lazy public faces.

This is the public face: ``from closedrooms.core import OccupancyGrid, read_map``. A name is imported when it is first
asked for, so that ``import closedrooms.core`` stays quick and loads no library.
"""

from typing import TYPE_CHECKING, Any

from closedrooms.core.runtime.lazy import lazy_face

if TYPE_CHECKING:
    from closedrooms.core.door import ClosedDoor as ClosedDoor
    from closedrooms.core.door import DoorSighting as DoorSighting
    from closedrooms.core.errors import ClosedroomsError as ClosedroomsError
    from closedrooms.core.errors import InvalidInputError as InvalidInputError
    from closedrooms.core.errors import OutputError as OutputError
    from closedrooms.core.files.geojson import read_doors as read_doors
    from closedrooms.core.files.geojson import read_features as read_features
    from closedrooms.core.files.geojson import read_rooms as read_rooms
    from closedrooms.core.files.geojson import write_doors as write_doors
    from closedrooms.core.files.geojson import write_features as write_features
    from closedrooms.core.files.geojson import write_rooms as write_rooms
    from closedrooms.core.files.rosmap import RosMap as RosMap
    from closedrooms.core.files.rosmap import read_map as read_map
    from closedrooms.core.files.rosmap import read_ros_map as read_ros_map
    from closedrooms.core.files.rosmap import write_map as write_map
    from closedrooms.core.files.tum import read_trajectory as read_trajectory
    from closedrooms.core.files.tum import write_trajectory as write_trajectory
    from closedrooms.core.grid import FREE as FREE
    from closedrooms.core.grid import OCCUPIED as OCCUPIED
    from closedrooms.core.grid import UNKNOWN as UNKNOWN
    from closedrooms.core.grid import GridFrame as GridFrame
    from closedrooms.core.grid import OccupancyGrid as OccupancyGrid
    from closedrooms.core.pose import Pose2 as Pose2
    from closedrooms.core.remarks import Remark as Remark
    from closedrooms.core.room import Alternative as Alternative
    from closedrooms.core.room import Room as Room
    from closedrooms.core.scan import LaserScan as LaserScan

    __version__: str

_load, __dir__, __all__ = lazy_face(
    __name__,
    {
        "door": ("ClosedDoor", "DoorSighting"),
        "errors": ("ClosedroomsError", "InvalidInputError", "OutputError"),
        "files.geojson": ("read_doors", "read_features", "read_rooms", "write_doors", "write_features", "write_rooms"),
        "grid": ("FREE", "OCCUPIED", "UNKNOWN", "GridFrame", "OccupancyGrid"),
        "pose": ("Pose2",),
        "remarks": ("Remark",),
        "room": ("Alternative", "Room"),
        "files.rosmap": ("RosMap", "read_map", "read_ros_map", "write_map"),
        "scan": ("LaserScan",),
        "files.tum": ("read_trajectory", "write_trajectory"),
    },
)


def __getattr__(name: str) -> Any:
    if name == "__version__":
        from importlib.metadata import version

        return version("closedrooms")
    return _load(name)
