import numpy as np
import pytest

from closedrooms.core.door import ClosedDoor
from closedrooms.core.pose import Pose2
from closedrooms.core.scan import LaserScan
from closedrooms.mapping.beams import clean
from closedrooms.mapping.config import MapperConfig
from closedrooms.mapping.glass.before_glass import before_glass
from closedrooms.mapping.graph.keyframe import Keyframe
from closedrooms.mapping.log_odds_grid import EvidenceGrid
from closedrooms.mapping.mapper import Mapper
from closedrooms.navigation.tour.opened_doors import ReopenedMap, _outside

# A corridor along x, 2 m wide; in its upper wall at y = 1 a door from x = 2.05 to x = 2.95, a room of 3 m behind it.
DOOR = ClosedDoor("d00", (2.5, 1.0), ((2.05, 1.0), (2.95, 1.0)), 0.9)
WALLS = [((-3, -1), (8, -1)), ((-3, 1), (2.05, 1)), ((2.95, 1), (8, 1)), ((-3, -1), (-3, 1)), ((8, -1), (8, 1))]
ROOM = [((1, 1), (1, 4)), ((1, 4), (4, 4)), ((4, 4), (4, 1))]
LEAF = ((2.05, 1.0), (2.95, 1.0))


def _scan(pose: Pose2, segments: list, stamp: float) -> LaserScan:
    """An exact sweep of 720 beams."""
    angles = -np.pi + np.arange(720) * 2 * np.pi / 720
    directions = np.column_stack((np.cos(angles + pose.theta), np.sin(angles + pose.theta)))
    ranges = np.full(720, np.inf)
    for a, b in segments:
        start, along = np.array(a, dtype=float) - (pose.x, pose.y), np.subtract(b, a).astype(float)
        cross = directions[:, 0] * along[1] - directions[:, 1] * along[0]
        with np.errstate(divide="ignore", invalid="ignore"):
            t = (start[0] * along[1] - start[1] * along[0]) / cross
            s = (start[0] * directions[:, 1] - start[1] * directions[:, 0]) / cross
        hit = (t > 0) & (s >= 0) & (s <= 1)
        ranges[hit] = np.minimum(ranges[hit], t[hit])
    return LaserScan(ranges, -np.pi, 2 * np.pi / 720, 20.0, stamp=stamp)


def _drive(mapper: Mapper, xs: np.ndarray, segments: list, stamp: float) -> float:
    for x in xs:
        pose = Pose2(float(x), 0.0)
        mapper.process(_scan(pose, segments, stamp), pose)
        stamp += 0.1
    return stamp


def _leaf_cells(grid, depth: float = 0.1) -> np.ndarray:
    cells = np.argwhere(np.ones(grid.frame.shape, dtype=bool))
    points = grid.frame.to_points(cells)
    inside = (np.abs(points[:, 0] - 2.5) < 0.35) & (np.abs(points[:, 1] - 1.0) < depth)
    return grid.cells[cells[inside, 0], cells[inside, 1]]


def _mapper_after_many_passes() -> tuple[Mapper, float]:
    mapper = Mapper()
    stamp = 0.0
    for xs in (np.arange(0.0, 5.0, 0.2), np.arange(5.0, 0.0, -0.2)) * 2:
        stamp = _drive(mapper, xs, [*WALLS, LEAF], stamp)
    return mapper, stamp


def test_the_leaf_of_an_opened_door_is_gone_once_a_ray_has_passed() -> None:
    mapper, stamp = _mapper_after_many_passes()
    assert (_leaf_cells(mapper.grid()) > 65).any()
    reopened = ReopenedMap(mapper, [DOOR])
    assert not (_leaf_cells(reopened.grid()) > 65).any()  # void, and nothing new is known yet
    stamp = _drive(mapper, np.arange(0.0, 0.7, 0.2), [*WALLS, *ROOM], stamp)
    assert (_leaf_cells(mapper.grid()) > 65).any()  # the sums remember a little longer
    _drive(mapper, np.arange(0.8, 1.7, 0.2), [*WALLS, *ROOM], stamp)
    assert (np.abs(_leaf_cells(reopened.grid())) < 20).all()
    assert (_leaf_cells(reopened.grid()) >= 0).all()


def test_a_door_that_did_not_open_is_seen_again() -> None:
    mapper, stamp = _mapper_after_many_passes()
    reopened = ReopenedMap(mapper, [DOOR])
    _drive(mapper, np.arange(0.0, 2.6, 0.2), [*WALLS, LEAF], stamp)
    assert (_leaf_cells(reopened.grid()) > 65).any()


def test_a_door_that_waits_is_unknown_until_it_opens_and_seen_from_then_on() -> None:
    mapper, stamp = _mapper_after_many_passes()
    reopened = ReopenedMap(mapper, [DOOR], waiting=("d00",))
    stamp = _drive(mapper, np.arange(0.0, 2.6, 0.2), [*WALLS, LEAF], stamp)
    assert (_leaf_cells(reopened.grid()) < 65).all()  # not even what was seen since: it will open
    reopened.note_opened(["d00"])
    _drive(mapper, np.arange(2.6, 0.0, -0.2), [*WALLS, *ROOM], stamp)
    assert (np.abs(_leaf_cells(reopened.grid())) < 20).all()
    assert (_leaf_cells(reopened.grid()) >= 0).all()


