"""Tours on predicted maps keep to what the robot knows, where it knows something."""

import numpy as np
import pytest
import shapely

from closedrooms.core.door import ClosedDoor
from closedrooms.core.grid import FREE, OCCUPIED, UNKNOWN, GridFrame, OccupancyGrid
from closedrooms.coverage.graph.line_of_sight import find_cells_between
from closedrooms.coverage.tour.tour_planner import plan_coverage
from closedrooms.predictor.methods import predict

CELL = 0.05
# Doors are opened in the prediction: the wall around a leaf is passed there [m].
AT_LEAF = 0.35


def corridor(seed: int) -> tuple[OccupancyGrid, list[ClosedDoor]]:
    """A corridor whose rooms stand open or closed, walls seen in pieces from afar, pillars and a counter in the way."""
    rng = np.random.default_rng(seed)
    cells = np.full((200, 300), UNKNOWN, dtype=np.int8)
    cells[78:122, 8:292] = OCCUPIED
    cells[80:120, 10:290] = FREE
    doors = []
    for number, col in enumerate(range(12, 260, 56)):
        for wall, inner in ((78, np.s_[12:78]), (120, np.s_[122:186])):
            at = col + int(rng.integers(4, 30))
            if rng.random() < 0.5:
                cells[inner, col : col + 54] = FREE
                cells[inner, [col - 1, col + 54]] = OCCUPIED
                cells[[inner.start - 1, inner.stop], col - 1 : col + 55] = OCCUPIED
                cells[wall : wall + 2, at : at + 18] = FREE
                gaps = inner.start + rng.integers(0, inner.stop - inner.start, 12)
                cells[gaps, col + 54] = rng.choice([FREE, UNKNOWN], gaps.size)
                continue
            cells[wall : wall + 2, at : at + 18] = OCCUPIED
            y = (wall + 1) * CELL
            ends = ((at * CELL, y), ((at + 18) * CELL, y))
            doors.append(ClosedDoor(f"d{number}{wall}", ((at + 9) * CELL, y), ends, 18 * CELL))
    for _ in range(6):
        r, c, size = rng.integers((94, 12, 4), (102, 280, 9))
        cells[r : r + size, c : c + size] = OCCUPIED
    return OccupancyGrid(GridFrame(CELL, 0.0, 0.0, *cells.shape), cells), doors


@pytest.mark.parametrize("method", ["best", "paper"])
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_edges_on_a_predicted_map_cross_nothing_that_the_robot_saw_but_the_leaves_of_doors(
    seed: int, method: str
) -> None:
    known, doors = corridor(seed)
    predicted = predict(known, doors, method).grid
    graph = plan_coverage(predicted, start=(7.0, 5.0)).graph
    leaves = shapely.union_all([shapely.LineString(door.segment).buffer(AT_LEAF) for door in doors if door.segment])
    frame = predicted.frame
    observed = known.on(frame)
    crossed = np.concatenate(
        [
            find_cells_between(*(frame.to_corners(graph.vertices[v])[::-1] for v in pair))
            for pair in graph.pairs.tolist()
        ]
    )
    assert predicted.free[tuple(crossed.T)].all()
    x, y = (frame.origin_x + (crossed[:, 1] + 0.5) * CELL, frame.origin_y + (crossed[:, 0] + 0.5) * CELL)
    blocked = observed.occupied[tuple(crossed.T)] & ~shapely.contains_xy(leaves, x, y)
    assert not blocked.any(), list(zip(x[blocked], y[blocked], strict=True))[:5]
    # Rooms behind doors are entered: there are edges in cells that the robot never saw.
    assert (observed.cells[tuple(crossed.T)] == UNKNOWN).any()
