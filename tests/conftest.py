"""What all tests share: settings of hypothesis, a world of wall segments, a plan, and somebody else's method.

With the segments, which have an exact raycaster, the mapper and navigation are tested without the simulator.
"""

import textwrap
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import settings
from hypothesis.internal.conjecture import providers
from shapely.geometry import box as area_of

from closedrooms.core.arrays import FloatArray
from closedrooms.core.pose import Pose2
from closedrooms.core.random import stream
from closedrooms.core.scan import LaserScan
from closedrooms.worlds.plan import FloorPlan, Opening, PlanDoor, PlanRoom, Wall

# Properties hold on a busy machine too: an example that takes long is no failure. The examples are the same in every
# run, so that two runs of one commit agree; `pytest --hypothesis-profile anew` draws others.
settings.register_profile("closedrooms", deadline=None, derandomize=True)
settings.register_profile("anew", deadline=None)
settings.load_profile("closedrooms")
# It also tries numbers that stand in the modules that are imported by then, which the order of the tests decides.
providers._get_local_constants = lambda: providers._local_constants


def box(x0: float, y0: float, x1: float, y1: float) -> list[tuple[float, float, float, float]]:
    return [(x0, y0, x1, y0), (x1, y0, x1, y1), (x1, y1, x0, y1), (x0, y1, x0, y0)]


@dataclass
class Drive:
    """A drive: scans, odometry ``(n, 3)`` and true poses ``(n, 3)`` in the frame of the first one."""

    scans: list[LaserScan]
    odometry: FloatArray
    truth: FloatArray


