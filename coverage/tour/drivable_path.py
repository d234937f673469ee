"""A tour as a robot drives it: poses on free cells, up to closed doors instead of into them."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from closedrooms.core.arrays import FloatArray, frozen
from closedrooms.core.grid import OccupancyGrid
from closedrooms.coverage.graph.reachable_space import find_reachable
from closedrooms.coverage.tour.coverage_tour import CoverageTour

# Distance between poses [m]: nav2's own planners give one for each cell of 0.05 m, controllers need fewer.
SPACING = 0.10


@dataclass(frozen=True, slots=True, eq=False)
class DrivablePath:
    """Poses along one closed walk.

    Attributes:
        poses: x, y [m] and heading [rad] in the map frame, shape (n, 3), read-only; the heading is that of travel.
        stops: Which of them are places to visit for the first time, in order, shape (k,).
    """

    poses: FloatArray
    stops: tuple[int, ...]

    def __post_init__(self) -> None:
        object.__setattr__(self, "poses", frozen(self.poses))


def find_drivable_paths(grid: OccupancyGrid, tour: CoverageTour, radius: float) -> list[DrivablePath]:
    """Find the poses of a tour, one path for each unconnected part of it.

    Edges lead around furniture already. A closed door is approached as far as the robot fits.

    Args:
        grid: The map that the tour was planned on.
        tour: A tour for a robot of that radius.
        radius: Of the robot [m].
    """
    frame = grid.frame.cropped(-1, -1, grid.frame.rows + 2, grid.frame.cols + 2)  # the map may be free up to its rim
    reachable = find_reachable(grid.on(frame).free, radius / frame.resolution).cells
    doors = {tuple(tour.graph.vertices[vertex].tolist()) for vertex in tour.graph.door_vertices.values()}
    visited = {
        tuple(tour.graph.vertices[vertex].tolist()) for vertex in tour.order if tour.graph.kinds[vertex] != "detour"
    }
    paths = []
    for walk in _split_at_gaps(tour.path):
        points, stops = [walk[0]], [0] if tuple(walk[0].tolist()) not in doors else []
        seen = {tuple(walk[0].tolist())}
        for place in walk[1:]:
            target = place
            key = tuple(place.tolist())
            leg = np.linspace(points[-1], target, max(int(np.ceil(np.hypot(*(target - points[-1])) / SPACING)), 1) + 1)
            if key in doors:
                cells = frame.to_cells(leg)
                fits = reachable[cells[:, 0], cells[:, 1]]
                leg = leg[: int(np.flatnonzero(fits)[-1]) + 1] if fits.any() else leg[:1]
            points += list(leg[1:])
            if key in visited and key not in seen:
                stops.append(len(points) - 1)
            seen.add(key)
        paths.append(DrivablePath(_with_headings(np.array(points)), tuple(dict.fromkeys(stops))))
    return paths


def _split_at_gaps(path: FloatArray) -> Iterator[FloatArray]:
    """Split a tour's path into its walks, between which stand rows of NaN."""
    gaps = np.flatnonzero(np.isnan(path[:, 0]))
    for walk in np.split(path, gaps):
        yield walk[~np.isnan(walk[:, 0])]


def _with_headings(points: FloatArray) -> FloatArray:
    """Add to positions the direction to the next one; the last keeps that of the one before."""
    if len(points) == 1:
        return np.array([[*points[0], 0.0]])
    steps = np.diff(points, axis=0)
    headings = np.arctan2(steps[:, 1], steps[:, 0])
    return np.column_stack((points, np.append(headings, headings[-1])))
