"""A predicted tour, driven through the doors that were closed."""

from functools import partial

import pytest

from closedrooms.core.random import stream
from closedrooms.coverage.config import CoverageConfig
from closedrooms.coverage.tour.tour_planner import plan_coverage
from closedrooms.mapping.config import MapperConfig
from closedrooms.mapping.mapper import Mapper
from closedrooms.navigation.config import NavigationConfig
from closedrooms.navigation.tour_follower import TourPlan
from closedrooms.pipeline.drive import DriveSettings, drive_tour
from closedrooms.pipeline.reporting.drive_report import drive_metrics
from closedrooms.pipeline.reporting.progress import Silent
from closedrooms.pipeline.reporting.run_log import RunLog
from closedrooms.pipeline.survey import survey_building, true_building
from closedrooms.predictor.methods import predict
from closedrooms.sim.config import SimConfig
from closedrooms.sim.simulation import Simulation
from closedrooms.visualization.no_recording import no_recording
from closedrooms.worlds.closing import draw_closed
from closedrooms.worlds.library import load_world


@pytest.mark.slow
def test_the_tour_of_a_small_office_is_driven_and_every_room_is_seen() -> None:
    plan = load_world("office-01")
    closed = draw_closed(plan, 2, stream(0, "closed doors"))
    with Simulation(plan, closed, SimConfig(), 0) as sim:
        log, mapper = RunLog(sim, Silent(), keep_scans=False), Mapper(MapperConfig())
        survey = survey_building(log, mapper, NavigationConfig())
        assert survey.exploration.status == "complete"
        settings = DriveSettings(
            navigation=NavigationConfig().for_robot(sim.config.robot),
            mapper=MapperConfig(),
            predictor=partial(predict, method="paper"),
            coverage=CoverageConfig(),
        )
        prediction = settings.predictor(survey.grid, survey.doors)
        tour = plan_coverage(prediction.grid, (), settings.coverage, start=(mapper.pose.x, mapper.pose.y))
        plan_to_drive = TourPlan(prediction, tour, tuple(survey.doors))
        result = drive_tour(log, mapper, plan_to_drive, closed, settings, no_recording())
        map_T_world = sim.world_T_map.inverse()
    truth = true_building(plan, closed, result.grid.frame, map_T_world)
    figures = drive_metrics(result, plan, map_T_world, truth, None)
    assert result.log.status == "complete"
    assert {door for revision in result.outcome.revisions for door in revision.doors} == set(closed)
    assert figures["area_covered"] > 0.97
    assert figures["room_iou_mean_end"] > 0.8
    assert result.log.distance < 2.0 * tour.length
