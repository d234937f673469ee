"""The recording of a run where one is wanted, else a recorder that does nothing."""

import contextlib
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from closedrooms.core.robot import RobotConfig
from closedrooms.visualization.no_recording import no_recording

if TYPE_CHECKING:
    from closedrooms.visualization.rerun.live import LiveViewer
    from closedrooms.visualization.rerun.recorder import Recorder


@contextlib.contextmanager
def open_recording(
    path: Path | None, robot: RobotConfig, *, name: str, viewer: "LiveViewer | None" = None
) -> Iterator["Recorder"]:
    """Open the recorder of one run in a building.

    Args:
        path: The file to write (``.rrd``), or ``None`` for a recorder that does nothing.
        robot: As it is drawn.
        name: Of the recording.
        viewer: It is streamed to while it is written.
    """
    if path is None:
        yield no_recording()
        return
    from closedrooms.visualization.rerun.recorder import Recorder

    with Recorder(path, name=name, robot_radius=robot.radius, viewer=viewer) as recorder:
        yield recorder
