"""Build the map of a recorded run: what ``closedrooms map`` does before it writes files."""

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from closedrooms.core.arrays import FloatArray
from closedrooms.core.door import ClosedDoor
from closedrooms.core.grid import OccupancyGrid
from closedrooms.core.pose import Pose2
from closedrooms.core.remarks import Remark
from closedrooms.mapping.config import MapperConfig
from closedrooms.mapping.logs.recorded_run import RecordedRun
from closedrooms.mapping.mapper import Mapper
from closedrooms.mapping.motion.scan_odometry import ScanOdometry
from closedrooms.mapping.scan_preparation import prepare_scans
from closedrooms.mapping.trajectory import ate

MOST_NOT_HELD = 0.05
"""Share of the scans of a run without odometry that may fit as well elsewhere before it is said."""


@dataclass(frozen=True, slots=True, eq=False)
class BuiltMap:
    """The map of a recorded run.

    Attributes:
        grid: The final map.
        doors: Closed doors, where the run holds sightings.
        stamps: Times of the scans [s], shape (n,).
        trajectory: ``(x, y, theta)`` at the scans after the last optimisation, shape (n, 3).
        loops: Positions of the two ends of each loop, shape (k, 2, 2) [m].
        keyframes: How many scans make the map.
        seconds: Wall-clock time of mapping alone [s].
        errors: ATE ``(m, rad)`` against the reference of ``odometry`` (``scans_alone``, where the run has none),
            ``online`` and ``final``; empty without one.
        remarks: What was guessed on the way, and what the mapper met: gaps, lost scans, recovered poses, submaps.
    """

    grid: OccupancyGrid
    doors: list[ClosedDoor]
    stamps: FloatArray
    trajectory: FloatArray
    loops: FloatArray
    keyframes: int
    seconds: float
    errors: dict[str, tuple[float, float]]
    remarks: tuple[Remark, ...] = ()


def build_map(
    run: RecordedRun,
    config: MapperConfig | None = None,
    *,
    watch: Callable[[int, Pose2, Mapper], None] | None = None,
) -> BuiltMap:
    """Map a recorded run, scan after scan, as if it happened now.

    Where the run has no odometry, it is found by matching each scan with the last ones.

    Args:
        run: Scans with odometry; its reference is only compared with at the end.
        config: The mapper's settings, one set for all logs and for the simulation.
        watch: Called after each scan with its number, the estimate and the mapper (for progress and recording).
    """
    import scipy.sparse.linalg  # noqa: F401  (loading it takes longer than closing a loop; not part of the timing)

    config = config or MapperConfig()
    mapper = Mapper(config)
    online = np.empty((len(run.scans), 3))
    seconds = 0.0
    made_ready = prepare_scans(run.scans, config)
    follower = None if run.has_odometry else ScanOdometry(config)
    odometry = np.array(run.odometry)
    for i, scan in enumerate(run.scans):
        start = time.perf_counter()
        prepared = next(made_ready)
        if follower is not None:
            odometry[i] = follower.follow(prepared.points, scan.stamp).as_tuple()
        estimate = mapper.process(scan, Pose2(*odometry[i]), prepared=prepared)
        seconds += time.perf_counter() - start
        online[i] = estimate.as_tuple()
        if watch is not None:
            watch(i, estimate, mapper)
    start = time.perf_counter()
    mapper.finish()
    grid = mapper.grid()
    seconds += time.perf_counter() - start
    stamps, trajectory = mapper.trajectory()
    errors = {}
    if run.reference is not None:
        moved = "odometry" if run.has_odometry else "scans_alone"
        estimates = {moved: odometry, "online": online, "final": trajectory}
        errors = {name: ate(poses, run.reference) for name, poses in estimates.items()}
    return BuiltMap(
        grid,
        mapper.doors(),
        stamps,
        trajectory,
        mapper.loops,
        len(mapper.keyframes),
        seconds,
        errors,
        (
            *(() if follower is None else _lost_remarks(follower.lost, follower.not_held, len(run.scans))),
            *mapper.events,
            *(() if grid.occupied.any() else _empty_remarks(run, config)),
        ),
    )


def _empty_remarks(run: RecordedRun, config: MapperConfig) -> tuple[Remark, ...]:
    """Say why a map shows no wall: as a rule, ranges are in another unit."""
    ranges = np.concatenate([scan.ranges[scan.hits] for scan in run.scans])
    seen = f"half of the echoes are farther than {np.median(ranges):.4g} m" if ranges.size else "no echo in any scan"
    why = f"{seen}; the map takes those up to {config.max_range:g} m"
    return (Remark(action="dropped", what="walls", why=why, loss=True),)


def _lost_remarks(lost: int, not_held: int, scans: int) -> tuple[Remark, ...]:
    """Say that scans of a robot without odometry fit nowhere, or as well further along a hall."""
    remarks = []
    if lost:
        why = "they fit nowhere, and there is no odometry; taken to go on as before"
        remarks.append(Remark(action="guessed", what="scans' poses", why=why, count=lost, loss=True))
    if not_held > MOST_NOT_HELD * scans:
        why = "they fit as well further along a hall, and there is no odometry: it may be metres too short or too long"
        remarks.append(Remark(action="guessed", what="scans' poses", why=why, count=not_held, loss=True))
    return tuple(remarks)
