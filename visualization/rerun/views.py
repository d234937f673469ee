"""The views that tabs are made of: a map from above, curves, the log."""

import math
from collections.abc import Sequence

import rerun as rr
import rerun.blueprint as rrb
from rerun.blueprint.encodings import TextLogColumnKind

from closedrooms.core.grid import Bounds
from closedrooms.visualization import colours

BACKGROUND = [colours.UNKNOWN] * 3
# How far a plot reaches, by its largest value: a curve along the frame is not seen.
HEADROOM = 1.15
# The viewer's default vertical field of view is 55 degrees.
HALF_VIEW = math.radians(55.0) / 2


def show_log() -> rrb.View:
    """Show the log of the run: when, and what; all lines come from one place."""
    return rrb.TextLogView(
        origin="/log", name="Log", columns=rrb.TextLogColumns(text_log_columns=[TextLogColumnKind.Body])
    )


def plot_curves(name: str, title: str, *, top: float | None = None) -> rrb.View:
    """Plot curves over the whole run, whatever the cursor; along the axis time [s], or the stage where it is shown.

    Args:
        name: Entity of the curves below ``metrics``.
        title: What is plotted, with its unit.
        top: Largest value; without one the viewer fits the axis.
    """
    always = rr.TimeRange(start=rr.TimeRangeBoundary.infinite(), end=rr.TimeRangeBoundary.infinite())
    return rrb.TimeSeriesView(
        origin=f"/metrics/{name}",
        name=f"{title} over sim_time [s], or stage",
        axis_x=rrb.TimeAxis(view_range=always),
        axis_y=None if not top else rrb.ScalarAxis(range=(0.0, HEADROOM * top)),
        plot_legend=rrb.PlotLegend(rrb.Corner2D.LeftTop),
    )


def is_wide(bounds: Bounds) -> bool:
    """Check whether a building is so wide that its maps stand one above the other."""
    x0, y0, x1, y1 = bounds
    return x1 - x0 > 1.5 * (y1 - y0)


def show_from_above(bounds: Bounds, name: str, contents: Sequence[str], aspect: float = 1.5) -> rrb.View:
    """Show a map from above; ``aspect`` is the view's width by its height in a window 1.5 times as wide."""
    x0, y0, x1, y1 = bounds
    cx, cy = (x0 + x1) / 2, (y0 + y1) / 2
    height = 1.04 * max((y1 - y0) / 2, (x1 - x0) / 2 / aspect) / math.tan(HALF_VIEW)
    return rrb.Spatial3DView(
        origin="/",
        name=name,
        contents=list(contents),
        eye_controls=rrb.EyeControls3D(
            kind=rrb.Eye3DKind.Orbital,
            position=(cx, cy, height),
            look_target=(cx, cy, 0.0),
            eye_up=(0.0, 1.0, 0.0),
        ),
        background=BACKGROUND,
        line_grid=False,
    )
