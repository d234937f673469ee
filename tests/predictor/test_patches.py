"""What the network is shown, cell by cell, and how what it says is read: no network is needed for that."""

import math

import numpy as np
import pytest
import shapely

from closedrooms.core.door import ClosedDoor
from closedrooms.predictor.best.door_frame import TurnedMap
from closedrooms.predictor.best.door_pose import DoorPose
from closedrooms.predictor.best.hypotheses import Hypotheses, Proposals
from closedrooms.predictor.confidence.belief import Belief, Spread
from closedrooms.predictor.learned import ratings
from closedrooms.predictor.learned.mask_belief import MASK, believe_cells
from closedrooms.predictor.learned.model import BATCH, Model
from closedrooms.predictor.learned.patches import (
    AHEAD,
    ASIDE,
    BEHIND,
    CELL,
    FINE,
    LEAF,
    SIZE,
    Patch,
    _cut_patch,
    _draw_door,
    sample_cells,
)
from closedrooms.predictor.learned.ratings import OVERLAP, Rater
from closedrooms.predictor.learned.seen_room import SeenRoom, read_room
from closedrooms.predictor.prediction import WeighedRoom
from closedrooms.predictor.structure.doorways import FacingDoor

FINE_SIDE = SIZE * FINE


def _map(angle=0.0, rows=150, cols=110):
    """Random cells, a quarter of them unknown, a quarter occupied."""
    dice = np.random.default_rng(5).random((rows, cols))
    return TurnedMap(angle, np.array([-1.5, 2.5]), 0.05, dice < 0.5, dice < 0.75)


def _pose(turned, col, row, quarter, name="d", **stated):
    """A door at an edge of the turned map."""
    x, y = turned.to_map(np.array([col, row], dtype=float)).tolist()
    way = turned.angle + quarter * math.pi / 2
    door = FacingDoor(ClosedDoor(name, (x, y), **stated), np.array([-math.sin(way), math.cos(way)]))
    return DoorPose(door, turned.angle, quarter)


# Of the fine cells along each side of a patch every eleventh is looked up: as many as two in five of its cells hold.
SOME = np.arange(0, FINE_SIDE, 11)


def _looked_up(turned, pose):
    """The kinds of some fine cells of a patch, by the places of their centres in the map."""
    along, inward = pose.facing.along, pose.facing.inward
    corner = pose.facing.middle - ASIDE * along - BEHIND * inward
    steps = (SOME + 0.5) * turned.resolution
    points = corner + steps[:, None, None] * inward + steps[None, :, None] * along
    cols, rows = np.moveaxis(np.floor(turned.to_frame(points) + 1e-6).astype(int), -1, 0)
    inside = (rows >= 0) & (rows < turned.free.shape[0]) & (cols >= 0) & (cols < turned.free.shape[1])
    found = np.zeros(inside.shape, dtype=int)
    found[inside] = turned.known[rows[inside], cols[inside]].astype(int) + turned.free[rows[inside], cols[inside]]
    return found


@pytest.mark.parametrize("angle", [0.0, 0.3])
@pytest.mark.parametrize("quarter", range(4))
def test_a_patch_holds_the_cells_ahead_of_the_door_and_around_it(angle, quarter):
    turned = _map(angle)
    for col, row in ((60, 70), (3, 140), (400, 30), (900, 900)):
        pose = _pose(turned, col, row, quarter)
        cells = sample_cells(turned, pose)
        assert np.array_equal(cells[np.ix_(SOME, SOME)], _looked_up(turned, pose))
        patch = _cut_patch(turned, pose, (pose,))
        blocks = cells.reshape(SIZE, FINE, SIZE, FINE)
        np.testing.assert_allclose(patch.channels[0], (blocks == 2).mean(axis=(1, 3)), atol=1e-6)
        np.testing.assert_allclose(patch.channels[1], (blocks == 1).mean(axis=(1, 3)), atol=1e-6)
        np.testing.assert_allclose(patch.channels[:3].sum(axis=0), 1.0)
        assert patch.along == pytest.approx(pose.facing.along)
        assert patch.inward == pytest.approx(pose.facing.inward)
        assert patch.door == pytest.approx([ASIDE, BEHIND])
        assert patch.to_patch(pose.facing.middle) == pytest.approx(patch.door)
        ahead = pose.facing.middle + 3.0 * pose.facing.inward - 1.0 * pose.facing.along
        assert patch.to_patch(ahead) == pytest.approx([ASIDE - 1.0, BEHIND + 3.0])
        assert not patch.channels[4].any()


