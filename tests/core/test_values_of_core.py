"""What the values of the core are when little is said of them, and what they refuse."""

import math

import numpy as np
import pytest
from shapely.geometry import box

from closedrooms.core.arrays import frozen, handed_over
from closedrooms.core.door import ClosedDoor, DoorSighting
from closedrooms.core.errors import InvalidInputError
from closedrooms.core.observation import Observation
from closedrooms.core.pose import Pose2
from closedrooms.core.report import Report
from closedrooms.core.robot import RobotConfig
from closedrooms.core.room import Alternative, Room
from closedrooms.core.scan import LaserScan


def test_a_room_of_which_little_is_said_is_a_true_one() -> None:
    room = Room(box(0, 0, 1, 1), ("d",))
    assert (room.kind, room.score, room.bounded, room.confidence, room.outside) == (None, None, False, None, None)
    assert room.alternatives == ()


@pytest.mark.parametrize(
    "value",
    [
        Room(box(0, 0, 1, 1), ("d",)),
        Alternative(box(0, 0, 1, 1), 0.5),
        ClosedDoor("d", (0.0, 0.0)),
        DoorSighting("d", ((0.0, 0.0), (1.0, 0.0)), 0.0),
        Pose2(),
        Observation(LaserScan(np.zeros(2), 0.0, 0.1, 10.0), Pose2()),
        Report(folder="out", title="t", rows=[("a",)]),
        RobotConfig(),
    ],
)
def test_values_cannot_be_changed(value: object) -> None:
    name = next(iter(type(value).__dataclass_fields__))  # type: ignore[attr-defined]
    with pytest.raises(AttributeError):
        setattr(value, name, getattr(value, name))


def test_two_reports_are_two_and_their_fields_are_named() -> None:
    one, other = (Report(folder="out", title="t", rows=[("a",)]) for _ in range(2))
    assert len({one, other}) == 2
    with pytest.raises(TypeError):
        Report("out", "t", [("a",)])
    with pytest.raises(TypeError):
        RobotConfig(0.2)


def test_an_observation_has_the_stamp_of_its_sweep_and_nothing_that_was_not_seen() -> None:
    scan = LaserScan(np.zeros(2), 0.0, 0.1, 10.0, stamp=4.5)
    seen = Observation(scan, Pose2(1.0, 2.0, 3.0))
    assert (seen.stamp, seen.sightings, seen.bumps) == (4.5, (), ())
    assert len({seen, Observation(scan, Pose2(1.0, 2.0, 3.0))}) == 2


@pytest.mark.parametrize("width", [0.0, -1.0, math.nan, math.inf])
def test_a_door_without_a_finite_width_above_zero_is_refused(width: float) -> None:
    with pytest.raises(InvalidInputError, match=r"^door d of width .*; expected a width above 0 m$"):
        ClosedDoor("d", (0.0, 0.0), width=width)


@pytest.mark.parametrize("point", [(math.nan, 0.0), (0.0, math.inf)])
def test_a_door_with_one_coordinate_that_is_not_finite_is_refused(point: tuple[float, float]) -> None:
    segments = (((0.0, 0.0), point), (point, (0.0, 0.0)))
    for midpoint, segment in ((point, None), *(((0.0, 0.0), segment) for segment in segments)):
        with pytest.raises(InvalidInputError, match=r"^door d at .*; expected finite coordinates in metres$"):
            ClosedDoor("d", midpoint, segment)


def test_a_moved_door_keeps_what_does_not_depend_on_the_frame() -> None:
    door = ClosedDoor("d", (1.0, 0.0), None, 0.9, "unsure")
    moved = door.moved(Pose2(2.0, 3.0, math.pi / 2))
    assert (moved.id, moved.segment, moved.width, moved.state) == ("d", None, 0.9, "unsure")
    assert moved.midpoint == pytest.approx((2.0, 4.0))
    assert ClosedDoor("d", (0.0, 0.0)).state == "closed"


@pytest.mark.parametrize("name", sorted(RobotConfig.__dataclass_fields__))
@pytest.mark.parametrize("value", [0.0, -1.0, math.nan, math.inf])
def test_a_robot_without_size_or_speed_is_refused(name: str, value: float) -> None:
    with pytest.raises(InvalidInputError, match=rf"^robot {name} .*; expected a finite number above 0$"):
        RobotConfig(**{name: value})
    assert getattr(RobotConfig(**{name: 1e-3}), name) == 1e-3


def test_frozen_arrays_are_copies_of_what_somebody_may_still_change() -> None:
    writable = np.arange(6.0).reshape(2, 3)
    kept = frozen(writable)
    writable[0, 0] = 9.0
    assert kept[0, 0] == 0.0
    assert not kept.flags.writeable
    assert writable.flags.writeable
    part = frozen(writable[:, 1:])
    writable[0, 1] = 9.0
    assert part[0, 0] == 1.0
    # What nobody can change any more is taken as it is; another type or order is made anew.
    assert frozen(kept) is kept
    assert frozen(kept, np.int8).dtype == np.int8
    assert frozen(np.asfortranarray(writable)).flags.c_contiguous
    assert frozen([1, 2]).dtype == np.float64
    cells = np.zeros(3, dtype=np.int8)
    assert handed_over(cells) is cells
    assert frozen(cells, np.int8) is cells

    # A view of an array that somebody else holds, of the type asked for and yet another object.
    class Held:
        def __array__(self, dtype=None, copy=None):
            return writable[0]

    seen = frozen(Held())
    writable[0, 0] = 5.0
    assert seen[0] == 9.0
