"""What keyframes say about places: beams met something there, or went past, near the normal or askew."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from closedrooms.core.arrays import BoolArray, FloatArray, IntArray
from closedrooms.core.pose import Pose2
from closedrooms.mapping.glass.scan_view import LATERAL, Views, stretches
from closedrooms.mapping.graph.keyframe import Keyframe

NEAR, OBLIQUE = math.radians(9.0), math.radians(22.0)
"""Incidence up to which a pane returns every beam, and from which on it returns none [rad]."""
ASKEW = math.radians(30.0)
"""Incidence from which on a beam that ends there tells a wall [rad]: normals are known to some 8 degrees."""
DEPTH = 0.15
"""Distance from a place up to which a beam that ends there hits it [m]: three cells; twice as far it went past."""
BEHIND = 0.5
"""How far behind the plane of a pane a beam ends at least that went through it askew [m]: what ends nearer may have met
a wall from a pose that had drifted."""
EXACT = 0.08
"""The same of a beam that meets it askew [m]: the end of a wall beside a pane is hit not far beyond."""
REACH = 12.0
"""Distance from which a scan says something about a place [m]."""
VIEWPOINT = 0.2
"""Size of the squares of which each counts as one place to see from [m]: a robot that turns on the spot learns nothing
new of what it hits."""
MOST_ASKED = 50_000
"""Questions that are answered at once: a bound on memory."""
HIT_NEAR, HIT_OBLIQUE, PAST_NEAR, PAST_OBLIQUE = 1, 2, 3, 4


@dataclass(frozen=True, slots=True, eq=False)
class Said:
    """What keyframes say about places: entries, shape (n,) each; about most places a keyframe says nothing.

    Attributes:
        keyframes: Index of the keyframe.
        places: Index of the place.
        codes: One of the codes above.
    """

    keyframes: npt.NDArray[np.int32]
    places: npt.NDArray[np.int32]
    codes: npt.NDArray[np.int8]

    @staticmethod
    def joined(parts: Sequence["Said"]) -> "Said":
        """Join entries."""
        return Said(
            np.concatenate([part.keyframes for part in parts]),
            np.concatenate([part.places for part in parts]),
            np.concatenate([part.codes for part in parts]),
        )

    def kept(self, chosen: BoolArray) -> "Said":
        """Keep some entries, shape (n,)."""
        return Said(self.keyframes[chosen], self.places[chosen], self.codes[chosen])

    def count_viewpoints(self, sensors: FloatArray, count: int) -> IntArray:
        """Count for each code from how many viewpoints keyframes said it of each place, shape (4, count).

        Args:
            sensors: Where the keyframes were taken, shape (keyframes, 2) [m].
            count: Number of places.
        """
        squares = np.floor(sensors / VIEWPOINT).astype(np.int64)
        _, viewpoints = np.unique(squares @ np.array([1 << 31, 1]), return_inverse=True)
        seen_from = viewpoints[self.keyframes]
        counts = []
        for code in (HIT_NEAR, HIT_OBLIQUE, PAST_NEAR, PAST_OBLIQUE):
            mine = self.codes == code
            once = np.unique(self.places[mine] * np.int64(len(sensors)) + seen_from[mine])
            counts.append(np.bincount(once // max(len(sensors), 1), minlength=count))
        return np.stack(counts)


NOTHING_SAID = Said(np.zeros(0, dtype=np.int32), np.zeros(0, dtype=np.int32), np.zeros(0, dtype=np.int8))


class Witnesses:
    """Keyframes as they are asked about places."""

    def __init__(self) -> None:
        self._views = Views()
        self._poses: list[Pose2] = []
        self._headings: FloatArray = np.zeros(0)
        self.sensors: FloatArray = np.zeros((0, 2))
        """Where each scan was taken, map frame, shape (keyframes, 2) [m]."""
        self._changed: set[int] = set()

    def call(self, keyframes: Sequence[Keyframe]) -> None:
        """Take in all keyframes where they are now."""
        for keyframe in keyframes[len(self._views) :]:
            self._views.add(keyframe.beams)
        poses, known = [keyframe.pose for keyframe in keyframes], len(self._poses)
        anew = [k for k, (pose, before) in enumerate(zip(poses, self._poses, strict=False)) if pose is not before]
        anew += range(known, len(keyframes))
        self._poses = poses
        self._headings = np.concatenate((self._headings, np.zeros(len(keyframes) - known)))
        self.sensors = np.concatenate((self.sensors, np.zeros((len(keyframes) - known, 2))))
        for k in anew:
            self._headings[k] = poses[k].theta
            self.sensors[k] = poses[k].transform(keyframes[k].beams.origin[None])[0]
        self._changed.update(anew)

    def take_changed(self) -> list[int]:
        """List the indices of the keyframes that were new or had moved since the last call."""
        changed, self._changed = sorted(self._changed), set()
        return changed

    def say(self, chosen: Sequence[int], places: FloatArray, normals: FloatArray, first: int = 0) -> Said:
        """Find what some keyframes, by their indices, say about places, shape (n, 2), from the ``first`` one on."""
        parts = [NOTHING_SAID]
        # Places from left to right: those within reach of a keyframe stand side by side.
        order = first + np.argsort(places[first:, 0], kind="stable")
        x, numbers = places[order, 0], np.array(chosen, dtype=np.int64)
        sensors = self.sensors[numbers, 0]
        begins, ends = np.searchsorted(x, sensors - REACH), np.searchsorted(x, sensors + REACH, side="right")
        batches = np.cumsum(ends - begins) // MOST_ASKED
        for batch in np.split(np.arange(len(numbers)), np.flatnonzero(np.diff(batches)) + 1):
            whose, which, _ = stretches(begins[batch], ends[batch])
            who, what = numbers[batch][whose], order[which]
            codes = self._codes(who, places[what], normals[what])
            told = np.flatnonzero(codes)
            parts.append(Said(who[told].astype(np.int32), what[told].astype(np.int32), codes[told]))
        return Said.joined(parts)

    def may_cross(self, chosen: Sequence[int], segments: FloatArray) -> BoolArray:
        """Mark the segments, map frame, shape (m, 2, 2) [m], that beams of some keyframes may cross, shape (n, m)."""
        numbers = np.array(chosen, dtype=np.int64)
        return self._views.may_cross(numbers, self._seen_from(numbers[:, None, None], segments))

    def _seen_from(self, numbers: IntArray, places: FloatArray) -> FloatArray:
        """See places, shape (..., 2) [m], from the sensors of keyframes, in the axes of their robots."""
        offsets, headings = places - self.sensors[numbers], self._headings[numbers]
        cos, sin = np.cos(headings), np.sin(headings)
        x, y = offsets[..., 0], offsets[..., 1]
        return np.stack((cos * x + sin * y, cos * y - sin * x), axis=-1)

    def _codes(
        self, numbers: IntArray, places: FloatArray, normals: FloatArray
    ) -> np.ndarray[tuple[int], np.dtype[np.int8]]:
        """Find what keyframes say, each about one place, shape (n,); 0 where nothing."""
        codes = np.zeros(len(places), dtype=np.int8)
        offsets = places - self.sensors[numbers]
        away = np.hypot(*offsets.T)
        near = np.flatnonzero(away < REACH)
        numbers, away = numbers[near], away[near]
        seen = self._seen_from(numbers, places[near])
        met = np.abs((offsets[near] * normals[near]).sum(axis=1)) / np.maximum(away, 1e-9)
        incidence = np.arccos(np.minimum(met, 1.0))
        # A place that lies before or behind the pane by the noise is seen as far aside as the pane is askew.
        beyond = self._views.beyond(numbers, seen, LATERAL * np.where(incidence < OBLIQUE, 1.0, np.sin(incidence)))
        with np.errstate(invalid="ignore"):
            hit, past = np.abs(beyond) <= DEPTH, beyond > 2.0 * DEPTH
        # Of a place that is near, so many beams are beside it that some meet the pane near its normal.
        askew = np.flatnonzero(hit & (incidence >= ASKEW))
        hit[askew] = np.abs(self._views.beyond(numbers[askew], seen[askew], 0.0)) <= EXACT
        found = np.zeros(len(near), dtype=np.int8)
        found[hit & (incidence < OBLIQUE)] = HIT_NEAR
        found[hit & (incidence >= ASKEW)] = HIT_OBLIQUE
        found[past & (incidence < NEAR)] = PAST_NEAR
        found[past & (incidence >= OBLIQUE) & (beyond * met > BEHIND)] = PAST_OBLIQUE
        codes[near] = found
        return codes
