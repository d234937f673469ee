"""Rooms behind closed doors, predicted or true."""

from dataclasses import dataclass
from typing import Literal

from shapely.geometry import MultiPolygon, Polygon

RoomKind = Literal["independent", "dependent", "border"]


@dataclass(frozen=True, slots=True)
class Alternative:
    """Another shape that a predicted room may have.

    Attributes:
        polygon: Free interior, map frame [m].
        probability: That of the room and its alternatives this one comes nearest to the true room, 0..1.
    """

    polygon: Polygon | MultiPolygon
    probability: float


@dataclass(frozen=True, slots=True)
class Room:
    """The free interior of one room in the map frame.

    Attributes:
        polygon: Free interior, wall face to wall face, map frame [m].
        doors: Ids of the closed doors that lead there, one as a rule (paper, section 3).
        kind: How it was predicted (paper, sections 3.3 and 3.6); ``None`` for a true room.
        score: Value of the evaluation function (paper, section 3.4); ``None`` where none was computed.
        bounded: A search limit cut something while the room was found.
        confidence: Expected IoU with the true room if there is one, 0..1; ``None`` where nothing tells.
        alternatives: Up to three other shapes; the first few are the best choice of so many (``confidence.belief``).
        outside: Probability that its doors lead outside and there is no room, 0..1; ``None`` where nothing tells.
    """

    polygon: Polygon | MultiPolygon
    doors: tuple[str, ...]
    kind: RoomKind | None = None
    score: float | None = None
    bounded: bool = False
    confidence: float | None = None
    alternatives: tuple[Alternative, ...] = ()
    outside: float | None = None
