"""What makes a proposal of a door: profiles of faces by plain loops, and what lies behind and before a leaf."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from closedrooms.core.grid import FREE, OCCUPIED, UNKNOWN, GridFrame, OccupancyGrid
from closedrooms.predictor.structure.door_proposal_config import ProposalConfig
from closedrooms.predictor.structure.door_proposals import (
    DoorProposal,
    _around,
    _best,
    _has_room_behind,
    _Line,
    _lines,
    _on_line,
    _Recesses,
    _recesses,
)
from closedrooms.predictor.structure.wall_faces import WallFaces

CELL = 0.05
ALONG, OUTWARD = np.array([1.0, 0.0]), np.array([0.0, -1.0])


def _line(depth, seen=None):
    depth = np.array(depth, dtype=np.float64)
    seen = np.ones(depth.size, dtype=np.bool_) if seen is None else np.array(seen, dtype=np.bool_)
    return _Line(ALONG, OUTWARD, 0.0, 0.0, np.where(seen, depth, 0.0), seen)


def _slowly(line, config):
    """For every first bin the width with the largest gain, of those that are good."""
    beside = max(2, round(config.jamb / CELL))
    narrowest, widest = max(3, math.ceil(config.min_width / CELL - 1e-6)), math.floor(config.max_width / CELL + 1e-6)
    size, found = line.seen.size, []

    def part(low, high):
        at = [i for i in range(max(low, 0), min(high, size)) if line.seen[i]]
        return line.depth[at]

    for first in range(size):
        best = None
        for bins in range(narrowest, widest + 1):
            leaf = part(first + 1, first + bins - 1)
            left, right = part(first - 1 - beside, first - 1), part(first + bins + 1, first + bins + 1 + beside)
            wall = np.concatenate((left, right))
            if first + bins > size or min(left.size, right.size) < 2 or leaf.size < 0.7 * (bins - 2):
                continue
            recess = min(left.mean(), right.mean()) - leaf.mean()
            rough = math.sqrt(
                (((leaf - leaf.mean()) ** 2).sum() + ((wall - wall.mean()) ** 2).sum()) / (leaf.size + wall.size)
            )
            if not config.min_recess <= recess <= config.max_recess or abs(wall.mean()) > CELL:
                continue
            if recess < 1.3 * math.hypot(rough, 0.01):
                continue
            gain = leaf.size * wall.size / (leaf.size + wall.size) * (wall.mean() - leaf.mean()) ** 2
            if best is None or gain > best[0] + 1e-12:
                best = gain, first, bins, recess, rough, leaf.mean(), leaf.size / (bins - 2)
        if best is not None:
            found.append(best)
    return found


@given(
    seed=st.integers(0, 10_000),
    noise=st.sampled_from([0.004, 0.02]),
    jamb=st.sampled_from([0.05, 0.2, 0.3]),
    share=st.sampled_from([0.9, 0.72]),
)
@settings(max_examples=30)
def test_recesses_are_the_clearest_widths_of_every_first_bin(seed, noise, jamb, share):
    rng = np.random.default_rng(seed)
    depth = rng.normal(0.0, noise, 60)
    first, bins = int(rng.integers(5, 30)), int(rng.integers(11, 25))
    depth[first : first + bins] -= rng.uniform(0.03, 0.19)
    line = _line(depth, rng.random(60) < share)
    config = ProposalConfig(jamb=jamb)
    expected = _slowly(line, config)
    found = _recesses(line, CELL, config)
    assert sorted(found.first.tolist()) == [row[1] for row in expected]
    by_first = {row[1]: row for row in expected}
    gains = []
    for i, at in enumerate(found.first.tolist()):
        gain, _, width, recess, rough, leaf, seen = by_first[at]
        assert found.bins[i] == width
        assert (found.recess[i], found.rough[i], found.leaf[i], found.seen[i]) == pytest.approx(
            (recess, rough, leaf, seen)
        )
        gains.append(gain)
    assert (np.diff(gains) <= 1e-12).all()


def test_no_width_fits_into_coarse_cells():
    found = _recesses(_line([0.0] * 20), 0.5, ProposalConfig())
    assert found.first.size == found.bins.size == found.recess.size == found.seen.size == 0


def _pieces(*firsts_and_bins):
    first, bins = (np.array(column) for column in zip(*firsts_and_bins, strict=True))
    return _Recesses(first, bins, *[np.zeros(first.size)] * 4)


def test_of_recesses_that_overlap_by_three_tenths_of_the_narrower_the_clearer_stays():
    assert _best(_pieces((0, 20), (14, 20), (15, 20), (40, 10))) == [0, 2, 3]
    assert _best(_pieces((14, 20), (0, 20))) == [0]
    assert _best(_pieces((10, 10), (5, 20))) == [0]
    assert _best(_pieces((0, 10), (8, 30), (7, 30))) == [0, 1]
    assert _best(_Recesses(np.zeros(0, int), np.zeros(0, int), *[np.zeros(0)] * 4)) == []


def _grid(fill):
    """Map of 6 x 6 m around the origin; ``fill(x, y)`` gives its cells."""
    frame = GridFrame(CELL, -3.0, -3.0, 120, 120)
    points = frame.to_points(np.stack(np.indices(frame.shape), axis=-1))
    return OccupancyGrid(frame, fill(points[..., 0], points[..., 1]).astype(np.int8))


QUARTERS = [(ALONG, OUTWARD), (OUTWARD, -ALONG), (-ALONG, -OUTWARD), (-OUTWARD, ALONG)]


@pytest.mark.parametrize(("along", "outward"), QUARTERS)
def test_shares_behind_and_before_a_leaf_are_those_of_the_cells_there(along, outward):
    # Leaf at t = 0 from s = -0.45 to 0.45. Behind, up to t = -0.6: unknown from 0.3 m on; before: free up to 0.35 m.
    def fill(x, y):
        s, t = x * along[0] + y * along[1], x * outward[0] + y * outward[1]
        inside = np.abs(s) < 0.45
        cells = np.where(t > 0, np.where(t < 0.35, FREE, OCCUPIED), np.where(t < -0.3, UNKNOWN, OCCUPIED))
        return np.where(inside, cells, np.where(t > 0, OCCUPIED, FREE))

    line = _Line(along, outward, 0.0, 0.0, np.zeros(1), np.ones(1, dtype=np.bool_))
    unknown, free = _around(_grid(fill), line, -0.45, 0.45, 0.0 + 1e-4, ProposalConfig(depth=0.6))
    # Rows begin at 0.15, 0.20, ... 0.65 behind, of which those from 0.35 on are unknown; and at 0.05 to 0.55 before, of
    # which those up to 0.30 are free.
    assert (unknown, free) == pytest.approx((7 / 11, 6 / 11))
    unknown, _ = _around(_grid(fill), line, -0.45, 0.45, -0.1 + 1e-4, ProposalConfig(depth=0.6))
    assert unknown == pytest.approx(9 / 11)
    # Shallow settings look at one row at least.
    assert _around(_grid(fill), line, -0.45, 0.45, 1e-4, ProposalConfig(depth=0.01)) == (0.0, 1.0)


def test_what_lies_beyond_the_map_behind_a_leaf_is_unknown_and_before_it_not_free():
    line = _Line(ALONG, OUTWARD, 0.0, 0.0, np.zeros(1), np.ones(1, dtype=np.bool_))
    grid = _grid(lambda x, _: np.full(x.shape, FREE))
    assert _around(grid, line, -0.45, 0.45, -3.0, ProposalConfig()) == (1.0, 1.0)
    assert _around(grid, line, -0.45, 0.45, 3.0, ProposalConfig()) == (0.0, 0.0)
    assert _around(grid, line, -0.45, 0.45, 0.0, ProposalConfig()) == (0.0, 1.0)


@pytest.mark.parametrize(("along", "outward"), QUARTERS)
@pytest.mark.parametrize(
    ("low", "high", "deep", "fits"),
    [
        (-0.65, 0.65, 1.3, True), (-0.5, 0.5, 1.3, False), (-0.65, 0.65, 0.9, False), (0.0, 1.25, 1.3, True),
        (-1.25, 0.0, 1.3, True), (0.4, 1.9, 1.3, False), (-1.9, -0.4, 1.3, False),
    ],
)  # fmt: skip
def test_a_square_room_must_fit_behind_half_of_the_leaf(along, outward, low, high, deep, fits):
    # Unknown from low to high along the wall, so deep behind the 0.2 m that a wall takes; else free.
    def fill(x, y):
        s, t = x * along[0] + y * along[1], x * outward[0] + y * outward[1]
        return np.where((s > low) & (s < high) & (t > -0.2 - deep), UNKNOWN, FREE)

    line = _Line(along, outward, 0.0, 0.0, np.zeros(1), np.ones(1, dtype=np.bool_))
    assert _has_room_behind(_grid(fill), line, -0.45, 0.45, 0.0, ProposalConfig(min_room=1.2)) == fits
    assert _has_room_behind(_grid(fill), line, -0.45, 0.45, 0.0, ProposalConfig(min_room=0.0))


@pytest.mark.parametrize(("rows", "fits"), [(2, True), (3, False)])
def test_a_tenth_of_a_room_may_be_known_by_mistake(rows, fits):
    # Of 24 rows so many are known: 2 / 24 are 0.083, 3 / 24 are 0.125.
    grid = _grid(lambda _, y: np.where((y > 1.0) & (y < 1.0 + rows * CELL), OCCUPIED, UNKNOWN))
    line = _Line(ALONG, OUTWARD, 0.0, 0.0, np.zeros(1), np.ones(1, dtype=np.bool_))
    assert _has_room_behind(grid, line, -0.45, 0.45, 1e-4, ProposalConfig(min_room=1.2)) == fits


def _faces(*points, angle=-math.pi / 2, outward=(0.0, -1.0)):
    """Faces that look down, at places (x, y)."""
    array = np.array(points, dtype=np.float64)
    return WallFaces(array, np.tile(outward, (len(array), 1)), np.full(len(array), angle))


def _profile(faces, **settings_of):
    return list(_lines(faces, np.array([0.0]), CELL, ProposalConfig(**settings_of)))


def test_a_profile_holds_the_depth_of_the_face_by_cells_and_what_was_seen_of_it():
    # A wall at y = 0, from 1.0 to 2.5, its free side below; a leaf 0.1 m behind, and two cells that were not seen.
    wall = [(1.025 + CELL * i, 0.0) for i in range(30) if i not in range(10, 22)]
    leaf = [(1.025 + CELL * i, 0.1) for i in range(10, 22) if i not in (14, 15)]
    lines = [line for line in _profile(_faces(*wall, *leaf)) if abs(line.face) < 0.01]
    (line,) = lines
    assert line.along == pytest.approx([-1.0, 0.0])
    assert line.outward == pytest.approx([0.0, -1.0], abs=1e-12)
    # Along -x: the first bin is the last of the wall.
    assert line.start == pytest.approx(-(1.025 + CELL * 29))
    assert line.seen.tolist() == [i not in (14, 15) for i in range(29, -1, -1)]
    expected = [-0.1 if i in range(10, 22) and i not in (14, 15) else 0.0 for i in range(29, -1, -1)]
    assert line.depth == pytest.approx(expected, abs=1e-9)


def test_a_line_of_faces_needs_enough_wall_and_enough_that_lies_back():
    def found(walls, leaves, **settings_of):
        wall = [(CELL * i, 0.0) for i in range(walls)]
        leaf = [(CELL * (walls + i), 0.1) for i in range(leaves)]
        return any(abs(line.face) < 0.01 for line in _profile(_faces(*wall, *leaf), **settings_of))

    assert found(4, 7)
    assert not found(3, 7)
    assert not found(4, 6)
    # What lies further back than a leaf may is another wall.
    assert not found(4, 7, max_recess=0.04)


def test_only_faces_that_look_the_way_of_the_wall_are_on_its_lines():
    wall, leaf = [(CELL * i, 0.0) for i in range(20)], [(CELL * i, 0.1) for i in range(20, 40)]
    assert _profile(_faces(*wall, *leaf))
    for off, there in ((29.0, True), (31.0, False), (-29.0, True), (-31.0, False)):
        assert bool(_profile(_faces(*wall, *leaf, angle=math.radians(off - 90.0)))) == there
    # A side of a cell across the wall is none of its face.
    assert not _profile(_faces(*wall, *leaf, outward=(1.0, 0.0)))


def test_a_proposal_tells_where_its_leaf_is_and_how_clear_it_is():
    # Bins of a line along x whose free side is below: a leaf of 18 bins, 0.1 m back.
    depth = np.zeros(60)
    depth[20:38] = -0.1
    line = _Line(-ALONG, OUTWARD, -1.475, 0.0, depth, np.ones(60, dtype=np.bool_))
    # Free below the wall, up to the leaf in the recess; unknown above.
    low, high = -1.475 + 19.5 * CELL, -1.475 + 37.5 * CELL
    # The bins at the jambs themselves are counted to the width.
    left, right, width = low - CELL, high + CELL, 20 * CELL

    def fill(x, y):
        back = (-x > low) & (-x < high)
        return np.where(y < np.where(back, 0.1, 0.0), FREE, UNKNOWN)

    ((proposal, niche),) = list(_on_line(_grid(fill), line, ProposalConfig()))
    assert np.array(proposal.segment) == pytest.approx(np.array([(-left, 0.1), (-right, 0.1)]))
    assert proposal.midpoint == pytest.approx((-(low + high) / 2, 0.1))
    assert (proposal.width, proposal.recess, proposal.rough, proposal.seen) == pytest.approx((width, 0.1, 0.0, 1.0))
    logit = -10.87 + 3.04 * math.log(0.1 / 0.01) + 8.37
    assert proposal.score == pytest.approx(1.0 / (1.0 + math.exp(-logit)))
    assert niche.middle == pytest.approx(proposal.midpoint)
    assert (niche.width, niche.recess) == pytest.approx((width, 0.1))
    assert niche.outward == pytest.approx(OUTWARD)
    # Known behind, or not free before: none.
    assert not list(_on_line(_grid(lambda _, y: np.where(y < 2.0, FREE, UNKNOWN)), line, ProposalConfig()))
    assert not list(_on_line(_grid(lambda x, _: np.full(x.shape, UNKNOWN)), line, ProposalConfig()))


def test_the_middle_of_a_proposal_lies_between_its_jambs():
    assert DoorProposal(((1.0, 2.0), (3.0, 5.0)), 3.6, 0.5, 0.1, 0.0, 1.0).midpoint == (2.0, 3.5)
