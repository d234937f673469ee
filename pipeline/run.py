"""The main job: simulate, map, predict, plan, compare with the truth, write the run directory."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from closedrooms.core.errors import InvalidInputError
from closedrooms.core.files import check_output_folder, output_folder
from closedrooms.core.geojson import write_doors, write_features, write_rooms
from closedrooms.core.grid import OccupancyGrid
from closedrooms.core.pose import Pose2
from closedrooms.core.random import stream
from closedrooms.core.rosmap import write_map
from closedrooms.core.tum import write_trajectory
from closedrooms.coverage.estimates import compare_tours
from closedrooms.coverage.tour import CoverageTour
from closedrooms.coverage.tour_features import make_tour_features
from closedrooms.coverage.tour_planner import plan_coverage
from closedrooms.mapping.logs.npz import write_scans
from closedrooms.mapping.mapper import Mapper
from closedrooms.mapping.trajectory import ate
from closedrooms.navigation.drive import DriveResult, drive
from closedrooms.navigation.exploration import ExplorationResult
from closedrooms.navigation.observer import Observer
from closedrooms.pipeline.config import RunConfig, predictor_config, sim_config
from closedrooms.pipeline.drive_report import draw_drive, drive_features, drive_metrics
from closedrooms.pipeline.manifest import resolved, versions
from closedrooms.pipeline.progress import Progress, Silent
from closedrooms.pipeline.run_log import Witness
from closedrooms.pipeline.scores import area_mapped, mean, room_iou, rooms_seen
from closedrooms.pipeline.stopwatch import Stopwatch
from closedrooms.pipeline.survey import Survey, Truth, survey_building, true_building
from closedrooms.predictor.predict import predict
from closedrooms.predictor.prediction import Prediction
from closedrooms.sim.simulation import Simulation
from closedrooms.visualization.rerun.opening import open_recording
from closedrooms.worlds.closing import check_closed, closable_rooms, draw_closed
from closedrooms.worlds.library import load_world
from closedrooms.worlds.plan import FloorPlan
from closedrooms.worlds.truth import reachable

DEFAULT_CLOSED = 5
START = (0.0, 0.0)


@dataclass(frozen=True, slots=True, eq=False)
class RunResult:
    """One finished run.

    Attributes:
        folder: The run directory.
        title: Head of the table of results.
        metrics: ``metrics`` of ``run.json``.
        closed: Doors that were closed.
        seen: Closed doors that the robot saw.
        failures: Why a seen door could not be predicted, by door id.
        durations: Seconds by stage.
        exploration: ``exploration`` of ``run.json``: status, simulated seconds, scans, way.
    """

    folder: Path
    title: str
    metrics: dict[str, Any]
    closed: tuple[str, ...]
    seen: tuple[str, ...]
    failures: dict[str, str] = field(default_factory=dict)
    durations: dict[str, float] = field(default_factory=dict)
    exploration: dict[str, Any] = field(default_factory=dict)

    def table(self) -> list[tuple[str, str]]:
        """Rows for people; the first is the head."""
        from closedrooms.pipeline.report import run_rows

        return run_rows(self)


def run(config: RunConfig, *, progress: Progress | None = None) -> RunResult:
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
    config = replace(config, sim=sim_config(config))
    with watch.stage("world"):
        progress.stage("world")
        plan = load_world(config.world, level=config.level)
        closed = choose_closed(plan, config)
        folder = config.out or Path("runs") / f"{plan.name}-{config.seed}"
        check_output_folder(folder)
    manifest: dict[str, Any] = {
        "configuration": resolved(config, leave_out=("out", "world")),
        "world": plan.name,
        "seed": config.seed,
        "closed": list(closed),
        "versions": versions(),
    }
    with (
        output_folder(folder, manifest) as staging,
        open_recording(
            staging / "run.rrd" if config.record else None,
            plan,
            name=f"{plan.name}-{config.seed}",
            driving=config.drive,
        ) as observer,
        Simulation(plan, closed, config.sim, config.seed) as sim,
    ):
        map_T_world = sim.world_T_map.inverse()
        observer.configuration(manifest["configuration"])
        observer.building(plan, map_T_world, closed)
        witness = Witness(sim, progress, keep_scans=config.keep_scans)
        mapper = Mapper(config.mapper)
        survey = survey_building(
            witness, mapper, config.navigation, period=1.0 / config.sim.lidar.rate,
            observer=observer, progress=progress, watch=watch,
        )  # fmt: skip
        with watch.stage("predict"):
            progress.stage("predict")
            settings = predictor_config(config)
            prediction = predict(survey.grid, survey.doors, settings, trace=config.record)
            truth = true_building(plan, closed, prediction.grid.frame, map_T_world)
            observer.prediction(survey.grid, survey.doors, prediction)
            observer.truth(truth.grid, truth.rooms)
        frame = truth.grid.frame
        survey = replace(survey, grid=survey.grid.on(frame))
        prediction = replace(prediction, grid=prediction.grid.on(frame))
        with watch.stage("cover"):
            progress.stage("cover")
            tours, notes = plan_tours(survey, prediction, truth.grid, config)
            observer.tours(tours)
        manifest["exploration"] = _exploration(survey.exploration)
        manifest["metrics"] = _metrics(plan, closed, map_T_world, survey, prediction, truth, tours)
        driven: DriveResult | None = None
        if config.drive and "predicted" in tours:
            with watch.stage("drive"):
                progress.stage("drive")
                driven, figures = _drive(witness, mapper, config, closed, survey, prediction, truth, tours, observer)
            manifest["metrics"]["drive"] = figures
        manifest["doors"] = {
            "seen": [door.id for door in survey.doors],
            "not_seen": sorted(set(closed) - {door.id for door in survey.doors}),
            "failures": prediction.failures,
        }
        manifest["notes"] = notes
        with watch.stage("write"):
            progress.stage("write")
            _write(staging, survey, prediction, truth, tours, driven)
            if config.keep_scans:
                write_scans(staging / "scans.npz", witness.recorded(), estimate=mapper.trajectory()[1])
        manifest["durations"] = watch.seconds()
        result = RunResult(
            folder,
            f"{plan.name}, seed {config.seed}, noise {config.noise}",
            manifest["metrics"],
            closed,
            tuple(door.id for door in survey.doors),
            prediction.failures,
            manifest["durations"],
            manifest["exploration"],
        )
        observer.table(_markdown(result))
    return result


def choose_closed(plan: FloorPlan, config: RunConfig) -> tuple[str, ...]:
    """The doors to close: as named, or those of rooms drawn by the seed.

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
) -> tuple[dict[str, CoverageTour], list[str]]:
    """Tours on M with a vertex at every closed door, on M_pred and on M_GT (paper, section 5.2)."""
    tours: dict[str, CoverageTour] = {}
    notes: list[str] = []
    for name, grid, doors in (
        ("closed", survey.grid, survey.doors),
        ("predicted", prediction.grid, ()),
        ("truth", truth, ()),
    ):
        try:
            tours[name] = plan_coverage(grid, doors, config.coverage, start=START, map_name=name)
        except InvalidInputError as error:
            notes.append(f"no tour on the {name} map: {error}")
            continue
        notes += [f"tour on the {name} map: {note}" for note in tours[name].notes]
    return tours, notes


