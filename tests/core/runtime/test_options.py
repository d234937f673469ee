from dataclasses import dataclass, field

import pytest

from closedrooms.core.errors import InvalidInputError
from closedrooms.core.runtime.options import FACTOR, MOST, MOST_WHOLE, check_magnitudes, check_numbers


@dataclass(frozen=True)
class Stage:
    reach: float = 1.0


@dataclass(frozen=True)
class Options:
    seed: int = 0
    start: tuple[float, float] | None = None
    stage: Stage = field(default_factory=Stage)


@pytest.mark.parametrize("reach", [-MOST, 0.0, 5e-324, MOST])
def test_numbers_that_somebody_may_set_pass(reach: float) -> None:
    check_numbers(Options(MOST_WHOLE, (reach, 0.0), Stage(reach)))


@pytest.mark.parametrize("number", [MOST * 1.001, -MOST * 1.001, 1e308, float("inf"), float("nan")])
def test_a_number_that_nobody_sets_is_named_as_on_the_command_line(number: float) -> None:
    with pytest.raises(InvalidInputError, match=r"^--stage.reach .*; expected a number from -10000 to 10000$"):
        check_numbers(Options(stage=Stage(number)))
    with pytest.raises(InvalidInputError, match=r"^--start "):
        check_numbers(Options(start=(0.0, number)))
    with pytest.raises(InvalidInputError, match=r"^--seed of more than 19 digits"):
        check_numbers(Options(seed=-(10**400)))


@dataclass(frozen=True)
class Matcher:
    sigma: float = 0.1
    points: int = 300
    enabled: bool = True
    kind: str = "scan"

    def __post_init__(self) -> None:
        check_magnitudes(self, owner="matcher", positive=("points",), sigma=(0.01, 0.5))


def test_settings_of_a_stage_stay_near_what_it_was_made_for() -> None:
    for sigma, points in ((0.01, 1), (0.5, int(300 * FACTOR))):
        assert Matcher(sigma, points).points == points
    for sigma in (0.0099, 0.51, float("nan")):
        with pytest.raises(InvalidInputError, match=r"^matcher sigma .*; expected a number from 0.01 to 0.5$"):
            Matcher(sigma)
    for points in (0, -1, int(300 * FACTOR) + 1):
        with pytest.raises(InvalidInputError, match=r"^matcher points .*; expected a number above 0 and at most 6000$"):
            Matcher(points=points)
