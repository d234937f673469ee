"""Surveys on disk: every worker draws its maps from the same file, also after a restart."""

import contextlib
import tempfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

from closedrooms.core.errors import InvalidInputError
from closedrooms.core.files.archives import read_arrays
from closedrooms.core.files.incoming import read_json
from closedrooms.core.files.output_folders import MANIFEST, output_folder
from closedrooms.core.files.tum import read_trajectory, write_trajectory
from closedrooms.experiments.dataset.checksums import check, checksums
from closedrooms.experiments.dataset.config import SURVEYS, DatasetConfig
from closedrooms.experiments.dataset.open_survey import OpenSurvey
from closedrooms.experiments.dataset.packing import SCANS, SURVEY, read_rows, unpack
from closedrooms.experiments.dataset.variants import World
from closedrooms.experiments.stores import open_store
from closedrooms.mapping.logs.npz import read_scans, write_scans
from closedrooms.mapping.logs.recorded_run import RecordedRun
from closedrooms.sim.simulation import Simulation
from closedrooms.worlds.plan import FloorPlan


def write_survey(folder: Path, survey: OpenSurvey, about: dict[str, Any]) -> None:
    """Write a survey: ``scans.npz`` holds the keyframes' scans, the trajectories all poses.

    Args:
        folder: Takes its place whole or not at all.
        survey: What to keep.
        about: More entries of its ``run.json``.

    Raises:
        OutputError: The folder cannot be written, or holds something that is not ours.
    """
    manifest: dict[str, Any] = {
        **about,
        "exploration": {"status": survey.status, "simulated_s": round(survey.seconds, 3)},
    }
    with output_folder(folder, manifest) as staging:
        write_scans(staging / "scans.npz", survey.keyframes, estimate=survey.poses)
        write_trajectory(staging / "trajectory.tum", survey.stamps, survey.estimate)
        write_trajectory(staging / "trajectory_truth.tum", survey.stamps, survey.true_poses)
        manifest["checksums"] = checksums(staging)


def read_survey(folder: Path, plan: FloorPlan, config: DatasetConfig, seed: int) -> OpenSurvey:
    """Read a survey as it was written.

    Args:
        folder: Of the survey.
        plan: The building that was surveyed.
        config: How it was simulated and mapped.
        seed: Of its noise.

    Raises:
        InvalidInputError: A file is missing or broken.
    """
    recorded = read_scans(folder / "scans.npz")
    poses = read_arrays(folder / "scans.npz", what="a survey's scans").get("estimate")
    if poses is None:
        raise InvalidInputError("no array estimate", expected="a survey's scans", where=folder / "scans.npz")
    lidar = config.sim.lidar
    scans = tuple(replace(scan, range_min=lidar.range_min) for scan in recorded.scans)
    keyframes = RecordedRun(scans, recorded.odometry, recorded.reference)
    stamps, estimate = read_trajectory(folder / "trajectory.tum")
    _, true_poses = read_trajectory(folder / "trajectory_truth.tum")
    about = read_json(folder / MANIFEST, what="a survey's run.json")
    try:
        status, seconds = about["exploration"]["status"], float(about["exploration"]["simulated_s"])
    except (KeyError, TypeError, ValueError) as error:
        raise InvalidInputError("no exploration", expected="a survey's run.json", where=folder / MANIFEST) from error
    start = Simulation(plan, (), config.sim, seed).world_T_map
    return OpenSurvey(
        plan, config.sim, config.mapper, seed, start, status, seconds, keyframes, poses, stamps, estimate, true_poses
    )


def survey_name(world: World) -> str:
    """Name the file of a survey in a dataset of shards."""
    return f"{SURVEYS}/{world.name}.parquet"


@contextlib.contextmanager
def survey_folder(config: DatasetConfig, world: World) -> Iterator[Path]:
    """Yield a folder with the files of a survey; of a dataset of shards they are unpacked and compared with their sums.

    Raises:
        InvalidInputError: Missing, broken, or changed since it was written.
    """
    if config.format == "folders":
        assert isinstance(config.out, Path), "folders are of this machine"
        yield config.out / SURVEYS / world.name
        return
    store, name = open_store(config.out), survey_name(world)
    with tempfile.TemporaryDirectory(prefix="closedrooms-") as scratch:
        with store.opened(name) as file:
            rows = read_rows(file, store.where(name), columns=[*SURVEY, *SCANS])
        if len(rows) != 1:
            raise InvalidInputError(f"{len(rows)} rows", expected="one survey", where=store.where(name))
        folder = Path(scratch)
        unpack(rows[0], folder)
        try:
            check(folder)
        except InvalidInputError as error:
            where = store.where(name)
            raise InvalidInputError("changed since it was written", expected="a survey", where=where) from error
        yield folder
