"""The messages of a bag that say something of a robot's motion and scans, read one by one."""

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

from closedrooms.core.errors import InvalidInputError
from closedrooms.core.remarks import Remark
from closedrooms.mapping.logs.bags.bag_options import BagOptions
from closedrooms.mapping.logs.bags.bag_scans import ECHOES, SCAN
from closedrooms.mapping.logs.bags.transform_tree import TransformTree, clean_name, seen_from_above, transform_matrix

ODOMETRY = "nav_msgs/msg/Odometry"
TRANSFORMS = ("tf2_msgs/msg/TFMessage", "tf/msg/tfMessage")
MAX_SCANS = 2_000_000


@dataclass(slots=True)
class BagMessages:
    """Messages of a bag, in their order there; each with the time of its recording [s].

    Attributes:
        scans: Messages of the scans.
        odometry: ``header stamp, recording time, x, y, yaw`` of each.
        base: Frame of the robot that the odometry moves.
        frame: Frame that it moves in.
        tree: The transforms.
        broken: Messages that could not be read, by what they should hold.
        surplus: Scans beyond ``MAX_SCANS``.
    """

    scans: list[tuple[Any, float]] = field(default_factory=list)
    odometry: list[tuple[float, float, float, float, float]] = field(default_factory=list)
    base: str = ""
    frame: str = ""
    tree: TransformTree = field(default_factory=TransformTree)
    broken: Counter[str] = field(default_factory=Counter)
    surplus: int = 0


def choose_connections(connections: Iterable[Any], options: BagOptions) -> tuple[list[Any], list[Remark]]:
    """Choose the connections of one topic of scans, at most one of odometry, and all transforms."""
    remarks = []
    topics: dict[str, set[str]] = {}
    for connection in connections:
        if connection.msgcount:
            topics.setdefault(connection.msgtype, set()).add(connection.topic)
    scans, echoes = topics.get(SCAN, set()), topics.get(ECHOES, set())
    if options.scan_topic is None and len(scans) == 1 and echoes:
        why = f"{', '.join(sorted(scans))} is taken"
        remarks.append(Remark(action="dropped", what="topics of scans", why=why, names=tuple(sorted(echoes))))
        echoes = set()
    scan = _topic(scans | echoes, options.scan_topic, "sensor_msgs/LaserScan or MultiEchoLaserScan", topics)
    transforms = set().union(*(topics.get(kind, set()) for kind in TRANSFORMS))
    others = {topic for topic in transforms if topic != options.odometry_topic and not _beside(topic, scan)}
    if 0 < len(others) < len(transforms):
        why = f"{scan} lies in another namespace"
        remarks.append(Remark(action="dropped", what="transforms", why=why, names=tuple(sorted(others))))
        transforms -= others
    odometry = topics.get(ODOMETRY, set())
    asked = options.odometry_topic
    taken = {scan, *transforms}
    if asked not in transforms and (odometry or asked is not None):
        taken.add(_topic(odometry, asked, "nav_msgs/Odometry", topics))
    kinds = {SCAN, ECHOES, ODOMETRY, *TRANSFORMS}
    return [c for c in connections if c.topic in taken and c.msgtype in kinds], remarks


def _beside(topic: str, scan: str) -> bool:
    """Check whether a topic lies in the namespace of the scans or one around it: robots share names of frames."""
    return f"/{scan.strip('/')}".startswith(f"/{topic.strip('/')}".rpartition("/")[0] + "/")


def _topic(found: set[str], asked: str | None, kind: str, topics: dict[str, set[str]]) -> str:
    """Choose the topic of a kind: the one asked for, or the only one; else say which there are."""
    if asked is not None and asked in found:
        return asked
    if asked is None and len(found) == 1:
        return next(iter(found))
    if found:
        what = f"no topic {asked}" if asked is not None else f"{len(found)} topics of {kind}"
        raise InvalidInputError(what, expected=f"one of {', '.join(sorted(found))}")
    holds = ", ".join(sorted(topics)) or "no messages"
    what = f"no topic {asked} of {kind}" if asked is not None else f"no topic of {kind}"
    raise InvalidInputError(f"{what}, but {holds}", expected="a bag of a planar lidar")


def read_messages(reader: Any, connections: list[Any]) -> BagMessages:
    """Read the messages of some connections, in the order of the bag; broken ones are counted."""
    messages = BagMessages()
    for connection, recorded, data in reader.messages(connections=connections):
        kind = connection.msgtype
        try:
            message = reader.deserialize(data, kind)
            if kind in {SCAN, ECHOES}:
                _take_scan(messages, message, 1e-9 * recorded)
            elif kind == ODOMETRY:
                _take_odometry(messages, message, 1e-9 * recorded)
            else:
                static = connection.topic.endswith("tf_static")
                _take_transforms(messages, message, 1e-9 * recorded, static=static)
        except Exception:  # as above: one broken message does not spoil the bag
            messages.broken["scans" if kind in {SCAN, ECHOES} else "messages of motion"] += 1
    return messages


def _take_scan(messages: BagMessages, message: Any, recorded: float) -> None:
    """Keep a scan with the time it was recorded at [s]; beyond the limit it is only counted."""
    if len(messages.scans) >= MAX_SCANS:
        messages.surplus += 1
        return
    messages.scans.append((message, recorded))


def _take_odometry(messages: BagMessages, message: Any, recorded: float) -> None:
    """Keep a pose as stamp, recording time [s], x, y [m] and yaw [rad], and the frame that moves."""
    pose = message.pose.pose
    turned, at = pose.orientation, pose.position
    matrix = transform_matrix((at.x, at.y, at.z), (turned.x, turned.y, turned.z, turned.w))
    messages.odometry.append((stamp_of(message), recorded, *seen_from_above(matrix)))
    messages.frame = clean_name(message.header.frame_id)
    messages.base = clean_name(message.child_frame_id) or messages.base


def _take_transforms(messages: BagMessages, message: Any, recorded: float, *, static: bool) -> None:
    """Add transforms to the tree of frames; those that are no rotation are counted as broken."""
    for stamped in message.transforms:
        shift, turn = stamped.transform.translation, stamped.transform.rotation
        try:
            matrix = transform_matrix((shift.x, shift.y, shift.z), (turn.x, turn.y, turn.z, turn.w))
        except InvalidInputError:
            messages.broken["transforms"] += 1
            continue
        messages.tree.add(
            stamped.header.frame_id,
            stamped.child_frame_id,
            matrix,
            static=static,
            stamp=stamp_of(stamped),
            recorded=recorded,
        )


def stamp_of(message: Any) -> float:
    """Time in the header of a message [s]."""
    stamp = message.header.stamp
    return float(stamp.sec) + 1e-9 * float(stamp.nanosec)
