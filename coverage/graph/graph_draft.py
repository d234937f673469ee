"""From the Voronoi graph to the topological graph: straight edges, bends and door vertices (paper, section 5.1)."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from closedrooms.core.arrays import BoolArray, FloatArray, IntArray
from closedrooms.core.door import ClosedDoor
from closedrooms.coverage.config import GraphConfig
from closedrooms.coverage.graph.free_space import FreeSpace
from closedrooms.coverage.graph.grid_path import find_path_along, pull_taut
from closedrooms.coverage.graph.line_of_sight import is_clear, split_where_blocked
from closedrooms.coverage.graph.skeleton import VoronoiGraph
from closedrooms.coverage.graph.topological_graph import TopologicalGraph, VertexKind, make_graph

# How many of the nearest edges, then of the nearest skeleton cells, a door looks at before it counts as unreachable.
LOOKS = 200


class GraphDraft:
    """A topological graph while vertices and edges are added to it; positions are (row, col) in continuous cells."""

    def __init__(self, space: FreeSpace, voronoi: VoronoiGraph, *, doorway: float) -> None:
        """Begin with a Voronoi graph; ``doorway`` [cells]: what is smaller each way may be passed on either side."""
        self.space = space
        self._around = doorway
        self.points: list[FloatArray] = []
        self.kinds: list[VertexKind] = []
        self.edges: dict[tuple[int, int], FloatArray] = {}
        self.doors: dict[str, int] = {}
        self._at_cell: dict[tuple[int, int], int] = {}
        degrees = np.bincount(voronoi.edges.ravel(), minlength=len(voronoi.cells)).tolist()
        for cell, degree in zip(voronoi.cells, degrees, strict=True):
            kind: VertexKind = "end" if degree <= 1 else "junction" if degree >= 3 else "bend"
            self._vertex_at(self.nearest_reachable(cell), kind)
        for chain in voronoi.chains:
            self.follow(chain)

    def _vertex_at(self, cell: IntArray, kind: VertexKind) -> int:
        """Find or add the vertex in the middle of a cell; a detour that is met again takes the other kind."""
        key = (int(cell[0]), int(cell[1]))
        if key not in self._at_cell:
            self._at_cell[key] = self.add_vertex(cell.astype(np.float64) + 0.5, kind)
        vertex = self._at_cell[key]
        if self.kinds[vertex] == "detour":
            self.kinds[vertex] = kind
        return vertex

    def nearest_reachable(self, cell: IntArray) -> IntArray:
        """Find the nearest cell where the robot can be: of those that the clean map shows in free sight, if any.

        A vertex in the middle of a table moves beside it.
        """
        row, col = cell.tolist()
        reachable, labels = self.space.reachable, self.space.labels
        if reachable[row, col]:
            return cell
        label, reach = labels[row, col], 8
        while True:
            low = np.maximum(cell - reach, 0)
            window = np.s_[low[0] : row + reach + 1, low[1] : col + reach + 1]
            found = np.argwhere(reachable[window] & (labels[window] == label)) + low
            apart = np.hypot(*(found - cell).T)
            found = found[np.argsort(apart, kind="stable")]
            # Only what lies within the reach is certainly the nearest.
            if (apart <= reach).any() or reach > max(reachable.shape):
                break
            reach *= 2
        centre = cell + 0.5
        seen = (place for place in found[:LOOKS] if is_clear(self.space.clean, centre, place + 0.5))
        return np.asarray(next(seen, found[0]))

    def add_vertex(self, point: FloatArray, kind: VertexKind) -> int:
        """Add a vertex at ``point``, ``(row, col)`` in continuous cells; returns its number."""
        self.points.append(np.asarray(point, dtype=np.float64))
        self.kinds.append(kind)
        return len(self.points) - 1

    def follow(self, chain: IntArray) -> int:
        """Add edges along a chain of cells, with bends where a straight one would cross an obstacle.

        Walls decide at which cells of the chain it bends. Where a robot has to keep clear of something else between
        two of them, a doorpost or a table, the edge goes around it.

        Returns:
            The vertex at the chain's first cell.
        """
        stops = split_where_blocked(chain, self.space.clean, around=self._around)
        first = last = self._vertex_at(self.nearest_reachable(chain[0]), "bend")
        for i, j in pairwise(stops):
            path = self._reachable_path(chain[i : j + 1])
            for u, v in pairwise(pull_taut(path, self.space.reachable)):
                vertex = self._vertex_at(path[v], "bend" if v == len(path) - 1 else "detour")
                whole = v - u == len(path) - 1
                self.add_edge(last, vertex, (chain[i : j + 1] if whole else path[u : v + 1]).astype(np.float64) + 0.5)
                last = vertex
        return first

    def _reachable_path(self, chain: IntArray) -> IntArray:
        """List cells from end to end of a chain: straight where the robot can go straight, else around obstacles."""
        reachable = self.space.reachable
        start, goal = (self.nearest_reachable(chain[end]) for end in (0, -1))
        if is_clear(reachable, start + 0.5, goal + 0.5):
            return np.array([start, goal])
        path = find_path_along(chain, start, goal, reachable)
        # Never: a chain stays beside one connected part. Then there is no edge.
        return start[None] if path is None else path

    def add_edge(self, u: int, v: int, polyline: FloatArray) -> None:
        """Add an edge from ``u`` to ``v``; of two between the same vertices the first stays."""
        if u != v and (u, v) not in self.edges and (v, u) not in self.edges:
            self.edges[u, v] = polyline

    def split_edge(self, edge: tuple[int, int], point: FloatArray) -> int:
        """Put a new vertex on an edge."""
        u, v = edge
        polyline = self.edges.pop(edge)
        middle = int(np.argmin(((polyline - point) ** 2).sum(axis=1)))
        vertex = self.add_vertex(point, "junction")
        self.add_edge(u, vertex, np.vstack((polyline[: middle + 1], point)))
        self.add_edge(vertex, v, np.vstack((point, polyline[middle:])))
        return vertex

    def finish(self, map_name: str | None = None) -> TopologicalGraph:
        """Convert the draft to a graph in the map frame."""
        frame = self.space.frame
        origin, resolution = np.array([frame.origin_x, frame.origin_y]), frame.resolution
        return make_graph(
            origin + np.array(self.points).reshape(-1, 2)[:, ::-1] * resolution,
            np.array(list(self.edges), dtype=np.int64).reshape(-1, 2),
            kinds=self.kinds,
            door_vertices=self.doors,
            polylines=[origin + polyline[:, ::-1] * resolution for polyline in self.edges.values()],
            map_name=map_name,
        )


def add_doors(draft: GraphDraft, doors: Sequence[ClosedDoor], voronoi: VoronoiGraph, config: GraphConfig) -> list[str]:
    """Add a vertex at every closed door, joined to the nearest place of the graph that is visible from it.

    A door stands in an obstacle: its edge may cross the cells of its own leaf and of the wall that it hangs in.

    Args:
        draft: Gets the vertices.
        doors: Closed doors, map frame.
        voronoi: Of ``draft``: where no edge of the graph is visible, one of its cells is.
        config: Widths.

    Returns:
        Ids of the doors that cannot be reached.
    """
    cells = np.concatenate([*voronoi.chains, voronoi.cells])
    where = [(chain, position) for chain in voronoi.chains for position in range(len(chain))]
    where += [(cell[None, :], 0) for cell in voronoi.cells]
    unreached = []
    for door in doors:
        point = draft.space.frame.to_corners(np.array(door.midpoint))[::-1]
        passable = _beside_leaf(draft.space, door, config)
        place = _visible_edge(draft, point, passable, config.doorway / draft.space.frame.resolution)
        if place is None:
            place = _visible_cell(draft, point, passable, cells, where)
        if place is None:
            unreached.append(door.id)
            continue
        vertex = draft.add_vertex(point, "door")
        draft.doors[door.id] = vertex
        draft.add_edge(vertex, place, np.vstack((point, draft.points[place])))
    return unreached


def _beside_leaf(space: FreeSpace, door: ClosedDoor, config: GraphConfig) -> BoolArray:
    """Mark what the edge of ``door`` may cross: the robot's space, the door's leaf and wall, what is free before."""
    frame = space.frame
    before = config.leaf_reach + config.robot_radius + frame.resolution
    reach = before + (door.width or config.doorway)
    low = frame.to_cells(np.array(door.midpoint) - reach)
    high = frame.to_cells(np.array(door.midpoint) + reach) + 1
    (r0, c0), (r1, c1) = (np.clip(cells, 0, frame.shape).tolist() for cells in (low, high))
    if r1 <= r0 or c1 <= c0:
        return space.reachable
    cells = np.moveaxis(np.mgrid[r0:r1, c0:c1], 0, -1)
    offset = frame.to_points(cells) - np.array(door.midpoint)
    slack = frame.resolution / 2.0
    if door.segment is None:
        across = np.hypot(offset[..., 0], offset[..., 1])
        beside = np.zeros(across.shape, dtype=np.bool_)
    else:
        leaf = np.array(door.segment[1]) - np.array(door.segment[0])
        length = float(np.hypot(leaf[0], leaf[1]))
        across = np.abs(offset @ np.array([-leaf[1], leaf[0]])) / length
        beside = np.abs(offset @ leaf) / length > length / 2.0
    own = ~beside & (across <= config.leaf_reach + slack)
    in_front = ~beside & (across <= before + slack) & space.clean[r0:r1, c0:c1]
    passable = space.reachable.copy()
    passable[r0:r1, c0:c1] |= own | in_front
    return passable


def _visible_edge(draft: GraphDraft, point: FloatArray, passable: BoolArray, doorway: float) -> int | None:
    """Find a vertex at the nearest visible place on an edge: an end of the edge, or a new vertex on it."""
    if not draft.edges:
        return next((v for v, other in enumerate(draft.points) if is_clear(passable, point, other)), None)
    edges = [edge for edge in draft.edges if "door" not in {draft.kinds[edge[0]], draft.kinds[edge[1]]}]
    a = np.array([draft.points[u] for u, _ in edges])
    step = np.array([draft.points[v] for _, v in edges]) - a
    t = np.clip(((point - a) * step).sum(axis=1) / (step**2).sum(axis=1), 0.0, 1.0)
    feet = a + t[:, None] * step
    distances = np.hypot(*(feet - point).T)
    nearest: list[int] = np.argsort(distances, kind="stable")[:LOOKS].tolist()
    for number in nearest:
        u, v = edges[number]
        along = float(np.hypot(*step[number]))
        for end, apart in ((u, t[number] * along), (v, (1.0 - t[number]) * along)):
            if apart < doorway / 2.0 and is_clear(passable, point, draft.points[end]):
                return end
        if 0.0 < t[number] < 1.0 and is_clear(passable, point, feet[number]):
            return draft.split_edge((u, v), feet[number])
    return None


def _visible_cell(
    draft: GraphDraft,
    point: FloatArray,
    passable: BoolArray,
    cells: IntArray,
    where: list[tuple[IntArray, int]],
) -> int | None:
    """Make a vertex at the nearest visible cell of the skeleton, joined to the graph along it."""
    distances = ((cells + 0.5 - point) ** 2).sum(axis=1)
    for number in np.argsort(distances, kind="stable")[: 10 * LOOKS : 5].tolist():
        row, col = cells[number].tolist()
        if draft.space.reachable[row, col] and is_clear(passable, point, cells[number] + 0.5):
            chain, position = where[number]
            ends = (chain[position::-1], chain[position:])
            return draft.follow(min(ends, key=len))
    return None
