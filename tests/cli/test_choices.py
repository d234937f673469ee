"""Choices that options spell out, so that ``--help`` imports little, are those that the code has."""

from typing import get_args, get_type_hints

from closedrooms.pipeline.options.run import LidarName, NoiseName
from closedrooms.pipeline.options.worlds import ConvertWorld
from closedrooms.pipeline.world_files import exporters
from closedrooms.sim.config import LIDAR_PRESETS, NOISE_LEVELS


def test_choices_of_options_are_those_of_the_code() -> None:
    assert get_args(LidarName) == tuple(LIDAR_PRESETS)
    assert get_args(NoiseName) == tuple(NOISE_LEVELS)
    assert get_args(get_type_hints(ConvertWorld)["to"]) == tuple(exporters())
