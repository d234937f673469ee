"""The methods of prediction by name: ours, and those that other packages bring.

A package adds one with an entry point of the group ``closedrooms.methods`` that names a :class:`Method`::

    [project.entry-points."closedrooms.methods"]
    mine = "my_package:METHOD"
"""

import importlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Any, Protocol

from closedrooms.core.errors import InvalidInputError
from closedrooms.core.names import shown
from closedrooms.core.nearest import nearest
from closedrooms.predictor.config import BestConfig, FacesConfig, LearnedConfig, PaperConfig, RoseConfig

if TYPE_CHECKING:
    from closedrooms.core.door import ClosedDoor
    from closedrooms.core.grid import OccupancyGrid
    from closedrooms.predictor.prediction import Prediction

GROUP = "closedrooms.methods"
DEFAULT_METHOD = "best"


class Predictor(Protocol):
    """Function that predicts rooms."""

    def __call__(self, grid: "OccupancyGrid", doors: "Sequence[ClosedDoor]", config: Any) -> "Prediction":
        """Predict the rooms behind ``doors``; trouble with one door stands in ``failures`` and stops no other."""


@dataclass(frozen=True, slots=True)
class Method:
    """One way of predicting rooms.

    Attributes:
        name: As ``--method`` takes it.
        summary: One line for people.
        config: Its own frozen dataclass of settings, every field with a default.
        function: The predictor, or ``module:name`` of it, imported when it is first used.
        disjoint: Rooms of one prediction never overlap, so that a tour can be planned on the completed map (the
            baselines predict each room for itself; paper, section 5.2).
        shares_faces: The function takes ``started=`` from ``paper.initial_layouts.find_initial_faces``, which several
            methods can share.
    """

    name: str
    summary: str
    config: type[Any]
    function: Predictor | str
    disjoint: bool = True
    shares_faces: bool = False

    @property
    def resolved_function(self) -> Any:
        """The function, imported where it is only named; its rooms have no confidence yet, see :meth:`run`."""
        if not isinstance(self.function, str):
            return self.function
        module, name = self.function.split(":")
        return getattr(importlib.import_module(module), name)

    def run(self, grid: "OccupancyGrid", doors: "Sequence[ClosedDoor]", config: Any, **shared: Any) -> "Prediction":
        """Predict, and say how sure every room and cell is, whatever the function itself says of that."""
        from closedrooms.predictor.confidence.judge import judge

        return judge(self.name, grid, doors, self.resolved_function(grid, doors, config, **shared))

    def checked(self, config: Any | None) -> Any:
        """Check settings for this method: its defaults for ``None``.

        Raises:
            InvalidInputError: Settings of another method.
        """
        if config is None:
            return self.config()
        if not isinstance(config, self.config):
            raise InvalidInputError(
                f"settings of type {type(config).__name__} for the method {self.name}", expected=self.config.__name__
            )
        return config


_OURS = (
    Method(
        "paper",
        "what the authors describe and ran",
        PaperConfig,
        "closedrooms.predictor.paper.method:predict_paper",
        shares_faces=True,
    ),
    Method(
        "rose",
        "the same on walls and directions from ROSE",
        RoseConfig,
        "closedrooms.predictor.paper.method:predict_paper",
        shares_faces=True,
    ),
    Method(
        "best",
        "rectangles between wall faces, chosen jointly by their evidence",
        BestConfig,
        "closedrooms.predictor.best.method:predict_best",
    ),
    Method(
        "learned",
        "the same rectangles, rated by a network that was trained on true rooms too",
        LearnedConfig,
        "closedrooms.predictor.learned.method:predict_learned",
    ),
    Method(
        "line-of-sight",
        "baseline: what can be seen from the door",
        FacesConfig,
        "closedrooms.predictor.baselines:line_of_sight",
        disjoint=False,
        shares_faces=True,
    ),
    Method(
        "geometric",
        "baseline: all unknown faces in sight of the door",
        FacesConfig,
        "closedrooms.predictor.baselines:geometric",
        disjoint=False,
        shares_faces=True,
    ),
)


class _Methods(Mapping[str, Method]):
    """Our methods, then those of other packages by name; a package is imported when its method is asked for."""

    def __getitem__(self, name: str) -> Method:
        for method in _OURS:
            if method.name == name:
                return method
        return _load(name)

    def __iter__(self) -> Iterator[str]:
        ours = [method.name for method in _OURS]
        yield from ours
        yield from sorted({entry.name for entry in _entries()} - set(ours))

    def __len__(self) -> int:
        return sum(1 for _ in self)


METHODS: Mapping[str, Method] = _Methods()


def find_method(name: str) -> Method:
    """Look up a method by its name.

    Raises:
        InvalidInputError: There is none; the message lists all. A package that brings it cannot be loaded.
    """
    try:
        return METHODS[name]
    except KeyError:
        near = nearest(name, METHODS)
        meant = f" (did you mean {near}?)" if near else ""
        known = ", ".join(METHODS)
        raise InvalidInputError(
            f"unknown method {shown(name, longest=80)!r}{meant}", expected=f"one of {known}"
        ) from None


def predict(
    grid: "OccupancyGrid",
    doors: "Sequence[ClosedDoor]",
    method: str = DEFAULT_METHOD,
    config: Any | None = None,
    *,
    trace: bool = False,
) -> "Prediction":
    """Predict the rooms behind closed doors and complete the map with them (paper, section 3).

    Args:
        grid: The map, of any resolution and size.
        doors: Closed doors in the frame of the map.
        method: A name in :data:`METHODS`.
        config: Settings of that method's own class; its defaults for ``None``.
        trace: Keep every stage in the result, where the method has stages to keep.

    Returns:
        The completed map on the lattice of the input, the rooms in the order of the doors, failures by door id.

    Raises:
        InvalidInputError: An unknown method, settings of another one, two doors of one id, a known area or a completed
            map of too many cells.
    """
    from dataclasses import fields, replace

    chosen = find_method(method)
    settings = chosen.checked(config)
    if trace and any(item.name == "keep_trace" for item in fields(settings)):
        settings = replace(settings, keep_trace=True)
    return chosen.run(grid, doors, settings)


@cache
def _entries() -> tuple[Any, ...]:
    """List the entry points by which other packages add methods."""
    # Only who names a method that is not ours, or asks for all, waits for this.
    from importlib.metadata import entry_points

    return tuple(entry_points(group=GROUP))


def _load(name: str) -> Method:
    """Load the method that another package brings; ``KeyError`` where none does."""
    entry = next((entry for entry in _entries() if entry.name == name), None)
    if entry is None:
        raise KeyError(name)
    try:
        method = entry.load()
    except Exception as error:
        raise InvalidInputError(
            f"the method {name!r} cannot be loaded ({type(error).__name__}: {error})", expected=entry.value
        ) from error
    if not isinstance(method, Method):
        raise InvalidInputError(
            f"the entry point {entry.value} of the method {name!r} is a {type(method).__name__}", expected="a Method"
        )
    return method