def test_a_door_between_cells_has_a_patch_of_whole_ones():
    turned = _map()
    between, whole = _pose(turned, 60.4, 69.6, 0), _pose(turned, 60, 70, 0)
    assert np.array_equal(sample_cells(turned, between), sample_cells(turned, whole))
    patch = _cut_patch(turned, between, (between,))
    assert patch.door == pytest.approx([ASIDE + 0.4 * 0.05, BEHIND - 0.4 * 0.05])


def test_a_patch_is_as_large_as_a_room_may_be():
    assert (SIZE, CELL, FINE, ASIDE, AHEAD) == (128, 0.25, 5, 16.0, 24.0)


def _patch():
    return Patch(
        np.zeros((5, SIZE, SIZE)), np.zeros(2), np.array([1.0, 0.0]), np.array([0.0, 1.0]), np.array([16.0, 8.0])
    )


def _drawn(x, y, along=(1.0, 0.0), **stated):
    channel = np.zeros((SIZE, SIZE))
    inward = np.array([-along[1], along[0]])
    _draw_door(channel, _patch(), DoorPose(FacingDoor(ClosedDoor("d", (x, y), **stated), inward), 0.0, 0))
    assert set(np.unique(channel)) <= {0.0, 1.0}
    return {(int(row), int(col)) for row, col in np.argwhere(channel)}


def test_a_leaf_is_drawn_along_its_wall_as_wide_as_it_is():
    # From 15.5 to 16.5 m: the cells 62 to 66, of which the last begins at 16.5.
    assert _drawn(16.0, 8.1, width=1.0) == {(32, col) for col in range(62, 67)}
    assert _drawn(16.0, 8.1, width=0.98) == {(32, col) for col in range(62, 66)}
    assert LEAF == 0.9
    assert _drawn(16.1, 8.1) == {(32, col) for col in range(62, 67)}  # 15.65 to 16.55
    assert _drawn(10.1, 20.0, along=(0.0, 1.0), width=0.6) == {(row, 40) for row in (78, 79, 80, 81)}
    # What the door's own segment says counts for nothing.
    assert _drawn(16.0, 8.1, width=1.0, segment=((10.0, 8.0), (20.0, 8.0))) == {(32, col) for col in range(62, 67)}


def test_a_leaf_beyond_the_patch_is_left_out():
    assert _drawn(-3.0, 8.0) == set()
    assert _drawn(32.0, 8.1, width=1.0) == {(32, 126), (32, 127)}
    # So far away that its cells would have no number.
    assert _drawn(1e9, 8.0) == set()
    assert _drawn(16.0, -1e9) == set()


def test_the_own_door_and_the_others_have_channels_of_their_own():
    turned = _map()
    own, near, far = (
        _pose(turned, 60, 70, 0, "own"),
        _pose(turned, 100, 70, 0, "near"),
        _pose(turned, 60, 130, 2, "far"),
    )
    patch = _cut_patch(turned, own, (far, own, near))
    leaf = np.zeros((SIZE, SIZE), dtype=bool)
    # 16 m and 8 m in: from 15.55 to 16.45 m.
    leaf[32, 62:66] = True
    assert np.array_equal(patch.channels[3] > 0, leaf)
    others = {(int(row), int(col)) for row, col in np.argwhere(patch.channels[4])}
    # 2 m to the right, and 3 m ahead.
    assert others == {(32, col) for col in range(70, 74)} | {(44, col) for col in range(62, 66)}


class _Words(Model):
    """A network that says of every patch what is in its first two channels."""

    def __init__(self):
        self.asked = []

    def ask(self, patches):
        self.asked.append(len(patches))
        assert patches.dtype == np.float32
        # Of the unknown cells by their column as well, so that it tells a patch from its mirror image.
        return patches[:, 0] + patches[:, 1] * np.arange(SIZE)