def _drive(
    witness: Witness,
    mapper: Mapper,
    config: RunConfig,
    closed: Sequence[str],
    survey: Survey,
    prediction: Prediction,
    truth: Truth,
    tours: dict[str, CoverageTour],
    observer: Observer,
) -> tuple[DriveResult, dict[str, Any]]:
    """Open the doors, drive the tour of the predicted map, and judge it."""
    driven = drive(
        witness, mapper, prediction, tours["predicted"], survey.doors, config.navigation,
        closed=closed, predictor=predictor_config(config), coverage=config.coverage, mapping=config.mapper,
        observer=observer, period=1.0 / config.sim.lidar.rate,
    )  # fmt: skip
    seen, sim = driven.grid, witness.sim
    start = sim.world_T_map
    cells = reachable(sim.plan, (), seen.frame, start.inverse(), (start.x, start.y))
    return driven, drive_metrics(driven, truth.rooms, seen, cells, tours.get("truth"))


def _exploration(exploration: ExplorationResult) -> dict[str, Any]:
    return {
        "status": exploration.status,
        "simulated_s": round(exploration.seconds, 3),
        "scans": exploration.scans,
        "distance_m": round(exploration.distance, 3),
        "plans": exploration.plans,
    }


def _metrics(
    plan: FloorPlan,
    closed: Sequence[str],
    map_T_world: Pose2,
    survey: Survey,
    prediction: Prediction,
    truth: Truth,
    tours: dict[str, CoverageTour],
) -> dict[str, Any]:
    """Every figure of the run; units stand in the names or beside them."""
    position, heading = ate(survey.estimate, survey.truth)
    start = map_T_world.inverse()
    cells = reachable(plan, closed, truth.grid.frame, map_T_world, (start.x, start.y))
    seen = {door.id for door in survey.doors}
    figures = {door: iou for door, iou in room_iou(prediction.rooms, truth.rooms).items() if door in seen}
    average = mean(figures)
    metrics: dict[str, Any] = {
        "area_mapped": round(area_mapped(survey.grid, cells), 5),
        "ate_m": round(position, 5),
        "ate_rad": round(heading, 6),
        "room_iou": {door: round(iou, 5) for door, iou in figures.items()},
        "room_iou_mean": None if average is None else round(average, 5),
        "doors_closed": len(closed),
        "doors_seen": len(seen),
        "rooms_seen": rooms_seen(plan, survey.grid, map_T_world),
        "tour": {},
        "units": {"area_mapped": "share 0..1", "room_iou": "share 0..1", "ate_m": "m", "ate_rad": "rad"},
    }
    for name, tour in tours.items():
        metrics["tour"][name] = {
            "length_m": round(tour.length, 4),
            "lower_bound_m": round(tour.lower_bound, 4),
            "vertices": len(tour.graph.vertices),
            "status": tour.status,
        }
    if {"closed", "predicted", "truth"} <= tours.keys():
        errors = compare_tours(
            tours["closed"], tours["predicted"], tours["truth"], metrics["rooms_seen"], len(survey.doors)
        )
        metrics["tour"]["errors_percent"] = {
            name: None if error is None else round(error, 4)
            for name, error in (
                ("closed", errors.error_closed),
                ("baseline", errors.error_baseline),
                ("predicted", errors.error_pred),
            )
        }
    return metrics


