"""The tabs of a recording, a function each."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import rerun.blueprint as rrb

from closedrooms.core.grid import Bounds
from closedrooms.visualization.rerun.views import BACKGROUND, is_wide, plot_curves, show_from_above, show_log

# Bar charts on one page of the tab Weighing.
CHARTS = 4


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
    """Parts that a recording holds, and the extent of the map, to which views are zoomed.

    Attributes:
        holds: Parts of the recording.
        bounds: ``x_min, y_min, x_max, y_max`` in the map frame [m].
        tops: Largest values of the plots by name, once all values are known.
    """

    holds: Contents
    bounds: Bounds
    tops: Mapping[str, float] = field(default_factory=dict)

    def plot(self, name: str, title: str) -> rrb.View:
        """Plot curves from 0 up to their largest value."""
        return plot_curves(name, title, top=self.tops.get(name))


def building_tab(layout: Layout) -> rrb.Container:
    """Arrange the building in three dimensions beside what happens in it."""
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
    views.append(show_log())
    side = rrb.Vertical(*views, row_shares=[2, 4, 4][: len(views)])
    return rrb.Horizontal(view, side, column_shares=[3, 1], name="Building")


def mapping_tab(layout: Layout) -> rrb.Container:
    """Arrange the growing map beside the errors of the poses and the known area."""
    view = show_from_above(layout.bounds, "Map", ["+ /map/**", "+ /building/people", "+ /building/boxes"], aspect=1.3)
    errors = {
        "position_error": "Position error [m]",
        "heading_error": "Heading error [deg]",
        "odometry_error": "Error of the odometry alone [m]",
    }
    titles = errors if layout.holds.reference else {}
    side = rrb.Vertical(
        *(layout.plot(name, title) for name, title in titles.items()),
        layout.plot("known_area", "Known area [m²]"),
        rrb.TextDocumentView(origin="/legend", name="Colours"),
        row_shares=[3] * (len(titles) + 1) + [4],
    )
    return rrb.Horizontal(view, side, column_shares=[2, 1], name="Mapping")


def evidence_tab(layout: Layout) -> rrb.Container:
    """Arrange what was seen, what was weighed, what came of it."""
    plain = ["+ /prediction/input", "+ /prediction/doors/**"]
    aspect = 1.9
    return rrb.Grid(
        show_from_above(
            layout.bounds,
            "Wall faces by the way they face",
            [*plain, "+ /prediction/wall_faces"],
            aspect=aspect,
        ),
        show_from_above(
            layout.bounds,
            "Candidates by door with their scores (filled: chosen, violet: runner-up)",
            ["+ /prediction/input", "+ /prediction/doors/bars", "+ /prediction/candidates/**"],
            aspect=aspect,
        ),
        show_from_above(layout.bounds, "Rooms chosen together", [*plain, "+ /prediction/layouts/**"], aspect=aspect),
        rrb.TextDocumentView(origin="/weighing/candidates", name="Candidates at the end"),
        grid_columns=2,
        name="Evidence",
    )


def weighing_tab(layout: Layout) -> rrb.Container:
    """Arrange a bar chart a room: terms of the chosen candidate against the runner-up, with their names."""
    rooms = layout.holds.weighed
    pages = [
        rrb.Grid(*(_weighed(room) for room in rooms[at : at + CHARTS]), grid_columns=2, name=_page(rooms, at))
        for at in range(0, len(rooms), CHARTS)
    ]
    return rrb.Tabs(*pages, active_tab=0, name="Weighing")


def _page(rooms: Sequence[str], at: int) -> str:
    """Name a page of bar charts by its first and last room."""
    page = rooms[at : at + CHARTS]
    return page[0] if len(page) == 1 else f"{page[0]} to {page[-1]}"


def _weighed(room: str) -> rrb.Container:
    """Arrange the bar chart of a room beside the names of its terms."""
    chart = rrb.BarChartView(
        origin=f"/weighing/{room}",
        contents=[f"+ /weighing/{room}/chosen", f"+ /weighing/{room}/runner_up"],
        name=f"{room}: what each term counts [log-odds], by number",
        plot_legend=rrb.PlotLegend(visible=False),
    )
    return rrb.Horizontal(chart, rrb.TextDocumentView(origin=f"/weighing/{room}/terms", name=f"{room}: terms"))


def structure_tab(layout: Layout) -> rrb.Container:
    """Arrange the steps from wall segments to initial faces (paper, sections 3.1 to 3.3)."""
    return rrb.Grid(
        show_from_above(layout.bounds, "Wall segments (3.1)", ["+ /prediction/input", "+ /prediction/segments"]),
        show_from_above(
            layout.bounds, "Lines (3.1)", ["+ /prediction/input", "+ /prediction/lines/**", "+ /prediction/doors/**"]
        ),
        show_from_above(layout.bounds, "Faces (3.2)", ["+ /prediction/input", "+ /prediction/faces/**"]),
        show_from_above(
            layout.bounds,
            "Initial faces (3.3)",
            ["+ /prediction/input", "+ /prediction/initial/**", "+ /prediction/doors/**"],
        ),
        grid_columns=2,
        name="Structure",
    )


def expansion_tab(layout: Layout) -> rrb.Container:
    """Arrange the layouts of a level beside the scores of all levels (paper, section 3.4)."""
    view = show_from_above(
        layout.bounds,
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


def rooms_tab(layout: Layout) -> rrb.Container:
    """Arrange prediction and truth, one above the other in a wide building; beside them how the prediction grew."""
    holds, wide = layout.holds, is_wide(layout.bounds)
    aspect = 2.2 if wide else 0.6
    views = []
    if holds.rooms:
        contents = ["+ /rooms/predicted/**", "+ /prediction/doors/bars"]
        views.append(show_from_above(layout.bounds, "Predicted map", contents, aspect=aspect))
    if holds.truth:
        views.append(show_from_above(layout.bounds, "Truth", ["+ /rooms/truth/**"], aspect=aspect))
    maps = (rrb.Vertical if wide else rrb.Horizontal)(*views)
    if not holds.mapping:
        return rrb.Horizontal(maps, name="Rooms")
    curves = [layout.plot("known_area", "Known area [m²]"), show_log()]
    if holds.room_iou:
        curves.insert(0, plot_curves("room_iou", "IoU with the true room, by door [0..1]", top=1.0))
    return rrb.Horizontal(maps, rrb.Vertical(*curves), column_shares=[2, 1], name="Rooms")


def sureness_tab(layout: Layout) -> rrb.Container:
    """Arrange what every cell and every room may be."""
    contents = ["+ /sureness/grid", "+ /rooms/predicted/**", "- /rooms/predicted/grid", "+ /prediction/doors/bars"]
    title = "Probability to be floor, from grey (0) to blue (1); rooms fainter where less sure, dashed what else"
    table = rrb.TextDocumentView(origin="/sureness/table", name="Rooms by confidence")
    view = show_from_above(layout.bounds, title, contents, aspect=1.3)
    return rrb.Horizontal(view, table, column_shares=[2, 1], name="How sure")


def coverage_tab(layout: Layout) -> rrb.Container:
    """Arrange the tours, each on the map that it was planned on, and the table of results."""
    titles = {
        "closed": ("Tour on the map M with its closed doors", "+ /coverage/closed/grid"),
        "predicted": ("Tour on the predicted map", "+ /coverage/predicted/grid"),
        "truth": ("Tour on the true map", "+ /rooms/truth/grid"),
    }
    views: list[rrb.View] = [
        show_from_above(layout.bounds, titles[name][0], [f"+ /coverage/{name}/**", titles[name][1]])
        for name in layout.holds.tours
        if name in titles
    ]
    if layout.holds.result:
        views.append(rrb.TextDocumentView(origin="/result", name="Result"))
    return rrb.Grid(*views, grid_columns=2, name="Coverage")


def driving_tab(layout: Layout) -> rrb.Container:
    """Arrange the drive over the predicted tour beside doors, known area and log."""
    view = show_from_above(
        layout.bounds,
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
    views = [layout.plot("known_area", "Known area [m²]"), show_log()]
    if layout.holds.door_states:
        views.insert(0, rrb.StateTimelineView(origin="/door_states", name="Closed doors, over sim_time [s]"))
    return rrb.Horizontal(view, rrb.Vertical(*views), column_shares=[2, 1], name="Driving")


def result_tab(layout: Layout) -> rrb.Container:
    """Arrange the table of results beside the configuration."""
    views = []
    if layout.holds.result:
        views.append(rrb.TextDocumentView(origin="/result", name="Result"))
    if layout.holds.configuration:
        views.append(rrb.TextDocumentView(origin="/configuration", name="Configuration"))
    return rrb.Horizontal(*views, name="Result")
