"""One sample of a dataset: made, written, and described in one row."""

import functools
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from closedrooms.core.arrays import FloatArray
from closedrooms.core.door import ClosedDoor
from closedrooms.core.errors import OutputError, reason
from closedrooms.core.files.geojson import write_doors, write_rooms
from closedrooms.core.files.output_folders import output_folder
from closedrooms.core.files.rosmap import write_map
from closedrooms.core.files.tum import write_trajectory
from closedrooms.core.grid import GridFrame, OccupancyGrid
from closedrooms.core.pose import Pose2
from closedrooms.experiments.dataset.checksums import checksums
from closedrooms.experiments.dataset.config import FORMAT, NOT_CONTENT, SURVEYS, DatasetConfig
from closedrooms.experiments.dataset.erase import Eraser
from closedrooms.experiments.dataset.open_survey import survey_open
from closedrooms.experiments.dataset.shard import Shard
from closedrooms.experiments.dataset.survey_store import read_survey, survey_folder, write_survey
from closedrooms.experiments.dataset.variants import Variant, World, noise_seed
from closedrooms.mapping.logs.npz import write_scans
from closedrooms.mapping.logs.recorded_run import RecordedRun
from closedrooms.mapping.mapper import Mapper
from closedrooms.mapping.trajectory import ate
from closedrooms.pipeline.reporting.manifest import resolved, versions
from closedrooms.pipeline.reporting.progress import Silent
from closedrooms.pipeline.reporting.run_log import RunLog
from closedrooms.pipeline.reporting.run_scores import area_mapped, count_seen, room_points, rounded
from closedrooms.pipeline.survey import Truth, survey_building
from closedrooms.sim.simulation import Simulation
from closedrooms.visualization.rerun.optional_recording import open_recording
from closedrooms.worlds.library import load_world
from closedrooms.worlds.plan import FloorPlan
from closedrooms.worlds.truth import rasterise, reachable, true_rooms, truth_bounds

if TYPE_CHECKING:
    from closedrooms.visualization.rerun.recorder import Recorder


@dataclass(frozen=True, slots=True)
class Task:
    """Survey of a world (no variant), or one sample, to be made."""

    config: DatasetConfig
    world: World
    variant: Variant | None = None

    @property
    def folder(self) -> Path:
        """Place in a dataset of folders."""
        assert isinstance(self.config.out, Path), "folders are of this machine"
        if self.variant is None:
            return self.config.out / SURVEYS / self.world.name
        return self.config.out / self.variant.id


@dataclass(frozen=True, slots=True)
class TaskResult:
    """Result of a task: nothing set is well.

    Attributes:
        failure: Why this one cannot be made; the others can.
        trouble: Why nothing can be written, e.g. a full disk; all work ends.
        size: Bytes that were written, where they count.
        shard: What is in the shard that was written, where it is one.
    """

    failure: str = ""
    trouble: str = ""
    size: int = 0
    shard: Shard | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Observed:
    """Map, doors and poses that a sample's robot brought home, whichever way it was made: not all were explored.

    Poses are those of all scans of an exploration, of an erased map those of the keyframes that make it.
    """

    grid: OccupancyGrid
    doors: Sequence[ClosedDoor]
    stamps: FloatArray
    estimate: FloatArray
    true_poses: FloatArray
    scans: RecordedRun | None
    about: dict[str, Any]


def make(task: Task) -> TaskResult:
    """Make one survey or sample as a folder; tell what goes wrong, but raise a missing package."""
    return guarded(lambda: make_folder(task, task.folder))


def guarded(work: Callable[[], TaskResult | None]) -> TaskResult:
    """Do work and tell what goes wrong, but raise a missing package."""
    try:
        return work() or TaskResult()
    except OutputError as error:
        return TaskResult(trouble=str(error))
    except ModuleNotFoundError:
        raise
    except Exception as error:
        return TaskResult(failure=reason(error))


def make_folder(task: Task, folder: Path) -> None:
    """Write one survey or sample.

    Args:
        task: What to make.
        folder: Takes its place whole or not at all.

    Raises:
        OutputError: It cannot be written.
        InvalidInputError: It cannot be made.
    """
    plan = _plan(task.world.source)
    if task.variant is None:
        config = task.config
        seed = noise_seed(config, task.world)
        survey = survey_open(plan, config.sim, config.mapper, config.navigation, seed)
        write_survey(folder, survey, _about(task, seed))
    else:
        _make_sample(task, task.variant, plan, folder)


def _about(task: Task, seed: int) -> dict[str, Any]:
    """Describe what a survey's and a sample's ``run.json`` begin with."""
    return {
        "format": FORMAT,
        "world": task.world.name,
        "world_sha256": task.world.digest,
        "seed": seed,
        "configuration": resolved(task.config, leave_out=NOT_CONTENT),
        "versions": versions(),
    }


