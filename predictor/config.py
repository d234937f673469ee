"""Settings of the methods of prediction, one class a method; lengths in metres, angles in radians.

Imports nothing heavy.
"""

import math
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Literal

from closedrooms.core.errors import InvalidInputError
from closedrooms.core.numbers import COARSEST, FINEST, bounded

Phi = Literal["as-run", "as-printed"]
RoomOrder = Literal["smallest-first", "largest-first", "by-position"]


@dataclass(frozen=True, kw_only=True)
class LinesConfig:
    """Settings of wall lines (paper, section 3.1). Defaults: read in the authors' published structure extraction."""

    resolution: float = 0.05
    """Cell size that a map is brought to before walls are looked for [m]."""

    canny_low: float = 90.0
    """Lower hysteresis threshold of the Canny detector [grey levels]."""

    canny_high: float = 100.0
    """Upper hysteresis threshold of the Canny detector [grey levels]."""

    canny_aperture: int = 5
    """Size of the Sobel kernel of the Canny detector [cells], 3, 5 or 7."""

    hough_votes: float = 1.0
    """Length of wall that must vote for a line before a segment is traced on it [m]."""

    hough_angle: float = math.radians(1.0)
    """Step of the Hough transform in angle [rad]."""

    min_segment: float = 0.15
    """Shortest segment kept [m]."""

    max_gap: float = 0.10
    """Longest gap inside one segment [m]. The authors ran none, on upright maps: slanted walls then fall to pieces."""

    angle_bandwidth: float = math.radians(12.0)
    """Half width of the mean shift kernel over wall directions [rad]."""

    collinear_distance: float = 0.35
    """Segments of one direction closer than this belong to one wall [m]."""

    merge_distance: float = 0.60
    """Walls of one direction whose lines are closer than this share a line [m]."""

    min_line_wall: float = 1.5
    """A line needs wall along this much of it [m], seen from one side or both; less is a jamb or clutter."""

    minor_reach: float = 5.0
    """A line of a direction other than the two main ones reaches so far beyond its walls, then to the next line [m]."""

    border_margin: float = 1.0
    """Distance of the boundary lines from the outermost segments [m]."""

    def __post_init__(self) -> None:
        positive = ("hough_votes", "border_margin", "collinear_distance")
        _check_numbers(self, positive)
        bounded(self.resolution, FINEST, COARSEST, name="resolution", unit="m")
        # Finer steps than a cell seen from 50 m ask for gigabytes of votes.
        bounded(self.hough_angle, 1e-3, math.pi / 2, name="hough_angle", unit="rad")
        bounded(self.angle_bandwidth, 1e-3, math.pi / 4, name="angle_bandwidth", unit="rad")
        if self.canny_aperture not in {3, 5, 7}:
            raise InvalidInputError(f"canny_aperture {self.canny_aperture}", expected="3, 5 or 7")


@dataclass(frozen=True, kw_only=True)
class DirectionsConfig:
    """Choice of wall directions, by mean shift over the angles of segments (paper, section 3.1)."""

    min_segment: float = 0.50
    """Shorter segments have no say in which directions there are [m]: ten cells tell a direction to 6 degrees."""

    min_length: float = 2.0
    """A direction needs this much wall in longer segments [m]; less is noise of the raster."""

    min_share: float = 0.15
    """A direction needs this share of the strongest one's wall: oblique walls in few places shatter all faces."""

    min_concentration: float = 0.40
    """A direction needs this share of its longer segments within 3 degrees; noise spreads evenly, to about 0.25."""

    def __post_init__(self) -> None:
        _check_numbers(self, ())


@dataclass(frozen=True, kw_only=True)
class Weights:
    """Weights of the evaluation functions (paper, section 3.4; values of section 4.1)."""

    area: float = 1.2
    """w1, per metre of sqrt(area): the paper's 0.06 per cell of 0.05 m."""

    hull: float = 10.0
    """w2, of the convex hull ratio."""

    free_independent: float = 7.0
    """w3, of the free edges of an independent room."""

    free_faces: float = 10.0
    """w4, of the penalty for faces with several free edges."""

    free_dependent: float = 2.5
    """w5, of the free edges of a dependent room."""

    proportion: float = 2.0
    """w6, of long side over short side."""

    joint_area: float = 1.0
    """w7, of the similarity in area of two adjacent rooms."""

    joint_faces: float = 2.0
    """w8, of the faces with several free edges of two adjacent rooms."""

    def __post_init__(self) -> None:
        _check_numbers(self, ())


