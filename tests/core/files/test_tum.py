from pathlib import Path

import numpy as np
import pytest

from closedrooms.core.errors import InvalidInputError
from closedrooms.core.files.tum import read_trajectory, write_trajectory


def test_poses_are_read_back(tmp_path: Path) -> None:
    stamps = np.array([0.0, 0.1, 0.25])
    poses = np.array([[0.0, 0.0, 0.0], [1.5, -2.0, 3.0], [4.0, 1.0, -3.1]])
    write_trajectory(tmp_path / "t.tum", stamps, poses)
    again_stamps, again = read_trajectory(tmp_path / "t.tum")
    assert again_stamps == pytest.approx(stamps)
    assert again == pytest.approx(poses, abs=1e-6)


def test_names_the_line_that_is_wrong(tmp_path: Path) -> None:
    (tmp_path / "t.tum").write_text("# a comment\n0 0 0 0 0 0 0 1\n1 2 three\n")
    with pytest.raises(InvalidInputError, match="line 3"):
        read_trajectory(tmp_path / "t.tum")