class SegmentWorld:
    """Walls without thickness, shape (k, 4) as ``x0 y0 x1 y1`` [m]."""

    def __init__(self, segments: list[tuple[float, float, float, float]]) -> None:
        self.segments = np.array(segments, dtype=np.float64)

    def ranges(self, pose: Pose2, angles: FloatArray, range_max: float = 20.0) -> FloatArray:
        """Exact ranges: each ray against each segment."""
        d = np.column_stack((np.cos(angles + pose.theta), np.sin(angles + pose.theta)))
        a, e = self.segments[:, :2] - [pose.x, pose.y], self.segments[:, 2:] - self.segments[:, :2]
        cross = d[:, None, 0] * e[None, :, 1] - d[:, None, 1] * e[None, :, 0]
        with np.errstate(divide="ignore", invalid="ignore"):
            t = (a[None, :, 0] * e[None, :, 1] - a[None, :, 1] * e[None, :, 0]) / cross
            u = (a[None, :, 0] * d[:, None, 1] - a[None, :, 1] * d[:, None, 0]) / cross
        t = np.where((t > 0) & (u >= -1e-9) & (u <= 1 + 1e-9), t, np.inf)
        nearest: FloatArray = t.min(axis=1)
        nearest[nearest >= range_max] = np.inf
        return nearest

    def scan(
        self,
        pose: Pose2,
        *,
        beams: int = 360,
        view: float = 2 * np.pi,
        noise: float = 0.0,
        outliers: float = 0.0,
        dropouts: float = 0.0,
        rng: np.random.Generator | None = None,
        stamp: float = 0.0,
    ) -> LaserScan:
        """One sweep from ``pose``."""
        full = view > 2 * np.pi - 1e-6
        increment = view / beams if full else view / (beams - 1)
        angles = -view / 2 + increment * np.arange(beams)
        ranges = self.ranges(pose, angles)
        if rng is not None:
            ranges = np.where(np.isfinite(ranges), np.maximum(ranges + rng.normal(0, noise, beams), 0.05), ranges)
            ranges = np.where(rng.random(beams) < outliers, rng.uniform(0.1, 20.0, beams), ranges)
            ranges = np.where(rng.random(beams) < dropouts, np.nan, ranges)
        return LaserScan(ranges, -view / 2, increment, 20.0, 0.05, stamp=stamp)

    def drive(
        self,
        corners: list[tuple[float, float]],
        *,
        step: float = 0.08,
        turn: float = 0.12,
        distance_noise: float = 0.0,
        turn_noise: float = 0.0,
        bias: float = 0.0,
        seed: int = 0,
        **sensor: float,
    ) -> Drive:
        """Drive from corner to corner, turning on the spot.

        ``distance_noise`` [m] and ``turn_noise`` [rad] are standard deviations after 1 m (the variance is linear);
        ``bias`` [rad] turns the odometry by so much per metre.
        """
        rng = stream(seed, "drive")
        poses: list[tuple[float, float, float]] = []
        heading = float(np.arctan2(corners[1][1] - corners[0][1], corners[1][0] - corners[0][0]))
        for (x0, y0), (x1, y1) in pairwise(corners):
            target = float(np.arctan2(y1 - y0, x1 - x0))
            change = (target - heading + np.pi) % (2 * np.pi) - np.pi
            turns = max(1, int(np.ceil(abs(change) / turn)))
            poses += [(x0, y0, heading + change * i / turns) for i in range(turns)]
            heading = target
            steps = max(1, int(np.ceil(np.hypot(x1 - x0, y1 - y0) / step)))
            poses += [(x0 + (x1 - x0) * i / steps, y0 + (y1 - y0) * i / steps, heading) for i in range(steps)]
        start = Pose2(*poses[0]).inverse()
        scans, odometry, truth = [], [], []
        odom, before = Pose2(), Pose2(*poses[0])
        for i, (x, y, theta) in enumerate(poses):
            pose = Pose2(x, y, theta)
            delta = before.inverse() @ pose
            before = pose
            distance = float(np.hypot(delta.x, delta.y))
            root = np.sqrt(distance)
            odom = odom @ Pose2(
                delta.x + rng.normal(0, distance_noise * root) if distance else 0.0,
                delta.y + rng.normal(0, distance_noise * root) if distance else 0.0,
                delta.theta + rng.normal(0, turn_noise * root + 0.3 * turn_noise * abs(delta.theta)) + bias * distance,
            )
            odometry.append(odom.as_tuple())
            truth.append((start @ pose).as_tuple())
            scans.append(self.scan(pose, rng=rng, stamp=0.1 * i, **sensor))  # type: ignore[arg-type]
        return Drive(scans, np.array(odometry), np.array(truth))


@pytest.fixture
def office() -> SegmentWorld:
    """A corridor 12 x 2 m with a room of 5 x 4 m on either side, doors 0.9 m wide, and some furniture."""
    walls = [
        (0.0, 0.0, 0.0, 2.0), (12.0, 0.0, 12.0, 2.0),
        (0.0, 2.0, 2.0, 2.0), (2.9, 2.0, 12.0, 2.0),
        (0.0, 0.0, 7.0, 0.0), (7.9, 0.0, 12.0, 0.0),
        (0.0, 2.0, 0.0, 6.0), (0.0, 6.0, 5.0, 6.0), (5.0, 6.0, 5.0, 2.0),
        (6.0, 0.0, 6.0, -4.0), (6.0, -4.0, 11.0, -4.0), (11.0, -4.0, 11.0, 0.0),
    ]  # fmt: skip
    return SegmentWorld([*walls, *box(3.8, 4.5, 4.4, 5.5), *box(9.0, -3.4, 10.2, -2.9)])


@pytest.fixture
def ring() -> SegmentWorld:
    """A corridor 2 m wide round a block of 16 x 12 m, with niches that tell places apart."""
    niches = [
        (4.0, 0.0, 4.0, 0.5), (9.0, 0.0, 9.0, 0.35), (20.0, 5.0, 19.4, 5.0), (20.0, 11.0, 19.6, 11.0),
        (14.0, 16.0, 14.0, 15.5), (6.5, 16.0, 6.5, 15.6), (0.0, 12.0, 0.5, 12.0), (0.0, 6.0, 0.4, 6.0),
    ]  # fmt: skip
    return SegmentWorld([*box(0, 0, 20, 16), *box(2, 2, 18, 14), *niches])


