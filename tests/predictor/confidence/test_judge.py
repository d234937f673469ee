from dataclasses import replace

import numpy as np
import pytest
import shapely

from closedrooms.core.shapes import cells_inside
from closedrooms.predictor.best.features import FEATURES
from closedrooms.predictor.confidence.belief import Belief, Spread
from closedrooms.predictor.confidence.calibration import Curve, calibration_of, read_calibrations
from closedrooms.predictor.confidence.judge import judge
from closedrooms.predictor.confidence.room_features import NAMES, measure_rooms
from closedrooms.predictor.confidence.shape_variants import FACTORS, SAME, RoomVariants
from closedrooms.predictor.config import FacesConfig
from closedrooms.predictor.inpainting import withdraw_unsure
from closedrooms.predictor.methods import METHODS, Method, predict
from closedrooms.predictor.prediction import free_probability

OURS = ("paper", "rose", "best", "learned", "line-of-sight", "geometric")


@pytest.fixture(scope="module")
def scene(mapped):
    return mapped()


@pytest.fixture(scope="module", params=OURS)
def prediction(request, scene):
    return predict(scene.grid, scene.doors, request.param)


def test_every_method_says_how_sure_it_is(prediction):
    assert prediction.rooms
    for room in prediction.rooms:
        assert 0.0 <= room.confidence <= 1.0
        assert 1 <= len(room.alternatives) <= 3
        shares = [other.probability for other in room.alternatives]
        assert all(0.0 <= share <= 1.0 for share in shares)
        assert all(0.0 <= share <= 1.0 for share in shares)
        for other in room.alternatives:
            assert other.polygon.is_valid
            shared = other.polygon.intersection(room.polygon).area / other.polygon.union(room.polygon).area
            assert shared < 0.96


def test_alternatives_lie_in_what_the_map_does_not_know(prediction, scene):
    for room in prediction.rooms:
        for other in room.alternatives:
            inside = cells_inside(other.polygon.buffer(-0.1), scene.grid.frame)
            assert scene.grid.free[inside].mean() < 0.05


def test_a_hidden_room_is_more_probable_than_what_lies_around_it(prediction, scene):
    probability = free_probability(prediction, scene.grid)
    cells = probability.cells
    assert probability.frame == prediction.grid.frame
    assert (cells[scene.grid.on(probability.frame).known] == -1).all()
    assert cells.max() <= 100
    hidden = shapely.union_all([room.buffer(-0.5) for room in scene.hidden.values()])
    inside = cells_inside(hidden, probability.frame)
    around = shapely.union_all(list(scene.hidden.values())).buffer(0.5)
    outside = ~cells_inside(around, probability.frame) & (cells >= 0)
    assert cells[inside].mean() > cells[outside].mean() + 20.0


def test_rooms_that_are_not_sure_enough_are_not_drawn(scene):
    prediction = predict(scene.grid, scene.doors, "best")
    rooms = [replace(room, confidence=0.3 + 0.3 * number) for number, room in enumerate(prediction.rooms)]
    prediction = replace(prediction, rooms=tuple(rooms))
    drawn = withdraw_unsure(prediction, scene.grid, scene.doors, 0.5)
    assert drawn.rooms == prediction.rooms
    frame = drawn.grid.frame
    for room in drawn.rooms:
        inside = cells_inside(room.polygon.buffer(-0.2), frame) & scene.grid.on(frame).unknown
        assert drawn.grid.free[inside].all() == (room.confidence >= 0.5)
    everything = withdraw_unsure(prediction, scene.grid, scene.doors, 1.0)
    assert np.array_equal(everything.grid.cells, scene.grid.on(frame).cells)
    assert withdraw_unsure(prediction, scene.grid, scene.doors, 0.0) is prediction


def test_a_method_of_another_package_is_judged_too(scene):
    def halves(grid, doors, _):
        found = predict(grid, doors, "best")
        rooms = tuple(replace(room, confidence=None, alternatives=(), kind=None, score=None) for room in found.rooms)
        return replace(found, rooms=rooms, probability=None)

    method = Method("theirs", "by somebody else", FacesConfig, halves)
    judged = method.run(scene.grid, scene.doors, FacesConfig())
    assert all(room.confidence is not None and room.alternatives for room in judged.rooms)
    assert judged.probability is not None


def test_shipped_numbers_fit_what_is_measured():
    calibrations = read_calibrations()
    assert {"paper", "best", "learned"} <= set(calibrations) <= set(METHODS)
    for method, numbers in calibrations.items():
        evidence = {"best": 4 + len(FEATURES), "learned": 2}.get(method, 0)
        assert numbers.mean.shape == numbers.weights.shape == (len(NAMES) + evidence,)
        for curve in (numbers.confidence, numbers.cells, numbers.nearest):
            assert (np.diff(curve.x) >= 0).all()
            assert (np.diff(curve.y) >= 0).all()
            assert 0.0 <= curve.y.min() <= curve.y.max() <= 1.0
        for shares in numbers.variants.values():
            assert shares.shape == (len(FACTORS),)
            assert shares.sum() == pytest.approx(1.0, abs=1e-3)
    assert calibration_of("nobody's") is calibrations["paper"]


