"""The rectangles of ``best``, rated by what the network says beside their evidence."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from closedrooms.core.arrays import FloatArray
from closedrooms.predictor.best.hypotheses import Hypotheses, Proposals
from closedrooms.predictor.best.scene import Scene
from closedrooms.predictor.learned.model import Model
from closedrooms.predictor.learned.patches import Patch, cut_patches
from closedrooms.predictor.learned.seen_room import SeenRoom
from closedrooms.predictor.prediction import WeighedRoom

# What the overlap counts beside the evidence. Mean IoU by door on drawn maps and on maps of runs of the use
# ``choose``, then on those of real floors of ``fit`` that the network has not learned from: without the network
# 0.755, 0.749, 0.666, 0.760; 8 times the overlap 0.780, 0.756, 0.697, 0.768; 10 times 0.782, 0.756, 0.700, 0.763; 16
# times 0.782, 0.756, 0.709, 0.766. How far the network says that a room reaches has no say: where it is sure of a
# wrong side, that outdoes all evidence. The log probability of its sides and 4 times the overlap 0.783, 0.745, 0.696,
# 0.731; a quarter of it and 8 times 0.784, 0.754, 0.702, 0.754.
OVERLAP = 10.0
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
        scores = np.round(own.scores + OVERLAP * said, 9)
        order = np.lexsort((*own.boxes.T, -scores))[: self.keep]
        return replace(
            own,
            boxes=own.boxes[order],
            corners=own.corners[order],
            scores=scores[order],
            measured=np.column_stack((own.measured, said))[order],
        )

    def hear(self, doors: Sequence[str], corners: FloatArray) -> FloatArray:
        """Ask the network about rectangles as the room of some doors.

        Args:
            doors: Their ids: what is said of several is the mean.
            corners: Of rectangles in the map frame [m], shape (n, 4, 2).

        Returns:
            Overlap (IoU) of each with the mask, shape (n,).
        """
        said = []
        for patch, seen in (self.heard[door] for door in doors):
            places = patch.to_patch(corners)
            boxes = np.concatenate((places.min(axis=1), places.max(axis=1)), axis=1)
            said.append(seen.rate(boxes))
        return np.asarray(np.mean(said, axis=0))

    def explain(self, room: WeighedRoom) -> WeighedRoom:
        """Add what the network said to the evidence that was weighed for a room."""
        counted = OVERLAP * self.hear(room.doors, room.corners)
        second = room.runner_up
        term = float(counted[room.chosen]), 0.0 if second is None else float(counted[second])
        return replace(room, joint=room.joint + counted, terms=dict(room.terms) | {"network": term})
