"""Opens the recording of a run, or nothing where none is wanted."""

import contextlib
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from closedrooms.core.pose import Pose2
from closedrooms.core.robot import RobotConfig
from closedrooms.visualization.no_recording import no_recording
from closedrooms.worlds.plan import FloorPlan
from closedrooms.worlds.truth import truth_bounds

if TYPE_CHECKING:
    from closedrooms.visualization.rerun.recorder import Recorder


@contextlib.contextmanager
def open_recording(
    path: Path | None, plan: FloorPlan, robot: RobotConfig, *, name: str, driving: bool = False
) -> Iterator["Recorder"]:
    """The recorder of one run in a building.

    Args:
        path: The file to write (``.rrd``), or ``None`` for a recorder that does nothing.
        plan: The building, for the size of the views.
        robot: As it is drawn.
        name: Of the recording.
        driving: Whether the predicted tour will be driven too.
    """
    if path is None:
        yield no_recording()
        return
    from closedrooms.visualization.rerun.blueprint import Layout
    from closedrooms.visualization.rerun.recorder import Recorder

    x_min, y_min, x_max, y_max = truth_bounds(plan, Pose2())
    reach = max(x_max - x_min, y_max - y_min) / 2
    layout = Layout((-reach, -reach, reach, reach), driving=driving)
    with Recorder(path, name=name, layout=layout, robot_radius=robot.radius) as recorder:
        yield recorder