def _make_sample(task: Task, variant: Variant, plan: FloorPlan, folder: Path) -> None:
    """Write the folder of one sample: map, truth, doors, rooms, trajectories."""
    config, world = task.config, task.world
    closed = tuple(door.id for door in plan.doors if door.id in variant.closed)
    erased = config.maps == "erased"
    own = () if erased else (str(variant.repetition), str(len(closed)))
    seed = noise_seed(config, world, *own)
    start = Simulation(plan, closed, config.sim, seed).world_T_map
    manifest: dict[str, Any] = {
        **_about(task, seed),
        "sample": variant.id,
        "split": world.split,
        "repetition": variant.repetition,
        "order": list(variant.closed),
        "closed": list(closed),
    }
    with (
        output_folder(folder, manifest) as staging,
        open_recording(staging / "run.rrd" if config.record else None, config.sim.robot, name=variant.id) as recorder,
    ):
        recorder.configuration(manifest["configuration"])
        recorder.building(plan, start.inverse(), closed)
        observed = _erased(config, world, closed) if erased else _simulated(config, plan, closed, seed, recorder)
        truth = Truth(_true_map(world.source, observed.grid.frame, start), true_rooms(plan, closed, start.inverse()))
        if erased:
            _show(recorder, observed)
        recorder.truth(truth.grid, truth.rooms)
        frame = truth.grid.frame
        write_map(staging / "map", observed.grid.on(frame))
        write_map(staging / "truth", truth.grid)
        write_doors(staging / "doors.geojson", observed.doors)
        write_rooms(staging / "truth_rooms.geojson", truth.rooms)
        write_trajectory(staging / "trajectory.tum", observed.stamps, observed.estimate)
        write_trajectory(staging / "trajectory_truth.tum", observed.stamps, observed.true_poses)
        if config.keep_scans and observed.scans is not None:
            write_scans(staging / "scans.npz", observed.scans, estimate=observed.estimate)
        manifest["exploration"] = observed.about
        manifest["metrics"] = _metrics(world.source, closed, observed, truth.grid, start)
        seen = {door.id for door in observed.doors}
        manifest["doors"] = {"seen": sorted(seen), "not_seen": sorted(set(closed) - seen)}
        manifest["checksums"] = checksums(staging)


def _metrics(
    source: str, closed: Sequence[str], observed: Observed, truth: OccupancyGrid, start: Pose2
) -> dict[str, Any]:
    """Measure what a run's ``run.json`` says of the map, under the same names."""
    plan, map_T_world = _plan(source), start.inverse()
    position, heading = ate(observed.estimate, observed.true_poses)
    cells = reachable(plan, closed, truth.frame, map_T_world, (start.x, start.y))
    return {
        "area_mapped": rounded(area_mapped(observed.grid.on(truth.frame), cells)),
        "ate_m": round(position, 5),
        "ate_rad": round(heading, 6),
        "doors_closed": len(closed),
        "doors_seen": len(observed.doors),
        "rooms_seen": count_seen(_room_points(source), observed.grid, map_T_world),
        "units": {"area_mapped": "share 0..1", "ate_m": "m", "ate_rad": "rad"},
    }


def _erased(config: DatasetConfig, world: World, closed: Sequence[str]) -> Observed:
    """Redraw the map of the open survey as it would be with these doors closed."""
    eraser = _eraser(config, world)
    survey, result = eraser.survey, eraser.erase(closed)
    kept = result.keyframes
    scans = RecordedRun(result.scans, survey.keyframes.odometry[kept], survey.keyframe_true_poses[kept])
    stamps = np.array([scan.stamp for scan in result.scans])
    about = {"status": survey.status, "simulated_s": round(survey.seconds, 3), "scans": len(kept)}
    return Observed(
        result.grid, result.doors, stamps, survey.poses[kept], survey.keyframe_true_poses[kept], scans, about
    )


@functools.lru_cache(maxsize=1)
def _eraser(config: DatasetConfig, world: World) -> Eraser:
    """Read a survey once: a worker takes the samples of one world after the other."""
    with survey_folder(config, world) as folder:
        return Eraser(read_survey(folder, _plan(world.source), config, noise_seed(config, world)))


@functools.lru_cache(maxsize=2)
def _plan(source: str) -> FloorPlan:
    return load_world(source)


@functools.lru_cache(maxsize=2)
def _room_points(source: str) -> list[FloatArray]:
    return room_points(_plan(source))


@functools.lru_cache(maxsize=2)
def _true_map(source: str, frame: GridFrame, start: Pose2) -> OccupancyGrid:
    """Draw the truth on ``frame``, grown so that it holds the building; erased maps of one survey share it."""
    plan, map_T_world = _plan(source), start.inverse()
    return rasterise(plan, frame.covering(*truth_bounds(plan, map_T_world)), map_T_world)


def _simulated(
    config: DatasetConfig, plan: FloorPlan, closed: Sequence[str], seed: int, recorder: "Recorder"
) -> Observed:
    """Explore the building with these doors closed."""
    with Simulation(plan, closed, config.sim, seed) as sim:
        log, mapper = RunLog(sim, Silent(), keep_scans=config.keep_scans), Mapper(config.mapper)
        survey = survey_building(log, mapper, config.navigation, recorder=recorder)
        scans = log.recorded() if config.keep_scans else None
    about: dict[str, Any] = {
        "status": survey.exploration.status,
        "simulated_s": round(survey.exploration.seconds, 3),
        "scans": survey.exploration.scans,
    }
    about |= {} if survey.exploration.status == "complete" else {"reason": survey.exploration.reason}
    return Observed(survey.grid, survey.doors, survey.stamps, survey.estimate, survey.true_poses, scans, about)


def _show(recorder: "Recorder", observed: Observed) -> None:
    """Show what there is at the end of the survey: an erased map was never explored."""
    end = float(observed.stamps[-1])
    recorder.trajectory(observed.stamps, observed.estimate)
    recorder.map(observed.grid, end, final=True)
    recorder.doors(observed.doors, end)
