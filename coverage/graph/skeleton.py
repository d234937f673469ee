"""The Voronoi graph of free space, from its skeleton (paper, section 5.1)."""

import itertools
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np

from closedrooms.core.arrays import BoolArray, IntArray
from closedrooms.core.runtime.compiled import load_compiled

# The eight neighbours of a cell (row, col): the four sides first, so that walks prefer them.
NEIGHBOURS = np.array([(-1, 0), (0, -1), (0, 1), (1, 0), (-1, -1), (-1, 1), (1, -1), (1, 1)])
# The same, clockwise from the cell above.
AROUND = np.array([(-1, 0), (-1, 1), (0, 1), (1, 1), (1, 0), (1, -1), (0, -1), (-1, -1)])
# Cells times the depth of the deepest one: what scikit-image visits, 4e9 in about 10 s.
MOST_VISITS = 4e9


@dataclass(frozen=True, slots=True, eq=False)
class VoronoiGraph:
    """Vertices and polylines of a skeleton one cell wide.

    Attributes:
        cells: Cell (row, col) of each vertex, shape (n, 2): a leaf, a junction of three or more branches, a lone cell,
            or one cell of a ring that has neither.
        edges: Pairs of vertices, shape (m, 2); a ring ends where it begins.
        chains: The cells (row, col) from the first to the second vertex of each edge, both included, every step to one
            of the eight neighbours.
    """

    cells: IntArray
    edges: IntArray
    chains: tuple[IntArray, ...]


