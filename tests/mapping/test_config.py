"""Settings of the mapper: bounds, and that the defaults are of one piece."""

from dataclasses import fields
from typing import Any

import numpy as np
import pytest

from closedrooms.core.errors import InvalidInputError
from closedrooms.mapping.config import LoopConfig, MapperConfig, MatcherConfig, RecoveryConfig
from closedrooms.mapping.motion.uncertain_motion import UncertainMotion

POSITIVE = {
    MatcherConfig: {"point_spacing", "max_points", "iterations"},
    LoopConfig: {"max_points", "kernel"},
    RecoveryConfig: set(),
    MapperConfig: {"keyframe_distance", "keyframe_angle", "max_range", "log_odds_limit"},
}
BOUNDED = {"field_sigma": (0.01, 0.5), "resolution": (1e-3, 10.0)}


@pytest.mark.parametrize("make", POSITIVE)
def test_numbers_from_zero_on_are_taken_and_of_some_zero_is_not(make: Any) -> None:
    for item in fields(make):
        if not isinstance(item.default, int | float) or isinstance(item.default, bool):
            continue
        low, high = BOUNDED.get(item.name, (0.0, None))
        if item.name not in POSITIVE[make]:
            assert getattr(make(**{item.name: low}), item.name) == low
        for wrong in (-1.0,) if item.name not in POSITIVE[make] else (0.0, -1.0):
            with pytest.raises(InvalidInputError, match=item.name):
                make(**{item.name: wrong})
        if high is not None:
            make(**{item.name: high})
        with pytest.raises(InvalidInputError, match=item.name):
            make(**{item.name: 1e12 if high is None else 1.01 * high})


def test_one_hit_outweighs_two_misses_and_not_three_and_one_of_either_is_enough_to_know() -> None:
    config = MapperConfig()
    assert 2 * config.log_odds_miss < config.log_odds_hit < 3 * config.log_odds_miss
    # As map_server reads a map: occupied above 0.65, free below 0.196.
    assert 1 / (1 + np.exp(-config.log_odds_hit)) > 0.65
    assert 1 / (1 + np.exp(config.log_odds_miss)) < 0.196
    # At its limit a cell is as sure as a percentage tells.
    assert round(100 / (1 + np.exp(-config.log_odds_limit))) == 100
    assert 3 * config.log_odds_hit < config.log_odds_limit < 10 * config.log_odds_hit


def test_defaults_fit_together() -> None:
    config = MapperConfig()
    matcher, loops, recovery = config.matcher, config.loops, config.recovery
    # All that finds and mends is switched on.
    assert config.undistort
    assert config.glass
    assert loops.enabled
    assert recovery.enabled
    # Shares and likelihoods.
    shares = (matcher.new_surface, matcher.lost_score, matcher.min_score, matcher.doubt, matcher.poor)
    shares += (loops.min_score, loops.max_rival, loops.min_weight)
    shares += (recovery.check_below, recovery.max_conflict, recovery.min_score, recovery.max_rival)
    assert all(0.0 < value < 1.0 for value in shares)
    assert matcher.lost_score < matcher.min_score < loops.min_score < matcher.doubt
    assert matcher.poor < recovery.check_below < matcher.doubt
    assert 0.0 < recovery.advantage < 0.2
    # What is matched is finer than what is matched against, and of a scan a part.
    assert config.resolution < matcher.field_sigma < matcher.point_spacing <= 2 * config.resolution
    assert 5 <= matcher.min_points < 100 < matcher.max_points < loops.max_points
    assert 2 <= matcher.iterations <= 10
    # Keyframes overlap: several within what a robot sees of a room, and submaps lie beyond all of them.
    assert 2 * matcher.point_spacing < config.keyframe_distance < 1.0
    assert 0.1 < config.keyframe_angle < np.pi / 4
    assert 2.0 <= config.poor_spacing <= 3.0
    assert (
        config.keyframe_distance
        < loops.interval
        <= loops.link_interval
        < loops.link_distance
        < loops.recent_distance + 1
    )
    assert loops.recent_distance <= loops.overlap < loops.max_distance < loops.surroundings < loops.horizon
    assert loops.horizon < config.max_range < recovery.break_length
    # A search without drift is narrower than with it, and than that for a lost robot.
    assert loops.window < recovery.reach < recovery.max_reach < recovery.join_window < loops.max_window
    assert 0.01 < loops.drift * 1.0 < 0.1
    assert 0.0 < loops.drift_angle < loops.drift < loops.window_angle < 0.5
    assert matcher.max_window < recovery.reach
    assert 0.3 < matcher.max_window_angle < np.pi / 2
    assert recovery.lost_distance > 2 * config.keyframe_distance
    assert recovery.lost_distance < loops.overlap
    assert 5 <= recovery.submap_after <= 20
    # Nobody knows how far apart two submaps are: by metres, and by a radian.
    assert recovery.break_distance == pytest.approx(1.0, abs=0.5)
    assert recovery.break_angle == pytest.approx(1.0, abs=0.5)
    # No robot indoors is as fast, but many go at a metre a second.
    assert 2.0 < recovery.possible_speed < 10.0
    assert np.pi < recovery.possible_turn_rate < 4 * np.pi
    assert 0.5 <= matcher.range_margin <= 1.5
    assert 2.0 <= loops.kernel <= 6.0
    assert 1.0 < loops.point_information < 4.0


def test_the_odometry_is_trusted_as_far_as_that_of_a_robot_with_noise_goes() -> None:
    config = MatcherConfig()
    # After a metre, the noisiest level has 0.08 m and 4 degrees; after a full turn 8 %.
    distance, angle = UncertainMotion(1.0, 0.0).sigmas(config)
    assert 0.05 < distance < 0.15
    assert np.radians(3.0) < angle < np.radians(6.0)
    assert np.radians(20.0) < UncertainMotion(0.0, 2 * np.pi).sigmas(config)[1] < np.radians(40.0)
    # A step of a decimetre needs no search of headings, a turn of it does.
    assert (
        UncertainMotion(0.05, 0.0).sigmas(config)[1] < config.sure_angle < UncertainMotion(0.05, 0.1).sigmas(config)[1]
    )
    assert UncertainMotion().sigmas(config) == pytest.approx((config.odometry_floor, config.odometry_floor / 2))
    assert 1e-3 < config.odometry_floor < 0.01
    assert 2.0 <= config.window_sigmas <= 4.0
    assert 0.0 < config.prior_weight < 0.05
