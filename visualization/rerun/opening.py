"""Opens the recording of a run, or nothing where none is wanted."""

import contextlib
from collections.abc import Iterator
from pathlib import Path

from closedrooms.core.pose import Pose2
from closedrooms.navigation.observer import NoObserver, Observer
from closedrooms.worlds.plan import FloorPlan
from closedrooms.worlds.truth import truth_bounds


@contextlib.contextmanager
def open_recording(path: Path | None, plan: FloorPlan, *, name: str, driving: bool = False) -> Iterator[Observer]:
    """The recorder of one run in a building.

    Args:
        path: The file to write (``.rrd``), or ``None`` for an observer that does nothing.
        plan: The building, for the size of the views.
        name: Of the recording.
        driving: Whether the predicted tour will be driven too.
    """
    if path is None:
        yield NoObserver()
        return
    from closedrooms.visualization.rerun.blueprint import Layout
    from closedrooms.visualization.rerun.recorder import Recorder

    x_min, y_min, x_max, y_max = truth_bounds(plan, Pose2())
    reach = max(x_max - x_min, y_max - y_min) / 2
    layout = Layout((-reach, -reach, reach, reach), driving=driving)
    with Recorder(path, name=name, layout=layout) as recorder:
        yield recorder
