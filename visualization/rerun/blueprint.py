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
# Where nothing is known yet [m].
DEFAULT_BOUNDS: Bounds = (-20.0, -20.0, 20.0, 20.0)
# Bar charts on one page of the tab Weighing.
CHARTS = 4
HALF_VIEW = math.radians(55.0) / 2


@dataclass(frozen=True, slots=True)
class Contents:
    """Parts that a recording holds by now; tabs and views are made of nothing else.

    Attributes:
        building: A simulated building (tab ``Building``).
        door_states: Closed doors whose state is known.
        mapping: A robot that maps (tab ``Mapping``).
        reference: True poses beside the estimated ones.
        weighed: Entity names of the rooms whose candidates a method weighed (tabs ``Evidence``, ``Weighing``).
        expansion: Lines, faces and layouts level by level (tabs ``Structure``, ``Expansion``).
        rooms: Predicted rooms (tab ``Rooms``).
        sureness: How sure they are (tab ``How sure``).
        room_iou: How well each room is predicted, over time.
        truth: The true map and rooms.
        tours: Names of the maps with a tour (tab ``Coverage``).
        driving: The robot drives a tour (tab ``Driving``).
        result: A table of results (tab ``Result``).
        configuration: The configuration as resolved.
        active: Name of the tab in front.
    """

    building: bool = False
    door_states: bool = False
    mapping: bool = False
    reference: bool = False
    weighed: tuple[str, ...] = ()
    expansion: bool = False
    rooms: bool = False
    sureness: bool = False
    room_iou: bool = False
    truth: bool = False
    tours: tuple[str, ...] = ()
    driving: bool = False
    result: bool = False
    configuration: bool = False
    active: str = "Building"


@dataclass(frozen=True, slots=True)
class Layout:
    """Parts of a recording, and their place: ``bounds`` are ``x_min, y_min, x_max, y_max`` [m] in the map frame."""

    holds: Contents
    bounds: Bounds


