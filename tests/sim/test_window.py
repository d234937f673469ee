"""PyBullet's window: checked for before it is opened, because without a display PyBullet ends the process."""

import hashlib
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from closedrooms.core.errors import InvalidInputError
from closedrooms.sim.config import SimConfig
from closedrooms.sim.physics_world import PhysicsWorld
from closedrooms.sim.pybullet_process import check_display

DRIVE = """
import hashlib, sys
from closedrooms.sim.config import SimConfig
from closedrooms.sim.simulation import Simulation
from closedrooms.worlds.library import load_world
found = hashlib.sha256()
with Simulation(load_world("office-01"), (), SimConfig(body="wheels", gui=sys.argv[1] == "gui"), 0) as sim:
    for i in range(20):
        sim.step(0.5, 0.3, 0.1)
        found.update(sim.observe().scan.ranges.tobytes())
print(found.hexdigest())
"""


@pytest.mark.parametrize("display", [None, "", ":7654", "nonsense"])
def test_without_a_display_the_window_is_refused_in_one_line(
    display: str | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("DISPLAY", raising=False)
    if display is not None:
        monkeypatch.setenv("DISPLAY", display)
    with pytest.raises(InvalidInputError, match="no display"):
        check_display()
    with pytest.raises(InvalidInputError, match="no display"), PhysicsWorld(stepped=True, window=True):
        pass


def test_a_kinematic_robot_has_no_window() -> None:
    with pytest.raises(InvalidInputError, match="window"):
        SimConfig(gui=True)


@pytest.mark.slow
def test_a_window_changes_nothing(tmp_path: Path) -> None:
    server = shutil.which("Xvfb")
    if server is None:
        pytest.skip("no Xvfb")
    # It finds a number that is free, and says it once it listens.
    command = [server, "-displayfd", "1", "-screen", "0", "800x600x24"]
    screen = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    try:
        assert screen.stdout is not None
        number = f":{screen.stdout.readline().strip()}"
        script = tmp_path / "drive.py"
        script.write_text(DRIVE)
        said = {}
        for how in ("gui", "direct"):
            environment = os.environ | {"DISPLAY": number}
            done = subprocess.run(
                [sys.executable, script, how], env=environment, capture_output=True, text=True, timeout=1800, check=True
            )
            said[how] = done.stdout.split()[-1]
    finally:
        screen.terminate()
        screen.communicate()
    assert said["gui"] == said["direct"]
    assert len(said["gui"]) == len(hashlib.sha256().hexdigest())