def test_what_is_said_of_a_patch_and_of_its_mirror_image_is_averaged():
    rng = np.random.default_rng(1)
    patches = []
    for _ in range(BATCH + 3):
        channels = rng.normal(size=(5, SIZE, SIZE))
        patches.append(Patch(channels, np.zeros(2), np.array([1.0, 0.0]), np.array([0.0, 1.0]), np.zeros(2)))
    words = _Words()
    rooms = words.look(patches)
    assert words.asked == [2 * BATCH, 6]
    for patch, room in zip(patches, rooms, strict=True):
        # The mirror image turned back is the patch; the columns of the two add up to the last one.
        same = read_room(patch, patch.channels[0] + patch.channels[1] * (SIZE - 1) / 2)
        for name in ("mask", "unknown"):
            np.testing.assert_allclose(getattr(room, name), getattr(same, name), atol=1e-5)


def test_logits_become_probabilities():
    mask = np.random.default_rng(2).normal(size=(SIZE, SIZE))
    mask[0, 0], mask[0, 1] = 1e6, -1e6
    patch = _patch()
    patch.channels[2, 3, 4] = 0.25
    room = read_room(patch, mask)
    np.testing.assert_allclose(room.mask[1:], 1.0 / (1.0 + np.exp(-mask[1:])))
    assert room.mask[0, :2] == pytest.approx([1.0, 0.0], abs=1e-9)
    assert (room.mask[0, :2] > 0.0).all()
    assert (room.unknown[3, 4], room.unknown.sum()) == (0.25, 0.25)


def _room(seed):
    rng = np.random.default_rng(seed)
    return SeenRoom(rng.random((SIZE, SIZE)), np.ones((SIZE, SIZE)))


def _heard(**doors):
    """Patches with their lower left corners at given places, and what was said of each."""
    axes = np.array([1.0, 0.0]), np.array([0.0, 1.0])
    return {
        name: (Patch(np.zeros((5, SIZE, SIZE)), np.array(corner, float), *axes, np.zeros(2)), _room(seed))
        for seed, (name, corner) in enumerate(doors.items())
    }


def _corners(*boxes):
    return np.array([[(x0, y0), (x1, y0), (x1, y1), (x0, y1)] for x0, y0, x1, y1 in boxes], dtype=float)


def _hypotheses(*boxes, scores):
    cells = np.array(boxes, dtype=np.int64)
    measured = np.arange(2.0 * len(boxes)).reshape(-1, 2)
    return Hypotheses(cells, _corners(*boxes), np.array(scores), 0.0, 0, 1.0, 2.0, measured)


BOXES = ((14, 8, 18, 12), (13, 8, 19, 14), (15, 8, 20, 11))


def test_rectangles_are_rated_by_what_each_of_their_doors_heard_on_average():
    rater = Rater(None, 3, _heard(a=(0, 0), b=(1, 0)))
    own, other = (rater.heard[name][1] for name in "ab")
    boxes = np.array(BOXES, dtype=float)
    moved = boxes - np.array([1.0, 0.0, 1.0, 0.0])
    said = rater.hear(["a"], _corners(*BOXES))
    assert said == pytest.approx(own.rate(boxes))
    assert rater.hear(["a", "b"], _corners(*BOXES)) == pytest.approx((said + other.rate(moved)) / 2)


@pytest.mark.parametrize("keep", [1, 2, 9])
def test_what_the_network_says_is_added_to_the_scores_and_the_best_are_kept(monkeypatch, keep):
    rater = Rater(None, keep)
    heard = _heard(a=(0, 0), b=(1, 0))
    monkeypatch.setattr(ratings, "cut_patches", lambda _: [patch for patch, _ in heard.values()])

    class Scene:
        poses = tuple(DoorPose(FacingDoor(ClosedDoor(name, (0.0, 0.0)), np.zeros(2)), 0.0, 0) for name in heard)

    class Network:
        def look(self, patches):
            assert patches == [patch for patch, _ in heard.values()]
            return [room for _, room in heard.values()]

    rater.model = Network()
    alone = [_hypotheses(*BOXES, scores=(9.0, 8.0, 7.0)), _hypotheses(*BOXES[::-1], scores=(3.0, 2.0, 1.0))]
    found = rater(Scene(), Proposals(alone, {(0, 1): [alone[0]]}))
    assert rater.heard == heard
    for doors, before, after in (
        (["a"], alone[0], found.alone[0]),
        (["b"], alone[1], found.alone[1]),
        (["a", "b"], alone[0], found.shared[0, 1][0]),
    ):  # fmt: skip
        said = rater.hear(doors, before.corners)
        scores = before.scores + said * OVERLAP
        order = np.argsort(-scores)[:keep]
        assert after.scores == pytest.approx(scores[order])
        assert np.array_equal(after.boxes, before.boxes[order])
        assert np.array_equal(after.corners, before.corners[order])
        assert after.measured == pytest.approx(np.column_stack((before.measured, said))[order])
    assert OVERLAP > 0.0


