"""Coverage tours of a sample: on M and M_GT once, on the M_pred of every method (paper, section 5).

Tours are planned with the default ``CoverageConfig``: a robot of 0.20 m radius, whatever drove the sample.
"""

import hashlib
import json
from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any

from closedrooms.core.door import ClosedDoor, Point
from closedrooms.core.errors import InvalidInputError
from closedrooms.core.files.incoming import read_json
from closedrooms.core.files.outgoing import write_json
from closedrooms.core.grid import OccupancyGrid
from closedrooms.coverage.config import CoverageConfig
from closedrooms.coverage.tour.coverage_tour import CoverageTour
from closedrooms.experiments.dataset.checksums import files_digest
from closedrooms.pipeline.reporting.manifest import versions

# The robot starts at the origin of the map.
START = (0.0, 0.0)
# Unknown cells around what is known, so that a tour does not depend on the size of the picture [m].
MARGIN = 1.0
CACHE = "tours"
Tour = dict[str, Any]


def plan_cropped_tour(grid: OccupancyGrid, doors: Sequence[ClosedDoor] = (), *, start: Point = START) -> CoverageTour:
    """Plan the tour on a map, which depends on its known cells only.

    Raises:
        InvalidInputError: A map without free space.
    """
    from closedrooms.coverage.tour.tour_planner import plan_coverage

    return plan_coverage(cropped(grid), doors, CoverageConfig(), start=start)


def cropped(grid: OccupancyGrid) -> OccupancyGrid:
    """Crop a map to its known part with a margin of 1 m."""
    window = grid.known_bounds()
    if window is None:
        return grid
    row, col, rows, cols = window
    margin = round(MARGIN / grid.frame.resolution)
    return grid.on(grid.frame.cropped(row - margin, col - margin, rows + 2 * margin, cols + 2 * margin))


def kept_tour(out: Path, grid: OccupancyGrid, doors: Sequence[ClosedDoor] = (), *, start: Point = START) -> Tour:
    """Read or plan the tour on a map, once for all samples that share the map.

    It is kept in ``out/tours`` under the hash of what it depends on; two processes that plan the same tour write the
    same bytes.

    Raises:
        InvalidInputError: A map without free space.
        OutputError: The folder cannot be written.
    """
    path = out / CACHE / f"{_key(cropped(grid), doors, start)}.json"
    try:
        kept: Tour = read_json(path, what="a kept tour")
        if isinstance(kept["length_m"], float):
            return kept
    except (InvalidInputError, KeyError, TypeError):
        pass
    path.parent.mkdir(parents=True, exist_ok=True)
    figures = tour_figures(plan_cropped_tour(grid, doors, start=start))
    write_json(path, figures)
    return figures


def tour_figures(tour: CoverageTour) -> Tour:
    """Measure length, lower bound [m] and size of a tour."""
    return {
        "length_m": round(float(tour.length), 6),
        "lower_bound_m": round(float(tour.lower_bound), 6),
        "vertices": len(tour.graph.vertices),
        "status": tour.status,
    }


def _key(grid: OccupancyGrid, doors: Sequence[ClosedDoor], start: Point) -> str:
    """Digest what a tour depends on: known cells, doors, start, code."""
    frame = grid.frame
    where = [round(value, 6) for value in (frame.resolution, frame.origin_x, frame.origin_y)]
    places = [[door.id, door.midpoint, door.segment, door.width] for door in doors]
    digest = hashlib.sha256(json.dumps([where, frame.shape, places, start, MARGIN, versions()]).encode())
    digest.update(tour_code().encode())
    digest.update(grid.free.tobytes() + grid.occupied.tobytes())
    return digest.hexdigest()[:32]


@lru_cache(maxsize=1)
def tour_code() -> str:
    """Compute the digest of the code that a tour depends on."""
    root = Path(__file__).parents[3]
    files = [
        *(root / "coverage").rglob("*.py"),
        *(root / "core").rglob("*.py"),
        *(root / "predictor" / "structure").glob("*.py"),
    ]
    return files_digest([*files, Path(__file__)])
