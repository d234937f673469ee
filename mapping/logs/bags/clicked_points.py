"""Doors that a person clicked in RViz: a bag of geometry_msgs/PointStamped, through the optional ``rosbags``."""

import math
from pathlib import Path

from closedrooms.core.door import ClosedDoor
from closedrooms.core.errors import InvalidInputError
from closedrooms.core.files.incoming import is_folder
from closedrooms.core.remarks import Remark

POINT = "geometry_msgs/msg/PointStamped"
BAGS = {".mcap", ".db3", ".bag"}
MAP = "map"
# As many as a list of doors may hold.
MOST = 10_000


def is_bag(path: Path) -> bool:
    """Check whether a path looks like a bag rather than a list of doors."""
    return is_folder(path) or path.suffix.lower() in BAGS


def read_clicked_points(path: Path, *, remarks: list[Remark] | None = None) -> list[ClosedDoor]:
    """Read the points of RViz's tool *Publish Point* as the middles of closed doors, numbered as they were clicked.

    Args:
        path: A bag that holds ``/clicked_point`` or one other topic of PointStamped.
        remarks: Told what was dropped.

    Raises:
        InvalidInputError: ``rosbags`` is not installed, a broken bag, no points or several topics of them, points of
            another frame than the map's.
    """
    # Every list of doors asks whether it is a bag; only a bag needs its readers.
    from closedrooms.mapping.logs.bags.rosbag import opened_bag

    places: list[tuple[float, float]] = []
    told: list[Remark] = []
    broken = 0
    with opened_bag(path, told) as reader:
        topics = {connection.topic for connection in reader.connections if connection.msgtype == POINT}
        topic = "/clicked_point" if "/clicked_point" in topics else next(iter(topics), None)
        if topic is None or (len(topics) > 1 and topic != "/clicked_point"):
            what = f"{len(topics)} topics of PointStamped" if topics else "no PointStamped in the bag"
            raise InvalidInputError(what, expected="points clicked in RViz on /clicked_point", where=path)
        for connection, _, data in reader.messages(connections=[c for c in reader.connections if c.topic == topic]):
            message = reader.deserialize(data, connection.msgtype)
            frame = message.header.frame_id.lstrip("/")
            if frame != MAP:
                raise InvalidInputError(
                    f"points in the frame {frame!r}", expected="fixed frame map in RViz", where=path
                )
            x, y = float(message.point.x), float(message.point.y)
            if not (math.isfinite(x) and math.isfinite(y)):
                broken += 1
            elif len(places) >= MOST:
                raise InvalidInputError(f"more than {MOST} points", expected="a point a door", where=path)
            else:
                places.append((x, y))
    if broken:
        why = "no finite coordinates"
        told.append(Remark(action="dropped", what="points", why=why, count=broken, loss=True))
    if remarks is not None:
        remarks.extend(told)
    return [ClosedDoor(f"d{number:02d}", place) for number, place in enumerate(places)]
