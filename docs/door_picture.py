"""Picture a drive through a door that opens: ``python docs/door_picture.py`` writes ``opened_door.png``.

The robot on wheels stands before the closed door, the door opens by its motor, and the robot drives through, as the
bodies of the simulation stand then; seen by PyBullet's own renderer, which needs no screen.
"""

import math
from pathlib import Path
from unittest import mock

import matplotlib.pyplot as plt
import numpy as np

from closedrooms.core.pose import Pose2, wrap_angle
from closedrooms.sim.config import SimConfig
from closedrooms.sim.physics_world import PhysicsWorld
from closedrooms.sim.simulation import Simulation
from closedrooms.worlds.library import load_world

DOCS = Path(__file__).resolve().parent
WORLD, DOOR = "office-01", "d00"
SIZE = (640, 480)
# Seconds of simulated time at which pictures are taken, after the door was told to open.
MOMENTS = (0.0, 1.0, 2.5, 8.0)


class VisibleWorld(PhysicsWorld):
    """Bodies that are to be seen, as in a window, but without one."""

    def __init__(self, *, stepped: bool = False, window: bool = False) -> None:
        super().__init__(stepped=stepped, window=window)
        self.visible = True


def main() -> None:
    """Drive and take the pictures."""
    plan = load_world(WORLD)
    door = next(door for door in plan.doors if door.id == DOOR)
    a, b = np.array(door.segment)
    middle, across = (a + b) / 2.0, np.array([a[1] - b[1], b[0] - a[0]]) / math.dist(a, b)
    pictures = []
    with (
        mock.patch("closedrooms.sim.simulation.PhysicsWorld", VisibleWorld),
        Simulation(plan, (DOOR,), SimConfig(body="wheels"), 0) as sim,
    ):
        side = 1.0 if np.dot(np.array([sim.world_T_robot.x, sim.world_T_robot.y]) - middle, across) > 0.0 else -1.0
        drive_to(sim, middle + side * 0.8 * across)
        turn_to(sim, middle)
        begun = sim.time
        for moment in MOMENTS:
            while sim.time - begun < moment - 1e-9:
                sim.step(*command(sim.world_T_robot, middle - side * 1.5 * across, wait=sim.time - begun < 2.5), 0.05)
            pictures.append((moment, picture(sim, middle, across * side)))
            if moment == 0.0:
                sim.open_door(DOOR)
    figure, axes = plt.subplots(2, 2, figsize=(11, 8.4), layout="constrained")
    for at, (moment, pixels) in zip(axes.flat, pictures, strict=True):
        at.imshow(pixels)
        at.set_title(f"{moment:.1f} s")
        at.set_axis_off()
    figure.savefig(DOCS / "pictures" / "opened_door.png", dpi=80)


def command(pose: Pose2, goal: np.ndarray, *, wait: bool = False) -> tuple[float, float]:
    """Choose speeds towards a place, by where the robot truly is [m/s], [rad/s]."""
    error = wrap_angle(math.atan2(goal[1] - pose.y, goal[0] - pose.x) - pose.theta)
    return (0.0, 0.0) if wait else (0.4 if abs(error) < 0.3 else 0.0, max(-1.0, min(1.0, 2.0 * error)))


def drive_to(sim: Simulation, goal: np.ndarray) -> None:
    """Drive to a place, straight."""
    for _ in range(600):
        pose = sim.world_T_robot
        if math.dist((pose.x, pose.y), goal) < 0.1:
            return
        sim.step(*command(pose, goal), 0.05)


def turn_to(sim: Simulation, goal: np.ndarray) -> None:
    """Turn towards a place."""
    for _ in range(60):
        sim.step(0.0, command(sim.world_T_robot, goal)[1], 0.05)


def picture(sim: Simulation, middle: np.ndarray, towards: np.ndarray) -> np.ndarray:
    """Render the doorway from above and from the robot's side, shape (rows, columns, 3)."""
    import pybullet

    eye = [*(middle + 2.2 * towards + 1.0 * np.array([-towards[1], towards[0]])), 5.5]
    view = pybullet.computeViewMatrix(eye, [*middle, 0.0], [0.0, 0.0, 1.0])
    lens = pybullet.computeProjectionMatrixFOV(55.0, SIZE[0] / SIZE[1], 0.1, 20.0)
    _, _, pixels, _, _ = pybullet.getCameraImage(
        *SIZE, view, lens, shadow=0, renderer=pybullet.ER_TINY_RENDERER, physicsClientId=sim.physics._client
    )
    return np.reshape(np.asarray(pixels, dtype=np.uint8), (SIZE[1], SIZE[0], 4))[:, :, :3]


if __name__ == "__main__":
    main()