def _write(
    folder: Path,
    survey: Survey,
    prediction: Prediction,
    truth: Truth,
    tours: dict[str, CoverageTour],
    driven: DriveResult | None,
) -> None:
    """Every data file of the run directory, then the picture."""
    from closedrooms.visualization.summary import draw_summary

    write_map(folder / "map", survey.grid)
    write_map(folder / "predicted", prediction.grid)
    write_map(folder / "truth", truth.grid)
    write_doors(folder / "doors.geojson", survey.doors)
    write_rooms(folder / "rooms.geojson", prediction.rooms)
    write_rooms(folder / "truth_rooms.geojson", truth.rooms)
    write_trajectory(folder / "trajectory.tum", survey.stamps, survey.estimate)
    write_trajectory(folder / "trajectory_truth.tum", survey.stamps, survey.truth)
    features = [f for name, tour in tours.items() for f in make_tour_features(tour, name)]
    write_features(folder / "tour.geojson", features + ([] if driven is None else drive_features(driven)))
    if driven is not None:
        draw_drive(folder / "drive.png", driven, truth.rooms)
    draw_summary(
        folder / "summary.png",
        survey.grid,
        prediction,
        survey.doors,
        truth=truth.grid,
        truth_rooms=truth.rooms,
        tours=tours,
        trajectory=survey.estimate,
    )


def _markdown(result: RunResult) -> str:
    head, *rows = result.table()
    # Times differ from run to run, recordings of equal runs must not.
    lines = [f"| {' | '.join(row)} |" for row in rows if not row[0].startswith("time")]
    return "\n".join([f"# {result.title}", "", f"| {' | '.join(head)} |", "| --- | ---: |", *lines])
