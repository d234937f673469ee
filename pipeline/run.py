"""The main job: simulate, map, predict, plan, compare with the truth, write the run directory."""

import contextlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from closedrooms.core.errors import InvalidInputError
from closedrooms.core.files.output_folders import check_output_folder, output_folder
from closedrooms.core.grid import OccupancyGrid
from closedrooms.core.names import file_name
from closedrooms.core.random import stream
from closedrooms.core.report import Report
from closedrooms.coverage.config import CoverageConfig
from closedrooms.coverage.cost_spread import CostSpread, spread_cost
from closedrooms.coverage.tour.coverage_tour import CoverageTour
from closedrooms.coverage.tour.tour_planner import plan_coverage
from closedrooms.mapping.logs.bags.bag_writer import check_bags, write_bag
from closedrooms.mapping.logs.npz import write_scans
from closedrooms.mapping.mapper import Mapper
from closedrooms.navigation.tour.tour_follower import TourPlan
from closedrooms.pipeline.bounds import check_size, check_width, too_narrow
from closedrooms.pipeline.drive import DriveSettings, drive_tour
from closedrooms.pipeline.options.run import RunConfig
from closedrooms.pipeline.reporting.live_recording import InterimPrediction
from closedrooms.pipeline.reporting.manifest import resolved, versions
from closedrooms.pipeline.reporting.progress import Progress, Silent
from closedrooms.pipeline.reporting.report import markdown, run_report
from closedrooms.pipeline.reporting.run_directory import Finding, run_figures, stopped_stages, write_run_files
from closedrooms.pipeline.reporting.run_log import RunLog
from closedrooms.pipeline.reporting.run_scores import room_iou
from closedrooms.pipeline.reporting.stopwatch import Stopwatch
from closedrooms.pipeline.reporting.story import describe_robot, summarise_run
from closedrooms.pipeline.survey import Survey, survey_building, true_building
from closedrooms.predictor.methods import predict
from closedrooms.predictor.prediction import Prediction
from closedrooms.sim.simulation import Simulation
from closedrooms.visualization.rerun.optional_recording import open_recording
from closedrooms.worlds.closing import check_closed, closable_rooms, draw_closed
from closedrooms.worlds.library import load_world, world_source
from closedrooms.worlds.plan import FloorPlan
from closedrooms.worlds.truth import true_rooms

if TYPE_CHECKING:
    from closedrooms.visualization.rerun.live import LiveViewer
    from closedrooms.visualization.rerun.recorder import Recorder

DEFAULT_CLOSED = 5
START = (0.0, 0.0)


# What says where a run is written and watched, and how many there are, but nothing of its result.
ASIDE = ("out", "world", "more_worlds", "seeds", "live", "web")


def run(config: RunConfig, *, progress: Progress | None = None) -> Report:
    """Simulate a robot in a building with closed doors and predict what it could not see.

    Args:
        config: Options; the fields are documented there.
        progress: Told what the run does.

    Returns:
        The figures, which also stand in ``run.json`` of the run directory.

    Raises:
        InvalidInputError: The world, the doors or an option is not usable.
        OutputError: The run directory cannot be written, or holds something that is not ours.
    """
    progress, watch = progress or Silent(), Stopwatch()
    if config.sim.robot_urdf is not None:
        from closedrooms.sim.robot.robot_urdf import with_own_robot

        config = replace(config, sim=with_own_robot(config.sim))
    with watch.stage("world"):
        progress.stage("world")
        plan = load_world(config.world, level=config.level)
        closed = choose_closed(plan, config)
        folder = config.out or Path("runs") / f"{file_name(plan.name)}-{config.seed}"
        check_output_folder(folder, "run", sources=[Path(config.world)])
        check_width(plan, config.sim.robot)
        if config.bag:
            check_bags()
        check_size(plan, config.mapper.resolution, config.navigation)
    manifest: dict[str, Any] = {
        "command": "run",
        "configuration": resolved(config, leave_out=ASIDE),
        "paths": {"world": world_source(config.world)},
        "world": plan.name,
        "seed": config.seed,
        "closed": list(closed),
        "versions": versions(),
    }
    name, record = f"{plan.name}-{config.seed}", config.record
    with (
        _watched(config, progress) as viewer,
        output_folder(folder, manifest) as staging,
        open_recording(staging / "run.rrd" if record else None, config.sim.robot, name=name, viewer=viewer) as recorder,
        Simulation(plan, closed, config.sim, config.seed) as sim,
    ):
        recorder.configuration(manifest["configuration"])
        recorder.building(sim.plan, sim.world_T_map.inverse(), closed)
        recorder.note(describe_robot(config))
        log, mapper = RunLog(sim, progress, keep_scans=config.keep_scans or config.bag), Mapper(config.mapper)
        found = _find_out(config, closed, log, mapper, recorder, progress, watch)
        remarks = [
            *plan.remarks,
            *mapper.events,
            *too_narrow(plan, closed, sim.world_T_map, config.navigation.for_robot(config.sim.robot)),
        ]
        manifest |= run_figures(plan, closed, sim.world_T_map.inverse(), found)
        manifest["remarks"] = [remark.as_json() for remark in remarks]
        recorder.note(summarise_run(manifest["metrics"]))
        with watch.stage("write"):
            progress.stage("write")
            write_run_files(staging, found, manifest["metrics"])
            if config.keep_scans:
                write_scans(staging / "scans.npz", log.recorded(), estimate=mapper.trajectory()[1])
            if config.bag:
                write_bag(staging / "sensed", log.recorded())
        manifest["durations"] = watch.seconds()
        title = f"{plan.name}, seed {config.seed}, noise {config.noise}"
        result = run_report(folder, title, manifest, stopped=stopped_stages(found), remarks=remarks)
        recorder.table(markdown(result))
    return result


