"""A kind of evidence with its weight (method ``best``): of a rectangle, of two rooms, of doors with one room."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, TypeVar

Measured = TypeVar("Measured")
Figures = TypeVar("Figures")


@dataclass(frozen=True, slots=True)
class Feature(Generic[Measured, Figures]):
    """Kind of evidence.

    Attributes:
        name: For people.
        measure: The figure, or one for each of what is measured at once.
        weight: Factor of the figure in the score.
    """

    name: str
    measure: Callable[[Measured], Figures]
    weight: float
