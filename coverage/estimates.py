"""How well a map tells the cost of coverage (paper, sections 5.2 and 5.3)."""

from dataclasses import dataclass

from closedrooms.core.errors import InvalidInputError
from closedrooms.coverage.tour.coverage_tour import CoverageTour


@dataclass(frozen=True, slots=True)
class CoverageErrors:
    """The four estimates of the length of a coverage tour and the three errors.

    Attributes:
        tsp_closed: Tour on M with a vertex at each closed door [m].
        tsp_baseline: ``tsp_closed + tsp_closed / |R| * |D|`` [m].
        tsp_pred: Tour on M_pred [m].
        tsp_gt: Tour on M_GT [m].
        error_closed: ``|tsp_gt - tsp_closed| / tsp_gt`` in percent; ``None`` where the true tour has no length: a
            building with a single place to visit.
        error_baseline: Likewise for the baseline, percent.
        error_pred: Likewise for the prediction, percent.
    """

    tsp_closed: float
    tsp_baseline: float
    tsp_pred: float
    tsp_gt: float
    error_closed: float | None
    error_baseline: float | None
    error_pred: float | None


def compare_tours(
    closed: CoverageTour, predicted: CoverageTour, truth: CoverageTour, n_rooms: int, n_doors: int
) -> CoverageErrors:
    """Compare the estimates of the cost of coverage with the true cost (sections 5.2 and 5.3).

    Args:
        closed: Tour on M.
        predicted: Tour on M_pred.
        truth: Tour on M_GT.
        n_rooms: ``|R|``, the rooms that the robot observed: true rooms seen where truth is known, else
            :func:`closedrooms.coverage.room_count.count_rooms` of M. At least 1: a map that holds a tour holds a room.
        n_doors: ``|D|``, the closed doors in M.

    Raises:
        InvalidInputError: Tours of different methods.
    """
    methods = {tour.method for tour in (closed, predicted, truth)}
    if len(methods) > 1:
        raise InvalidInputError(f"tours by {', '.join(sorted(methods))}", expected="the same method for all three")
    return compare_lengths(closed.length, predicted.length, truth.length, n_rooms=n_rooms, n_doors=n_doors)


def compare_lengths(closed: float, predicted: float, truth: float, *, n_rooms: int, n_doors: int) -> CoverageErrors:
    """Compare as :func:`compare_tours` does, from the lengths of the three tours [m]."""
    baseline = closed + closed / max(n_rooms, 1) * n_doors

    def error(estimate: float) -> float | None:
        return abs(truth - estimate) / truth * 100.0 if truth > 0.0 else None

    return CoverageErrors(closed, baseline, predicted, truth, error(closed), error(baseline), error(predicted))
