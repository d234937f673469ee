"""Floor plans as worlds for Stage: a bitmap of the walls, doors as models of their own."""

import math
from pathlib import Path

import numpy as np

from closedrooms.core.errors import InvalidInputError
from closedrooms.core.files.outgoing import write_bytes
from closedrooms.core.grid import GridFrame
from closedrooms.core.names import shown, stage_text
from closedrooms.core.pose import Pose2
from closedrooms.worlds.boxes import box_leaves, open_leaf
from closedrooms.worlds.geometry import wall_area
from closedrooms.worlds.plan import FloorPlan, Furniture
from closedrooms.worlds.start_pose import start_pose
from closedrooms.worlds.truth import rasterise
from closedrooms.worlds.ways_out import wall_up_entrances

# Metres a pixel of the bitmap.
RESOLUTION = 0.02
MAX_PIXELS = 200_000_000
# Tables and cupboards up to this height block a lidar [m].
FURNITURE_HEIGHT = 0.8


def write_stage(path: Path, plan: FloorPlan) -> None:
    """Write ``<stem>.world`` and the bitmap ``<stem>.png`` beside it.

    Metres, x right, y up, as in the plan. Stage fits a bitmap into the size of its model by what is dark in it: the
    bitmap is cut at the walls. Doors stand open, each leaf a model named after its door; furniture is a
    model a piece.

    Raises:
        InvalidInputError: A building too large for a bitmap.
        OutputError: The folder cannot be written.
    """
    import cv2

    path = Path(path)
    plan = wall_up_entrances(plan)
    x0, y0, x1, y1 = wall_area(plan).bounds
    cols, rows = math.ceil((x1 - x0) / RESOLUTION), math.ceil((y1 - y0) / RESOLUTION)
    if cols * rows > MAX_PIXELS:
        raise InvalidInputError(f"a bitmap of {cols} x {rows} pixels", expected=f"at most {MAX_PIXELS}", where=path)
    frame = GridFrame(RESOLUTION, x0, y0, rows, cols)
    pixels = np.where(rasterise(plan, frame, Pose2()).occupied, 0, 255).astype(np.uint8)
    picture = path.with_suffix(".png")
    write_bytes(picture, cv2.imencode(".png", pixels[::-1])[1].tobytes())
    write_bytes(path.with_suffix(".world"), _text(plan, picture.name, (x0, y0, x1, y1)).encode())


def _text(plan: FloorPlan, picture: str, bounds: tuple[float, float, float, float]) -> str:
    """Write the world file that shows the picture, the leaves of the doors and a robot."""
    x0, y0, x1, y1 = bounds
    start = start_pose(plan)
    leaves = [
        f'leaf ( name "{stage_text(door.id)}{"" if number == 0 else f"_{number}"}"'
        f" size [{box.length:.4f} {box.thickness:.4f} 2.0]"
        f" pose [{box.x:.4f} {box.y:.4f} 0 {math.degrees(box.angle):.3f}] )"
        for door in plan.doors
        for number, leaf in enumerate(box_leaves(plan, door))
        for box in [open_leaf(leaf)]
    ]
    things = [_thing(thing) for thing in plan.furniture]
    lines = [
        f"# {shown(plan.name)}: metres, x right, y up; doors stand open, one model a leaf",
        "resolution 0.02",
        "interval_sim 100",
        'define floorplan model ( color "gray30" boundary 0 gui_nose 0 gui_grid 0 gui_move 0 gripper_return 0 '
        "fiducial_return 0 ranger_return 1 )",
        'define leaf model ( color "brown" gui_nose 0 ranger_return 1 )',
        'define thing model ( color "tan" gui_nose 0 ranger_return 1 )',
        "define lidar ranger ( sensor ( range [0.0 20.0] fov 360 samples 720 ) size [0.05 0.05 0.1] )",
        'define robot position ( size [0.4 0.4 0.3] drive "diff" localization "gps" lidar ( pose [0 0 0 0] ) )',
        f'floorplan ( name "building" bitmap "{picture}" size [{x1 - x0:.4f} {y1 - y0:.4f} 2.5] '
        f"pose [{(x0 + x1) / 2:.4f} {(y0 + y1) / 2:.4f} 0 0] )",
        *leaves,
        *things,
        f'robot ( name "robot" pose [{start.x:.4f} {start.y:.4f} 0 {math.degrees(start.theta):.3f}] )',
    ]
    return "\n".join(lines) + "\n"


def _thing(thing: Furniture) -> str:
    """Write furniture: Stage fits a block's box into the size of its model, around the model's pose."""
    x0, y0, x1, y1 = thing.polygon.bounds
    x, y = (x0 + x1) / 2, (y0 + y1) / 2
    corners = thing.polygon.exterior.coords[:-1]
    points = " ".join(f"point[{number}] [{a - x:.4f} {b - y:.4f}]" for number, (a, b) in enumerate(corners))
    return (
        f'thing ( name "{stage_text(thing.id)}" size [{x1 - x0:.4f} {y1 - y0:.4f} {FURNITURE_HEIGHT}]'
        f" pose [{x:.4f} {y:.4f} 0 0]"
        f" block ( points {len(corners)} {points} z [0 {FURNITURE_HEIGHT}] ) )"
    )
