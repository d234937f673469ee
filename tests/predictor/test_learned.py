"""The method ``learned`` with the model that comes with closedrooms, run by OpenCV alone."""

import itertools
import subprocess
import sys
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import shapely
from shapely import affinity

from closedrooms.core.door import ClosedDoor
from closedrooms.core.errors import InvalidInputError
from closedrooms.core.grid import GridFrame, OccupancyGrid
from closedrooms.core.shapes import cells_inside
from closedrooms.predictor.best.scene import prepare
from closedrooms.predictor.config import BestConfig, LearnedConfig
from closedrooms.predictor.learned.mask_belief import believe_cells
from closedrooms.predictor.learned.method import predict_learned
from closedrooms.predictor.learned.model import SHIPPED, load_model, seal
from closedrooms.predictor.learned.patches import ASIDE, BEHIND, CELL, SIZE, cut_patches
from closedrooms.predictor.learned.ratings import OVERLAP, Rater
from closedrooms.predictor.methods import predict

CLOSED = ("t1", "t2", "b0", "b1", "b3")


def mirrored(scene):
    """The map about the y axis, and its doors."""
    frame, (_, y0, x1, _) = scene.grid.frame, scene.grid.frame.bounds
    cells = np.ascontiguousarray(scene.grid.cells[:, ::-1])
    grid = OccupancyGrid(GridFrame(frame.resolution, -x1, y0, *cells.shape), cells)
    return grid, [ClosedDoor(door.id, (-door.midpoint[0], door.midpoint[1])) for door in scene.doors]


def prepared(scene):
    return prepare(scene.grid, scene.doors, BestConfig())


def test_rooms_are_disjoint_and_in_unknown_space(mapped, iou):
    scene = mapped(closed=CLOSED)
    prediction = predict(scene.grid, scene.doors, "learned")
    assert prediction.failures == {}
    assert sorted(door for room in prediction.rooms for door in room.doors) == sorted(CLOSED)
    for a, b in itertools.combinations(prediction.rooms, 2):
        assert a.polygon.intersection(b.polygon).area < 1e-6
    for room in prediction.rooms:
        inside = cells_inside(room.polygon.buffer(-0.1), scene.grid.frame)
        assert not (inside & scene.grid.known).any()
    found = [iou(room.polygon, scene.hidden[room.doors[0]]) for room in prediction.rooms]
    assert np.mean(found) > 0.75


def test_every_room_says_how_sure_it_is_and_what_else_it_could_be(mapped):
    scene = mapped(closed=CLOSED)
    prediction = predict(scene.grid, scene.doors, "learned")
    assert all(0.0 < room.confidence <= 1.0 for room in prediction.rooms)
    assert any(room.alternatives for room in prediction.rooms)
    frame, cells = prediction.probability.frame, prediction.probability.cells
    for room in prediction.rooms:
        inside = cells_inside(room.polygon.buffer(-0.2), frame)
        assert cells[inside & (cells >= 0)].mean() > 50.0


def test_the_same_twice(mapped):
    scene = mapped(closed=CLOSED)
    first, second = (predict(scene.grid, scene.doors, "learned") for _ in range(2))
    assert first.rooms == second.rooms
    assert np.array_equal(first.probability.cells, second.probability.cells)


def test_a_mirrored_map_gives_mirrored_rooms(mapped, iou):
    scene = mapped(closed=CLOSED)
    usual = {room.doors: room for room in predict(scene.grid, scene.doors, "learned").rooms}
    other = {room.doors: room for room in predict(*mirrored(scene), "learned").rooms}
    assert usual.keys() == other.keys()
    for doors, room in usual.items():
        assert iou(affinity.scale(room.polygon, -1.0, 1.0, origin=(0, 0)), other[doors].polygon) > 0.95


