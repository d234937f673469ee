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


@pytest.mark.parametrize("place", range(1, 4))
def test_a_coordinate_beyond_any_place_is_refused_and_one_at_the_bound_is_read(tmp_path: Path, place: int) -> None:
    values = ["0"] * 7 + ["1"]
    values[place] = "1e8"
    (tmp_path / "t.tum").write_text(" ".join(values) + "\n")
    assert len(read_trajectory(tmp_path / "t.tum")[0]) == 1
    values[place] = "-1.01e8"
    (tmp_path / "t.tum").write_text(" ".join(values) + "\n")
    with pytest.raises(InvalidInputError, match=r"^line 1; expected stamp x y z qx qy qz qw"):
        read_trajectory(tmp_path / "t.tum")


@pytest.mark.parametrize("line", ["0 1 2 0 0 0 1", "0 1 2 0 0 0 0 1 1", "nan 0 0 0 0 0 0 1", "0 0 0 0 0 0 2.1 0"])
def test_a_line_of_other_than_eight_honest_numbers_is_refused(tmp_path: Path, line: str) -> None:
    (tmp_path / "t.tum").write_text(line + "\n")
    with pytest.raises(InvalidInputError, match=r"^line 1;"):
        read_trajectory(tmp_path / "t.tum")
