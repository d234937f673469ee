"""One drive through a building with ideal sensors, and what a mapper makes of it with worse ones.

Every level of noise is put on the same drive, so that two levels differ in nothing but the noise.
"""

import itertools
import math
from dataclasses import dataclass, replace

import numpy as np

from closedrooms.core.arrays import FloatArray
from closedrooms.core.pose import Pose2, wrap_angle
from closedrooms.core.random import stream
from closedrooms.core.scan import LaserScan
from closedrooms.experiments.dataset.open_survey import OpenSurvey
from closedrooms.mapping.config import MapperConfig
from closedrooms.mapping.logs.recorded_run import RecordedRun
from closedrooms.mapping.mapper import Mapper
from closedrooms.navigation.config import NavigationConfig
from closedrooms.navigation.control_loop import LoopStatus
from closedrooms.pipeline.reporting.progress import Silent
from closedrooms.pipeline.reporting.run_log import RunLog
from closedrooms.pipeline.survey import survey_building
from closedrooms.sim.config import NOISE_LEVELS, FaultConfig, NoiseConfig, SimConfig
from closedrooms.sim.faults import Faults
from closedrooms.sim.odometry import Odometry
from closedrooms.sim.robot.driven_robot import Motion
from closedrooms.sim.simulation import Simulation
from closedrooms.worlds.plan import FloorPlan
from closedrooms.worlds.start_pose import start_pose

# No furniture this near to the start [m]: the robot's radius and room to turn.
START_CLEAR = 0.6


@dataclass(frozen=True, slots=True, eq=False)
class RecordedDrive:
    """Observations of ideal sensors on one exploration with all doors open.

    Attributes:
        plan: The building.
        sim: Robot and lidar, without noise.
        run: Every scan; odometry and reference are the true poses, map frame.
        world_T_map: The start.
        status: How the exploration ended.
    """

    plan: FloorPlan
    sim: SimConfig
    run: RecordedRun
    world_T_map: Pose2
    status: LoopStatus


def record_drive(
    plan: FloorPlan, sim: SimConfig, mapper: MapperConfig, navigation: NavigationConfig, seed: int
) -> RecordedDrive:
    """Explore a building with all doors open and ideal sensors.

    Args:
        plan: The building.
        sim: Robot and lidar.
        mapper: The mapper that the exploration steers by.
        navigation: Exploration.
        seed: Of the start's heading.

    Raises:
        InvalidInputError: The robot does not fit at the start.
    """
    ideal = replace(sim, noise=NOISE_LEVELS["none"])
    with Simulation(plan, (), ideal, seed) as world:
        log = RunLog(world, Silent(), keep_scans=True)
        survey = survey_building(log, Mapper(mapper), navigation)
        return RecordedDrive(plan, ideal, log.recorded(), world.world_T_map, survey.exploration.status)


def map_drive(
    drive: RecordedDrive, noise: NoiseConfig, mapper: MapperConfig, seed: int, faults: FaultConfig | None = None
) -> OpenSurvey:
    """Map a drive again as worse sensors would have seen it.

    Args:
        drive: The drive.
        noise: Put on scans and odometry.
        mapper: The mapper.
        seed: Of the noise.
        faults: What fails beside it.
    """
    scans = _disturbed(drive.run.scans, noise, seed)
    truth = drive.run.reference
    assert truth is not None, "a drive keeps true poses"
    odometry = _drifted(truth, noise, seed)
    if faults is not None and faults != FaultConfig():
        spoilt = Faults(faults, drive.plan, seed)
        told = [spoilt.odometry(Pose2(*pose), scan.stamp) for pose, scan in zip(odometry, scans, strict=True)]
        odometry = np.array([pose.as_tuple() for pose in told])
        scans = [spoilt.scan(scan) for scan in scans]
    slam = Mapper(mapper)
    for scan, pose in zip(scans, odometry, strict=True):
        slam.process(scan, Pose2(*pose))
    slam.finish()
    stamps, estimate = slam.trajectory()
    rows = np.searchsorted(stamps, [keyframe.stamp for keyframe in slam.keyframes])
    keyframes = RecordedRun(tuple(scans[row] for row in rows), odometry[rows], truth[rows])
    poses = np.array([keyframe.pose.as_tuple() for keyframe in slam.keyframes])
    return OpenSurvey(
        drive.plan, replace(drive.sim, noise=noise), mapper, seed, drive.world_T_map, drive.status, float(stamps[-1]),
        keyframes, poses, stamps, estimate, truth,
    )  # fmt: skip


def odometry_noise(times_medium: float) -> NoiseConfig:
    """Scale the odometry errors of the noise level ``medium``; the lidar is ideal."""
    medium = NOISE_LEVELS["medium"]
    return replace(
        NOISE_LEVELS["none"],
        distance=medium.distance * times_medium,
        turn_per_metre=medium.turn_per_metre * times_medium,
        turn=medium.turn * times_medium,
    )


def _disturbed(scans: tuple[LaserScan, ...], noise: NoiseConfig, seed: int) -> list[LaserScan]:
    """Disturb scans by the lidar's noise, as the simulation puts it on."""
    far, silent = stream(seed, "lidar", "range"), stream(seed, "lidar", "dropouts")
    disturbed = []
    for scan in scans:
        ranges = scan.ranges + noise.range_sd * far.standard_normal(scan.ranges.size)
        ranges = np.where(ranges < scan.range_min, math.nan, ranges)
        ranges = np.where(ranges >= scan.range_max, math.inf, ranges)
        # Drawn whether used or not: the ones that are silent at one level are silent at every higher one.
        ranges = np.where(silent.random(ranges.size) < noise.dropouts, math.nan, ranges)
        disturbed.append(replace(scan, ranges=ranges))
    return disturbed


def _drifted(truth: FloatArray, noise: NoiseConfig, seed: int) -> FloatArray:
    """Compute the odometry of a drive, shape (n, 3), from its true poses."""
    odometry = Odometry(noise, seed)
    poses = [odometry.pose.as_tuple()]
    for before, after in itertools.pairwise(truth):
        step = Pose2(*before).inverse() @ Pose2(*after)
        odometry.add(Motion(step.x, step.y, wrap_angle(step.theta)))
        poses.append(odometry.pose.as_tuple())
    return np.array(poses)


def furnished(plan: FloorPlan, share: float, seed: int) -> FloorPlan:
    """Furnish a plan anew with a share of what would fill it; the robot starts where it would without.

    Args:
        plan: The building; its own furniture is taken out.
        share: 0 to 1; what stands in the rooms at one share also stands there at a larger one.
        seed: Of the furniture.
    """
    import shapely

    from closedrooms.worlds.generation.furniture import furnish

    bare = replace(plan, furniture=())
    start = start_pose(bare)
    bare = replace(bare, start=start.as_tuple())
    if share <= 0.0:
        return bare
    full = furnish(bare, stream(seed, "furniture", plan.name)).furniture
    chance = stream(seed, "furniture", "share", plan.name).random(len(full))
    place = shapely.Point(start.x, start.y)
    kept = [
        thing
        for thing, value in zip(full, chance, strict=True)
        if value < share and thing.polygon.distance(place) > START_CLEAR
    ]
    return replace(bare, furniture=tuple(kept))