def test_rectangles_of_one_score_stand_by_their_place():
    rater = Rater(None, 9, _heard(a=(0, 0)))
    rater.heard["a"] = (
        rater.heard["a"][0],
        SeenRoom(np.zeros((SIZE, SIZE)), np.ones((SIZE, SIZE))),
    )
    same = ((3, 1, 5, 4), (2, 1, 5, 4), (2, 0, 5, 4), (2, 0, 4, 5))
    found = rater._rate(["a"], _hypotheses(*same, scores=(1.0, 1.0, 1.0, 1.0)))
    # By the last side first.
    assert found.boxes.tolist() == [[2, 0, 5, 4], [2, 1, 5, 4], [3, 1, 5, 4], [2, 0, 4, 5]]


@pytest.mark.parametrize("second", [None, 2])
def test_a_trace_tells_what_the_network_said_of_the_chosen_one_and_of_the_next(second):
    rater = Rater(None, 3, _heard(a=(0, 0)))
    weighed = WeighedRoom(
        ("a",), _corners(*BOXES), np.zeros(3), np.array([5.0, 6.0, 7.0]), 1, second, {"x": (1.0, 2.0)}
    )
    said = rater.hear(["a"], _corners(*BOXES)) * OVERLAP
    found = rater.explain(weighed)
    assert found.joint == pytest.approx(np.array([5.0, 6.0, 7.0]) + said)
    assert found.terms["x"] == (1.0, 2.0)
    assert found.terms["network"] == pytest.approx((said[1], 0.0 if second is None else said[2]))


def _belief(share, *, along=(1.0, 0.0), evidence=(1.0, 2.0, 3.0, 4.0, 5.0, 6.0)):
    return Belief(0.5, (), Spread(np.array([2.0, 1.0]), np.array(along), 0.25, share), evidence)


@pytest.mark.parametrize("angle", [0.0, math.pi / 2, 0.4])
def test_the_mask_counts_three_tenths_where_the_rectangles_reach(angle):
    # The mask is a plane, which interpolation keeps exactly; the raster lies inside of the patch.
    c, s = math.cos(angle), math.sin(angle)
    share = np.full((12, 9), 0.5)
    share[0] = 0.0
    belief = _belief(share, along=(c, s))
    rows, cols = np.indices((SIZE, SIZE))
    mask = 0.1 + (cols + 0.5) * CELL * 0.02 + (rows + 0.5) * CELL * 0.01
    patch = Patch(
        np.zeros((5, SIZE, SIZE)), np.array([-6.0, -5.0]), np.array([1.0, 0.0]), np.array([0.0, 1.0]), np.zeros(2)
    )
    seen = SeenRoom(mask, np.ones((SIZE, SIZE)))
    room = shapely.Polygon(
        np.array([2.0, 1.0]) + np.array([(0.5, 0.5), (1.5, 0.5), (1.5, 2.0), (0.5, 2.0)]) @ np.array([(c, s), (-s, c)])
    )
    found = believe_cells(belief, room, [(patch, seen)])
    across, along = (np.indices((12, 9)) + 0.5) * 0.25
    places = np.array([2.0, 1.0]) + along[..., None] * np.array([c, s]) + across[..., None] * np.array([-s, c])
    masks = 0.1 + (places[..., 0] + 6.0) * 0.02 + (places[..., 1] + 5.0) * 0.01
    masks[0] = 0.0
    assert found.spread.share == pytest.approx(0.7 * share + 0.3 * masks, abs=2e-4)
    assert MASK == 0.3
    inside = np.zeros((12, 9), dtype=bool)
    inside[2:8, 2:6] = True
    overlap = masks[inside].sum() / (inside.sum() + masks[~inside].sum())
    # What the network said of the rectangle, and this.
    assert found.evidence == pytest.approx((6.0, overlap), abs=2e-3)
    # What two doors heard is averaged.
    blank = SeenRoom(np.zeros((SIZE, SIZE)), seen.unknown)
    both = believe_cells(belief, room, [(patch, seen), (patch, blank)])
    assert both.spread.share == pytest.approx(0.7 * share + 0.15 * masks, abs=2e-4)
