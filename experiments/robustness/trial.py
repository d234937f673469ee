"""One building under every setting: drive, map, close doors, predict, plan, measure, repair."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import shapely

from closedrooms.core.arrays import BoolArray, FloatArray
from closedrooms.core.door import ClosedDoor
from closedrooms.core.errors import InvalidInputError
from closedrooms.core.files.geojson import write_doors, write_rooms
from closedrooms.core.files.rosmap import write_map
from closedrooms.core.grid import OccupancyGrid
from closedrooms.core.random import stream
from closedrooms.core.room import Room
from closedrooms.experiments.dataset.erase import Eraser
from closedrooms.experiments.dataset.open_survey import OpenSurvey
from closedrooms.experiments.evaluation.scoring.scores import iou, room_masks
from closedrooms.experiments.evaluation.scoring.tours import cropped, kept_tour, plan_cropped_tour
from closedrooms.experiments.robustness.clean_walls import sampled, with_clean_walls
from closedrooms.experiments.robustness.config import RobustnessConfig
from closedrooms.experiments.robustness.door_noise import disturbed_doors, phantom_doors, true_doors
from closedrooms.experiments.robustness.drives import RecordedDrive, furnished, map_drive, odometry_noise, record_drive
from closedrooms.experiments.robustness.levels import Setting, first_setting
from closedrooms.experiments.statistics import mean_figure, round_figure
from closedrooms.experiments.tables import Row
from closedrooms.mapping.trajectory import ate
from closedrooms.pipeline.reporting.run_scores import room_iou, rooms_seen
from closedrooms.pipeline.survey import Truth, true_building
from closedrooms.predictor.methods import predict
from closedrooms.predictor.prediction import Prediction
from closedrooms.sim.config import FaultConfig
from closedrooms.sim.robot.robot_model import TRACK_SHARE
from closedrooms.worlds.closing import closable_rooms, draw_closed
from closedrooms.worlds.geometry import door_leaf
from closedrooms.worlds.library import load_world
from closedrooms.worlds.truth import reachable

# A cell farther than this from every true wall is simply wrong: how far says nothing [m].
FARTHEST = 0.5


@dataclass(frozen=True, slots=True, eq=False)
class Closing:
    """One set of doors of a building, closed: truth, and the map as an undisturbed robot makes it.

    Attributes:
        closed: Ids of the closed doors.
        seen: Ids of those of them that the undisturbed robot saw.
        clean: Map of the undisturbed robot.
        truth: M_GT and the hidden rooms, on a frame of 0.05 m.
        open_cells: True free cells that a robot can reach, on that frame.
        wall_distance: Distance of its cells to the next true wall, closed leaf or furniture [m].
    """

    closed: tuple[str, ...]
    seen: tuple[str, ...]
    clean: OccupancyGrid
    truth: Truth
    open_cells: BoolArray
    wall_distance: FloatArray


class BuildingTrials:
    """Trials of one building, with what they share: plan, sets of closed doors, drives, surveys and erasers."""

    def __init__(self, world: str, config: RobustnessConfig) -> None:
        self._config = config
        self._plan = load_world(world)
        self.name = self._plan.name
        count = min(config.closed, len(closable_rooms(self._plan)))
        if count == 0:
            raise InvalidInputError("no room that one door closes", expected="a world with such rooms", where=world)
        self._sets = [
            draw_closed(self._plan, count, stream(config.seed, "closed doors", self.name, str(repetition)))
            for repetition in range(config.repetitions)
        ]
        self._drives: dict[Setting, RecordedDrive] = {}
        self._surveys: dict[Setting, OpenSurvey] = {}
        self._erasers: dict[tuple[Setting, bool], Eraser] = {}
        self._closings: dict[tuple[int, Setting], Closing] = {}

    def rows(self, setting: Setting, keep: Path | None = None) -> list[Row]:
        """Measure a row of figures for each set of closed doors.

        Args:
            setting: How much everything is disturbed.
            keep: Folder for map, doors and rooms of the first set, for pictures.
        """
        return [
            self._row(setting, repetition, keep if repetition == 0 else None)
            for repetition in range(self._config.repetitions)
        ]

    def _row(self, setting: Setting, repetition: int, keep: Path | None) -> Row:
        """Measure one set of closed doors at one setting: map, doors, rooms, tours, and what each stage costs."""
        config = self._config
        drive, survey = self._drive(setting), self._survey(setting)
        closing = self._closing(repetition, setting)
        map_T_world = drive.world_T_map.inverse()
        mapped = self._eraser(setting, true_poses=False).erase(closing.closed)
        doors = self._seen_doors(mapped.doors, setting, repetition)
        phantoms = phantom_doors(self._plan, int(setting.phantoms), mapped.grid, map_T_world, config.seed)
        known = {door.id for door in doors}
        doors += phantoms
        prediction = self._predict(mapped.grid, doors)
        position, heading = ate(survey.estimate, survey.true_poses)
        figures = room_iou(prediction.rooms, closing.truth.rooms)
        seen = [door.id for door in doors]
        right = {door.id: np.array(door.midpoint) for door in true_doors(self._plan, closing.closed, map_T_world)}
        offsets = [
            float(np.linalg.norm(np.array(door.midpoint) - right[door.id])) for door in doors if door.id in known
        ]
        row: Row = {
            "world": self.name,
            "repetition": repetition,
            "exploration": drive.status,
            "closed_doors": len(closing.closed),
            "doors_seen": len(known),
            "ate_m": round_figure(position),
            "ate_rad": round_figure(heading),
            "walls_m": round_figure(self._walls(mapped.grid, closing)),
            "free_iou": round_figure(self._free(mapped.grid, closing)),
            "doors_m": round_figure(np.mean(offsets)) if offsets else None,
            "iou": mean_figure([figures.get(door, 0.0) for door in closing.closed]),
            "iou_seen": mean_figure([figures[door] for door in seen if door in figures]),
        }
        row |= self._repaired(setting, closing, repetition)
        if config.tours:
            row |= self._tours(mapped.grid, doors, prediction, closing)
        if keep is not None:
            keep.mkdir(parents=True, exist_ok=True)
            write_map(keep / "map", cropped(mapped.grid))
            write_doors(keep / "doors.geojson", doors)
            write_rooms(keep / "rooms.geojson", prediction.rooms)
            write_rooms(keep / "truth_rooms.geojson", closing.truth.rooms)
        return row

    def _repaired(self, setting: Setting, closing: Closing, repetition: int) -> Row:
        """Measure the mean IoU when stage after stage gets what an undisturbed one would have given it.

        First the scans are put at their true poses; then the doors, too, are where they are; then the walls, too, are
        those of the undisturbed map. What is still lost then is lost in the prediction, for want of known space.
        """
        placed = self._eraser(setting, true_poses=True).erase(closing.closed)
        doors = self._seen_doors(placed.doors, setting, repetition)
        right = true_doors(self._plan, closing.seen, self._drive(setting).world_T_map.inverse())
        steps = {
            "iou_true_poses": (placed.grid, doors),
            "iou_true_doors": (placed.grid, right),
            "iou_true_walls": (with_clean_walls(placed.grid, closing.clean), right),
        }
        row: Row = {}
        for name, (repaired, at) in steps.items():
            figures = room_iou(self._predict(repaired, at).rooms, closing.truth.rooms)
            row[name] = mean_figure([figures.get(door, 0.0) for door in closing.closed])
        return row

    def _tours(self, grid: OccupancyGrid, doors: Sequence[ClosedDoor], prediction: Prediction, closing: Closing) -> Row:
        """Measure the errors of the coverage cost [%]; ``None`` where a tour cannot be planned."""
        from closedrooms.coverage.estimates import compare_lengths

        try:
            truth = kept_tour(self._config.out, closing.truth.grid)["length_m"]
            lengths = [plan_cropped_tour(grid, doors).length, plan_cropped_tour(prediction.grid).length]
        except InvalidInputError:
            return {"error_closed": None, "error_baseline": None, "error_predicted": None}
        world_T_map = self._drive(first_setting(self._config)).world_T_map
        seen = rooms_seen(self._plan, grid, world_T_map.inverse())
        errors = compare_lengths(lengths[0], lengths[1], truth, n_rooms=seen, n_doors=len(doors))
        return {
            name: None if error is None else round_figure(error)
            for name, error in (
                ("error_closed", errors.error_closed),
                ("error_baseline", errors.error_baseline),
                ("error_predicted", errors.error_pred),
            )
        }

    def _predict(self, grid: OccupancyGrid, doors: Sequence[ClosedDoor]) -> Prediction:
        return predict(grid, doors, self._config.method)

    def _seen_doors(self, doors: Sequence[ClosedDoor], setting: Setting, repetition: int) -> list[ClosedDoor]:
        return disturbed_doors(
            doors, missed=setting.missed, shift=setting.shift, turn=setting.turn, seed=self._config.seed,
            name=f"{self.name} {repetition}",
        )  # fmt: skip

    def _drive(self, setting: Setting) -> RecordedDrive:
        """Drive through the building once for all settings that leave it as it is."""
        place = setting.place
        if place not in self._drives:
            config = self._config
            plan = furnished(self._plan, place.furniture, config.seed)
            sim = replace(config.sim, glass=place.glass, people=int(place.people), clutter=int(place.clutter))
            self._drives[place] = record_drive(plan, sim, config.mapper, config.navigation, config.seed)
        return self._drives[place]

    def _survey(self, setting: Setting) -> OpenSurvey:
        """Map the building under a setting, once; its doors are disturbed later."""
        key = replace(setting, missed=0.0, shift=0.0, turn=0.0, phantoms=0.0)
        if key not in self._surveys:
            noise = replace(odometry_noise(key.odometry), range_sd=key.lidar, dropouts=key.dropouts)
            track = TRACK_SHARE * self._config.sim.robot.radius
            noise = replace(noise, bias_turn_per_metre=key.unequal / track)
            faults = FaultConfig(lost_scans=key.lost, odometry_freezes=key.freezes, odometry_drops=key.drops)
            mapper = replace(self._config.mapper, resolution=key.resolution)
            self._surveys[key] = map_drive(self._drive(key), noise, mapper, self._config.seed, faults)
        return self._surveys[key]

    def _eraser(self, setting: Setting, *, true_poses: bool) -> Eraser:
        """Make what erases one survey once, for all settings of doors."""
        key = (replace(setting, missed=0.0, shift=0.0, turn=0.0, phantoms=0.0), true_poses)
        if key not in self._erasers:
            survey = self._survey(setting)
            self._erasers[key] = Eraser(replace(survey, poses=survey.keyframe_true_poses) if true_poses else survey)
        return self._erasers[key]

    def forget(self, setting: Setting) -> None:
        """Give back the memory of a setting's survey; that of the first setting stays."""
        first = replace(first_setting(self._config), missed=0.0, shift=0.0, turn=0.0, phantoms=0.0)
        key = replace(setting, missed=0.0, shift=0.0, turn=0.0, phantoms=0.0)
        if key != first:
            self._surveys.pop(key, None)
            for true_poses in (False, True):
                self._erasers.pop((key, true_poses), None)

    def _closing(self, repetition: int, setting: Setting) -> Closing:
        """Find once what is true with a set of doors closed."""
        key = (repetition, setting.place)
        if key not in self._closings:
            closed = self._sets[repetition]
            first = first_setting(self._config)
            undisturbed = self._eraser(first, true_poses=True).erase(closed)
            drive = self._drive(setting)
            map_T_world = drive.world_T_map.inverse()
            truth = true_building(self._plan, closed, undisturbed.grid.frame, map_T_world)
            frame, start = truth.grid.frame, drive.world_T_map
            cells = reachable(self._plan, closed, frame, map_T_world, (start.x, start.y))
            leaves = [door_leaf(self._plan, door) for door in self._plan.doors if door.id in closed]
            pieces = [thing.polygon for thing in drive.plan.furniture]
            things = [_in_map(area, drive) for area in (*leaves, *pieces)]
            masks = room_masks([Room(area, ()) for area in things], frame)
            solid = truth.grid.occupied.copy()
            for mask in masks:
                solid |= mask
            self._closings[key] = Closing(
                closed, tuple(door.id for door in undisturbed.doors), undisturbed.grid, truth, cells & ~solid,
                _distance(solid) * frame.resolution,
            )  # fmt: skip
        return self._closings[key]

    @staticmethod
    def _walls(grid: OccupancyGrid, closing: Closing) -> float:
        """Average the distance of the map's occupied cells to what really stands there [m], each at most 0.5 m."""
        frame = closing.truth.grid.frame
        cells = frame.to_cells(grid.frame.to_points(np.argwhere(grid.occupied)))
        cells = cells[frame.contains(cells)]
        if not len(cells):
            return FARTHEST
        return float(np.minimum(closing.wall_distance[cells[:, 0], cells[:, 1]], FARTHEST).mean())

    @staticmethod
    def _free(grid: OccupancyGrid, closing: Closing) -> float:
        """Compute the IoU of the map's free cells with the true ones that a robot can reach."""
        return iou(sampled(grid, closing.truth.grid.frame).free, closing.open_cells)


def _in_map(area: Any, drive: RecordedDrive) -> Any:
    return shapely.transform(area, drive.world_T_map.inverse().transform)


def _distance(solid: BoolArray) -> FloatArray:
    """Compute the distance of every cell from the next solid one [cells]."""
    import cv2

    return np.asarray(cv2.distanceTransform((~solid).astype(np.uint8), cv2.DIST_L2, 5), dtype=np.float64)
