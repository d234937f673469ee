"""One exploration of a building with all doors open, from which maps with closed doors can be redrawn."""

from dataclasses import dataclass

import numpy as np

from closedrooms.core.arrays import FloatArray
from closedrooms.core.errors import InvalidInputError
from closedrooms.core.pose import Pose2
from closedrooms.mapping.config import MapperConfig
from closedrooms.mapping.logs.recorded_run import RecordedRun
from closedrooms.mapping.mapper import Mapper
from closedrooms.navigation.config import NavigationConfig
from closedrooms.navigation.control_loop import LoopStatus
from closedrooms.pipeline.reporting.progress import Silent
from closedrooms.pipeline.reporting.run_log import RunLog
from closedrooms.pipeline.survey import survey_building
from closedrooms.sim.config import SimConfig
from closedrooms.sim.simulation import Simulation
from closedrooms.worlds.plan import FloorPlan


@dataclass(frozen=True, slots=True, eq=False)
class OpenSurvey:
    """Recording that a robot brought home from a building with all doors open.

    Attributes:
        plan: The building.
        sim: How it was simulated.
        mapper: How it was mapped.
        seed: Of every source of noise, also of the erased maps'.
        world_T_map: The start.
        status: How the exploration ended.
        seconds: Simulated time [s].
        keyframes: The scans that make the map, with odometry and true poses (``reference``).
        poses: ``map_T_robot`` of the keyframes after the last optimisation, shape (k, 3).
        stamps: Times of all scans [s], shape (n,).
        estimate: Estimated poses of all scans, shape (n, 3), map frame.
        true_poses: True poses of all scans, shape (n, 3), map frame.
    """

    plan: FloorPlan
    sim: SimConfig
    mapper: MapperConfig
    seed: int
    world_T_map: Pose2
    status: LoopStatus
    seconds: float
    keyframes: RecordedRun
    poses: FloatArray
    stamps: FloatArray
    estimate: FloatArray
    true_poses: FloatArray

    @property
    def keyframe_true_poses(self) -> FloatArray:
        """True poses of the keyframes, shape (k, 3), map frame."""
        assert self.keyframes.reference is not None, "a survey keeps true poses"
        return self.keyframes.reference


def survey_open(
    plan: FloorPlan, sim: SimConfig, mapper: MapperConfig, navigation: NavigationConfig, seed: int
) -> OpenSurvey:
    """Explore a building with all doors open.

    Args:
        plan: The building.
        sim: Robot, lidar, odometry and their noise.
        mapper: The mapper.
        navigation: Exploration.
        seed: Of every source of noise.

    Raises:
        InvalidInputError: The robot does not fit at the start, or got stuck where it knows nothing.
    """
    with Simulation(plan, (), sim, seed) as world:
        log, slam = RunLog(world, Silent(), keep_scans=True), Mapper(mapper)
        survey = survey_building(log, slam, navigation)
        recorded, world_T_map = log.recorded(), world.world_T_map
    if not slam.keyframes:
        raise InvalidInputError("an exploration without a scan", expected="a map", where=plan.name)
    stamps = np.array([keyframe.stamp for keyframe in slam.keyframes])
    rows = np.searchsorted(survey.stamps, stamps)
    keyframes = RecordedRun(tuple(recorded.scans[i] for i in rows), recorded.odometry[rows], survey.true_poses[rows])
    poses = np.array([keyframe.pose.as_tuple() for keyframe in slam.keyframes])
    exploration = survey.exploration
    return OpenSurvey(
        plan, sim, mapper, seed, world_T_map, exploration.status, exploration.seconds, keyframes, poses,
        survey.stamps, survey.estimate, survey.true_poses,
    )  # fmt: skip
