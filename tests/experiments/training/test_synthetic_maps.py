from pathlib import Path

import numpy as np
import pytest

from closedrooms.core.files.rosmap import read_map
from closedrooms.core.random import stream
from closedrooms.core.shapes import cells_inside
from closedrooms.experiments.evaluation.samples.listing import find_samples
from closedrooms.experiments.evaluation.samples.sample_reader import read_sample
from closedrooms.experiments.training.synthetic_maps import DrawnMap, synthesise_map, write_sample
from closedrooms.worlds.closing import draw_closed
from closedrooms.worlds.library import load_world


@pytest.fixture(scope="module")
def drawn() -> DrawnMap:
    plan = load_world("office-01")
    closed = draw_closed(plan, 3, stream(0, "test"))
    return synthesise_map(plan, closed, stream(0, "test", "noise"))


def test_a_hidden_room_is_not_seen_and_all_else_is(drawn: DrawnMap) -> None:
    assert len(drawn.rooms) == len(drawn.doors) == 3
    hidden = np.zeros(drawn.observed.frame.shape, dtype=np.bool_)
    for room in drawn.rooms:
        inside = cells_inside(room.polygon.buffer(-0.15), drawn.observed.frame)
        assert drawn.observed.unknown[inside].all()
        hidden |= cells_inside(room.polygon.buffer(0.1), drawn.observed.frame)
    assert drawn.observed.free[drawn.truth.free & ~hidden].mean() > 0.98


def test_walls_are_seen_from_their_near_side_alone(drawn: DrawnMap) -> None:
    walls = np.count_nonzero(drawn.observed.cells == 100)
    edge = np.count_nonzero(np.diff(drawn.observed.free.astype(np.int8), axis=0)) + np.count_nonzero(
        np.diff(drawn.observed.free.astype(np.int8), axis=1)
    )
    assert 0.8 * edge < walls < 2.2 * edge


def test_the_same_seed_draws_the_same_map() -> None:
    plan = load_world("office-01")
    closed = draw_closed(plan, 2, stream(1, "test"))
    one, other = (synthesise_map(plan, closed, stream(1, "noise"), angle=0.3) for _ in range(2))
    assert np.array_equal(one.observed.cells, other.observed.cells)
    assert one.doors == other.doors


def test_a_sample_is_read_again(tmp_path: Path, drawn: DrawnMap) -> None:
    write_sample(tmp_path / "data" / "office-01" / "00", drawn, world="office-01", repetition=4)
    (path,) = find_samples([tmp_path / "data"])
    sample = read_sample(path)
    assert (sample.world, sample.repetition, len(sample.rooms)) == ("office-01", 4, 3)
    assert read_map(path.folder / "map.yaml").frame.resolution == 0.05
