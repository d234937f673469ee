"""A map becomes a topological graph (paper, section 5.1)."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from closedrooms.core.door import ClosedDoor, Point
from closedrooms.core.grid import OccupancyGrid
from closedrooms.coverage.config import CoverageConfig
from closedrooms.coverage.graph.free_space import FreeSpace, clean_free_space
from closedrooms.coverage.graph.graph_draft import GraphDraft, add_doors
from closedrooms.coverage.graph.line_of_sight import is_clear
from closedrooms.coverage.graph.skeleton import thin, trace_skeleton
from closedrooms.coverage.graph.topological_graph import TopologicalGraph
from closedrooms.coverage.graph.vertex_merging import merge_thin

# A start farther from all free space than this [m] is worth a note: no robot stands there.
FAR_START = 1.0
# So much space is worth a note when it is left out [m2]: about a doorway's square is in every map.
WORTH_SAYING = 1.0


@dataclass(frozen=True, slots=True, eq=False)
class BuiltGraph:
    """A graph and what there is to say about it.

    Attributes:
        graph: The topological graph.
        start: Vertex where a tour begins: the nearest that is visible from the robot, or vertex 0.
        unreached_doors: Ids of the closed doors that cannot be reached.
        notes: What was left out.
    """

    graph: TopologicalGraph
    start: int
    unreached_doors: tuple[str, ...]
    notes: tuple[str, ...]


def build_graph(
    grid: OccupancyGrid,
    doors: Sequence[ClosedDoor] = (),
    config: CoverageConfig | None = None,
    *,
    start: Point | None = None,
    map_name: str | None = None,
) -> BuiltGraph:
    """Build the topological graph of what is free, with a vertex at every closed door.

    Args:
        grid: M, M_pred or M_GT.
        doors: Closed doors of M; none on the other two.
        config: Widths, and which part to cover.
        start: Where the robot is, map frame [m].
        map_name: Which map it is; the graph remembers it as ``graph["map"]``.

    Raises:
        InvalidInputError: A map without free space.
    """
    config = config or CoverageConfig()
    space = clean_free_space(grid, config.graph)
    space, notes = _chosen_parts(space, config, start)
    cells = config.graph.doorway / space.frame.resolution
    voronoi = trace_skeleton(thin(space.mask))
    clearance = space.clearance / space.frame.resolution
    merged = merge_thin(voronoi, clearance, doorway=cells, corner_ratio=config.graph.corner_ratio)
    draft = GraphDraft(space, merged, doorway=cells)
    unreached = add_doors(draft, doors, merged, config.graph)
    notes += [f"door {door} cannot be reached from the space that is covered" for door in unreached]
    return BuiltGraph(draft.finish(map_name), _start_vertex(draft, start), tuple(unreached), tuple(notes))


def _start_vertex(draft: GraphDraft, start: Point | None) -> int:
    """Find the vertex to start from: the nearest in sight of ``start`` [m], else the nearest; the first without one."""
    if start is None:
        return 0
    point = draft.space.frame.to_corners(np.array(start))[::-1]
    squared = ((np.array(draft.points) - point) ** 2).sum(axis=1)
    order: list[int] = np.argsort(squared, kind="stable").tolist()
    return next((v for v in order if is_clear(draft.space.clean, point, draft.points[v])), order[0])


def _nearest_part(space: FreeSpace, start: Point) -> tuple[int, float]:
    """Find the part that holds ``start``, or the nearest one, and how far away it is [m]."""
    cell = space.frame.to_cells(np.array(start))
    if space.frame.contains(cell) and space.mask[cell[0], cell[1]]:
        return int(space.parts[cell[0], cell[1]]), 0.0
    cells = np.argwhere(space.mask)
    squared = ((cells + 0.5 - space.frame.to_corners(np.array(start))[::-1]) ** 2).sum(axis=1)
    nearest = int(np.argmin(squared))
    distance = float(np.sqrt(squared[nearest])) * space.frame.resolution
    return int(space.parts[cells[nearest, 0], cells[nearest, 1]]), distance


def _chosen_parts(space: FreeSpace, config: CoverageConfig, start: Point | None) -> tuple[FreeSpace, list[str]]:
    """Choose the part with the robot, or all; with a note when there are several."""
    notes = []
    if space.outside > 0.0:
        notes.append(f"{space.outside:.1f} m2 that rays saw through windows, with hardly a wall around, are left out")
    if space.unreachable >= WORTH_SAYING:
        radius = config.graph.robot_radius
        notes.append(f"{space.unreachable:.1f} m2 that a robot of {radius:.2f} m radius cannot get into are left out")
    chosen = 1
    if start is not None:
        chosen, distance = _nearest_part(space, start)
        if distance > FAR_START:
            notes.append(f"the start ({start[0]:.2f}, {start[1]:.2f}) lies {distance:.1f} m from free space")
    count = len(space.areas) - 1
    if count <= 1:
        return space, notes
    if config.parts == "all":
        notes.append(f"{count} unconnected parts, all covered, each by a tour of its own")
        return space, notes
    left_out = float(space.areas.sum() - space.areas[chosen])
    which = "the largest" if start is None else "the one with the start"
    notes.append(
        f"{count} unconnected parts: {which} is covered ({space.areas[chosen]:.1f} m2), {left_out:.1f} m2 left out"
    )
    mask = space.parts == chosen
    kept = replace(
        space,
        mask=mask,
        clearance=np.where(mask, space.clearance, 0.0),
        parts=mask.astype(np.int32),
        areas=np.array([0.0, space.areas[chosen]]),
    )
    return kept, notes
