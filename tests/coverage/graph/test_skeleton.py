import subprocess
import sys

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import closedrooms.coverage.graph.skeleton as skeleton_module
from closedrooms.coverage.graph.skeleton import AROUND, load_skeletonize, peel, removable, thin, trace_skeleton


def _blobs(seed, discs):
    rng = np.random.default_rng(seed)
    mask = np.zeros((80, 100), dtype=np.uint8)
    for _ in range(discs):
        a, b = rng.integers(5, 75, 2), rng.integers(5, 75, 2)
        cv2.line(mask, a.tolist(), b.tolist(), 1, int(rng.integers(1, 9)))
    mask[[0, -1]] = mask[:, [0, -1]] = 0
    return mask > 0


def _components(count, edges):
    parent = list(range(count))

    def root(v):
        while parent[v] != v:
            v = parent[v]
        return v

    for u, v in edges.tolist():
        parent[root(u)] = root(v)
    return len({root(v) for v in range(count)})


@given(seed=st.integers(0, 10_000), discs=st.integers(1, 12))
@settings(max_examples=30, deadline=None)
def test_the_graph_has_as_many_parts_and_loops_as_the_skeleton(seed, discs):
    skeleton = thin(_blobs(seed, discs))
    graph = trace_skeleton(skeleton)
    parts, _ = cv2.connectedComponents(skeleton.astype(np.uint8), connectivity=8)
    _, _, stats, _ = cv2.connectedComponentsWithStats((~skeleton).astype(np.uint8), connectivity=4)
    holes = int((stats[1:, cv2.CC_STAT_AREA] > 4).sum()) - 1  # without what lies around
    assert _components(len(graph.cells), graph.edges) == parts - 1
    loops = len(graph.edges) - len(graph.cells) + parts - 1
    # Holes of a few cells may vanish inside a group of junction cells; such a group may also enclose nothing.
    assert loops >= holes


@given(seed=st.integers(0, 10_000), discs=st.integers(1, 12))
@settings(max_examples=30, deadline=None)
def test_chains_walk_the_skeleton_cell_by_cell_and_cover_it(seed, discs):
    skeleton = thin(_blobs(seed, discs))
    graph = trace_skeleton(skeleton)
    covered = np.zeros_like(skeleton)
    for (u, v), chain in zip(graph.edges, graph.chains, strict=True):
        assert (chain[0] == graph.cells[u]).all()
        assert (chain[-1] == graph.cells[v]).all()
        assert np.abs(np.diff(chain, axis=0)).max() == 1
        assert skeleton[chain[:, 0], chain[:, 1]].all()
        covered[chain[:, 0], chain[:, 1]] = True
    covered[graph.cells[:, 0], graph.cells[:, 1]] = True
    # Cells of a group of junction cells that no chain passes through may stay out.
    assert (skeleton & ~covered).sum() <= 4 * len(graph.cells)


def test_a_cross_has_one_junction_and_four_ends():
    skeleton = np.zeros((21, 21), dtype=bool)
    skeleton[10, 2:19] = skeleton[2:19, 10] = True
    graph = trace_skeleton(skeleton)
    degrees = np.bincount(graph.edges.ravel())
    assert sorted(degrees.tolist()) == [1, 1, 1, 1, 4]
    assert graph.cells[degrees == 4].tolist() == [[10, 10]]


def test_a_ring_without_branches_keeps_one_vertex_and_one_edge():
    skeleton = np.zeros((20, 20), dtype=np.uint8)
    cv2.circle(skeleton, (10, 10), 6, 1)
    graph = trace_skeleton(thin(skeleton > 0))
    assert len(graph.cells) == 1
    assert graph.edges.tolist() == [[0, 0]]
    assert (graph.chains[0][0] == graph.chains[0][-1]).all()


def test_every_part_of_the_mask_keeps_a_cell():
    mask = np.zeros((20, 30), dtype=bool)
    mask[3:5, 3:5] = mask[10, 10] = mask[12:18, 20:26] = True
    skeleton = thin(mask)
    _, labels = cv2.connectedComponents(mask.astype(np.uint8))
    assert set(labels[skeleton].tolist()) == {1, 2, 3}


