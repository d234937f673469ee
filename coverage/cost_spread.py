"""The cost of coverage as a distribution: tours over what the rooms behind closed doors may be.

A room behind one door is a dead end. A closed walk falls into a closed walk on either side of a place that alone holds
the two together, so that a room adds to a tour what it takes to cover it from its door and back. So one tour is planned
on the completed map, and what each possible shape of a room adds more or less than the predicted one is measured in the
room alone: hundreds of completions cost no more than a few small tours. What is left out: a way that leads through a
room with several doors.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from statistics import NormalDist
from typing import Any

import numpy as np
import shapely

from closedrooms.core.arrays import FloatArray, handed_over
from closedrooms.core.door import ClosedDoor
from closedrooms.core.errors import InvalidInputError
from closedrooms.core.grid import FREE, OCCUPIED, UNKNOWN, GridFrame, OccupancyGrid
from closedrooms.core.random import stream
from closedrooms.core.room import Room
from closedrooms.core.shapes import Shape, fill_shape, trace_outline
from closedrooms.coverage.completions import Possibilities, list_possibilities, sample_rooms
from closedrooms.coverage.config import CoverageConfig
from closedrooms.coverage.graph.graph_builder import build_graph
from closedrooms.coverage.tour.tour_planner import solve_tour

# What the interval holds.
HELD = 0.9
# What draws of rooms do not hold: how far tours over M and M_GT differ where both show the same (M is ragged, M_GT is
# not), and how far rooms of one building are off together. A standard deviation, as a share of the tour's length, found
# on drawn maps of the use `fit` (benchmarks/quality/completions.py): the interval of `best` holds the true cost on 90 %
# of 69.
COST_NOISE = 0.016
# Unknown cells around a room [m].
MARGIN = 0.5
# A door without a leaf is taken to be so wide [m] (paper, section 3.7); an opening reaches so far before and behind the
# middle of its leaf [m]: a wall.
WIDTH, REACH = 0.8, 0.3


@dataclass(frozen=True, slots=True, eq=False)
class CostSpread:
    """Distribution of the cost of covering a building of which some rooms are only predicted.

    Attributes:
        lengths: Of a tour over each completion [m], shape (n,), in the order drawn.
        mean: Their mean [m].
        low: Lower end of the interval [m].
        high: Upper end [m].
        held: Probability that the interval holds the true length: :data:`HELD`, less for fewer than 19 draws.
        without_room: Ids of doors behind which nothing is predicted: they add nothing.
    """

    lengths: FloatArray
    mean: float
    low: float
    high: float
    held: float
    without_room: tuple[str, ...] = ()

    def figures(self, true_length: float | None = None) -> dict[str, Any]:
        """Tell it in numbers for ``run.json``.

        Args:
            true_length: Of the tour on the true map [m], where known.
        """
        figures: dict[str, Any] = {
            "count": len(self.lengths),
            "mean_m": round(self.mean, 4),
            "interval": round(self.held, 4),
            "low_m": round(self.low, 4),
            "high_m": round(self.high, 4),
            "lengths_m": [round(length, 4) for length in self.lengths.tolist()],
        }
        if self.without_room:
            figures["doors_without_room"] = list(self.without_room)
        if true_length is not None:
            figures["true_within"] = self.low <= true_length <= self.high
        return figures


def spread_cost(
    predicted: float,
    frame: GridFrame,
    doors: Sequence[ClosedDoor],
    rooms: Sequence[Room],
    probability: OccupancyGrid | None,
    config: CoverageConfig,
    *,
    count: int,
    seed: int,
    noise: float = COST_NOISE,
) -> CostSpread:
    """Estimate the cost of coverage over completions drawn from what the rooms may be.

    Every draw is a length that the true tour may have: that over the drawn rooms, and what they do not tell. A door
    without a predicted room adds nothing.

    Args:
        predicted: Length of the tour on the completed map [m].
        frame: Of the map, whose cells rooms are drawn with.
        doors: Closed doors of the map.
        rooms: As predicted, with their alternatives.
        probability: Of each cell to be free [percent].
        config: Graph and tour.
        count: Number of completions, at least 1.
        seed: Of the run.
        noise: What the rooms do not tell: standard deviation as a share of the tour's length.
    """
    rng = stream(seed, "completions")
    named = {door.id: door for door in doors}
    known = [room for room in rooms if room.doors and room.doors[0] in named]
    possible = [list_possibilities(room, probability) for room in known]
    costs = [_measure_possibilities(own, named[own.room.doors[0]], frame, config) for own in possible]
    begun = sum(float(own[0]) for own in costs)
    drawn = np.array(
        [
            sum(float(cost[at]) for cost, at in zip(costs, state, strict=True))
            for state in sample_rooms(possible, count, rng)
        ]
    )
    # As evenly spread as can be: a few random numbers would make another interval of every seed.
    normal = np.array([NormalDist().inv_cdf(share) for share in (rng.permutation(count) + 0.5) / count])
    found = {door for room in rooms for door in room.doors}
    spread = summarise(np.maximum(predicted + drawn - begun + noise * predicted * normal, 0.0))
    return replace(spread, without_room=tuple(door.id for door in doors if door.id not in found))


def _measure_possibilities(
    own: Possibilities, door: ClosedDoor, frame: GridFrame, config: CoverageConfig
) -> FloatArray:
    """What each of the shapes of a room adds to a tour [m], nothing where there is no room."""
    return np.array([0.0 if shape is None else measure_excursion(shape, door, frame, config) for shape in own.shapes])


def summarise(lengths: FloatArray) -> CostSpread:
    """Summarise lengths that were drawn as the true one might have been.

    The next draw lies between the ends with the probability :data:`HELD`: quantiles by order statistics of which the
    true length is taken to be one more (Weibull's plotting positions). Between the least and the largest of a few it
    lies less often.
    """
    count = len(lengths)
    low, high = np.quantile(lengths, [(1.0 - HELD) / 2, (1.0 + HELD) / 2], method="weibull")
    return CostSpread(lengths, float(lengths.mean()), float(low), float(high), min(HELD, (count - 1) / (count + 1)))


def measure_excursion(shape: Shape, door: ClosedDoor, frame: GridFrame, config: CoverageConfig) -> float:
    """Measure the closed tour from a door through a room and back [m]; 0 where no robot fits in.

    Args:
        shape: The room.
        door: That leads there.
        frame: Whose cells it is drawn with.
        config: Graph and tour.
    """
    grid = _rasterise_room(shape, door, frame)
    graph = replace(config.graph, clutter_filter=False)
    try:
        built = build_graph(grid, [door], replace(config, graph=graph), start=door.midpoint)
    except InvalidInputError:
        return 0.0
    tour = replace(config.tour, kicks=1, patience=1, bound_steps=1)
    vertex = built.graph.door_vertices.get(door.id)
    if vertex is not None:
        return solve_tour(built.graph, tour, start=vertex).length
    away = float(np.hypot(*(built.graph.vertices[built.start] - np.array(door.midpoint))))
    return 2.0 * away + solve_tour(built.graph, tour, start=built.start).length


def _rasterise_room(shape: Shape, door: ClosedDoor, frame: GridFrame) -> OccupancyGrid:
    """Draw one room with its door open and nothing around it."""
    if door.segment is None:
        opening: Shape = shapely.Point(door.midpoint).buffer(WIDTH / 2)
    else:
        opening = shapely.LineString(door.segment).buffer(REACH, cap_style="flat")
    x0, y0, x1, y1 = shapely.total_bounds([shape, opening])
    (r0, c0), (r1, c1) = frame.to_cells(np.array([[x0 - MARGIN, y0 - MARGIN], [x1 + MARGIN, y1 + MARGIN]])).tolist()
    frame = frame.cropped(r0, c0, r1 - r0 + 1, c1 - c0 + 1)
    inside, ring, opened = (np.zeros(frame.shape, dtype=np.bool_) for _ in range(3))
    fill_shape(shape, frame, inside)
    trace_outline(shape, frame, ring)
    fill_shape(opening, frame, opened)
    cells = np.full(frame.shape, UNKNOWN, dtype=np.int8)
    cells[inside] = FREE
    cells[ring] = OCCUPIED
    cells[opened] = FREE
    return OccupancyGrid(frame, handed_over(cells))
