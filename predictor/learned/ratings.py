"""The rectangles of ``best``, rated by what the network says beside the evidence for their sides."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from closedrooms.core.arrays import FloatArray
from closedrooms.predictor.best.hypotheses import Hypotheses, Proposals
from closedrooms.predictor.best.scene import Scene
from closedrooms.predictor.learned.model import Model
from closedrooms.predictor.learned.patches import Patch, cut_patches
from closedrooms.predictor.learned.sides import SeenRoom
from closedrooms.predictor.prediction import WeighedRoom

# What the network says, and what that counts beside the evidence: the log probability of the sides, and the overlap
# with the mask. On buildings of the use ``choose`` the mean IoU of the rectangles, without the network and with these
# two weights: 0.746 on drawn maps, 0.775 (1, 0), 0.776 (1, 4), 0.777 (2, 4), 0.772 (4, 8); 0.688 on maps of runs, 0.700
# (1, 0), 0.698 (1, 4), 0.694 (2, 4), 0.695 (4, 8).
WORDS = ("sides", "cells")
WEIGHTS = np.array([1.0, 4.0])
# Weights of ``best.shared_rooms.SHARED_FEATURES`` for scores that hold what the network says, found as those of
# ``best`` by ``benchmarks/fitting/fit_shared_rooms.py``.
SHARING = np.array([-0.3, 0.138, 1.31, -0.215, -3.39, 4.25, -0.517])


@dataclass(slots=True, eq=False)
class Rater:
    """Judge of one map's rectangles; keeps what the network said, for beliefs and traces.

    Attributes:
        model: The network.
        keep: So many rectangles a room are left for the joint choice.
        heard: What the network was shown and what it said, by the id of the door.
    """

    model: Model
    keep: int
    heard: dict[str, tuple[Patch, SeenRoom]] = field(default_factory=dict)

    def __call__(self, scene: Scene, proposals: Proposals) -> Proposals:
        """Rate all rectangles of a map anew, and keep the best of each room."""
        names = [pose.facing.door.id for pose in scene.poses]
        patches = cut_patches(scene)
        self.heard = dict(zip(names, zip(patches, self.model.look(patches), strict=True), strict=True))
        alone = [self._rate([name], own) for name, own in zip(names, proposals.alone, strict=True)]
        shared = {
            doors: [self._rate([names[i] for i in doors], part) for part in parts]
            for doors, parts in proposals.shared.items()
        }
        return replace(proposals, alone=alone, shared=shared, sharing=SHARING)

    def _rate(self, doors: Sequence[str], own: Hypotheses) -> Hypotheses:
        """Add what the network says to the scores of rectangles, and keep the best of them in order."""
        said = self.hear(doors, own.corners)
        scores = np.round(own.scores + said @ WEIGHTS, 9)
        order = np.lexsort((*own.boxes.T, -scores))[: self.keep]
        return replace(
            own,
            boxes=own.boxes[order],
            corners=own.corners[order],
            scores=scores[order],
            measured=np.concatenate((own.measured, said), axis=1)[order],
        )

    def hear(self, doors: Sequence[str], corners: FloatArray) -> FloatArray:
        """Ask the network about rectangles as the room of some doors.

        Args:
            doors: Their ids: what is said of several is the mean.
            corners: Of rectangles in the map frame [m], shape (n, 4, 2).

        Returns:
            A column for each of :data:`WORDS`, shape (n, 2).
        """
        said = []
        for patch, seen in (self.heard[door] for door in doors):
            places = patch.to_patch(corners)
            boxes = np.concatenate((places.min(axis=1), places.max(axis=1)), axis=1)
            said.append(np.stack((seen.rate_sides(boxes), seen.rate_cells(boxes)), axis=1))
        return np.asarray(np.mean(said, axis=0))

    def explain(self, room: WeighedRoom) -> WeighedRoom:
        """Add what the network said to the evidence that was weighed for a room."""
        counted = self.hear(room.doors, room.corners) * WEIGHTS
        second = room.runner_up
        terms = {
            f"network: {word}": (float(column[room.chosen]), 0.0 if second is None else float(column[second]))
            for word, column in zip(WORDS, counted.T, strict=True)
        }
        return replace(room, joint=room.joint + counted.sum(axis=1), terms=dict(room.terms) | terms)
