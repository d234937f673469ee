"""Offices and schools that look like buildings, from a seed."""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from closedrooms.core.errors import InvalidInputError
from closedrooms.core.random import stream
from closedrooms.worlds.closing import closable_rooms
from closedrooms.worlds.generation.construction import build_plan, turned_sketch
from closedrooms.worlds.generation.corridors import SHAPES
from closedrooms.worlds.generation.room_programme import BAYS, measures
from closedrooms.worlds.generation.sketch import sketch_rooms
from closedrooms.worlds.plan import FloorPlan
from closedrooms.worlds.start_pose import start_pose
from closedrooms.worlds.validation import validate

# A change of what any seed gives is a new version; the old one stays in VERSIONS.
GENERATOR_VERSION = 1
KINDS = tuple(BAYS)
SIZES = ("small", "medium", "large")
# How often each shape is drawn where none is asked for.
SHAPE_WEIGHTS = {"bar": 2.0, "L": 2.0, "U": 1.5, "T": 2.0, "ring": 1.5, "slant": 1.5}


def generate(
    kind: str,
    seed: int,
    *,
    shape: str | None = None,
    size: str | None = None,
    angle: float | None = None,
    furniture: bool = False,
    name: str | None = None,
    version: int = GENERATOR_VERSION,
) -> FloorPlan:
    """Generate a building of its own for each seed.

    Args:
        kind: ``office`` or ``school``.
        seed: From 0.
        shape: ``bar``, ``L``, ``U``, ``T``, ``ring`` or ``slant``; drawn by the seed when ``None``.
        size: ``small``, ``medium`` or ``large``; drawn by the seed when ``None``.
        angle: Of the building against the x axis [degrees]; when ``None``, some are turned.
        furniture: Also furnish the rooms.
        name: Of the world; ``<kind>-<seed>`` when ``None``.
        version: Of the generator; each version keeps giving the same buildings.

    Raises:
        InvalidInputError: An unknown kind, shape, size or version, a negative seed.
    """
    _check("kind", kind, KINDS)
    _check("generator version", version, tuple(VERSIONS))
    if shape is not None:
        _check("shape", shape, tuple(SHAPES))
    if size is not None:
        _check("size", size, SIZES)
    if not 0 <= seed < 2**32:
        raise InvalidInputError(f"seed {seed}", expected="0 to 4294967295")
    plan = VERSIONS[version](kind, seed, shape, size, angle, furniture)
    plan = replace(plan, name=name or f"{kind}-{seed}")
    validate(plan, plan.name)
    return plan


def _check(what: str, value: object, valid: tuple[object, ...]) -> None:
    if value not in valid:
        raise InvalidInputError(f"unknown {what} {value!r}", expected=f"one of {', '.join(map(str, valid))}")


def _version_1(
    kind: str, seed: int, shape: str | None, size: str | None, angle: float | None, furniture: bool
) -> FloorPlan:
    """Generate as version 1 does, whose worlds are published: draws are never reordered."""
    rng = stream(seed, "generator", "1", kind)
    drawn_shape = str(rng.choice(list(SHAPE_WEIGHTS), p=np.array(list(SHAPE_WEIGHTS.values())) / 10.5))
    drawn_size = SIZES[int(rng.choice(3, p=[0.3, 0.45, 0.25]))]
    drawn_angle = float(rng.integers(5, 86)) if rng.random() < 0.3 else 0.0
    shape, size, angle = shape or drawn_shape, size or drawn_size, drawn_angle if angle is None else angle
    # Two rooms that open into each other as well as into the corridor leave nothing to close: draw on. A seed that gave
    # a building of use keeps it.
    while True:
        dimensions = measures(rng, kind, size)
        skeleton = SHAPES[shape](rng, dimensions)
        sketch = sketch_rooms(rng, kind, skeleton)
        sketch = turned_sketch(sketch, math.radians(angle))
        plan = build_plan(rng, sketch)
        if closable_rooms(plan):
            break
    meta: dict[str, object] = {"generator": 1, "kind": kind, "seed": seed, "shape": shape, "size": size, "angle": angle}
    plan = replace(plan, meta=meta)
    if furniture:
        from closedrooms.worlds.generation.furniture import furnish

        plan = furnish(plan, stream(seed, "furniture", "1", kind))
    pose = start_pose(plan)
    return replace(plan, start=pose.as_tuple())


VERSIONS: dict[int, Callable[[str, int, str | None, str | None, float | None, bool], FloorPlan]] = {1: _version_1}
