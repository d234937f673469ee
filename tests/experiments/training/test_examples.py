import shutil
from pathlib import Path

import numpy as np
import pytest
import shapely

from closedrooms.core.errors import InvalidInputError
from closedrooms.core.random import stream
from closedrooms.experiments.evaluation.samples.listing import find_samples
from closedrooms.experiments.training.batches import blur, draw_batches, hide_pockets, make_batch, skew, wear_walls
from closedrooms.experiments.training.buildings import group_of, may_train
from closedrooms.experiments.training.config import TrainConfig
from closedrooms.experiments.training.examples import (
    AHEAD_CELLS,
    ASIDE_CELLS,
    DOOR_ROW,
    WHOLE,
    Examples,
    draw_room,
    gather_examples,
    measure_sides,
    pack_patch,
    unpack_patches,
)
from closedrooms.experiments.training.train import hold_out_buildings
from closedrooms.predictor.learned.patches import ASIDE, BEHIND, CELL, FINE, SIZE, Patch


@pytest.fixture(scope="module")
def gathered(drawn_dataset: Path):
    return gather_examples(find_samples([drawn_dataset]))


def upright(channels=None) -> Patch:
    """A patch along the axes of the map, its corner in the origin."""
    zeros = np.zeros((5, SIZE, SIZE)) if channels is None else channels
    return Patch(zeros, np.zeros(2), np.array([1.0, 0.0]), np.array([0.0, 1.0]), np.array([ASIDE, BEHIND]))


def test_a_patch_reaches_16_m_to_either_side_24_m_ahead_and_8_m_behind_the_door() -> None:
    assert (ASIDE_CELLS, AHEAD_CELLS, DOOR_ROW) == (64, 96, 32)


@pytest.mark.parametrize("sides", [(1.0, 3.0, 5.0), (2.5, 0.6, 1.9), (15.8, 15.8, 23.8), (0.7, 0.7, 12.3)])
def test_the_sides_of_a_rectangle_are_measured_to_a_tenth(sides: tuple[float, float, float]) -> None:
    left, right, back = sides
    room = shapely.box(ASIDE - left, BEHIND + 0.1, ASIDE + right, BEHIND + back)
    assert measure_sides(draw_room(upright(), room)) == pytest.approx(sides, abs=0.13)


def test_the_sides_of_a_room_with_a_bay_are_those_of_the_room() -> None:
    room = shapely.box(14.0, 8.1, 19.0, 13.0).union(shapely.box(19.0, 12.0, 20.0, 12.6))
    assert measure_sides(draw_room(upright(), room)) == pytest.approx((2.0, 3.0, 5.0), abs=0.13)


def test_a_hole_is_not_part_of_a_room() -> None:
    room = shapely.box(10.0, 10.0, 20.0, 20.0).difference(shapely.box(12.0, 12.0, 15.0, 15.0))
    assert draw_room(upright(), room).sum() * (CELL / FINE) ** 2 == pytest.approx(room.area, rel=0.02)


def test_every_door_of_buildings_that_may_train_is_an_example(gathered) -> None:
    assert gathered.failures == {}
    assert gathered.withheld == 1
    assert gathered.examples.names == ("office-g1-1", "office-g1-2", "school-g1-3", "somebody's")
    assert 6 <= len(gathered.examples) <= 12
    room = gathered.examples.masks > WHOLE / 2
    free = gathered.examples.shown[:, 0] > WHOLE / 2
    # What the map shows as free is not hidden.
    assert (room & free).sum() < 0.02 * room.sum()
    assert (gathered.examples.sides[:, 2] > 0.5).all()


def test_a_broken_sample_is_named_and_the_rest_is_used(drawn_dataset: Path, tmp_path: Path) -> None:
    folder = tmp_path / "data"
    shutil.copytree(drawn_dataset, folder)
    (folder / "office-g1-1" / "00" / "map.png").write_bytes(b"no picture")
    found = gather_examples(find_samples([folder]))
    assert list(found.failures) == ["office-g1-1/00"]
    assert "office-g1-1" not in found.examples.names
    assert len(found.examples.names) == 3


def test_patches_come_back_from_what_is_kept() -> None:
    rng = np.random.default_rng(0)
    free = rng.integers(0, WHOLE + 1, (SIZE, SIZE))
    occupied = WHOLE - free
    doors = rng.random((2, SIZE, SIZE)) < 0.1
    channels = np.stack((free / WHOLE, occupied / WHOLE, np.zeros((SIZE, SIZE)), *doors))
    assert unpack_patches(pack_patch(upright(channels))[None])[0] == pytest.approx(channels, abs=1e-6)


def test_buildings_kept_to_choose_or_report_do_not_train() -> None:
    assert may_train("office-01")
    assert may_train("office-g1-0")
    assert may_train("a building of somebody")
    assert not may_train("office-g1-1000")
    assert not may_train("office-g2-0")
    assert not may_train("VILLAGE")
    assert not may_train("Sabadell3_updated")


def test_floors_of_one_building_stand_on_one_side() -> None:
    assert group_of("FALAELEM2_updated") == group_of("FALAELEM1_updated") == "FALAELEM1_updated"
    assert group_of("nobody's") == "nobody's"


def empty(groups: list[int]) -> Examples:
    number = len(groups)
    return Examples(
        np.zeros((number, 3, SIZE, SIZE), np.uint8),
        np.zeros((number, SIZE, SIZE), np.uint8),
        np.ones((number, 3)),
        np.array(groups, dtype=np.int64),
        tuple(f"b{at}" for at in sorted(set(groups))),
    )


