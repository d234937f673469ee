"""A drawing surface in map coordinates: OpenCV draws lines and areas, Pillow the text; both load quickly."""

from collections.abc import Sequence
from functools import cache
from itertools import pairwise
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt
import shapely
from PIL import Image, ImageDraw, ImageFont
from shapely.geometry.base import BaseGeometry

from closedrooms.core.arrays import FloatArray
from closedrooms.core.grid import Bounds, GridFrame, OccupancyGrid
from closedrooms.core.names import shown
from closedrooms.visualization import colours
from closedrooms.visualization.colours import Colour
from closedrooms.visualization.dashes import cut_dashes

Pixels = npt.NDArray[np.uint8]
# A path starts in the first colour and ends in the last: the eye can follow it.
COURSE_START, COURSE_END = np.array([48, 18, 140]), np.array([250, 150, 20])
# Pieces of one colour in which a path is drawn.
COURSE_PIECES = 240
# OpenCV takes coordinates as fixed-point numbers with this many bits behind the point.
SHIFT = 4
# Further out than this nothing is drawn where it is [pixels]: what a user gives may lie anywhere.
FAR = 1e6


class Canvas:
    """Panel of a picture that shows the map frame, y up."""

    def __init__(self, bounds: Bounds, scale: float) -> None:
        """Make an empty panel.

        Args:
            bounds: ``x_min, y_min, x_max, y_max`` [m].
            scale: Pixels per metre.
        """
        self._bounds, self.scale = bounds, scale
        x0, y0, x1, y1 = bounds
        self.width, self.height = max(round((x1 - x0) * scale), 1), max(round((y1 - y0) * scale), 1)
        self.pixels: Pixels = np.full((self.height, self.width, 3), colours.UNKNOWN, dtype=np.uint8)
        self._texts: list[tuple[float, float, str, int, Colour]] = []

    def grid(self, grid: OccupancyGrid) -> None:
        """Draw the cells: free white, occupied dark, unknown grey."""
        x0, y0, x1, y1 = self._bounds
        frame = grid.frame
        # No further beyond the grid than it is large: in tiny cells, the margin around it would fill the memory.
        reach = max(frame.rows, frame.cols, 100)
        corners = frame.to_cells(np.array([[x0, y0], [x1, y1]]))
        (r0, c0), (r1, c1) = np.clip(corners, -reach, np.array(frame.shape) + reach).tolist()
        window: GridFrame = frame.cropped(r0, c0, max(r1 - r0, 1), max(c1 - c0, 1))
        cells = grid.on(window)
        grey = np.full(window.shape, colours.UNKNOWN, dtype=np.uint8)
        grey[cells.free] = colours.FREE
        grey[cells.occupied] = colours.OCCUPIED
        # From centres of pixels to centres of cells: exact for windows that do not end on whole pixels.
        step = 1.0 / (self.scale * window.resolution)
        u0 = (x0 - window.origin_x) / window.resolution + step / 2 - 0.5
        v0 = window.rows - (y1 - window.origin_y) / window.resolution + step / 2 - 0.5
        # Area-averaging keeps thin walls visible where a pixel holds several cells.
        box = min(max(round(step), 1), reach)
        smooth = cv2.blur(np.ascontiguousarray(grey[::-1]), (box, box))
        mapping = np.array([[step, 0.0, u0], [0.0, step, v0]])
        mode = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
        drawn = cv2.warpAffine(smooth, mapping, (self.width, self.height), flags=mode, borderValue=colours.UNKNOWN)
        self.pixels[:] = drawn[..., None]

    def fill(self, shape: BaseGeometry, colour: Colour, *, opacity: float) -> None:
        """Fill a polygon; holes stay free."""
        layer = self.pixels.copy()
        for polygon in shapely.get_parts(shape):
            rings = [self._fixed(shapely.get_coordinates(ring)) for ring in shapely.get_rings(polygon)]
            if rings:
                cv2.fillPoly(layer, rings, colour, lineType=cv2.LINE_AA, shift=SHIFT)
        cv2.addWeighted(layer, opacity, self.pixels, 1.0 - opacity, 0.0, dst=self.pixels)

    def outline(self, shape: BaseGeometry, colour: Colour, *, width: int = 2) -> None:
        """Draw the rings of a polygon."""
        for ring in shapely.get_rings(shapely.get_parts(shape)):
            self.line(shapely.get_coordinates(ring), colour, width=width)

    def dashed(self, shape: BaseGeometry, colour: Colour, *, width: int = 2, dash: float = 9.0) -> None:
        """Draw the rings of a polygon in dashes of a length [pixels] with gaps as long."""
        self._lines(list(cut_dashes(shape, dash / self.scale)), colour, width)

    def line(self, points: FloatArray, colour: Colour, *, width: int = 2) -> None:
        """Draw a polyline, shape (k, 2)."""
        if len(points) > 1:
            self._lines([points], colour, width)

    def _lines(self, lines: Sequence[FloatArray], colour: Colour, width: int) -> None:
        """Draw polylines, each of shape (k, 2), at once."""
        if lines:
            places = self._fixed(np.concatenate(lines))
            # Twice as quick as np.split on many short ones.
            cuts = np.cumsum([0, *map(len, lines)]).tolist()
            pieces = [places[first:last] for first, last in pairwise(cuts)]
            cv2.polylines(self.pixels, pieces, False, colour, thickness=width, lineType=cv2.LINE_AA, shift=SHIFT)

    def course(self, points: FloatArray, *, width: int = 2) -> None:
        """Draw a path, shape (k, 2), from blue at its start to orange at its end; rows of NaN interrupt it."""
        points = np.asarray(points, dtype=np.float64).reshape(-1, 2)
        pieces = min(len(points) - 1, COURSE_PIECES)
        cuts = np.linspace(0, len(points) - 1, pieces + 1).astype(int).tolist() if pieces > 0 else []
        for number, (first, last) in enumerate(pairwise(cuts)):
            piece = points[first : last + 1]
            mixed = COURSE_START + number / max(pieces - 1, 1) * (COURSE_END - COURSE_START)
            red, green, blue = (int(value) for value in mixed)
            for part in np.split(piece, np.flatnonzero(np.isnan(piece[:, 0]))):
                self.line(part[~np.isnan(part[:, 0])], (red, green, blue), width=width)

    def dots(self, points: FloatArray, colour: Colour, *, radius: float = 3.0) -> None:
        """Draw filled circles, shape (n, 2); ``radius`` in pixels."""
        for x, y in self._fixed(np.asarray(points, dtype=np.float64).reshape(-1, 2)).tolist():
            cv2.circle(self.pixels, (x, y), round(radius * 2**SHIFT), colour, -1, lineType=cv2.LINE_AA, shift=SHIFT)

    def text(self, at: Sequence[float], text: str, *, size: int = 15, colour: Colour = colours.INK) -> None:
        """Write centred at a point; drawn above everything else."""
        u, v = (self._fixed(np.array([at], dtype=np.float64))[0] / 2**SHIFT).tolist()
        self._texts.append((u, v, "\n".join(map(shown, text.split("\n"))), size, colour))

    def finished(self) -> Pixels:
        """Draw the texts onto the panel and hand over its pixels."""
        image = Image.fromarray(self.pixels)
        draw = ImageDraw.Draw(image)
        for u, v, text, size, colour in self._texts:
            draw.text(
                (u, v), text, fill=colour, font=font(size), anchor="mm", align="center", stroke_width=2,
                stroke_fill=(255, 255, 255),
            )  # fmt: skip
        return np.asarray(image)

    def _fixed(self, points: FloatArray) -> npt.NDArray[np.int32]:
        """Convert places [m] to OpenCV's pixels in fixed-point numbers, none too far out for it."""
        x0, _, _, y1 = self._bounds
        points = np.clip(np.asarray(points, dtype=np.float64), -1e300, 1e300)  # the product below stays finite
        u, v = (points[:, 0] - x0) * self.scale - 0.5, (y1 - points[:, 1]) * self.scale - 0.5
        pixels = np.clip(np.column_stack((u, v)), -FAR, FAR)
        fixed: npt.NDArray[np.int32] = np.rint(pixels * 2**SHIFT).astype(np.int32)
        return fixed


@cache
def font(size: int) -> Any:
    """Load Pillow's own font: the same on every machine."""
    return ImageFont.load_default(size)
