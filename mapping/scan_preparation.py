"""Scans of a run that is known beforehand, made ready for the mapper many at a time."""

import itertools
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from closedrooms.core.arrays import FloatArray
from closedrooms.core.pose import Pose2
from closedrooms.core.scan import LaserScan
from closedrooms.mapping.beams import Beams, clean_alike, directions, matched_range, spaced
from closedrooms.mapping.config import MapperConfig

TOGETHER = 64
"""Scans that are made ready at once: NumPy's overhead a call is all but gone, and few seconds of the run are held."""


@dataclass(frozen=True, slots=True, eq=False)
class PreparedScan:
    """Parts of a scan that the mapper uses.

    Attributes:
        points: The points that are matched, robot frame, shape (n, 2) [m].
        beams: What is drawn.
    """

    points: FloatArray
    beams: Beams


def prepare_scans(scans: Iterable[LaserScan], config: MapperConfig) -> Iterator[PreparedScan]:
    """Take what the mapper needs from each scan: the same as from one alone, in a fraction of the time."""
    for _, alike in itertools.groupby(scans, key=_sensor):
        while some := list(itertools.islice(alike, TOGETHER)):
            points = _thin_alike(some, config)
            beams = clean_alike(some, max_range=config.max_range)
            yield from (PreparedScan(*taken) for taken in zip(points, beams, strict=True))


def _sensor(scan: LaserScan) -> tuple[object, ...]:
    """List what scans must have in common to be made ready together."""
    beams = (scan.ranges.size, scan.angle_min, scan.angle_increment)
    return (*beams, scan.range_min, scan.range_max, scan.robot_T_sensor)


def _thin_alike(scans: Sequence[LaserScan], config: MapperConfig) -> list[FloatArray]:
    """Thin the hits of scans of one sensor, up to the range that is matched; shape (n, 2) each [m]."""
    first = scans[0]
    ranges = np.stack([scan.ranges for scan in scans])
    reach = matched_range(first, max_range=config.max_range, margin=config.matcher.range_margin)
    hits = (ranges >= first.range_min) & (ranges < reach)
    # The hits of each scan, one beside the other from the left.
    order = np.argsort(~hits, axis=1, kind="stable")
    counts = np.count_nonzero(hits, axis=1)[:, None]
    units, _ = directions(first.angle_min, first.angle_increment, ranges.shape[1])
    points = units[order] * np.take_along_axis(np.where(hits, ranges, 0.0), order, axis=1)[:, :, None]
    if first.robot_T_sensor != (0.0, 0.0, 0.0):
        points = Pose2(*first.robot_T_sensor).transform(points)
    keep = spaced(points, counts, config.matcher.point_spacing, config.matcher.max_points)
    return [seen[kept] for seen, kept in zip(points, keep, strict=True)]
