"""Messages of a bag, made by hand: which topics are read, and what of each is kept."""

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from closedrooms.core.errors import InvalidInputError
from closedrooms.mapping.logs.bags import bag_messages
from closedrooms.mapping.logs.bags.bag_messages import ODOMETRY, TRANSFORMS, choose_connections, read_messages, stamp_of
from closedrooms.mapping.logs.bags.bag_options import BagOptions
from closedrooms.mapping.logs.bags.bag_scans import ECHOES, SCAN

TF = TRANSFORMS[0]


def topic(name: str, kind: str, count: int = 1) -> SimpleNamespace:
    return SimpleNamespace(topic=name, msgtype=kind, msgcount=count)


def chosen(*connections: SimpleNamespace, **options: Any) -> list[str]:
    return [connection.topic for connection in choose_connections(connections, BagOptions(**options))[0]]


def header(seconds: int, nanoseconds: int = 0, frame: str = "odom") -> SimpleNamespace:
    return SimpleNamespace(stamp=SimpleNamespace(sec=seconds, nanosec=nanoseconds), frame_id=frame)


def point(x: float, y: float, z: float = 0.0) -> SimpleNamespace:
    return SimpleNamespace(x=x, y=y, z=z)


def turn(theta: float) -> SimpleNamespace:
    return SimpleNamespace(x=0.0, y=0.0, z=math.sin(theta / 2), w=math.cos(theta / 2))


def odometry(x: float, theta: float, child: str = "base_link") -> SimpleNamespace:
    pose = SimpleNamespace(position=point(x, 2.0, 7.0), orientation=turn(theta))
    return SimpleNamespace(header=header(3, 250_000_000), pose=SimpleNamespace(pose=pose), child_frame_id=child)


def transforms(*turns: SimpleNamespace) -> SimpleNamespace:
    made = [
        SimpleNamespace(
            header=header(4), child_frame_id=f"child{number}",
            transform=SimpleNamespace(translation=point(1.0, 0.0), rotation=rotation),
        )
        for number, rotation in enumerate(turns)
    ]  # fmt: skip
    return SimpleNamespace(transforms=made)


class Reader:
    """A bag of messages that are there already; a message that is an error cannot be read."""

    def __init__(self, *messages: tuple[str, str, int, Any]) -> None:
        self._messages = messages

    def messages(self, connections: list[SimpleNamespace]) -> Any:
        for name, kind, recorded, message in self._messages:
            if any(connection.topic == name for connection in connections):
                yield topic(name, kind), recorded, message

    def deserialize(self, data: Any, _: str) -> Any:
        if isinstance(data, Exception):
            raise data
        return data


def test_a_stamp_is_seconds_and_nanoseconds() -> None:
    assert stamp_of(SimpleNamespace(header=header(3, 250_000_000))) == pytest.approx(3.25)


def test_one_topic_of_scans_one_of_odometry_and_all_transforms_are_read() -> None:
    bag = [
        topic("/scan", SCAN),
        topic("/odom", ODOMETRY),
        topic("/tf", TF),
        topic("/tf_static", TF),
        topic("/x", "std/Y"),
    ]
    assert chosen(*bag) == ["/scan", "/odom", "/tf", "/tf_static"]
    assert chosen(*bag[:1]) == ["/scan"]
    # Transforms that are asked for are the odometry.
    assert chosen(*bag, odometry_topic="/tf") == ["/scan", "/tf", "/tf_static"]
    # A topic without messages is none.
    assert chosen(*bag, topic("/other", SCAN, 0)) == ["/scan", "/odom", "/tf", "/tf_static"]
    both = [topic("/a", SCAN), topic("/b", SCAN)]
    assert chosen(*both, scan_topic="/b") == ["/b"]


def test_plain_scans_go_before_echoes() -> None:
    bag = [topic("/scan", SCAN), topic("/echoes", ECHOES)]
    connections, (remark,) = choose_connections(bag, BagOptions())
    assert [connection.topic for connection in connections] == ["/scan"]
    assert (remark.what, remark.names, remark.why) == ("topics of scans", ("/echoes",), "/scan is taken")
    assert chosen(*bag, scan_topic="/echoes") == ["/echoes"]
    assert chosen(bag[1]) == ["/echoes"]
    assert choose_connections(bag[1:], BagOptions())[1] == []


@pytest.mark.parametrize(
    ("bag", "options", "message"),
    [
        ([], {}, "no topic of sensor_msgs/LaserScan or MultiEchoLaserScan, but no messages"),
        ([topic("/odom", ODOMETRY)], {}, "no topic of sensor_msgs.*, but nav_msgs/msg/Odometry"),
        ([topic("/a", SCAN), topic("/b", SCAN)], {}, "2 topics of sensor_msgs.*expected one of /a, /b"),
        ([topic("/a", SCAN)], {"scan_topic": "/b"}, "no topic /b; expected one of /a"),
        ([topic("/a", SCAN)], {"odometry_topic": "/b"}, "no topic /b of nav_msgs/Odometry, but sensor_msgs"),
        ([topic("/a", SCAN), topic("/o", ODOMETRY)], {"odometry_topic": "/b"}, "no topic /b; expected one of /o"),
    ],
)
def test_topics_that_are_not_there_are_named(bag: list[Any], options: dict[str, Any], message: str) -> None:
    with pytest.raises(InvalidInputError, match=message):
        chosen(*bag, **options)


def test_messages_are_kept_with_the_time_of_their_recording() -> None:
    connections = [topic("/scan", SCAN), topic("/odom", ODOMETRY), topic("/tf", TF)]
    reader = Reader(
        ("/scan", SCAN, 1_500_000_000, "first"),
        ("/odom", ODOMETRY, 2_500_000_000, odometry(1.0, 0.5, "/base_link")),
        ("/other", SCAN, 1, "not asked for"),
        ("/scan", ECHOES, 3_500_000_000, "second"),
        ("/odom", ODOMETRY, 4_500_000_000, odometry(2.0, -0.5, "")),
    )
    messages = read_messages(reader, connections)
    assert messages.scans == [("first", pytest.approx(1.5)), ("second", pytest.approx(3.5))]
    assert np.array(messages.odometry) == pytest.approx(
        np.array([[3.25, 2.5, 1.0, 2.0, 0.5], [3.25, 4.5, 2.0, 2.0, -0.5]])
    )
    assert messages.base == "base_link"
    assert (dict(messages.broken), messages.surplus) == ({}, 0)


def test_broken_messages_are_counted_and_spoil_nothing() -> None:
    connections = [topic("/scan", SCAN), topic("/odom", ODOMETRY), topic("/tf", TF)]
    none = SimpleNamespace(x=0.0, y=0.0, z=0.0, w=0.0)
    reader = Reader(
        ("/scan", SCAN, 0, ValueError("broken")),
        ("/scan", SCAN, 0, "whole"),
        ("/scan", ECHOES, 0, ValueError("broken")),
        ("/odom", ODOMETRY, 0, "no odometry"),
        ("/tf", TF, 0, transforms(turn(0.0), none, none, turn(1.0))),
    )
    messages = read_messages(reader, connections)
    assert messages.broken == {"scans": 2, "messages of motion": 1, "transforms": 2}
    assert [scan for scan, _ in messages.scans] == ["whole"]


def test_scans_beyond_what_a_run_may_hold_are_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bag_messages, "MAX_SCANS", 2)
    reader = Reader(*(("/scan", SCAN, n, n) for n in range(5)))
    messages = read_messages(reader, [topic("/scan", SCAN)])
    assert ([scan for scan, _ in messages.scans], messages.surplus) == ([0, 1], 3)