def test_all_but_the_doorways_stays_as_the_mapper_has_it() -> None:
    mapper, stamp = _mapper_after_many_passes()
    reopened = ReopenedMap(mapper, [DOOR])
    _drive(mapper, np.arange(0.0, 0.9, 0.2), [*WALLS, *ROOM], stamp)
    own, theirs = reopened.grid(), mapper.grid()
    rows, cols = np.nonzero(own.cells != theirs.cells)
    points = own.frame.to_points(np.column_stack((rows, cols)))
    assert len(points)
    assert (np.abs(points[:, 0] - 2.5) <= 0.45).all()
    assert (np.abs(points[:, 1] - 1.0) <= 0.30).all()
    assert np.array_equal(ReopenedMap(mapper, []).grid().cells, theirs.cells)


@pytest.mark.parametrize(("y", "is_open"), [(0.5, False), (1.0, True)])
def test_a_pane_hides_the_doorway_behind_it_but_a_leaf_of_glass_went_with_its_door(y: float, is_open: bool) -> None:
    class AmongGlass(Mapper):
        panes = np.array([[[-3.0, y], [8.0, y]]])

    mapper = AmongGlass()
    stamp = 0.0
    for xs in (np.arange(0.0, 5.0, 0.2), np.arange(5.0, 0.0, -0.2)) * 2:
        stamp = _drive(mapper, xs, [*WALLS, LEAF], stamp)
    reopened = ReopenedMap(mapper, [DOOR])
    _drive(mapper, np.arange(0.0, 0.5, 0.2), [*WALLS, *ROOM], stamp)
    cells = _leaf_cells(reopened.grid(), 0.03)
    known = np.mean(cells >= 0)
    assert known > 0.8 if is_open else known < 0.2


class _Keyframes:
    """A map of keyframes that a test moves about."""

    def __init__(self, xs: list[float], segments: list) -> None:
        scans = [_scan(Pose2(x, 0.0), segments, float(n)) for n, x in enumerate(xs)]
        nothing = np.empty((0, 2))
        self.keyframes = [
            Keyframe(n, scan.stamp, Pose2(x, 0.0), clean(scan, max_range=20.0), nothing, nothing, 0.0)
            for n, (x, scan) in enumerate(zip(xs, scans, strict=True))
        ]
        self.panes = np.empty((0, 2, 2))

    def evidence(self, first: int) -> EvidenceGrid:
        """What the keyframes from one on say where they are now."""
        evidence = EvidenceGrid(MapperConfig())
        for keyframe in self.keyframes[first:]:
            evidence.add(before_glass(keyframe.beams, keyframe.pose, self.panes), keyframe.pose)
        return evidence

    def grid(self):
        return self.evidence(0).grid()

    def process(self, *_: object) -> Pose2:
        return Pose2()


def test_keyframes_that_moved_and_panes_that_were_found_are_counted_anew_and_others_once() -> None:
    mapper = _Keyframes([0.5, 1.5, 2.5, 3.5], [*WALLS, *ROOM])
    opened = ReopenedMap(mapper, [], MapperConfig())  # type: ignore[arg-type]
    opened._doors = (DOOR,)
    later, mapper.keyframes = mapper.keyframes[2:], mapper.keyframes[:2]
    opened.note_opened(["d00", "d99"])
    opened.note_opened(["d99"])
    (opening,) = opened._openings
    mapper.keyframes = [*mapper.keyframes, *later]

    def check() -> None:
        opened.grid()
        frame = mapper.grid().frame
        assert np.array_equal(opening.since.grid().on(frame).cells, mapper.evidence(2).grid().on(frame).cells)

    check()
    drawn = dict(opening.drawn)
    check()
    # What has not changed is not drawn again.
    assert all(opening.drawn[index] is entry for index, entry in drawn.items())
    assert sorted(drawn) == [2, 3]
    mapper.keyframes[2].pose = Pose2(2.5, 0.3, 0.1)
    check()
    assert opening.drawn[2] is not drawn[2]
    assert opening.drawn[3] is drawn[3]
    mapper.panes = np.array([[[5.0, -1.0], [5.0, 1.0]]])
    check()
    mapper.panes = np.empty((0, 2, 2))
    check()


def test_panes_within_the_reach_of_a_leaf_went_with_their_door() -> None:
    panes = np.array(
        [[[2.1, 1.0], [2.9, 1.0]], [[2.1, 1.29], [2.9, 1.29]], [[2.1, 1.31], [2.9, 1.31]], [[5.0, 1.0], [6.0, 1.0]]]
    )
    assert np.array_equal(_outside(panes, [DOOR]), panes[2:])
    assert _outside(panes, [ClosedDoor("d", (2.5, 1.0))]) is panes
    assert _outside(panes[:0], [DOOR]).shape == (0, 2, 2)
    assert _outside(panes, []) is panes
