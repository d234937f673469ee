"""How a recording opens: one tab a stage, in the order in which a run goes through them."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import rerun as rr
import rerun.blueprint as rrb

from closedrooms.visualization import colours

Bounds = tuple[float, float, float, float]
BACKGROUND = [colours.UNKNOWN] * 3
# The viewer's default vertical field of view is 55 degrees.
HALF_VIEW = math.radians(55.0) / 2


@dataclass(frozen=True, slots=True)
class Layout:
    """Which stages a recording has.

    Attributes:
        bounds: ``x_min, y_min, x_max, y_max`` [m] in the map frame that a map seen from above shows; a recorder
            replaces them by those of the building or of the map as soon as it knows them.
        building: There is a simulated building (tab ``Building``).
        mapping: There is a robot that maps (tab ``Mapping``).
        reference: True poses are known beside the estimated ones.
        prediction: There is a prediction (tabs ``Structure``, ``Expansion``, ``Rooms``).
        coverage: There are tours (tab ``Coverage``).
        driving: The robot drives the tour (tab ``Driving``).
        active: Name of the tab in front, by default the last stage but the tables.
    """

    bounds: Bounds = (-20.0, -20.0, 20.0, 20.0)
    building: bool = True
    mapping: bool = True
    reference: bool = True
    prediction: bool = True
    coverage: bool = True
    driving: bool = False
    active: str | None = None


def arrange(layout: Layout) -> rrb.Blueprint:
    """The blueprint of a recording."""
    tabs: list[rrb.Container | rrb.View] = []
    if layout.building:
        tabs.append(_building(layout))
    if layout.mapping:
        tabs.append(_mapping(layout))
    if layout.prediction:
        tabs += [_structure(layout), _expansion(layout), _rooms(layout)]
    if layout.coverage:
        tabs.append(_coverage(layout))
    if layout.driving:
        tabs.append(_driving(layout))
    tabs.append(_result())
    names = [str(tab.name) for tab in tabs]
    active = names.index(layout.active) if layout.active in names else 0
    return rrb.Blueprint(
        rrb.Tabs(*tabs, active_tab=active),
        rrb.TimePanel(
            state="collapsed",
            timeline="sim_time" if layout.mapping else "stage",
            # Opens at the end, where every view holds something; one scrubs back from there.
            play_state="following",
            # A sequence has no speed of its own: two stages a second can be followed by eye.
            fps=2.0,
        ),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
    )


def _building(layout: Layout) -> rrb.Container:
    x0, y0, x1, y1 = layout.bounds
    cx, cy, reach = (x0 + x1) / 2, (y0 + y1) / 2, max(x1 - x0, (y1 - y0) * 1.2)
    view = rrb.Spatial3DView(
        origin="/",
        name="Building",
        contents=[
            "+ /building/**",
            "+ /map/grid",
            "+ /map/scan",
            "+ /map/path/truth",
            "+ /rooms/predicted/**",
            # Two grids in one plane would hide what is drawn between them.
            "- /rooms/predicted/grid",
        ],
        eye_controls=rrb.EyeControls3D(
            kind=rrb.Eye3DKind.Orbital,
            position=(cx, cy - 0.6 * reach, 0.8 * reach),
            look_target=(cx, cy - 0.02 * reach, 0.0),
            eye_up=(0.0, 0.0, 1.0),
        ),
        background=BACKGROUND,
        line_grid=False,
    )
    side = rrb.Vertical(
        rrb.TextDocumentView(origin="/stage", name="Stage"),
        rrb.StateTimelineView(origin="/door_states", name="Closed doors"),
        _log(),
        row_shares=[2, 4, 3],
    )
    return rrb.Horizontal(view, side, column_shares=[3, 1], name="Building")


def _mapping(layout: Layout) -> rrb.Container:
    view = _from_above(layout, "Map", ["+ /map/**"], aspect=1.3)
    errors = {
        "position_error": "Position error [m]",
        "heading_error": "Heading error [deg]",
        "odometry_error": "Error of the odometry alone [m]",
    }
    side = rrb.Vertical(
        *(_series(name, title) for name, title in errors.items() if layout.reference),
        _series("known_area", "Known area [m²]"),
        rrb.Tabs(rrb.TextDocumentView(origin="/legend", name="Colours"), _log(), active_tab=0),
        row_shares=[3] * (4 if layout.reference else 1) + [4],
    )
    return rrb.Horizontal(view, side, column_shares=[2, 1], name="Mapping")


def _structure(layout: Layout) -> rrb.Container:
    return rrb.Grid(
        _from_above(layout, "Wall segments (3.1)", ["+ /prediction/input", "+ /prediction/segments"]),
        _from_above(layout, "Lines (3.1)", ["+ /prediction/input", "+ /prediction/lines/**", "+ /prediction/doors/**"]),
        _from_above(layout, "Faces (3.2)", ["+ /prediction/input", "+ /prediction/faces/**"]),
        _from_above(
            layout,
            "Initial faces (3.3)",
            ["+ /prediction/input", "+ /prediction/initial/**", "+ /prediction/doors/**"],
        ),
        grid_columns=2,
        name="Structure",
    )


def _expansion(layout: Layout) -> rrb.Container:
    view = _from_above(
        layout,
        "Expansion (3.4)",
        ["+ /prediction/input", "+ /prediction/faces/edges", "+ /prediction/layouts/**", "+ /prediction/doors/**"],
        aspect=1.3,
    )
    side = rrb.Vertical(
        rrb.TextDocumentView(origin="/stage", name="Stage"),
        rrb.TimeSeriesView(origin="/metrics/score", name="Score of each room by level (on the timeline stage)"),
        rrb.TextDocumentView(origin="/prediction/scores", name="Scores"),
        row_shares=[2, 3, 3],
    )
    return rrb.Horizontal(view, side, column_shares=[2, 1], name="Expansion")


def _rooms(layout: Layout) -> rrb.Container:
    """Prediction and truth, one above the other where the building is wide."""
    wide = _is_wide(layout)
    aspect = 3.0 if wide else 0.8
    views = [_from_above(layout, "Predicted map", ["+ /rooms/predicted/**"], aspect=aspect)]
    if layout.building:
        views.append(_from_above(layout, "Truth", ["+ /rooms/truth/**"], aspect=aspect))
    stack = rrb.Vertical if wide else rrb.Horizontal
    return stack(*views, name="Rooms")


def _coverage(layout: Layout) -> rrb.Container:
    views: list[rrb.View] = [
        _from_above(layout, title, [f"+ /coverage/{name}/**", f"+ {grid}"])
        for name, title, grid in (
            ("closed", "Tour on the map M with its closed doors", "/prediction/input"),
            ("predicted", "Tour on the predicted map", "/rooms/predicted/grid"),
            ("truth", "Tour on the true map", "/rooms/truth/grid"),
        )
    ]
    return rrb.Grid(*views, rrb.TextDocumentView(origin="/result", name="Result"), grid_columns=2, name="Coverage")


def _driving(layout: Layout) -> rrb.Container:
    view = _from_above(
        layout,
        "Driven",
        [
            "+ /map/grid",
            "+ /map/scan",
            "+ /map/robot/**",
            "+ /map/path/estimate",
            "+ /map/path/truth",
            "+ /driving/**",
            "- /driving/predicted/grid",
        ],
        aspect=1.3,
    )
    side = rrb.Vertical(
        rrb.StateTimelineView(origin="/door_states", name="Closed doors"),
        _series("known_area", "Known area [m²]"),
        _log(),
    )
    return rrb.Horizontal(view, side, column_shares=[2, 1], name="Driving")


def _result() -> rrb.Container:
    return rrb.Horizontal(
        rrb.TextDocumentView(origin="/result", name="Result"),
        rrb.TextDocumentView(origin="/configuration", name="Configuration"),
        name="Result",
    )


def _log() -> rrb.View:
    return rrb.TextLogView(origin="/log", name="Log")


def _series(name: str, title: str) -> rrb.View:
    """Curves over the whole run, whatever the cursor."""
    always = rr.TimeRange(start=rr.TimeRangeBoundary.infinite(), end=rr.TimeRangeBoundary.infinite())
    return rrb.TimeSeriesView(
        origin=f"/metrics/{name}",
        name=title,
        axis_x=rrb.TimeAxis(view_range=always),
        plot_legend=rrb.PlotLegend(rrb.Corner2D.LeftTop),
    )


def _is_wide(layout: Layout) -> bool:
    x0, y0, x1, y1 = layout.bounds
    return x1 - x0 > 1.5 * (y1 - y0)


def _from_above(layout: Layout, name: str, contents: Sequence[str], aspect: float = 1.5) -> rrb.View:
    """A map seen from above; ``aspect`` is the width of the view by its height when the window is 1.5 times as wide."""
    x0, y0, x1, y1 = layout.bounds
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
