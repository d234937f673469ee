"""What the method ``best`` looks at: the map along its walls, and the doors that face something unknown."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

from closedrooms.core.door import ClosedDoor
from closedrooms.core.grid import OccupancyGrid
from closedrooms.predictor.best.door_frame import TurnedMap, turn_map
from closedrooms.predictor.best.door_pose import DoorPose, face_door
from closedrooms.predictor.best.resolution import RESOLUTION
from closedrooms.predictor.config import BestConfig
from closedrooms.predictor.paper.initial_layouts import unusable
from closedrooms.predictor.structure.clutter import free_islands, without_specks
from closedrooms.predictor.structure.edges import shows_walls
from closedrooms.predictor.structure.known_window import at_resolution, known_window
from closedrooms.predictor.structure.wall_directions import find_wall_directions
from closedrooms.predictor.structure.wall_thickness import WallThickness, measure_walls

# Unknown cells around a turned map [m]: what lies further out reads as its edge.
MARGIN = 1.0
# Thickness where hardly any wall is seen from both sides [m]: usual for inner walls.
UNSEEN_WALLS = WallThickness(usual=0.2, least=0.2)


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """A map and its doors, ready for rooms to be proposed.

    Attributes:
        config: Settings.
        grid: What is known of the map, in cells of :data:`RESOLUTION`.
        turned: The map by the angle of the walls that it is turned along [rad].
        poses: The doors that face something unknown, in the order of the doors.
        walls: Thickness of the walls.
        failures: Why the others have no room, by door id.
    """

    config: BestConfig
    grid: OccupancyGrid
    turned: dict[float, TurnedMap] = field(default_factory=dict)
    poses: tuple[DoorPose, ...] = ()
    walls: WallThickness = UNSEEN_WALLS
    failures: dict[str, str] = field(default_factory=dict)


def prepare(grid: OccupancyGrid, doors: Sequence[ClosedDoor], config: BestConfig) -> Scene:
    """Crop a map, clear it of furniture, turn it along its walls and find out which way each door looks.

    Args:
        grid: The map, of any resolution and size.
        doors: Closed doors in the frame of the map.
        config: Settings.

    Returns:
        A scene without doors where the map shows no wall.

    Raises:
        InvalidInputError: Two doors of one id, or a known area that is too large (:func:`at_resolution`).
    """
    failures = unusable(doors, config.same_door)
    waiting = [door for door in doors if door.id not in failures]
    window = known_window(grid)
    if window is None:
        return Scene(config, grid, failures={door.id: "the map is all unknown" for door in doors})
    working = without_specks(at_resolution(window, RESOLUTION))
    del window  # a copy of a large map
    working = free_islands(working, config.clutter_area, [door.midpoint for door in waiting], config.door_reach)
    directions = find_wall_directions(working) if shows_walls(working) else None
    if directions is None:
        return Scene(config, grid, failures={door.id: "the map holds no wall line" for door in doors})
    main = float(directions.angles[0])
    turned = {main: turn_map(working, main, margin=MARGIN)}
    poses = []
    for door in waiting:
        angle = directions.at(door)
        if angle not in turned:
            turned[angle] = turn_map(working, angle, margin=MARGIN)
        found = face_door(door, turned[angle], reach=config.door_reach)
        if isinstance(found, DoorPose):
            poses.append(found)
        else:
            failures[door.id] = found
    walls = measure_walls(working, (main, main + math.pi / 2)) or UNSEEN_WALLS
    return Scene(config, working, turned, tuple(poses), walls, failures)
