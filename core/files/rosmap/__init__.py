"""Maps as ROS map_server keeps them: a YAML beside a picture.

``map_reader`` reads them into a ``ros_map``: ``map_description`` the YAML, ``map_picture`` the picture, and ``greys``
says which cell a grey value stands for. ``map_writer`` writes them.
"""

from typing import TYPE_CHECKING

from closedrooms.core.runtime.lazy import lazy_face

if TYPE_CHECKING:
    from closedrooms.core.files.rosmap.map_reader import read_bare_picture as read_bare_picture
    from closedrooms.core.files.rosmap.map_reader import read_map as read_map
    from closedrooms.core.files.rosmap.map_reader import read_ros_map as read_ros_map
    from closedrooms.core.files.rosmap.map_writer import write_map as write_map
    from closedrooms.core.files.rosmap.map_writer import write_raw_map as write_raw_map
    from closedrooms.core.files.rosmap.ros_map import RosMap as RosMap

__getattr__, __dir__, __all__ = lazy_face(
    __name__,
    {
        "map_reader": ("read_bare_picture", "read_map", "read_ros_map"),
        "map_writer": ("write_map", "write_raw_map"),
        "ros_map": ("RosMap",),
    },
)
