"""A predicted tour, driven through the doors that were closed."""

from functools import partial
from typing import Any

import pytest

from closedrooms.core.random import stream
from closedrooms.coverage.config import CoverageConfig
from closedrooms.coverage.tour.tour_planner import plan_coverage
from closedrooms.mapping.config import MapperConfig
from closedrooms.mapping.mapper import Mapper
from closedrooms.navigation.config import NavigationConfig
from closedrooms.navigation.tour.tour_follower import TourPlan
from closedrooms.pipeline.drive import DriveSettings, Porter, drive_tour
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


class _Told:
    """Stand-in for simulation, map, follower and recorder at once; remembers what was asked of it."""

    def __init__(self, first: list[str]) -> None:
        self.first, self.opened, self.map, self.notes = first, [], [], []
        self.sim = self

    def open_door(self, door: str) -> None:
        self.opened.append(door)

    def note_opened(self, doors: list[str]) -> None:
        self.map += doors

    def doors_first(self) -> tuple[str, ...]:
        return tuple(self.first)

    def note(self, text: str, stamp: float) -> None:
        self.notes.append((text, stamp))


def test_doors_of_unsure_rooms_open_one_after_the_other_and_then_all_others() -> None:
    told = _Told(["d3", "d1"])
    porter: Any = Porter(told, told, told, ["d1", "d2", "d3", "d4"], told)  # type: ignore[arg-type]
    porter.open_next(1.0)
    porter.open_next(2.0)
    assert told.opened == ["d3"]
    told.first = ["d1"]  # the first one has been seen
    porter.open_next(9.0)
    assert told.opened == ["d3", "d1"]
    assert porter.is_opening(9.5)
    assert not porter.is_opening(30.0)
    told.first = []
    porter.open_next(40.0)
    assert told.opened == told.map == ["d3", "d1", "d2", "d4"]
    porter.open_next(41.0)
    assert len(told.opened) == 4
    assert [stamp for _, stamp in told.notes] == [1.0, 9.0, 40.0]


def test_without_a_wish_all_doors_open_at_once() -> None:
    told = _Told([])
    Porter(told, told, told, ["d2", "d1"], told).open_next(0.0)  # type: ignore[arg-type]
    assert told.opened == ["d1", "d2"]


@pytest.mark.slow
def test_the_least_sure_room_is_opened_and_seen_before_the_others() -> None:
    plan = load_world("office-01")
    closed = draw_closed(plan, 3, stream(0, "closed doors"))
    with Simulation(plan, closed, SimConfig(), 0) as sim:
        log, mapper = RunLog(sim, Silent(), keep_scans=False), Mapper(MapperConfig())
        survey = survey_building(log, mapper, NavigationConfig())
        settings = DriveSettings(
            navigation=NavigationConfig().for_robot(sim.config.robot),
            mapper=MapperConfig(),
            predictor=partial(predict, method="best"),
            coverage=CoverageConfig(),
        )
        prediction = settings.predictor(survey.grid, survey.doors)
        sure = {door: room.confidence or 0.0 for room in prediction.rooms for door in room.doors}
        order = sorted(closed, key=lambda door: sure[door])
        tour = plan_coverage(prediction.grid, (), settings.coverage, start=(mapper.pose.x, mapper.pose.y))
        to_drive = TourPlan(prediction, tour, tuple(survey.doors), unsure=1.0)
        result = drive_tour(log, mapper, to_drive, closed, settings, no_recording())
    assert result.log.status == "complete"
    seen = [door for revision in result.outcome.revisions for door in revision.doors]
    assert seen[0] == order[0]
    assert set(seen) == set(closed)
