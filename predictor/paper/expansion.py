"""Joint expansion of all rooms, level by level (paper, section 3.3)."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from closedrooms.core.arrays import BoolArray, IntArray
from closedrooms.predictor.config import PaperConfig
from closedrooms.predictor.paper.arrangement import Arrangement
from closedrooms.predictor.paper.initial_faces import Entrance
from closedrooms.predictor.paper.layout_score import FaceSet, face_set, score_layouts
from closedrooms.predictor.paper.subsets import best_subset


@dataclass(slots=True)
class Growth:
    """The layouts while they grow: the one mutable thing of a prediction.

    Attributes:
        arrangement: All faces.
        unknown: Which faces were not observed, shape (n,).
        entrances: One room each.
        owner: Room that a face belongs to, -1 for none, shape (n,).
        scores: Value of the evaluation function a room.
        dependent: Whether a room touches another one's layout.
        bounded: Whether a search limit cut something a room.
    """

    arrangement: Arrangement
    unknown: BoolArray
    entrances: Sequence[Entrance]
    owner: IntArray = field(init=False)
    scores: list[float] = field(init=False)
    dependent: list[bool] = field(init=False)
    bounded: list[bool] = field(init=False)

    def __post_init__(self) -> None:
        self.owner = np.full(len(self.arrangement.faces), -1, dtype=np.int64)
        for room, entrance in enumerate(self.entrances):
            self.owner[entrance.face] = room
        rooms = len(self.entrances)
        self.scores, self.dependent, self.bounded = [0.0] * rooms, [False] * rooms, [False] * rooms

    @property
    def free(self) -> BoolArray:
        """Unknown faces that belong to no room, shape (n,)."""
        return np.asarray(self.unknown & (self.owner < 0))

    def layout(self, room: int) -> IntArray:
        """List the faces of a room."""
        return np.flatnonzero(self.owner == room)

    def is_border(self, room: int) -> bool:
        """Check whether a room starts in a border face (paper, section 3.6)."""
        return bool(self.arrangement.border[self.entrances[room].face])

    def candidates(self, room: int) -> IntArray:
        """List ``F_r^k``: unknown faces of no room beside the layout, never border faces."""
        free = self.free & ~self.arrangement.border
        beside = {g for f in self.layout(room) for g in self.arrangement.neighbours[f] if free[g]}
        return np.array(sorted(beside), dtype=np.int64)

    def touches(self, room: int) -> set[int]:
        """List the other rooms with a face beside this room's layout."""
        beside = {int(self.owner[g]) for f in self.layout(room) for g in self.arrangement.neighbours[f]}
        return beside - {-1, room}

    def position(self, room: int) -> tuple[float, ...]:
        """Make the key that sorts one room among rooms that tie: door to middle of all doors, then x, y [m]."""
        doors = np.array([entrance.door.midpoint for entrance in self.entrances])
        away = float(np.hypot(*(doors[room] - doors.mean(axis=0))))
        return (round(away, 6), *self.entrances[room].door.midpoint)

    def face_set(self, room: int, faces: IntArray, returnable: BoolArray) -> FaceSet:
        """Gather ``faces``, indices of shape (n,), of which a room's layouts are made, for scoring subsets.

        Args:
            room: Number of the room.
            faces: Faces that its layouts may contain.
            returnable: Which of them are unassigned unknown faces when a layout leaves them out, shape (n,).
        """
        return face_set(self.arrangement, faces, returnable, self.free, self.entrances[room].facing.along)


def expand(growth: Growth, config: PaperConfig, report: Callable[[int], None] = lambda _level: None) -> None:
    """Grow all rooms jointly until nothing improves or ``max_level`` is reached.

    At each level the rooms take their turn from the smallest to the largest set of candidates (or as
    ``room_order`` says); whether a room is
    dependent is asked again at every turn. A layout stays as it is when no subset improves it.

    Args:
        growth: The initial faces; grown in place.
        config: Weights and limits.
        report: Called after every level.
    """
    rooms = [room for room in range(len(growth.entrances)) if not growth.is_border(room)]
    for room in rooms:
        _score(growth, room, config)
    report(0)
    for level in range(1, config.max_level + 1):
        changed = False
        for room in sorted(rooms, key=lambda r: _turn(growth, r, config)):
            changed |= _grow(growth, room, config)
        report(level)
        if not changed:
            break


def _turn(growth: Growth, room: int, config: PaperConfig) -> tuple[float, ...]:
    """Order within a level: fewest candidates first; ties by their area, the layout's, then by position."""
    if config.room_order == "by-position":
        return growth.position(room)
    candidates, areas = growth.candidates(room), growth.arrangement.areas
    return (
        candidates.size if config.room_order == "smallest-first" else -candidates.size,
        round(float(areas[candidates].sum()), 6),
        round(float(areas[growth.layout(room)].sum()), 6),
        *growth.position(room),
    )


def _grow(growth: Growth, room: int, config: PaperConfig) -> bool:
    """Grow one room once; returns whether its layout changed."""
    candidates, layout = growth.candidates(room), growth.layout(room)
    faces = np.concatenate((layout, candidates))
    fixed = np.arange(faces.size) < layout.size
    pool = growth.face_set(room, faces, ~fixed)
    growth.dependent[room] = bool(growth.touches(room))
    found = best_subset(
        pool,
        fixed,
        config.weights,
        config.phi,
        dependent=growth.dependent[room],
        door=np.array(growth.entrances[room].door.midpoint),
        exact=config.exact_candidates,
        max_nodes=config.max_nodes,
    )
    growth.scores[room] = found.score
    growth.bounded[room] |= found.bounded
    growth.owner[pool.faces[found.chosen]] = room
    return bool(found.chosen.sum() > layout.size)


def _score(growth: Growth, room: int, config: PaperConfig) -> None:
    """Score a room's layout as it is."""
    layout = growth.layout(room)
    pool = growth.face_set(room, layout, np.zeros(layout.size, dtype=np.bool_))
    growth.dependent[room] = bool(growth.touches(room))
    terms = pool.terms(np.ones((1, layout.size), dtype=np.bool_))
    growth.scores[room] = float(score_layouts(terms, config.weights, config.phi, dependent=growth.dependent[room])[0])
