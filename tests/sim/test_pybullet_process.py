import os
from pathlib import Path

import pytest

from closedrooms.sim.pybullet_process import quiet


def test_what_is_written_below_python_is_kept_off_the_terminal_for_as_long_as_the_block(
    capfd: pytest.CaptureFixture[str],
) -> None:
    before = len(list(Path("/proc/self/fd").iterdir()))
    for number, stream in ((1, "out"), (2, "err")):
        with quiet():
            os.write(number, b"hidden")
        os.write(number, f"shown on {stream}".encode())
    assert capfd.readouterr() == ("shown on out", "shown on err")
    assert len(list(Path("/proc/self/fd").iterdir())) == before