def test_a_curve_is_level_beyond_its_knots():
    curve = Curve(np.array([0.2, 0.4]), np.array([0.1, 0.9]))
    assert curve.at([0.0, 0.3, 1.0]).tolist() == pytest.approx([0.1, 0.5, 0.9])


def test_a_room_between_known_ones_is_bounded_and_one_beyond_is_not(scene):
    prediction = predict(scene.grid, scene.doors, "best")
    belief = Belief(0.5, (), Spread(np.zeros(2), np.array([1.0, 0.0]), 0.1, np.zeros((1, 1))))
    beyond = replace(prediction.rooms[0], polygon=shapely.box(100.0, 100.0, 104.0, 105.0))
    measured = measure_rooms(scene.grid, (prediction.rooms[0], beyond), [belief, belief])
    bounded, outside = NAMES.index("bounded by known space"), NAMES.index("beyond what is known")
    assert measured[0, bounded] > 0.4
    assert measured[1, bounded] == 0.0
    assert measured[1, outside] == pytest.approx(1.0)


def test_what_is_measured_of_a_shape_alone_is_what_it_says(scene):
    belief = Belief(0.5, (), Spread(np.zeros(2), np.array([1.0, 0.0]), 0.1, np.zeros((1, 1))))
    room = predict(scene.grid, scene.doors, "best").rooms[0]
    shapes = (shapely.box(0.0, 0.0, 5.0, 5.0), shapely.box(0.0, 0.0, 2.0, 8.0))
    found = [
        replace(room, polygon=shape, kind=kind, score=score, doors=doors)
        for shape, kind, score, doors in zip(
            shapes, ("dependent", "border"), (4.0, None), (("a",), ("a", "b")), strict=True
        )
    ]
    measured = measure_rooms(scene.grid, tuple(found), [belief, belief])
    wanted = {
        "log area": (0.0, np.log(16.0 / 25.0)), "log area squared": (0.0, np.log(16.0 / 25.0) ** 2),
        # Of a square it is 1.
        "compactness": (1.0, 16.0 * 16.0 / 20.0**2), "dependent": (1.0, 0.0), "border": (0.0, 1.0), "doors": (1.0, 2.0),
        "expected IoU": (0.5, 0.5),
    }  # fmt: skip
    for name, values in wanted.items():
        assert measured[:, NAMES.index(name)] == pytest.approx(values), name
    assert measured[0, NAMES.index("score")] == pytest.approx(0.4)


def test_variants_are_the_room_itself_and_longer_and_wider_ones(scene):
    prediction = predict(scene.grid, scene.doors, "best")
    room = next(room for room in prediction.rooms if room.doors == ("b3",))
    door = next(door for door in scene.doors if door.id == "b3")
    variants = RoomVariants(scene.grid, room, door.midpoint)
    areas = variants.masks.sum(axis=(1, 2)) * variants.cell**2
    assert areas[SAME] == pytest.approx(room.polygon.area, rel=0.1)
    deeper = int(np.flatnonzero((FACTORS == (1.0, 1.0, 2.0)).all(axis=1))[0])
    assert areas[deeper] == pytest.approx(2 * room.polygon.area, rel=0.15)
    assert variants.inward == pytest.approx([0.0, -1.0], abs=0.05)
    assert variants.overlaps_with(room.polygon).argmax() == SAME
    # By the root of the probabilities: 1e-5 then weighs a 300th, and half of that is gained.
    for seldom, others in ((1e-5, 1), (1e-7, 0)):
        weights = np.zeros(len(FACTORS))
        weights[SAME], weights[deeper] = 1.0 - seldom, seldom
        assert len(variants.believe(weights).alternatives) == others


def test_confidence_and_probabilities_are_told_to_six_digits(scene):
    prediction = METHODS["best"].resolved_function(scene.grid, scene.doors, METHODS["best"].config())
    usual, straight = calibration_of("best"), Curve(np.array([0.0, 1.0]), np.array([0.0, 1.0]))
    numbers = replace(
        usual, weights=np.zeros_like(usual.weights), intercept=0.12345678, confidence=straight, nearest=straight
    )
    judged = judge("best", scene.grid, scene.doors, prediction, numbers)
    assert {room.confidence for room in judged.rooms} == {0.123457}
    for room, belief in zip(judged.rooms, prediction.beliefs, strict=True):
        told = [other.probability for other in room.alternatives]
        assert told == [round(other.probability, 6) for other in belief.alternatives]
        assert any(round(value, 5) != value for value in told)
    # What has been judged is not judged again.
    assert judge("best", scene.grid, scene.doors, judged, numbers) is judged
