from pathlib import Path

import pytest

from closedrooms.core.random import stream
from closedrooms.experiments.training.synthetic_maps import synthesise_map, write_sample
from closedrooms.worlds.closing import draw_closed
from closedrooms.worlds.generation.generator import generate


@pytest.fixture(scope="session")
def drawn_dataset(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A dataset of five maps: of three buildings to learn from, one to choose by, one that nobody sorted."""
    folder = tmp_path_factory.mktemp("drawn")
    names = ("office-g1-1", "office-g1-2", "school-g1-3", "office-g1-1000", "somebody's")
    for number, name in enumerate(names):
        kind, seed = (name.split("-")[0], int(name.split("-")[2])) if "-g1-" in name else ("office", 7)
        plan = generate(kind, seed)
        rng = stream(number, "test")
        drawn = synthesise_map(plan, draw_closed(plan, 3, rng), rng)
        write_sample(folder / name / "00", drawn, world=name, repetition=0)
    return folder