def thin(mask: BoolArray) -> BoolArray:
    """Thin ``mask``, whose border is empty, to its skeleton: one cell wide, same connectivity.

    scikit-image's ``skeletonize``, as the paper; what is wide on a large mask is peeled first (:func:`peel`). A part
    that thinning takes away whole keeps one cell.
    """
    import cv2

    depth = cv2.distanceTransform(mask.astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    thick = np.ascontiguousarray(mask, dtype=np.bool_)
    if float(depth.max(initial=0.0)) * mask.size > MOST_VISITS:
        thick = peel(thick)
    skeleton: BoolArray = np.asarray(load_skeletonize()(thick), dtype=np.bool_)
    count, labels = cv2.connectedComponents(mask.astype(np.uint8), connectivity=8)
    lost = np.setdiff1d(np.arange(1, count), labels[skeleton])
    if lost.size:
        # The deepest cell of each, the first of several.
        cells = np.flatnonzero(np.isin(labels, lost))
        part = labels.ravel()[cells]
        order = np.lexsort((cells, -depth.ravel()[cells], part))
        _, first = np.unique(part[order], return_index=True)
        skeleton.flat[cells[order[first]]] = True
    return skeleton


def peel(mask: BoolArray) -> BoolArray:
    """Take cells off all around a mask, whose border is empty, until nothing more can go (Zhang and Suen, CACM 1984).

    The rules of the paper, in two steps each that take off the lower right and the upper left rim. Only cells whose
    neighbours went in the last two steps are looked at: the work grows with the area, where looking at the whole mask
    in each step is work for the area times the width of what is widest. scikit-image's rules take off a few cells
    more, so that its ``skeletonize`` belongs after it.
    """
    width = mask.shape[1]
    cells = mask.astype(np.uint8).ravel()
    stamp = np.zeros(cells.size, dtype=np.int32)
    around = AROUND @ np.array([width, 1])

    def left_of(places: IntArray) -> IntArray:
        """List those of some places that are still in the mask, each once."""
        found = places[cells[places] > 0]
        number = np.arange(found.size, dtype=np.int32)
        stamp[found] = number
        once: IntArray = found[stamp[found] == number]
        return once

    inside = np.zeros_like(mask)
    inside[1:-1, 1:-1] = mask[1:-1, 1:-1]
    for row, col in AROUND.tolist():
        inside[1:-1, 1:-1] &= mask[1 + row : mask.shape[0] - 1 + row, 1 + col : mask.shape[1] - 1 + col]
    # Beside the rim, which the first two steps look at whole: cells around those that went in a step.
    looked_at = rim = np.flatnonzero(mask & ~inside)
    changed: list[IntArray] = [rim]
    for rules in itertools.cycle(removable()):
        present = (cells[looked_at[:, None] + around] << np.arange(8, dtype=np.uint8)).sum(axis=1)
        gone = looked_at[rules[present]]
        cells[gone] = 0
        changed = [changed[-1], (gone[:, None] + around).ravel()]
        looked_at = left_of(np.concatenate(changed))
        if not looked_at.size:
            break
    return cells.view(np.bool_).reshape(mask.shape)


@cache
def removable() -> tuple[BoolArray, BoolArray]:
    """Tell, for the first and the second step of :func:`peel`, which of 256 neighbourhoods let their middle go.

    Bit k of a neighbourhood is the neighbour ``AROUND[k]``.
    """
    p = (np.arange(256)[:, None] >> np.arange(8)) & 1
    north, east, south, west = p[:, 0], p[:, 2], p[:, 4], p[:, 6]
    count, turns = p.sum(axis=1), ((p == 0) & (np.roll(p, -1, axis=1) == 1)).sum(axis=1)
    rim = (count >= 2) & (count <= 6) & (turns == 1)
    first = rim & (north * east * south == 0) & (east * south * west == 0)
    second = rim & (north * east * west == 0) & (north * south * west == 0)
    return first, second


@cache
def load_skeletonize() -> Callable[[BoolArray], BoolArray]:
    """Load scikit-image's ``skeletonize`` of two dimensions.

    Its package imports scipy.ndimage and scipy.spatial for functions beside it, a fifth of the CPU time of
    ``closedrooms cover``.
    """
    compiled = load_compiled("skimage.morphology._skeletonize_various_cy", "_fast_skeletonize")
    if compiled is not None:
        thin_fast: Callable[[BoolArray], BoolArray] = compiled._fast_skeletonize
        return thin_fast
    from skimage.morphology import skeletonize

    whole: Callable[[BoolArray], BoolArray] = skeletonize
    return whole


def trace_skeleton(skeleton: BoolArray) -> VoronoiGraph:
    """Trace the vertices where the skeleton ends or branches, and the chains of cells between them.

    Neighbours of all cells are looked up at once; only the walk along the chains is a loop.

    Args:
        skeleton: One cell wide, empty on its border.
    """
    pixels, links = _link(skeleton)
    degree = [len(link) for link in links]
    group, members = _junction_groups(degree, links)
    vertex_pixels = [_centre(pixels, group_members) for group_members in members]
    edges, chains = _walk(degree, links, group, members, vertex_pixels)
    return VoronoiGraph(
        pixels[vertex_pixels].reshape(-1, 2),
        np.array(edges, dtype=np.int64).reshape(-1, 2),
        tuple(pixels[chain] for chain in chains),
    )


def _link(skeleton: BoolArray) -> tuple[IntArray, list[list[int]]]:
    """List the cells of the skeleton and, for each, the numbers of its neighbours.

    A diagonal step is left out where two side steps through one skeleton cell do the same: else every corner of the
    skeleton would look like a junction.
    """
    pixels = np.argwhere(skeleton)
    number = np.full(skeleton.shape, -1, dtype=np.int64)
    number[pixels[:, 0], pixels[:, 1]] = np.arange(len(pixels))
    around = pixels[:, None, :] + NEIGHBOURS[None, :, :]
    neighbours = number[around[..., 0], around[..., 1]]
    for diagonal in range(4, 8):
        row, col = NEIGHBOURS[diagonal]
        beside = neighbours[:, [0 if row < 0 else 3, 1 if col < 0 else 2]]
        neighbours[(beside >= 0).any(axis=1), diagonal] = -1
    flat, counts = neighbours[neighbours >= 0].tolist(), (neighbours >= 0).sum(axis=1).tolist()
    links, position = [], 0
    for count in counts:
        links.append(flat[position : position + count])
        position += count
    return pixels, links


def _junction_groups(degree: list[int], links: list[list[int]]) -> tuple[list[int], list[list[int]]]:
    """Group of each cell (-1 on a chain) and the cells of each group.

    Leaves and lone cells are groups of their own, junction cells that touch are one.
    """
    group = [-1] * len(degree)
    members: list[list[int]] = []
    for pixel, own in enumerate(degree):
        if own == 2 or group[pixel] >= 0:
            continue
        group[pixel] = len(members)
        found = [pixel]
        if own >= 3:
            for reached in found:
                for other in links[reached]:
                    if degree[other] >= 3 and group[other] < 0:
                        group[other] = group[pixel]
                        found.append(other)
        members.append(found)
    return group, members


def _centre(pixels: IntArray, members: list[int]) -> int:
    """Find the member next to the middle of the group."""
    if len(members) == 1:
        return members[0]
    cells = pixels[members]
    return members[int(np.argmin(((cells - cells.mean(axis=0)) ** 2).sum(axis=1)))]


def _walk(
    degree: list[int],
    links: list[list[int]],
    group: list[int],
    members: list[list[int]],
    centres: list[int],
) -> tuple[list[tuple[int, int]], list[list[int]]]:
    """Walk chains from group to group, then rings that touch none (each gets a vertex: ``centres`` grows)."""
    edges: list[tuple[int, int]] = []
    chains: list[list[int]] = []
    paths = [_paths_to_centre(links, group, members[g], centres[g]) for g in range(len(members))]
    seen = [False] * len(degree)
    for g, pixels in enumerate(members):
        for pixel in pixels:
            for first in links[pixel]:
                if group[first] == g or seen[first] or (0 <= group[first] < g):
                    continue
                chain = _follow(pixel, first, links, group, seen)
                other = group[chain[-1]]
                edges.append((g, other))
                chains.append(paths[g][pixel][::-1] + chain[1:-1] + paths[other][chain[-1]])
    for pixel, own in enumerate(degree):
        if own == 2 and not seen[pixel]:
            centres.append(pixel)
            seen[pixel] = True
            edges.append((len(centres) - 1, len(centres) - 1))
            chains.append(_ring(pixel, links, seen))
    return edges, chains


def _paths_to_centre(links: list[list[int]], group: list[int], members: list[int], centre: int) -> dict[int, list[int]]:
    """Find the cells from each cell of a group to the group's centre, both included."""
    paths = {centre: [centre]}
    reached = [centre]
    for pixel in reached:
        for other in links[pixel]:
            if other not in paths and group[other] == group[centre] and len(members) > 1:
                paths[other] = [other, *paths[pixel]]
                reached.append(other)
    return paths


def _follow(start: int, first: int, links: list[list[int]], group: list[int], seen: list[bool]) -> list[int]:
    """Follow the chain that leaves ``start`` through ``first``, up to the first cell of a group."""
    chain = [start, first]
    while group[chain[-1]] < 0:
        here, before = chain[-1], chain[-2]
        seen[here] = True
        one, two = links[here]
        chain.append(two if one == before else one)
    return chain


def _ring(pixel: int, links: list[list[int]], seen: list[bool]) -> list[int]:
    """Follow a ring without junctions around, from one of its pixels to the same."""
    ring = [pixel, links[pixel][0]]
    while ring[-1] != pixel:
        here, before = ring[-1], ring[-2]
        seen[here] = True
        one, two = links[here]
        ring.append(two if one == before else one)
    return ring