@contextlib.contextmanager
def _watched(config: RunConfig, progress: Progress) -> Iterator["LiveViewer | None"]:
    """Open a viewer to stream to, on demand."""
    if not (config.live or config.web):
        yield None
        return
    from closedrooms.visualization.rerun.live import open_viewer

    with open_viewer(web=config.web, tell=progress.tell) as viewer:
        yield viewer


def _find_out(
    config: RunConfig,
    closed: Sequence[str],
    log: RunLog,
    mapper: Mapper,
    recorder: "Recorder",
    progress: Progress,
    watch: Stopwatch,
) -> Finding:
    """Explore, predict, plan tours and, on demand, drive the predicted one."""
    plan, map_T_world = log.sim.plan, log.sim.world_T_map.inverse()
    interim = None
    if config.record:
        method = partial(predict, method=config.method, config=config.predictor, trace=True)
        interim = InterimPrediction(recorder, method, true_rooms(plan, closed, map_T_world))
    survey = survey_building(
        log, mapper, config.navigation, recorder=recorder, interim=interim, progress=progress, watch=watch
    )
    with watch.stage("predict"):
        progress.stage("predict")
        prediction = predict(survey.grid, survey.doors, config.method, config.predictor, trace=config.record)
        truth = true_building(plan, closed, prediction.grid.frame, map_T_world)
        recorder.truth(truth.grid, truth.rooms)
        iou = room_iou(prediction.rooms, truth.rooms)
        recorder.prediction(survey.grid, survey.doors, prediction, iou=iou)
    survey = replace(survey, grid=survey.grid.on(truth.grid.frame))
    prediction = replace(prediction, grid=prediction.grid.on(truth.grid.frame))
    with watch.stage("cover"):
        progress.stage("cover")
        tours, missing, notes = plan_tours(survey, prediction, truth.grid, config)
        recorder.tours(tours)
        spread = _spread(survey, prediction, tours, config, recorder)
    found = Finding(survey, prediction, truth, tours, missing, notes, spread)
    if not config.drive or "predicted" not in tours:
        return found
    with watch.stage("drive"):
        progress.stage("drive")
        tour = TourPlan(prediction, tours["predicted"], tuple(survey.doors), config.unsure_first)
        settings = DriveSettings(
            navigation=config.navigation.for_robot(config.sim.robot),
            mapper=config.mapper,
            predictor=partial(predict, method=config.method, config=config.predictor),
            coverage=_coverage_for_robot(config),
            spent=survey.exploration.cpu_seconds,
        )
        return replace(found, driven=drive_tour(log, mapper, tour, closed, settings, recorder))


def choose_closed(plan: FloorPlan, config: RunConfig) -> tuple[str, ...]:
    """Choose the doors to close: as named, or those of rooms drawn by the seed.

    Raises:
        InvalidInputError: Unknown doors, or more rooms than can be closed.
    """
    if config.close_doors is not None:
        names = [name.strip() for name in config.close_doors.split(",") if name.strip()]
        return check_closed(plan, names)
    count = config.close
    if count is None:
        count = min(DEFAULT_CLOSED, len(closable_rooms(plan, several_doors=config.several_doors)))
    return draw_closed(plan, count, stream(config.seed, "closed doors"), several_doors=config.several_doors)


def plan_tours(
    survey: Survey, prediction: Prediction, truth: OccupancyGrid, config: RunConfig
) -> tuple[dict[str, CoverageTour], dict[str, str], list[str]]:
    """Plan tours on M with a vertex at every closed door, on M_pred and on M_GT (paper, section 5.2).

    Returns:
        Tours by the names ``closed``, ``predicted`` and ``truth``, why one is missing, and what their planning says.
    """
    tours: dict[str, CoverageTour] = {}
    missing: dict[str, str] = {}
    notes: list[str] = []
    coverage = _coverage_for_robot(config)
    for name, grid, doors in (
        ("closed", survey.grid, survey.doors),
        ("predicted", prediction.grid, ()),
        ("truth", truth, ()),
    ):
        try:
            tours[name] = plan_coverage(grid, doors, coverage, start=START, map_name=name)
        except InvalidInputError as error:
            missing[name] = f"no tour on the {name} map: {error}"
            continue
        notes += [f"tour on the {name} map: {note}" for note in tours[name].notes]
    return tours, missing, notes


def _spread(
    survey: Survey,
    prediction: Prediction,
    tours: Mapping[str, CoverageTour],
    config: RunConfig,
    recorder: "Recorder",
) -> CostSpread | None:
    """Estimate what covering the building may cost, where asked for and where there is a tour on the predicted map."""
    if not config.completions or "predicted" not in tours:
        return None
    spread = spread_cost(
        tours["predicted"].length,
        survey.grid.frame,
        survey.doors,
        prediction.rooms,
        prediction.probability,
        _coverage_for_robot(config),
        count=config.completions,
        seed=config.seed,
    )
    likely = f"{spread.mean:.1f} m, likely {spread.low:.1f} to {spread.high:.1f} m"
    recorder.note(f"tour over {config.completions} completions: {likely}")
    return spread


def _coverage_for_robot(config: RunConfig) -> CoverageConfig:
    """Set the tours for the robot that is simulated."""
    return replace(config.coverage, graph=replace(config.coverage.graph, robot_radius=config.sim.robot.radius))
