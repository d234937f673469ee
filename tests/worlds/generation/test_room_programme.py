"""Which rooms share a corridor: their widths fill it, and no building has too many of a kind."""

import itertools
from collections import Counter

import numpy as np
import pytest

from closedrooms.worlds.generation.room_programme import BAYS, END_ROOMS, LENGTHS, Bay, _draw, draw_bays, measures

KINDS = tuple(BAYS)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("length", [2.5, 7.0, 24.0, 55.0])
def test_bays_fill_their_run_on_a_grid_of_5_cm(kind: str, length: float) -> None:
    for seed in range(20):
        bays = draw_bays(np.random.default_rng(seed), kind, length, {})
        assert bays or length < 3.0
        if not bays:
            continue
        widths = [width for _, width in bays]
        assert sum(widths) == pytest.approx(length)
        assert all(width / 0.05 == pytest.approx(round(width / 0.05)) for width in widths[:-1])
        # Stretched or cut to fit, by as much as the narrowest room that may be left out.
        if length > 20.0:
            for bay, width in bays[:-1]:
                assert 0.8 * bay.widths[0] <= width <= 1.25 * bay.widths[1]


def test_a_run_shorter_than_every_bay_is_left_empty() -> None:
    for kind in KINDS:
        narrowest = min(bay.widths[0] for bay in BAYS[kind])
        assert draw_bays(np.random.default_rng(0), kind, narrowest, {}) == []
        ((_, width),) = draw_bays(np.random.default_rng(0), kind, narrowest + 0.01, {})
        assert width == pytest.approx(narrowest + 0.01)


@pytest.mark.parametrize("kind", KINDS)
def test_no_building_has_more_of_a_kind_than_it_may_and_the_counts_are_kept(kind: str) -> None:
    limits = {f"{bay.label}/{bay.layout}": bay.at_most for bay in BAYS[kind]}
    for seed in range(10):
        rng, counts = np.random.default_rng(seed), {}
        drawn: Counter[str] = Counter()
        for _ in range(4):
            drawn.update(f"{bay.label}/{bay.layout}" for bay, _ in draw_bays(rng, kind, 40.0, counts))
        assert drawn == counts
        assert all(number <= limits[name] for name, number in counts.items())


def test_what_fits_and_may_still_be_had_is_drawn_by_its_weight() -> None:
    often, seldom, none = Bay("a", (2.0, 3.0), 3.0), Bay("b", (3.0, 4.0), 1.0), Bay("c", (2.0, 3.0), 9.0, at_most=2)

    def share(counts: dict[str, int], left: float, *bays: Bay) -> Counter[str]:
        rng = np.random.default_rng(0)
        drawn = [_draw(rng, bays, left, counts) for _ in range(800)]
        return Counter("none" if bay is None else bay.label for bay in drawn)

    assert share({"c/room": 2}, 5.0, often, seldom, none)["a"] == pytest.approx(600, abs=50)
    assert share({"c/room": 1}, 5.0, often, seldom, none)["c"] == pytest.approx(800 * 9 / 13, abs=50)
    assert set(share({}, 2.9, often, seldom)) == {"a"}
    assert share({}, 3.0, often, seldom)["b"] > 0
    assert set(share({}, 1.9, often, seldom)) == {"none"}
    # Six times as often until the building has it.
    due = Bay("d", (2.0, 3.0), 1.0, at_least=1)
    assert share({}, 5.0, often, due)["d"] == pytest.approx(800 * 6 / 9, abs=50)
    assert share({"d/room": 1}, 5.0, often, due)["d"] == pytest.approx(200, abs=50)


def test_neighbours_of_one_kind_are_mostly_of_one_width() -> None:
    same = total = 0
    for seed in range(60):
        bays = draw_bays(np.random.default_rng(seed), "school", 60.0, {})[:-1]
        for (first, a), (second, b) in itertools.pairwise(bays):
            if first is second:
                total += 1
                same += abs(a - b) < 0.051
    assert total > 50
    assert 0.55 < same / total < 0.9


@pytest.mark.parametrize(
    ("kind", "widths", "depths"), [("office", (1.6, 2.4), (4.4, 6.2)), ("school", (2.4, 3.6), (6.4, 8.2))]
)
def test_measures_stay_within_those_of_their_kind(
    kind: str, widths: tuple[float, float], depths: tuple[float, float]
) -> None:
    for size, (low, high) in LENGTHS[kind].items():
        drawn = [measures(np.random.default_rng(seed), kind, size) for seed in range(150)]
        spans = [
            ([m.width for m in drawn], *widths),
            ([m.depths[0] for m in drawn], *depths),
            ([m.depths[1] for m in drawn], *depths),
            *(([m.legs[k] for m in drawn], low * share, high * share) for k, share in ((0, 1.0), (1, 0.8), (2, 0.7))),
        ]
        for values, least, most in spans:
            assert all(value == round(value, 1) for value in values)
            assert least - 0.051 <= min(values) <= least + 0.1 * (most - least) + 0.1
            assert most + 0.051 >= max(values) >= most - 0.1 * (most - least) - 0.1


def test_programmes_make_sense() -> None:
    for kind in KINDS:
        # A bend's corner needs a bay that may fill it, and every end room is a room.
        assert any(bay.corner for bay in BAYS[kind])
        for bay in BAYS[kind]:
            assert 0.0 < bay.widths[0] < bay.widths[1]
            assert bay.at_least <= bay.at_most
            assert bay.shallow <= 1.0 <= bay.deep
        for _, widths, depths in END_ROOMS[kind]:
            assert 2.0 < widths[0] < widths[1]
            assert 2.0 < depths[0] < depths[1]
