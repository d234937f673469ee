"""The surroundings that a scan is matched against: the keyframes that are consistent with the present."""

from collections.abc import Sequence

import numpy as np

from closedrooms.core.arrays import BoolArray, FloatArray
from closedrooms.mapping.config import MapperConfig
from closedrooms.mapping.crossed_space import CrossedSpace
from closedrooms.mapping.graph.keyframe import Keyframe
from closedrooms.mapping.matching.likelihood_field import LikelihoodField

HYSTERESIS = 1.5
"""Horizons after which a keyframe has to leave the field; one horizon lets it in. Saves stamping at the border."""
STALE_MEMBERS = 12
"""Keyframes that may stay in the field after they fell behind, before it is stamped anew."""


class LocalMap:
    """A likelihood field of the keyframes within the horizon of the present one, along the pose graph.

    What was mapped before a long way round may have drifted away from what is seen now. It comes back into the field
    when a loop brings it near along the graph.

    Attributes:
        field: Their surfaces.
        crossed: What they saw through.
    """

    def __init__(self, config: MapperConfig) -> None:
        self._config = config
        self._members: BoolArray = np.zeros(0, dtype=np.bool_)
        self.field = LikelihoodField(config.resolution, config.matcher)
        self.crossed = CrossedSpace(config)

    def update(self, keyframes: Sequence[Keyframe], path_lengths: FloatArray, distances: FloatArray) -> None:
        """Bring the field up to date after a new keyframe, the last one.

        Args:
            keyframes: All of them.
            path_lengths: Path length along the pose graph from the last keyframe to each, shape (keyframes,) [m].
            distances: The same as the crow flies.
        """
        horizon, near = self._config.loops.horizon, distances < self._config.max_range
        members = np.zeros(len(keyframes), dtype=np.bool_)
        members[: len(self._members)] = self._members
        if np.count_nonzero(members & near & (path_lengths > HYSTERESIS * horizon)) > STALE_MEMBERS:
            self.field.clear()
            self.crossed.clear()
            members[:] = False
        entering = near & (path_lengths <= horizon) & ~members
        chosen = [keyframes[i] for i in np.flatnonzero(entering).tolist()]
        self.field.add_scans([k.pose.transform(k.surfaces) for k in chosen])
        self.crossed.add([(k.beams, k.pose) for k in chosen])
        self._members = members | entering

    def clear(self) -> None:
        """Forget all, because poses were corrected."""
        self._members = np.zeros(0, dtype=np.bool_)
        self.field.clear()
        self.crossed.clear()
