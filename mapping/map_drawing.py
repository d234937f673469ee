"""The map as it is drawn: the keyframes at their present poses, cut where panes of glass were found."""

from collections.abc import Sequence

import numpy as np

from closedrooms.core.grid import OccupancyGrid
from closedrooms.core.pose import wrap_angle
from closedrooms.core.remarks import Remark
from closedrooms.mapping.config import MapperConfig
from closedrooms.mapping.glass.leaks import without_leaks
from closedrooms.mapping.glass.panes import Panes
from closedrooms.mapping.graph.keyframe import Keyframe
from closedrooms.mapping.log_odds_grid import EvidenceGrid

MOVED = (0.015, 0.003)
"""Correction of a keyframe ([m], [rad]) beyond which it is drawn anew."""
LOOK = 4
"""Keyframes after which it is looked for glass anew."""


class MapDrawing:
    """Draws the keyframes of a mapper; what is drawn already stays, unless its pose or its beams have changed.

    Attributes:
        panes: The panes of glass, found while the map is drawn.
    """

    def __init__(self, config: MapperConfig) -> None:
        self._glass = config.glass
        self._evidence = EvidenceGrid(config)
        self.panes = Panes(config.resolution)
        self._drawn = self._looked = 0
        self._corrected = self._finished = False
        self._without_leaks: tuple[OccupancyGrid, OccupancyGrid] | None = None

    def poses_moved(self) -> None:
        """Look at the poses of all keyframes anew when the map is drawn next."""
        self._drawn, self._corrected = 0, True

    def goes_on(self) -> None:
        """Take back that nothing comes after: there is another keyframe."""
        self._finished = False

    def look_again(self, keyframes: Sequence[Keyframe]) -> None:
        """Look for glass in all that was seen, as if nothing came after, when the map is drawn next."""
        if not self._glass:
            return
        self._finished = True
        self._looked = 0
        self.panes.start_again()
        for keyframe in keyframes:
            if keyframe.shown is not keyframe.beams:  # what no pane has cut need not be drawn anew
                keyframe.shown = None
        self._drawn = 0

    def remarks(self) -> tuple[Remark, ...]:
        """Say that panes of glass were found, with the middle of each, map frame [m]."""
        segments = self.panes.segments
        if not len(segments):
            return ()
        why = "scans met them near their normal and saw through them at an angle; what was seen through them is left"
        why = f"{why} unknown (--mapper.no-glass maps it)"
        names = tuple(f"at {x:.1f}, {y:.1f}" for x, y in segments.mean(axis=1))
        return (Remark(action="guessed", what="panes of glass", why=why, names=names, count=len(segments)),)

    def grid(self, keyframes: Sequence[Keyframe]) -> OccupancyGrid:
        """Draw the map.

        Args:
            keyframes: Those of the last call and further ones, oldest first.
        """
        grid = self._draw_with_panes(keyframes)
        if not len(self.panes.segments):
            return grid
        if self._without_leaks is None or self._without_leaks[0] is not grid:
            places = np.array([(keyframe.pose.x, keyframe.pose.y) for keyframe in keyframes])
            self._without_leaks = grid, without_leaks(grid, places)
        return self._without_leaks[1]

    def _draw_with_panes(self, keyframes: Sequence[Keyframe]) -> OccupancyGrid:
        grid = self._draw(keyframes)
        new = len(keyframes) - self._looked
        if not self._glass or new < (1 if self._finished else LOOK):
            return grid
        self._looked = len(keyframes)
        changed = self.panes.update(keyframes, self._evidence, moved=self._corrected, last=self._finished)
        self._corrected = False
        if not len(changed):
            return grid
        for keyframe in self.panes.seen_through(keyframes, changed):
            keyframe.shown = None
        self._drawn = 0
        return self._draw(keyframes)

    def _draw(self, keyframes: Sequence[Keyframe]) -> OccupancyGrid:
        moved = [keyframe for keyframe in keyframes[self._drawn :] if _outdated(keyframe)]
        self._evidence.add_all([k.drawn for k in moved if k.drawn is not None], sign=-1)
        for keyframe, shown in zip(moved, self.panes.shown(keyframes, moved), strict=True):
            keyframe.shown = shown
            keyframe.drawn = (keyframe.shown, keyframe.pose)
        self._evidence.add_all([k.drawn for k in moved if k.drawn is not None])
        self._drawn = len(keyframes)
        return self._evidence.grid()


def _outdated(keyframe: Keyframe) -> bool:
    """Check whether a keyframe is not drawn as, and where, it is now."""
    if keyframe.drawn is None or keyframe.shown is not keyframe.drawn[0]:
        return True
    drawn, pose = keyframe.drawn[1], keyframe.pose
    return drawn.distance(pose) > MOVED[0] or abs(wrap_angle(drawn.theta - pose.theta)) > MOVED[1]