@pytest.fixture
def segment_world() -> Callable[[list[tuple[float, float, float, float]]], SegmentWorld]:
    return SegmentWorld


@pytest.fixture
def three_rooms() -> Callable[..., FloorPlan]:
    """Makes a corridor of 12 x 2 m below three rooms of 4 x 3 m; the second also has a door to the third.

    r0 is the corridor, d0 (0.9 m) leads to r1, d1 (0.9 m) to r2, the opening o0 (1.5 m) to r3, d2 from r2 to r3; inner
    walls have 0.2 m.
    """

    def made(name: str, *, outer_walls: float, d2: float) -> FloorPlan:
        outer = [((0, 0), (12, 0)), ((12, 0), (12, 5)), ((0, 5), (12, 5)), ((0, 0), (0, 5))]
        inner = [((0, 2), (12, 2)), ((4, 2), (4, 5)), ((8, 2), (8, 5))]
        thick = [*((segment, outer_walls) for segment in outer), *((segment, 0.2) for segment in inner)]
        return FloorPlan(
            name=name,
            rooms=(
                PlanRoom("r0", "corridor", area_of(0, 0, 12, 2)),
                PlanRoom("r1", "office", area_of(0, 2, 4, 5)),
                PlanRoom("r2", "office", area_of(4, 2, 8, 5)),
                PlanRoom("r3", "office", area_of(8, 2, 12, 5)),
            ),
            walls=tuple(Wall(f"w{i}", segment, thickness) for i, (segment, thickness) in enumerate(thick)),
            doors=(
                PlanDoor("d0", ((1.5, 2.0), (2.4, 2.0)), ("r0", "r1"), opens_into="r1"),
                PlanDoor("d1", ((5.5, 2.0), (6.4, 2.0)), ("r0", "r2"), opens_into="r2"),
                PlanDoor("d2", ((8.0, 3.0), (8.0, 3.0 + d2)), ("r2", "r3"), opens_into="r2"),
            ),
            openings=(Opening("o0", ((9.0, 2.0), (10.5, 2.0)), ("r0", "r3")),),
            start=(3.0, 1.0, 0.0),
        )

    return made


ROUND_METHOD = """
    from dataclasses import dataclass

    from closedrooms.core.room import Room
    from closedrooms.predictor.methods import Method
    from closedrooms.predictor.prediction import Prediction
    from shapely.geometry import Point


    @dataclass(frozen=True, kw_only=True)
    class RoundConfig:
        radius: float = 2.0


    def predict_round(grid, doors, config):
        rooms = tuple(Room(Point(door.midpoint).buffer(config.radius), (door.id,)) for door in doors)
        return Prediction(grid, rooms)


    METHOD = Method("round", "a disc behind every door", RoundConfig, predict_round, disjoint=False)
    NOTHING = 3
    """


@pytest.fixture
def install_round(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[..., None]]:
    """Installs a package beside us that brings the method ``round``, and what else its entry points name."""
    from closedrooms.predictor import methods

    def install(module: str, **names: str) -> None:
        folder = tmp_path / "site"
        metadata = folder / f"{module}-1.0.dist-info"
        metadata.mkdir(parents=True)
        (folder / f"{module}.py").write_text(textwrap.dedent(ROUND_METHOD))
        (metadata / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {module.replace('_', '-')}\nVersion: 1.0\n")
        entries = [f"{name} = {module}:{value}" for name, value in {"round": "METHOD", **names}.items()]
        (metadata / "entry_points.txt").write_text("\n".join(["[closedrooms.methods]", *entries, ""]))
        monkeypatch.syspath_prepend(folder)
        methods._entries.cache_clear()

    yield install
    methods._entries.cache_clear()
