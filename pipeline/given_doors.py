"""The closed doors that a person gives: GeoJSON, or points clicked in RViz."""

from pathlib import Path

from closedrooms.core.door import ClosedDoor
from closedrooms.core.files.geojson import read_doors
from closedrooms.core.remarks import Remark


def given_doors(path: Path, remarks: list[Remark]) -> list[ClosedDoor]:
    """Read closed doors from GeoJSON or from a bag of geometry_msgs/PointStamped, in the map frame.

    Args:
        path: The file, or the folder of a rosbag 2.
        remarks: Told what was left out or named here.

    Raises:
        InvalidInputError: See :func:`closedrooms.core.files.geojson.read_doors`,
            :func:`closedrooms.mapping.logs.bags.clicked_points.read_clicked_points`.
    """
    from closedrooms.mapping.logs.bags.clicked_points import is_bag, read_clicked_points

    return read_clicked_points(path, remarks=remarks) if is_bag(path) else read_doors(path, remarks=remarks)