def test_what_the_network_says_of_a_mirrored_patch_is_mirrored(mapped):
    scene = prepared(mapped(closed=CLOSED))
    patch = cut_patches(scene)[0]
    turned = replace(patch, channels=patch.channels[..., ::-1].copy())
    seen, reversed_ = load_model(None).look([patch, turned])
    assert np.allclose(seen.mask, reversed_.mask[:, ::-1], atol=1e-4)
    assert not np.allclose(seen.mask, reversed_.mask, atol=1e-2)


@pytest.mark.parametrize("angle", [0.0, 0.4])
def test_a_patch_shows_the_corridor_behind_the_door_and_the_unknown_ahead(mapped, angle):
    scene = mapped(closed=("t2", "b2"), angle=angle)
    for patch, door in zip(cut_patches(prepared(scene)), scene.doors, strict=True):
        row, col = round(BEHIND / CELL), round(ASIDE / CELL)
        free, unknown = patch.channels[0], patch.channels[2]
        assert free[row - 4 : row - 2, col - 4 : col + 4].mean() > 0.9
        assert unknown[row + 3 : row + 8, col - 2 : col + 2].mean() > 0.9
        assert patch.channels[3, row - 1 : row + 1, col - 1 : col + 1].any()
        assert patch.channels[:3].sum(axis=0) == pytest.approx(np.ones((SIZE, SIZE)))
        assert patch.to_patch(np.array(door.midpoint)) == pytest.approx(patch.door)
        assert patch.door == pytest.approx([ASIDE, BEHIND], abs=0.05)


def test_the_network_changes_what_is_chosen_and_its_words_are_in_the_trace(mapped):
    scene = mapped(closed=CLOSED)
    prediction = predict_learned(scene.grid, scene.doors, LearnedConfig(keep_trace=True))
    rater = Rater(load_model(None), 100)
    patches = cut_patches(prepared(scene))
    names = [door.id for door in scene.doors]
    rater.heard = dict(zip(names, zip(patches, rater.model.look(patches), strict=True), strict=True))
    for weighed in prediction.trace.rooms:
        said = rater.hear(weighed.doors, weighed.corners) * OVERLAP
        assert said.std() > 0.0
        terms = weighed.terms
        assert terms["network"][0] == pytest.approx(said[weighed.chosen], abs=1e-6)
        assert sum(term[0] for term in terms.values()) == pytest.approx(weighed.joint[weighed.chosen], abs=1e-6)


def test_how_much_of_a_room_the_mask_shows_is_evidence(mapped):
    scene = mapped(closed=CLOSED)
    prediction = predict_learned(scene.grid, scene.doors, LearnedConfig())
    patches = cut_patches(prepared(scene))
    heard = zip(patches, load_model(None).look(patches), strict=True)
    said = dict(zip([door.id for door in scene.doors], heard, strict=True))
    for room, belief in zip(prediction.rooms, prediction.beliefs, strict=True):
        patch, seen = said[room.doors[0]]
        # The same on a raster of the patch's own cells, where known space takes nothing away.
        centres = (np.indices((SIZE, SIZE))[::-1].transpose(1, 2, 0) + 0.5) * CELL
        points = patch.corner + centres @ np.array([patch.along, patch.inward])
        inside = shapely.contains_xy(room.polygon, points[..., 0], points[..., 1])
        shown = seen.mask * (seen.unknown > 0.5)
        overlap = shown[inside].sum() / (inside.sum() + shown[~inside].sum())
        assert belief.evidence[-1] == pytest.approx(overlap, abs=0.1)
        moved = believe_cells(belief, affinity.translate(room.polygon, *(3.0 * patch.along)), [said[room.doors[0]]])
        assert moved.evidence[-1] < belief.evidence[-1] - 0.1


def test_what_lies_beyond_the_patch_counts_for_nothing(mapped):
    scene = prepared(mapped(closed=("t2",)))
    (seen,) = load_model(None).look(cut_patches(scene))
    near, far = (np.array([[ASIDE - 2.0, BEHIND, ASIDE + 2.0, back]]) for back in (SIZE * CELL, 50.0))
    assert seen.rate(far)[0] == pytest.approx(seen.rate(near)[0])


