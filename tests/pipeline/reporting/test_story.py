"""The log of a recording: what is worth a line, and what is not."""

from typing import Any, cast

import numpy as np
import pytest
from shapely.geometry import Polygon, box

from closedrooms.core.door import ClosedDoor
from closedrooms.core.grid import FREE, UNKNOWN, GridFrame, OccupancyGrid
from closedrooms.core.pose import Pose2
from closedrooms.core.remarks import Remark
from closedrooms.core.room import Room
from closedrooms.core.scan import LaserScan
from closedrooms.mapping.logs.recorded_run import RecordedRun
from closedrooms.mapping.map_builder import build_map
from closedrooms.mapping.mapper import Mapper
from closedrooms.pipeline.reporting.log_observer import LogWatch
from closedrooms.pipeline.reporting.story import Story, summarise_run
from closedrooms.predictor.prediction import Prediction

FRAME = GridFrame(0.5, 0.0, 0.0, 20, 20)
NOTHING = OccupancyGrid(FRAME, np.full(FRAME.shape, UNKNOWN, dtype=np.int8))


class Told:
    """A recorder that keeps its notes and takes all else."""

    def __init__(self) -> None:
        self.notes: list[tuple[str, float | None]] = []

    def note(self, text: str, stamp: float | None = None) -> None:
        self.notes.append((text, stamp))

    def wants_map(self, _stamp: float) -> bool:
        return True

    def __getattr__(self, name: str) -> Any:
        return lambda *_args, **_more: None


@pytest.fixture
def told() -> Told:
    return Told()


def a_story(told: Told, **known: Any) -> Story:
    return Story(cast(Any, told), **known)


def known(cells: int) -> OccupancyGrid:
    grid = np.full(FRAME.shape, UNKNOWN, dtype=np.int8)
    grid.flat[:cells] = FREE
    return OccupancyGrid(FRAME, grid)


def predicted(**rooms: Polygon) -> Prediction:
    return Prediction(NOTHING, tuple(Room(shape, (door,)) for door, shape in rooms.items()), {"d9": "in free space"})


def doors(*ids: str) -> list[ClosedDoor]:
    return [ClosedDoor(name, (0.0, 0.0)) for name in ids]


def test_every_quarter_of_the_floor_is_told_once_and_a_jump_over_two_of_them_is_one_line(told: Told) -> None:
    floor = FRAME.to_points(np.argwhere(np.arange(400).reshape(FRAME.shape) < 100))
    story = a_story(told, floor=floor)
    for stamp, cells in ((1.0, 24), (2.0, 25), (3.0, 40), (4.0, 80), (5.0, 400)):
        story.known(known(cells), stamp)
    assert told.notes == [("25 % of the floor is known", 2.0), ("75 % of the floor is known", 4.0)]


def test_what_is_known_outside_does_not_count_and_floor_beyond_the_map_does(told: Told) -> None:
    inside = FRAME.to_points(np.argwhere(np.arange(400).reshape(FRAME.shape) >= 300))
    a_story(told, floor=inside).known(known(300), 1.0)
    assert told.notes == []
    a_story(told, floor=np.concatenate((inside, inside + 100.0))).known(known(400), 2.0)
    assert told.notes == [("50 % of the floor is known", 2.0)]


def test_loops_are_told_when_their_number_has_doubled(told: Told) -> None:
    story = a_story(told)
    for number in range(20):
        story.loops(number, float(number))
    assert told.notes == [
        ("first loop closed", 1.0),
        *((f"{number} loops closed by now", float(number)) for number in (2, 4, 8, 16)),
    ]


def test_each_kind_of_trouble_is_told_when_it_is_first_met(told: Told) -> None:
    story = a_story(told)
    gap, jump = (Remark(action="guessed", what=what, why="why") for what in ("gaps", "jumps"))
    for stamp, remarks in ((1.0, ()), (2.0, (gap,)), (3.0, (gap,)), (4.0, (gap, jump))):
        story.events(remarks, stamp)
    assert told.notes == [
        ("guessed gaps for the first time: why", 2.0),
        ("guessed jumps for the first time: why", 4.0),
    ]


def test_a_door_is_told_when_it_is_seen_and_its_room_when_it_becomes_another_one(told: Told) -> None:
    story = a_story(told, closed=3)
    story.doors(doors("d1"), 1.0, predicted(d1=box(0, 0, 4, 5)), {"d1": 0.25})
    story.doors(doors("d1", "d9"), 2.0, predicted(d1=box(0, 0, 4, 4.8)), {})  # much the same room
    story.doors(doors("d1", "d9"), 3.0)  # nothing was predicted
    story.doors(doors("d1", "d9"), 4.0, predicted(d1=box(0, 0, 4, 2), d9=box(5, 5, 6, 6)), {"d1": 0.5})
    assert told.notes == [
        ("closed door d1 seen (1 of 3); behind it: 20.0 m² (IoU 0.25)", 1.0),
        ("closed door d9 seen (2 of 3); behind it: nothing (in free space)", 2.0),
        (
            "prediction revised, behind d1 from 19.2 m² to 8.0 m² (IoU 0.50); "
            "d9 from nothing (in free space) to 1.0 m²",
            4.0,
        ),
    ]


def test_where_nothing_is_predicted_a_door_is_told_all_the_same(told: Told) -> None:
    a_story(told).doors(doors("d1"), 1.0)
    assert told.notes == [("closed door d1 seen", 1.0)]


def test_the_end_sums_up_what_is_known_and_leaves_out_what_is_not() -> None:
    figures = {
        "ate_m": 0.01234,
        "area_mapped": 0.985,
        "room_iou_mean": 0.9,
        "rooms_closed": 5,
        "tour": {"errors_percent": {"predicted": 0.71}},
    }
    assert summarise_run(figures) == (
        "in the end: 98.5 % of what can be reached is mapped, trajectory error 0.012 m (ATE), "
        "IoU 0.900 on average over 5 rooms, length of the tour predicted to 0.7 %"
    )
    unknown = {"area_mapped": None, "room_iou_mean": None, "tour": {"errors_percent": {"predicted": None}}}
    assert summarise_run(figures | unknown) == "in the end: trajectory error 0.012 m (ATE)"


def test_the_log_of_a_mapped_log_says_how_long_it_is_how_far_it_is_and_what_was_missing(told: Told) -> None:
    stamps = [*range(10), *range(40, 50)]
    scans = tuple(LaserScan(np.full(36, 2.0), -np.pi, np.pi / 18, 20.0, stamp=float(stamp)) for stamp in stamps)
    run = RecordedRun(scans, np.array([(0.02 * stamp, 0.0, 0.0) for stamp in stamps]), None)
    watch = LogWatch(cast(Any, told), run)
    watch.begin()

    def step(number: int, pose: Pose2, mapper: Mapper) -> None:
        watch(number, pose, mapper)

    watch.finish(build_map(run, watch=step))
    texts = [text for text, _ in told.notes]
    assert texts[0] == "20 scans over 49 s, odometry, without a reference"
    assert [text.partition(":")[0] for text in texts if text.startswith(("25", "50", "75"))] == [
        f"{quarter} % of the scans are in the map" for quarter in (25, 50, 75)
    ]
    assert "1 gap between scans, up to 31.0 s, after 9.0 s" in texts
