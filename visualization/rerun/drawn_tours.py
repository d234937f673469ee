"""Tours in a recording: topological graphs and the tours over them (paper, section 5)."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from closedrooms.visualization import colours
from closedrooms.visualization.rerun import drawables
from closedrooms.visualization.rerun.stream import RecordingStream, Stage

if TYPE_CHECKING:
    from closedrooms.coverage.tour.coverage_tour import CoverageTour


def draw_tours(stream: RecordingStream, tours: Mapping[str, "CoverageTour"]) -> None:
    """Draw topological graphs and the tours over them."""
    stream.at(stage=Stage.COVERAGE)
    lengths = ", ".join(f"{name} {tour.length:.1f} m" for name, tour in tours.items())
    stream.say("Coverage", f"tours: {lengths or 'none'} (section 5)")
    for name, tour in tours.items():
        graph, colour = tour.graph, colours.TOURS.get(name, colours.INK)
        edges = np.asarray(graph.vertices)[graph.pairs]
        inside = {door: graph.vertices[index] for door, index in sorted(graph.door_vertices.items())}
        places = np.array(list(inside.values()))
        drawn = {
            "edges": drawables.strips(list(edges), (150, 150, 160), radius=drawables.THIN),
            "tour": drawables.strips([tour.path], colour, z=drawables.Z_PATH),
            "vertices": drawables.points(graph.vertices, colours.INK, radius=drawables.MEDIUM),
            "doors": drawables.points(places, colours.PAPER, radius=drawables.THIN, labels=list(inside)),
            "start": drawables.points(np.asarray(tour.path)[:1], colours.GOAL, radius=2 * drawables.THICK),
        }
        # Planned once, at the end: there whatever the time.
        for part, what in drawn.items():
            stream.log(f"coverage/{name}/{part}", what, static=True)