@given(seed=st.integers(0, 10_000))
@settings(max_examples=30, deadline=None)
def test_the_function_that_is_loaded_by_itself_is_that_of_scikit_image(seed):
    from skimage.morphology import skeletonize

    mask = np.zeros((60, 70), dtype=bool)
    rng = np.random.default_rng(seed)
    for row, col, height, width in rng.integers((1, 1, 2, 2), (40, 40, 19, 29), (10, 4)):
        mask[row : row + height, col : col + width] = True
    assert (np.asarray(load_skeletonize()(mask)) == skeletonize(mask)).all()


def test_where_scikit_image_keeps_it_elsewhere_the_package_gives_it(monkeypatch):
    from skimage.morphology import skeletonize

    monkeypatch.setattr("importlib.util.find_spec", lambda _: None)
    load_skeletonize.cache_clear()
    try:
        assert load_skeletonize() is skeletonize
    finally:
        load_skeletonize.cache_clear()


def test_covering_a_map_imports_neither_scipy_signal_nor_the_whole_of_scikit_image():
    """Each of them costs more than the work."""
    code = """
import sys
import numpy as np
from closedrooms.core.grid import FREE, OCCUPIED, GridFrame, OccupancyGrid
from closedrooms.coverage.tour.tour_planner import plan_coverage
cells = np.full((120, 200), OCCUPIED, dtype=np.int8)
cells[10:110, 10:90] = cells[10:110, 95:190] = cells[50:70, 90:95] = FREE
plan_coverage(OccupancyGrid(GridFrame(0.05, 0.0, 0.0, 120, 200), cells))
print(*sorted(sys.modules))
"""
    loaded = set(
        subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()
    )
    slow = {"scipy.signal", "scipy.sparse", "scipy.stats", "scipy.ndimage", "skimage.morphology", "ortools", "pandas"}
    assert "networkx" in loaded
    assert not slow & loaded


def _peeled_everywhere(mask):
    """Every cell looked at in every step."""
    cells, before = mask.astype(np.int64), None
    while before is None or (cells != before).any():
        before = cells.copy()
        for rules in removable():
            around = sum(np.roll(cells, (-row, -col), (0, 1)) << bit for bit, (row, col) in enumerate(AROUND.tolist()))
            cells[(cells > 0) & rules[around]] = 0
    return cells > 0


@given(seed=st.integers(0, 10_000), discs=st.integers(1, 12))
@settings(max_examples=30, deadline=None)
def test_peeling_looks_at_few_cells_and_takes_what_looking_at_all_takes(seed, discs):
    mask = _blobs(seed, discs)
    assert (peel(mask) == _peeled_everywhere(mask)).all()


@given(seed=st.integers(0, 10_000), discs=st.integers(1, 12))
@settings(max_examples=30, deadline=None)
def test_what_is_peeled_first_is_thinned_to_as_many_parts_and_holes(seed, discs):
    mask = _blobs(seed, discs)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(skeleton_module, "MOST_VISITS", 0.0)
        skeleton = thin(mask)
    assert not (skeleton & ~mask).any()
    for value, neighbours in ((1, 8), (0, 4)):
        counts = [
            cv2.connectedComponents((shape == value).astype(np.uint8), connectivity=neighbours)[0]
            for shape in (mask, skeleton)
        ]
        assert counts[0] == counts[1]


@given(seed=st.integers(0, 10_000), discs=st.integers(1, 12))
@settings(max_examples=30, deadline=None)
def test_parts_that_thinning_takes_away_keep_their_deepest_cell(seed, discs):
    mask = _blobs(seed, discs)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(skeleton_module, "load_skeletonize", lambda: np.zeros_like)
        skeleton = thin(mask)
    count, labels = cv2.connectedComponents(mask.astype(np.uint8), connectivity=8)
    depth = cv2.distanceTransform(mask.astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    deepest = [int(np.argmax(np.where(labels == part, depth, -1.0))) for part in range(1, count)]
    assert np.flatnonzero(skeleton).tolist() == sorted(deepest)
