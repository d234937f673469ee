"""How far the robot may have moved since the last match: what the odometry says, and how far to trust it."""

import math
from dataclasses import dataclass, replace

from closedrooms.mapping.config import MatcherConfig

STILL = (0.005, 0.003)
"""Motion ([m], [rad]) below which a scan is not matched again."""
FADING = 0.6
"""Share of the last step's motion that the next one is thought capable of, whatever its odometry says."""
SURPRISE = 3.0
"""Standard deviations of the odometry beyond which a correction says that the odometry is wrong just now."""
NEGLIGIBLE = (0.01, 0.005)
"""Surprise ([m], [rad]) below which it has faded."""


@dataclass(frozen=True, slots=True)
class UncertainMotion:
    """Motion since the last match and its uncertainty.

    Attributes:
        distance: Distance travelled [m].
        turn: Absolute turn [rad].
        recent_distance: The largest of the last steps, fading [m].
        recent_turn: The largest of the last turns, fading [rad].
        surprise: The largest of the last corrections that the odometry was not thought to need, fading: distance [m]
            and angle [rad]. One robot of the logs counts its distance forwards when it drives backwards.
        unmeasured: Distance [m] and turn [rad] of which the odometry says nothing, ``None`` where it measured all.
    """

    distance: float = 0.0
    turn: float = 0.0
    recent_distance: float = 0.0
    recent_turn: float = 0.0
    surprise: tuple[float, float] = (0.0, 0.0)
    unmeasured: tuple[float, float] | None = None

    def then(self, distance: float, turn: float) -> "UncertainMotion":
        """Add one more step of the odometry.

        What moved a moment ago hardly stands still: a noisy odometry may read zero by chance in the middle of a turn.
        """
        return UncertainMotion(
            self.distance + distance,
            self.turn + turn,
            max(distance, FADING * self.recent_distance),
            max(turn, FADING * self.recent_turn),
            self.surprise,
            self.unmeasured,
        )

    def without_odometry(self, distance: float, turn: float) -> "UncertainMotion":
        """Add a step of about ``distance`` [m] and ``turn`` [rad] that no odometry measured."""
        before = self.unmeasured or (0.0, 0.0)
        return replace(self, unmeasured=(before[0] + distance, before[1] + turn))

    def corrected(self, distance: float, angle: float, config: MatcherConfig) -> "UncertainMotion":
        """Remember how far, ``distance`` [m] and ``angle`` [rad], a match was from the prediction: it was less sure."""
        surprise = tuple(
            max(off if off > SURPRISE * sigma else 0.0, FADING * last if last > negligible else 0.0)
            for off, sigma, last, negligible in zip(
                (distance, angle), self._odometry_sigmas(config), self.surprise, NEGLIGIBLE, strict=True
            )
        )
        return replace(self, surprise=(surprise[0], surprise[1]))

    def matched(self) -> "UncertainMotion":
        """Start again at a match."""
        return UncertainMotion(0.0, 0.0, self.recent_distance, self.recent_turn, self.surprise)

    @property
    def still(self) -> bool:
        """Too little to match again."""
        return (
            self.unmeasured is None
            and max(self.distance, self.recent_distance) < STILL[0]
            and max(self.turn, self.recent_turn) < STILL[1]
        )

    def sigmas(self, config: MatcherConfig) -> tuple[float, float]:
        """Compute the standard deviations of the predicted position [m] and heading [rad]."""
        distance, angle = self._odometry_sigmas(config)
        unmeasured = self.unmeasured or (0.0, 0.0)
        return math.hypot(distance, self.surprise[0], unmeasured[0]), math.hypot(angle, self.surprise[1], unmeasured[1])

    def _odometry_sigmas(self, config: MatcherConfig) -> tuple[float, float]:
        """Compute what the odometry usually deserves; the variance grows with the distance."""
        distance, turn = max(self.distance, self.recent_distance), max(self.turn, self.recent_turn)
        position = math.sqrt(config.odometry_floor**2 + config.odometry_distance**2 * distance)
        angle = math.sqrt(
            (config.odometry_floor / 2.0) ** 2
            + config.odometry_turn_per_metre**2 * distance
            + config.odometry_turn**2 * turn
        )
        return position, angle
