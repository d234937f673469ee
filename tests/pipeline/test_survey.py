"""A survey ends: complete, or with the reason."""

from dataclasses import replace

import pytest

from closedrooms.core.observation import Observation
from closedrooms.core.pose import Pose2
from closedrooms.core.robot import RobotConfig
from closedrooms.mapping.mapper import Mapper
from closedrooms.navigation.config import NavigationConfig
from closedrooms.pipeline.reporting.progress import Silent
from closedrooms.pipeline.reporting.run_log import RunLog
from closedrooms.pipeline.survey import Survey, survey_building
from closedrooms.sim.config import SimConfig, noise_level
from closedrooms.sim.simulation import Simulation
from closedrooms.worlds.plan import FloorPlan

pytestmark = pytest.mark.simulation


def survey_of(plan: FloorPlan, **limits: float) -> Survey:
    config = SimConfig(noise=noise_level("none"))
    with Simulation(plan, (), config, 0) as sim:
        log = RunLog(sim, Silent(), keep_scans=False)
        return survey_building(log, Mapper(), NavigationConfig(**limits))  # type: ignore[arg-type]


def test_a_building_with_a_gap_in_its_outline_ends_the_survey_as_outside(flat: FloorPlan) -> None:
    leaky = replace(flat, walls=tuple(wall for wall in flat.walls if wall.id not in {"w0", "w1", "w2"}))
    survey = survey_of(leaky)
    assert survey.exploration.status == "outside"
    assert "left the building" in survey.exploration.reason
    assert survey.grid.known.any()
    assert survey.exploration.seconds < 300.0


def test_a_whole_building_is_surveyed_to_the_end(flat: FloorPlan) -> None:
    survey = survey_of(flat)
    assert (survey.exploration.status, survey.exploration.reason) == ("complete", "")
    assert len(survey.true_poses) == survey.exploration.scans == len(survey.stamps)


def test_the_limit_of_time_ends_a_survey_with_the_map_so_far(flat: FloorPlan) -> None:
    survey = survey_of(flat, time_limit=2.0)
    assert survey.exploration.status == "limit"
    assert survey.exploration.seconds == pytest.approx(2.0)
    assert survey.grid.known.any()


class Bumps(RunLog):
    """Count of the steps in which the robot touched something."""

    count = 0

    def step(self, v: float, w: float, duration: float) -> None:
        super().step(v, w, duration)
        self.count += self.sim.collided


def test_the_radius_that_is_simulated_is_planned_with(flat: FloorPlan) -> None:
    # Doors of 0.9 m: a robot of 0.44 m radius does not try them, and enters the room with the wide opening alone. In
    # the map the corridor's wall is at y = 1 m and that room begins at x = 5 m.
    config = SimConfig(noise=noise_level("none"), robot=RobotConfig(radius=0.44))
    with Simulation(flat, (), config, 0) as sim:
        log = Bumps(sim, Silent(), keep_scans=False)
        assert survey_building(log, Mapper(), NavigationConfig()).exploration.status == "complete"
    assert log.count < 20
    assert not ((log.true_poses[:, 1] > 1.2) & (log.true_poses[:, 0] < 4.5)).any()


def test_the_log_hands_out_observations_and_keeps_the_truth(flat: FloorPlan) -> None:
    with Simulation(flat, (), SimConfig(), 0) as sim:
        log = RunLog(sim, Silent(), keep_scans=True)
        seen = log.observe()
        log.step(0.5, 0.3, 0.5)
        log.observe()
        assert isinstance(seen, Observation)
        assert log.map_T_robot == sim.map_T_robot != Pose2()
        assert log.true_poses.tolist() == [list(Pose2().as_tuple()), list(sim.map_T_robot.as_tuple())]
        assert len(log.recorded().scans) == 2
