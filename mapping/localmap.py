"""The surroundings that a scan is matched against: the keyframes that are consistent with the present."""

from collections.abc import Sequence

from closedrooms.mapping.config import MapperConfig
from closedrooms.mapping.keyframe import Keyframe
from closedrooms.mapping.likelihood import LikelihoodField

HYSTERESIS = 1.5
"""Horizons after which a keyframe has to leave the field; one horizon lets it in. Saves stamping at the border."""
STALE_MEMBERS = 12
"""Keyframes that may stay in the field after they fell behind, before it is stamped anew."""


class LocalMap:
    """A likelihood field of the keyframes within the horizon of the present one, along the pose graph.

    What was mapped before a long way round may have drifted away from what is seen now. It comes back into the field
    when a loop brings it near along the graph.
    """

    def __init__(self, config: MapperConfig) -> None:
        self._config = config
        self._members: set[int] = set()
        self.field = LikelihoodField(config.resolution, config.matcher)

    def update(self, keyframes: Sequence[Keyframe], ways: dict[int, float]) -> None:
        """Bring the field up to date after a new keyframe, the last one.

        Args:
            keyframes: All of them.
            ways: Way along the pose graph from the last keyframe [m] to those within ``HYSTERESIS`` horizons.
        """
        here, reach, horizon = keyframes[-1].pose, self._config.max_range, self._config.loops.horizon
        stale = sum(1 for i in self._members if i not in ways and keyframes[i].pose.distance(here) < reach)
        if stale > STALE_MEMBERS:
            self.clear()
        for i in sorted(ways):
            if i not in self._members and ways[i] <= horizon and keyframes[i].pose.distance(here) < reach:
                self.field.add(keyframes[i].pose.transform(keyframes[i].beams.points))
                self._members.add(i)

    def clear(self) -> None:
        """Forget all, because poses were corrected."""
        self._members.clear()
        self.field.clear()