def test_the_overlap_with_the_mask_is_that_of_the_cells(mapped):
    scene = prepared(mapped(closed=("t2",)))
    (seen,) = load_model(None).look(cut_patches(scene))
    inside = np.zeros((SIZE, SIZE))
    inside[32:50, 60:72] = 1.0
    shared = (seen.mask * seen.unknown * inside).sum()
    expected = shared / ((seen.unknown * inside).sum() + (seen.mask * seen.unknown).sum() - shared)
    box = np.array([[60.0, 32.0, 72.0, 50.0]]) * CELL
    assert seen.rate(box)[0] == pytest.approx(expected)


SPOILT, WRONG = "another file, or one that was spoilt", "no network that OpenCV runs"


def flipped(content: bytes, at: int) -> bytes:
    return content[:at] + bytes([content[at] ^ 255]) + content[at + 1 :]


@pytest.mark.parametrize(
    ("make", "line"),
    [
        (lambda _: None, "cannot read"),
        (lambda _: b"", SPOILT),
        (lambda _: b"no network", SPOILT),
        (lambda whole: whole[:200_000], SPOILT),
        (lambda whole: whole[:-35], SPOILT),
        (lambda whole: flipped(whole, 100), SPOILT),
        (lambda whole: flipped(whole, len(whole) - 1), SPOILT),
        (lambda whole: whole + b"more", SPOILT),
        (lambda _: seal(b"no network"), WRONG),
    ],
    ids=["missing", "empty", "text", "cut", "unsealed", "spoilt", "other seal", "longer", "sealed text"],
)
def test_what_is_no_model_is_refused_in_one_line(tmp_path, mapped, make, line):
    path, content = tmp_path / "model.onnx", make(SHIPPED.read_bytes())
    if content is not None:
        path.write_bytes(content)
    scene = mapped(closed=("t2",))
    with pytest.raises(InvalidInputError, match=f"{line}.*expected a model that closedrooms train wrote.*{path.name}"):
        predict(scene.grid, scene.doors, "learned", LearnedConfig(model=path))


def test_the_wheel_holds_the_model_and_its_card():
    project = tomllib.loads((Path(__file__).parents[2] / "pyproject.toml").read_text())
    patterns = project["tool"]["setuptools"]["package-data"]["closedrooms.predictor.learned"]
    kept = {path.name for pattern in patterns for path in SHIPPED.parent.glob(pattern)}
    assert kept == {path.name for path in SHIPPED.parent.iterdir() if path.suffix in {".onnx", ".md"}}
    assert {"model.onnx", "MODEL.md"} <= kept


def test_a_folder_stands_for_the_model_in_it(tmp_path, mapped):
    (tmp_path / "model.onnx").write_bytes(SHIPPED.read_bytes())
    scene = mapped(closed=("t2",))
    own = predict(scene.grid, scene.doors, "learned", LearnedConfig(model=tmp_path))
    assert own.rooms == predict(scene.grid, scene.doors, "learned").rooms


def test_a_map_without_doors_or_walls_needs_no_network(mapped):
    scene = mapped(closed=("t2",))
    assert predict(scene.grid, [], "learned").rooms == ()
    nothing = OccupancyGrid(scene.grid.frame, np.full(scene.grid.frame.shape, -1, dtype=np.int8))
    assert set(predict(nothing, scene.doors, "learned").failures) == {"t2"}


def test_predicting_needs_no_torch():
    code = """
import sys
sys.modules["torch"] = sys.modules["onnx"] = None
from closedrooms.predictor.learned.model import load_model
assert load_model(None)
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_the_shipped_model_is_small_and_has_a_card():
    assert SHIPPED.stat().st_size <= 5_000_000
    assert b"/site-packages/" not in SHIPPED.read_bytes()
    card = SHIPPED.with_name("MODEL.md").read_text()
    assert "MIT" in card
    assert "held out" in card
