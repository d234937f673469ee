import numpy as np
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from closedrooms.core.grid import GridFrame
from closedrooms.predictor.inpaint import fill_shape

# Quarters of a cell, so that sides and corners often lie on centres of cells.
PLACES = st.integers(-20, 60).map(lambda quarter: quarter / 4)
POINTS = st.tuples(PLACES, PLACES)


@st.composite
def shapes(draw):
    """Boxes joined, some with holes and apart, or the hull of a few points."""
    if draw(st.booleans()):
        return shapely.MultiPoint(draw(st.lists(POINTS, min_size=3, max_size=6))).convex_hull.buffer(0)
    boxes = [shapely.MultiPoint(draw(st.tuples(POINTS, POINTS))).envelope.buffer(0) for _ in range(4)]
    return shapely.union_all(boxes[:3]).difference(boxes[3])


@given(shapes(), st.sampled_from([1.0, 0.5]))
@settings(max_examples=200, deadline=None)
def test_a_shape_fills_the_cells_whose_centre_lies_in_it(shape, resolution):
    frame = GridFrame(resolution, -2.0, 1.0, 9, 12)
    mask = np.zeros(frame.shape, dtype=np.bool_)
    fill_shape(shape, frame, mask)
    points = frame.to_points(np.stack(np.indices(frame.shape), axis=-1))
    assert (mask == shapely.contains_xy(shape, points[..., 0], points[..., 1])).all()


def test_what_is_marked_stays_marked():
    mask = np.ones((4, 4), dtype=np.bool_)
    fill_shape(shapely.box(0.5, 0.5, 2.5, 2.5), GridFrame(1.0, 0.0, 0.0, 4, 4), mask)
    assert mask.all()
