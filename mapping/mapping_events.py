"""What befell the mapper on the way: failed odometry, gaps and lost scans, counted with their times."""

from dataclasses import dataclass, field
from enum import Enum

from closedrooms.core.remarks import Action, Remark


class Event(Enum):
    """Kinds of events: what is done, to what, and why."""

    GAP = ("guessed", "motions over gaps without scans", "no scan for much longer than usual while the robot moved")
    JUMP = ("repaired", "jumps of the odometry", "no robot moves so fast: bridged by scan matching")
    LEAP = ("repaired", "sudden leaps of the odometry", "longer than any step before: half of it fits the scans better")
    SILENT = ("repaired", "steps without odometry", "it stood still or was missing while the scans moved")
    BLIND = ("guessed", "poses of scans with too few echoes", "odometry alone")
    RECOVERED = ("repaired", "failed matches", "odometry was wrong: the pose was found again in a wider window")
    LOST = ("guessed", "poses of lost scans", "they contradict the map at the pose that odometry gives: odometry kept")
    SUBMAP = ("guessed", "places of submaps", "the robot was lost: a new map starts where odometry puts it")
    JOINED = ("repaired", "submaps", "a loop joined them to the map")

    @property
    def action(self) -> Action:
        """As in a remark."""
        action: Action = self.value[0]
        return action


@dataclass(slots=True)
class EventLog:
    """Times of the events by kind [s]."""

    _times: dict[Event, list[float]] = field(default_factory=dict)

    def note(self, event: Event, stamp: float) -> None:
        """Remember that something happened."""
        self._times.setdefault(event, []).append(stamp)

    def count(self, event: Event) -> int:
        """Count how often an event happened."""
        return len(self._times.get(event, ()))

    def remarks(self) -> tuple[Remark, ...]:
        """Make one remark of each kind of event; its names are the times of the events."""
        return tuple(
            Remark(
                action=event.action,
                what=event.value[1],
                why=event.value[2],
                names=tuple(f"{stamp:.2f} s" for stamp in self._times[event]),
                count=len(self._times[event]),
            )
            for event in Event
            if event in self._times
        )