@dataclass(frozen=True, kw_only=True)
class MethodConfig:
    """Settings that every method of ours reads."""

    clutter_area: float = 4.0
    """What free space surrounds and covers less than this counts as free where walls are looked for [m2]: furniture."""

    door_reach: float = 1.0
    """A door further than this from every wall line lies on no wall [m]."""

    same_door: float = 0.30
    """Doors closer than this are the same door [m]."""

    door_width: float = 0.80
    """Width of the passages drawn at doors [m] (section 3.7)."""

    def __post_init__(self) -> None:
        _check_numbers(self, ("door_reach", "door_width"))


@dataclass(frozen=True, kw_only=True)
class FacesConfig(MethodConfig):
    """From a map and doors to faces and initial faces (sections 3.1 and 3.2): all that the two baselines read."""

    lines: LinesConfig = field(default_factory=LinesConfig)
    """Segments and lines."""

    directions: DirectionsConfig | None = field(default_factory=DirectionsConfig)
    """Directions of walls."""

    min_unknown: float = 0.30
    """A face is unknown when at least this share of it is unknown, or ``max_free`` holds."""

    max_free: float = 0.50
    """A face is unknown when at most this share of it is free."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 0.0 <= self.min_unknown <= 1.0 or not 0.0 <= self.max_free <= 1.0:
            raise InvalidInputError(
                f"min_unknown {self.min_unknown}, max_free {self.max_free}", expected="shares between 0 and 1"
            )


@dataclass(frozen=True, kw_only=True)
class PaperConfig(FacesConfig):
    """The method of the paper (section 3)."""

    phi: Phi = "as-run"
    """Evaluation function as the authors' logs show it, or as the text prints it (section 3.4)."""

    weights: Weights = field(default_factory=Weights)
    """Weights of the evaluation functions."""

    room_order: RoomOrder = "smallest-first"
    """Who takes its turn first in a step: by number of candidate faces, as printed, or by position, to compare."""

    max_level: int = 9
    """Largest k of the expansion."""

    exact_candidates: int = 12
    """Up to this many candidate faces every subset is scored; more are searched by branch and bound."""

    max_nodes: int = 1000
    """Nodes of one branch and bound search; a cut is said in the result (``bounded``)."""

    wall_thickness: float | None = None
    """Thickness of walls not counted as room [m]; measured in the map when not given, 0 draws rooms up to the lines."""

    average_border_depth: bool = True
    """Adjacent dependent border rooms share their mean depth (section 3.6)."""

    joint_layout: bool = True
    """Adjacent dependent rooms may swap faces at the end (section 3.5)."""

    keep_trace: bool = False
    """Keep segments, lines, faces and levels in the result, for recordings and pictures."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 0 <= self.exact_candidates <= 16:
            raise InvalidInputError(f"exact_candidates {self.exact_candidates}", expected="0 to 16")


@dataclass(frozen=True, kw_only=True)
class RoseConfig(PaperConfig):
    """The method of the paper with walls and directions from ROSE (section 4.2)."""

    directions: None = field(default=None, init=False)
    """ROSE finds directions in the spectrum of the map."""


@dataclass(frozen=True, kw_only=True)
class BestConfig(MethodConfig):
    """Rectangles between wall faces, chosen jointly by their evidence."""

    smallest_side: float = 0.8
    """Narrowest and shallowest room [m]."""

    largest_side: float = 24.0
    """Widest and deepest room [m]."""

    shortlist: int = 100
    """Rectangles a door keeps for the joint choice: 60 lose 0.014 of the best that was proposed (``choose``)."""

    keep_trace: bool = False
    """Keep each door's best rectangle by itself beside the rooms chosen together."""

    def __post_init__(self) -> None:
        super().__post_init__()
        _check_numbers(self, ("smallest_side", "largest_side", "shortlist"))
        if self.largest_side < self.smallest_side:
            raise InvalidInputError(
                f"largest_side {self.largest_side}", expected=f"at least smallest_side {self.smallest_side}"
            )


@dataclass(frozen=True, kw_only=True)
class LearnedConfig(BestConfig):
    """The rectangles of ``best``, rated by a trained network too."""

    model: Path | None = None
    """Folder that ``closedrooms train`` wrote, or an ONNX file; the model that comes with closedrooms if not given."""

    rated: int = 300
    """Rectangles a door that the network rates; ``shortlist`` of them are kept for the joint choice."""

    def __post_init__(self) -> None:
        super().__post_init__()
        _check_numbers(self, ("rated",))


def _check_numbers(config: object, positive: tuple[str, ...]) -> None:
    """Check that every plain number is finite and not negative, those in ``positive`` above zero."""
    for item in fields(config):  # type: ignore[arg-type]
        value = getattr(config, item.name)
        if isinstance(value, bool) or not isinstance(value, int | float):
            continue
        if not math.isfinite(value) or value < 0.0 or (item.name in positive and value == 0.0):
            wanted = "a finite number above 0" if item.name in positive else "a finite number of at least 0"
            raise InvalidInputError(f"{item.name} {value}", expected=wanted)