def test_no_building_is_learned_from_and_held_out() -> None:
    examples = empty([0, 0, 1, 2, 2, 2, 3, 4])
    config = TrainConfig(datasets=(Path("x"),), out=Path("y"), held_out=0.4)
    fit, held = hold_out_buildings(examples, config)
    assert sorted([*fit, *held]) == list(range(8))
    assert not set(examples.groups[fit]) & set(examples.groups[held])
    assert len(set(examples.groups[held])) == 2
    assert [list(part) for part in hold_out_buildings(examples, config)] == [list(fit), list(held)]


@pytest.mark.parametrize("groups", [[], [0, 0]])
def test_one_building_is_too_few(groups: list[int]) -> None:
    with pytest.raises(InvalidInputError, match=r"buildings.*expected samples with truth_rooms\.geojson"):
        hold_out_buildings(empty(groups), TrainConfig(datasets=(Path("x"),), out=Path("y")))


def test_an_epoch_depends_on_seed_and_number_alone(gathered) -> None:
    examples, of = gathered.examples, np.arange(len(gathered.examples))

    def draw(seed: int, epoch: int) -> list[np.ndarray]:
        return [batch.patches for batch in draw_batches(examples, of, 3, seed, epoch)]

    first = draw(0, 1)
    assert len(first) == len(of) // 3
    assert all(np.array_equal(a, b) for a, b in zip(first, draw(0, 1), strict=True))
    assert not all(np.array_equal(a, b) for a, b in zip(first, draw(0, 2), strict=True))
    assert not all(np.array_equal(a, b) for a, b in zip(first, draw(1, 1), strict=True))


def test_a_mirrored_example_has_left_and_right_exchanged(gathered, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("closedrooms.experiments.training.batches.ASKEW", 0.0)
    examples = gathered.examples
    plain = make_batch(examples.shown, examples.masks, examples.sides)
    seen = {True: 0, False: 0}
    for epoch in range(4):
        for batch in draw_batches(examples, np.arange(len(examples)), 1, 0, epoch):
            at = next(
                (at, flip)
                for at in range(len(examples))
                for flip in (False, True)
                if np.array_equal(plain.masks[at][:, ::-1] if flip else plain.masks[at], batch.masks[0])
            )
            left, right, back = (side[at[0]] for side in plain.sides)
            expected = (right, left, back) if at[1] else (left, right, back)
            assert all(np.allclose(a, b[0]) for a, b in zip(expected, batch.sides, strict=True))
            seen[at[1]] += 1
    assert min(seen.values()) > 0


def test_pockets_hide_known_space_and_leave_room_and_doors_alone(gathered) -> None:
    examples = gathered.examples
    hidden = 0
    for number in range(len(examples)):
        shown, mask = examples.shown[number].copy(), examples.masks[number]
        hide_pockets(shown, mask, stream(number, "test"))
        changed = shown != examples.shown[number]
        assert not changed[2].any()
        assert not changed[:, mask > 0].any()
        assert (shown[0] <= examples.shown[number][0]).all()
        hidden += int(changed.any())
    assert hidden > len(examples) / 2


def test_worn_walls_stand_where_walls_were_and_cells_stay_whole(gathered) -> None:
    thicker = thinner = lost = 0
    for number, before in enumerate(gathered.examples.shown):
        shown = before.copy()
        wear_walls(shown, stream(number, "test"))
        assert not (shown[1][before[1] == 0]).any()
        assert (shown[:2].sum(axis=0) <= WHOLE).all()
        assert (shown[2] == before[2]).all()
        thicker += int((shown[1] > before[1]).any())
        thinner += int((shown[1] < before[1]).any())
        lost += int(((shown[1] == 0) & (before[1] > 2)).any())
    assert min(thicker, thinner, lost) > 0


def test_a_map_and_its_room_are_skewed_together_around_the_door(monkeypatch: pytest.MonkeyPatch) -> None:
    door, moved = (round(BEHIND / CELL), SIZE // 2), 0
    for number in range(6):
        shown = np.zeros((3, SIZE, SIZE), dtype=np.uint8)
        shown[0, door[0] : door[0] + 30, door[1] - 12 : door[1] + 20] = WHOLE
        before, mask = shown.copy(), shown[0].copy()
        skew(shown, mask, stream(number, "test"))
        assert (shown[0] == mask).all()
        assert shown[0][door] == WHOLE
        moved += int((shown != before).any())
    assert moved >= 3
    monkeypatch.setattr("closedrooms.experiments.training.batches.ASKEW", 0.0)
    still = shown.copy()
    skew(shown, mask, stream(0, "test"))
    assert (shown == still).all()


def test_a_blurred_distance_is_a_distribution_around_it() -> None:
    weights = blur(np.array([0.0, 1.0, 3.3, 99.0]), 64)
    assert weights.sum(axis=1) == pytest.approx(np.ones(4), abs=1e-5)
    centres = (np.arange(64) + 0.5) * CELL
    assert weights[2] @ centres == pytest.approx(3.3, abs=0.01)
    assert weights.argmax(axis=1).tolist() == [0, 3, 13, 63]


@pytest.mark.parametrize(
    ("field", "value"), [("epochs", 0), ("batch", 1), ("held_out", 1.0), ("rate", 2.0), ("threads", 0), ("seed", -1)]
)
def test_options_out_of_bounds_are_refused(field: str, value: float) -> None:
    with pytest.raises(InvalidInputError, match=field):
        TrainConfig(datasets=(Path("x"),), out=Path("y"), **{field: value})
