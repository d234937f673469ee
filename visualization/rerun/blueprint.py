"""How a recording opens: one tab a stage, in the order in which a run goes through them."""

from collections.abc import Mapping
from types import MappingProxyType

import rerun.blueprint as rrb

from closedrooms.core.grid import Bounds
from closedrooms.visualization.rerun.tabs import (
    Contents,
    Layout,
    building_tab,
    coverage_tab,
    driving_tab,
    evidence_tab,
    expansion_tab,
    mapping_tab,
    result_tab,
    rooms_tab,
    structure_tab,
    sureness_tab,
    weighing_tab,
)
from closedrooms.visualization.rerun.views import show_log

# Where nothing is known yet [m].
DEFAULT_BOUNDS: Bounds = (-20.0, -20.0, 20.0, 20.0)


def make_blueprint(
    holds: Contents, bounds: Bounds | None, tops: Mapping[str, float] = MappingProxyType({})
) -> rrb.Blueprint:
    """Build the blueprint of a recording.

    Args:
        holds: What the recording holds.
        bounds: What a map seen from above shows.
        tops: Largest values of the plots by name, once all values are known; until then plots fit what they hold.
    """
    layout = Layout(holds, bounds or DEFAULT_BOUNDS, tops)
    tabs: list[rrb.Container | rrb.View] = []
    if holds.building:
        tabs.append(building_tab(layout))
    if holds.mapping:
        tabs.append(mapping_tab(layout))
    if holds.weighed:
        tabs += [evidence_tab(layout), weighing_tab(layout)]
    if holds.expansion:
        tabs += [structure_tab(layout), expansion_tab(layout)]
    if holds.rooms or holds.truth:
        tabs.append(rooms_tab(layout))
    if holds.sureness:
        tabs.append(sureness_tab(layout))
    if holds.tours:
        tabs.append(coverage_tab(layout))
    if holds.driving:
        tabs.append(driving_tab(layout))
    if holds.mapping or holds.rooms:
        tabs.append(show_log())
    if holds.result or holds.configuration:
        tabs.append(result_tab(layout))
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
