"""Driving the coverage tour of the predicted map, with the doors open and the map growing (beyond section 5)."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, field
from typing import Literal, Protocol

import numpy as np

from closedrooms.core.arrays import FloatArray
from closedrooms.core.door import ClosedDoor
from closedrooms.core.grid import OccupancyGrid
from closedrooms.core.pose import Pose2
from closedrooms.coverage.config import CoverageConfig
from closedrooms.coverage.tour import CoverageTour
from closedrooms.mapping.config import MapperConfig
from closedrooms.navigation.config import NavigationConfig
from closedrooms.navigation.exploration import StepWatch, World
from closedrooms.navigation.observer import NoObserver, Observer
from closedrooms.navigation.opened_doors import KeyframeMap, ReopenedMap
from closedrooms.navigation.tour_follower import Revision, TourGuide
from closedrooms.predictor.prediction import Prediction
from closedrooms.predictor.revision import Predict

DriveStatus = Literal["complete", "limit", "stuck"]

# While doors open the robot waits so long [s].
DOOR_WAIT = 2.5


class WorldWithDoors(World, Protocol):
    """A world whose doors can be opened."""

    def open_door(self, door_id: str) -> None:
        """Let a closed door open."""

    def door_states(self) -> dict[str, float]:
        """How far each door is open, 0 to 1."""


@dataclass(frozen=True, slots=True, eq=False)
class DriveResult:
    """How the tour went.

    Attributes:
        status: ``complete`` when every vertex was visited or found to be out of reach, ``limit`` when the time was up,
            ``stuck`` when the robot could not get free.
        planned_length: Length of the tour on the predicted map [m].
        driven_length: Way driven as estimated [m].
        seconds: Simulated time of the drive [s].
        visited: Vertices visited.
        unreachable: Vertices that could not be reached, map frame, shape (n, 2) [m].
        replans: Times the tour was solved again.
        revisions: What was learnt, in order.
        prediction: As it stands at the end.
        grid: The map at the end, without the leaves of opened doors.
        path: Way driven, map frame, shape (n, 2) [m].
        stamps: Time of each of its points [s], shape (n,).
        wall_seconds: Wall-clock time by step: ``sense``, ``map``, ``navigate``, ``move``, ``observe``.
    """

    status: DriveStatus
    planned_length: float
    driven_length: float
    seconds: float
    visited: int
    unreachable: FloatArray
    replans: int
    revisions: tuple[Revision, ...]
    prediction: Prediction
    grid: OccupancyGrid
    path: FloatArray
    stamps: FloatArray
    wall_seconds: dict[str, float] = field(default_factory=dict)


def drive(
    sim: WorldWithDoors,
    mapper: KeyframeMap,
    prediction: Prediction,
    tour: CoverageTour,
    doors: Sequence[ClosedDoor],
    config: NavigationConfig,
    *,
    closed: Collection[str],
    predictor: Predict,
    coverage: CoverageConfig,
    mapping: MapperConfig | None = None,
    observer: Observer | None = None,
    period: float = 0.1,
) -> DriveResult:
    """Open the closed doors and drive the tour; prediction and tour are revised by what is seen.

    Args:
        sim: The world, sensed and acted on.
        mapper: The mapper that made the map; it goes on.
        prediction: The completed map.
        tour: The tour on it, from where the robot is.
        doors: The closed doors as detected.
        config: Planning and driving, and the limit of simulated time for the drive.
        closed: Ids of the doors to open.
        predictor: Predicts rooms anew.
        coverage: For tours that are solved again.
        mapping: As the mapper has it.
        observer: Told of every scan and revision.
        period: Time between scans [s].

    Returns:
        Figures, what was learnt and the way driven; the map stays in ``mapper``.
    """
    observer = observer or NoObserver()
    for door in sorted(closed):
        sim.open_door(door)
    reopened = ReopenedMap(mapper, [door for door in doors if door.id in closed], mapping)
    guide = TourGuide(prediction, tour, doors, config, predictor, coverage)
    watch = StepWatch()
    status: DriveStatus = "limit"
    stamps: list[float] = []
    poses: list[Pose2] = []
    told = 0
    while True:
        observation = sim.observe()
        scan = observation.scan
        watch.lap("sense")
        pose = mapper.process(scan, observation.odometry, observation.sightings)
        watch.lap("map")
        stamps.append(scan.stamp)
        poses.append(pose)
        waiting = scan.stamp - stamps[0] < DOOR_WAIT
        v, w = (0.0, 0.0) if waiting else guide.command(pose, scan, reopened.grid)
        watch.lap("navigate")
        observer.observation(observation, pose)
        if waiting:
            observer.door_states(sim.door_states(), scan.stamp)
        if observer.wants_map(scan.stamp):
            observer.map(reopened.grid(), scan.stamp)
        if len(guide.revisions) != told or (told == 0 and len(stamps) == 1):
            for revision in guide.revisions[told:]:
                observer.note(_said(revision), scan.stamp)
            told = len(guide.revisions)
            observer.revision(guide.prediction, guide.way(), scan.stamp)
        watch.lap("observe")
        if guide.status is not None:
            status = guide.status
            break
        if scan.stamp - stamps[0] >= config.time_limit - 1e-9:
            break
        sim.step(v, w, period)
        watch.lap("move")
    path = np.array([(pose.x, pose.y) for pose in poses])
    driven = float(np.hypot(*np.diff(path, axis=0).T).sum())
    observer.note(f"tour {status}: {tour.length:.1f} m planned, {driven:.1f} m driven", stamps[-1])
    return DriveResult(
        status,
        tour.length,
        driven,
        stamps[-1] - stamps[0],
        guide.stops.visited,
        np.array(guide.unreachable).reshape(-1, 2),
        guide.replans,
        tuple(guide.revisions),
        guide.prediction,
        reopened.grid(),
        path,
        np.array(stamps),
        watch.seconds,
    )


def _said(revision: Revision) -> str:
    """One line of the log."""
    looked = f"looked behind {', '.join(revision.doors)}" if revision.doors else "prediction revised"
    changed = f", other shape behind {', '.join(revision.changed)}" if revision.changed else ""
    return f"{looked}{changed}{': new tour' if revision.replanned else ''}"