def arrange(holds: Contents, bounds: Bounds | None) -> rrb.Blueprint:
    """Build the blueprint of a recording.

    Args:
        holds: What the recording holds.
        bounds: What a map seen from above shows.
    """
    layout = Layout(holds, bounds or DEFAULT_BOUNDS)
    tabs: list[rrb.Container | rrb.View] = []
    if holds.building:
        tabs.append(_building(layout))
    if holds.mapping:
        tabs.append(_mapping(layout))
    if holds.weighed:
        tabs += [_evidence(layout), _weighing(layout)]
    if holds.expansion:
        tabs += [_structure(layout), _expansion(layout)]
    if holds.rooms or holds.truth:
        tabs.append(_rooms(layout))
    if holds.sureness:
        tabs.append(_sureness(layout))
    if holds.tours:
        tabs.append(_coverage(layout))
    if holds.driving:
        tabs.append(_driving(layout))
    if holds.result or holds.configuration:
        tabs.append(_result(layout))
    names = [str(tab.name) for tab in tabs]
    active = names.index(holds.active) if holds.active in names else 0
    return rrb.Blueprint(
        *([rrb.Tabs(*tabs, active_tab=active)] if tabs else []),
        rrb.TimePanel(
            state="collapsed",
            timeline="sim_time" if holds.mapping or holds.building else "stage",
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
    views: list[rrb.View] = [rrb.TextDocumentView(origin="/stage", name="Stage")]
    if layout.holds.door_states:
        views.append(rrb.StateTimelineView(origin="/door_states", name="Closed doors, over sim_time [s]"))
    views.append(_log())
    side = rrb.Vertical(*views, row_shares=[2, 4, 4][: len(views)])
    return rrb.Horizontal(view, side, column_shares=[3, 1], name="Building")


def _mapping(layout: Layout) -> rrb.Container:
    view = _from_above(layout, "Map", ["+ /map/**", "+ /building/people", "+ /building/boxes"], aspect=1.3)
    errors = {
        "position_error": "Position error [m]",
        "heading_error": "Heading error [deg]",
        "odometry_error": "Error of the odometry alone [m]",
    }
    titles = errors if layout.holds.reference else {}
    side = rrb.Vertical(
        *(_series(name, title) for name, title in titles.items()),
        _series("known_area", "Known area [m²]"),
        rrb.Tabs(rrb.TextDocumentView(origin="/legend", name="Colours"), _log(), active_tab=0),
        row_shares=[3] * (len(titles) + 1) + [4],
    )
    return rrb.Horizontal(view, side, column_shares=[2, 1], name="Mapping")


def _evidence(layout: Layout) -> rrb.Container:
    """Arrange what was seen, what was weighed, what came of it."""
    plain = ["+ /prediction/input", "+ /prediction/doors/**"]
    aspect = 1.9
    return rrb.Grid(
        _from_above(
            layout,
            "Wall faces by the way they face",
            [*plain, "+ /prediction/wall_faces"],
            aspect=aspect,
        ),
        _from_above(
            layout,
            "Candidates by door with their scores (filled: chosen, violet: runner-up)",
            ["+ /prediction/input", "+ /prediction/doors/bars", "+ /prediction/candidates/**"],
            aspect=aspect,
        ),
        _from_above(layout, "Rooms chosen together", [*plain, "+ /prediction/layouts/**"], aspect=aspect),
        rrb.TextDocumentView(origin="/weighing/candidates", name="Candidates at the end"),
        grid_columns=2,
        name="Evidence",
    )


def _weighing(layout: Layout) -> rrb.Container:
    """Arrange a bar chart a room: terms of the chosen candidate against the runner-up, with their names."""
    rooms = layout.holds.weighed
    pages = [
        rrb.Grid(*(_weighed(room) for room in rooms[at : at + CHARTS]), grid_columns=2, name=_page(rooms, at))
        for at in range(0, len(rooms), CHARTS)
    ]
    return rrb.Tabs(*pages, active_tab=0, name="Weighing")


def _page(rooms: Sequence[str], at: int) -> str:
    page = rooms[at : at + CHARTS]
    return page[0] if len(page) == 1 else f"{page[0]} to {page[-1]}"


def _weighed(room: str) -> rrb.Container:
    chart = rrb.BarChartView(
        origin=f"/weighing/{room}",
        contents=[f"+ /weighing/{room}/chosen", f"+ /weighing/{room}/runner_up"],
        name=f"{room}: what each term counts [log-odds], by number",
        plot_legend=rrb.PlotLegend(visible=False),
    )
    return rrb.Horizontal(chart, rrb.TextDocumentView(origin=f"/weighing/{room}/terms", name=f"{room}: terms"))


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
        rrb.TimeSeriesView(origin="/metrics/score", name="Score of each room (no unit) over stage [level]"),
        rrb.TextDocumentView(origin="/prediction/scores", name="Scores"),
        row_shares=[2, 3, 3],
    )
    return rrb.Horizontal(view, side, column_shares=[2, 1], name="Expansion")


def _rooms(layout: Layout) -> rrb.Container:
    """Arrange prediction and truth, one above the other in a wide building; beside them how the prediction grew."""
    holds, wide = layout.holds, _is_wide(layout)
    aspect = 2.2 if wide else 0.6
    views = []
    if holds.rooms:
        contents = ["+ /rooms/predicted/**", "+ /prediction/doors/bars"]
        views.append(_from_above(layout, "Predicted map", contents, aspect=aspect))
    if holds.truth:
        views.append(_from_above(layout, "Truth", ["+ /rooms/truth/**"], aspect=aspect))
    maps = (rrb.Vertical if wide else rrb.Horizontal)(*views)
    if not holds.mapping:
        return rrb.Horizontal(maps, name="Rooms")
    curves = [_series("known_area", "Known area [m²]"), _log()]
    if holds.room_iou:
        curves.insert(0, _series("room_iou", "IoU with the true room, by door [0..1]", top=1.0))
    return rrb.Horizontal(maps, rrb.Vertical(*curves), column_shares=[2, 1], name="Rooms")


def _sureness(layout: Layout) -> rrb.Container:
    """Arrange what every cell and every room may be."""
    contents = ["+ /sureness/grid", "+ /rooms/predicted/**", "- /rooms/predicted/grid", "+ /prediction/doors/bars"]
    title = "Probability to be floor, from grey (0) to blue (1); rooms fainter where less sure, dashed what else"
    table = rrb.TextDocumentView(origin="/sureness/table", name="Rooms by confidence")
    view = _from_above(layout, title, contents, aspect=1.3)
    return rrb.Horizontal(view, table, column_shares=[2, 1], name="How sure")


def _coverage(layout: Layout) -> rrb.Container:
    titles = {
        "closed": ("Tour on the map M with its closed doors", "+ /coverage/closed/grid"),
        "predicted": ("Tour on the predicted map", "+ /coverage/predicted/grid"),
        "truth": ("Tour on the true map", "+ /rooms/truth/grid"),
    }
    views: list[rrb.View] = [
        _from_above(layout, titles[name][0], [f"+ /coverage/{name}/**", titles[name][1]])
        for name in layout.holds.tours
        if name in titles
    ]
    if layout.holds.result:
        views.append(rrb.TextDocumentView(origin="/result", name="Result"))
    return rrb.Grid(*views, grid_columns=2, name="Coverage")


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
    views = [_series("known_area", "Known area [m²]"), _log()]
    if layout.holds.door_states:
        views.insert(0, rrb.StateTimelineView(origin="/door_states", name="Closed doors, over sim_time [s]"))
    return rrb.Horizontal(view, rrb.Vertical(*views), column_shares=[2, 1], name="Driving")


def _result(layout: Layout) -> rrb.Container:
    views = []
    if layout.holds.result:
        views.append(rrb.TextDocumentView(origin="/result", name="Result"))
    if layout.holds.configuration:
        views.append(rrb.TextDocumentView(origin="/configuration", name="Configuration"))
    return rrb.Horizontal(*views, name="Result")


def _log() -> rrb.View:
    return rrb.TextLogView(origin="/log", name="Log")


def _series(name: str, title: str, *, top: float | None = None) -> rrb.View:
    """Plot curves over the whole run, whatever the cursor; along the axis time [s], or the stage where it is shown."""
    always = rr.TimeRange(start=rr.TimeRangeBoundary.infinite(), end=rr.TimeRangeBoundary.infinite())
    return rrb.TimeSeriesView(
        origin=f"/metrics/{name}",
        name=f"{title} over sim_time [s], or stage",
        axis_x=rrb.TimeAxis(view_range=always),
        axis_y=None if top is None else rrb.ScalarAxis(range=(0.0, 1.05 * top)),
        plot_legend=rrb.PlotLegend(rrb.Corner2D.LeftTop),
    )


def _is_wide(layout: Layout) -> bool:
    x0, y0, x1, y1 = layout.bounds
    return x1 - x0 > 1.5 * (y1 - y0)


def _from_above(layout: Layout, name: str, contents: Sequence[str], aspect: float = 1.5) -> rrb.View:
    """Show a map from above; ``aspect`` is the view's width by its height in a window 1.5 times as wide."""
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
