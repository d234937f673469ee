"""The whole simulation: repeatable, tidy, and clear about what it does not take."""

import dataclasses
import math
import subprocess
import sys

import numpy as np
import pytest
import shapely

from closedrooms.core.errors import InvalidInputError
from closedrooms.core.observation import Observation
from closedrooms.core.pose import Pose2
from closedrooms.core.robot import RobotConfig
from closedrooms.sim.config import (
    LIDAR_PRESETS,
    NOISE_LEVELS,
    FaultConfig,
    LidarConfig,
    NoiseConfig,
    SimConfig,
    lidar_preset,
    noise_level,
)
from closedrooms.sim.simulation import Simulation
from closedrooms.worlds.plan import FloorPlan


def drive_around(plan: FloorPlan, config: SimConfig, seed: int, steps: int = 30) -> list[tuple[Observation, Pose2]]:
    """What was observed, each with the true pose at that time."""
    with Simulation(plan, ["hinged", "sliding"], config, seed) as sim:
        seen = []
        for i in range(steps):
            seen.append((sim.observe(), sim.map_T_robot))
            sim.step(0.5, 0.5 * math.sin(i / 5), 0.1)
            if i == 10:
                sim.open_door("hinged")
        return seen


def as_bytes(seen: list[tuple[Observation, Pose2]]) -> bytes:
    return b"".join(
        np.concatenate((o.scan.ranges, o.odometry.as_tuple(), true.as_tuple(), [o.stamp])).tobytes()
        + repr(o.sightings).encode()
        for o, true in seen
    )


@pytest.mark.simulation
def test_the_same_seed_gives_the_same_bytes_and_another_does_not(plan: FloorPlan) -> None:
    config = SimConfig(noise=noise_level("high"))
    assert as_bytes(drive_around(plan, config, 4)) == as_bytes(drive_around(plan, config, 4))
    assert as_bytes(drive_around(plan, config, 4)) != as_bytes(drive_around(plan, config, 5))


@pytest.mark.simulation
def test_noise_of_one_source_leaves_the_others_alone(plan: FloorPlan) -> None:
    base = noise_level("high")
    first, _ = drive_around(plan, SimConfig(noise=base), 4, 5)[-1]
    odometry, _ = drive_around(plan, SimConfig(noise=dataclasses.replace(base, distance=0.5)), 4, 5)[-1]
    assert first.odometry != odometry.odometry
    np.testing.assert_array_equal(first.scan.ranges, odometry.scan.ranges)
    dropouts, _ = drive_around(plan, SimConfig(noise=dataclasses.replace(base, dropouts=0.5)), 4, 5)[-1]
    both = np.isfinite(first.scan.ranges) & np.isfinite(dropouts.scan.ranges)
    assert 100 < both.sum() < 600
    np.testing.assert_array_equal(first.scan.ranges[both], dropouts.scan.ranges[both])
    assert first.odometry == dropouts.odometry


@pytest.mark.simulation
def test_noise_does_not_change_where_the_robot_is(plan: FloorPlan) -> None:
    quiet = drive_around(plan, SimConfig(noise=noise_level("none")), 0)
    loud = drive_around(plan, SimConfig(noise=noise_level("high")), 0)
    assert [true for _, true in quiet] == [true for _, true in loud]


@pytest.mark.simulation
def test_the_range_noise_is_as_large_as_set(plan: FloorPlan) -> None:
    config = SimConfig(noise=NoiseConfig(range_sd=0.05, dropouts=0.02, outliers=0.01))
    with Simulation(plan, [], config, 0) as sim:
        true = sim.true_ranges(sim.world_T_robot)
        ranges = np.array([sim.observe().scan.ranges for _ in range(60)])
    error = (ranges - true).ravel()
    dropped = np.isnan(error)
    assert dropped.mean() == pytest.approx(0.02, abs=0.003)
    wild = np.abs(error[~dropped]) > 0.3
    assert 0.007 < wild.mean() < 0.012
    assert error[~dropped][~wild].std() == pytest.approx(0.05, rel=0.03)
    assert abs(error[~dropped][~wild].mean()) < 0.002
    outliers = ranges.ravel()[~dropped][wild]
    assert outliers.min() >= config.lidar.range_min
    assert outliers.max() < config.lidar.range_max
    assert np.mean(outliers) == pytest.approx(10.0, rel=0.1)


@pytest.mark.simulation
def test_what_is_too_near_gives_no_measurement(plan: FloorPlan) -> None:
    config = SimConfig(lidar=LidarConfig(range_min=3.0), noise=noise_level("none"))
    with Simulation(plan, ["hinged"], config, 0) as sim:
        seen = sim.observe()
        true = sim.true_ranges(sim.world_T_robot)
    np.testing.assert_array_equal(np.isnan(seen.scan.ranges), true < 3.0)
    assert seen.sightings == ()


@pytest.mark.simulation
def test_without_noise_the_odometry_is_the_pose_in_the_map_even_when_it_slides(plan: FloorPlan) -> None:
    with Simulation(plan, ["hinged"], SimConfig(noise=noise_level("none")), 0) as sim:
        touched = False
        for _ in range(150):
            sim.step(0.8, 0.1, 0.1)
            touched |= sim.collided
        seen, true = sim.observe(), sim.map_T_robot
    assert touched
    assert seen.odometry.distance(true) < 1e-9
    assert seen.odometry.theta == pytest.approx(true.theta, abs=1e-9)


@pytest.mark.simulation
def test_the_map_frame_is_the_start_pose_with_the_heading_that_was_set(plan: FloorPlan) -> None:
    for heading, expected in ((None, 0.3), (1.0, 1.0)):
        with Simulation(plan, [], SimConfig(heading=heading), 0) as sim:
            assert sim.world_T_map == Pose2(2.0, 2.0, expected)
            assert sim.map_T_robot.distance(Pose2()) < 1e-12
            sim.step(0.5, 0.0, 1.0)
            again = sim.world_T_map @ sim.map_T_robot
            assert again.distance(sim.world_T_robot) < 1e-12


@pytest.mark.simulation
def test_time_passes_as_told(plan: FloorPlan) -> None:
    with Simulation(plan, [], SimConfig(), 0) as sim:
        assert sim.time == 0.0
        sim.step(0.0, 0.0, 0.25)
        sim.step(1.0, 0.0, 0.5)
        assert sim.time == pytest.approx(0.75)
        assert sim.observe().stamp == sim.time
        assert sim.observe().scan.stamp == sim.time


def clients() -> int:
    import pybullet

    return sum(pybullet.isConnected(physicsClientId=i) for i in range(64))


@pytest.mark.simulation
def test_every_client_is_disconnected_whatever_happens(plan: FloorPlan) -> None:
    with Simulation(plan, [], SimConfig(), 0):
        before = clients() - 1
    for _ in range(5):
        with Simulation(plan, [], SimConfig(), 0) as sim:
            sim.observe()
        with pytest.raises(InvalidInputError), Simulation(plan, ["nowhere"], SimConfig(), 0):
            pass
        with pytest.raises(RuntimeError, match="stop"), Simulation(plan, [], SimConfig(), 0):
            raise RuntimeError("stop")
    assert clients() == before


@pytest.mark.simulation
def test_a_start_where_the_robot_does_not_fit_is_refused(plan: FloorPlan) -> None:
    inside, beside = (6.0, 4.0, 0.0), (6.0, 3.8, 0.0)
    for start in (inside, beside):
        with (
            pytest.raises(InvalidInputError, match="start"),
            Simulation(dataclasses.replace(plan, start=start), ["double"], SimConfig(), 0),
        ):
            pass


@pytest.mark.simulation
def test_a_command_that_is_no_number_is_refused(plan: FloorPlan) -> None:
    with Simulation(plan, [], SimConfig(), 0) as sim:
        for v, w, duration in ((math.nan, 0.0, 0.1), (0.0, math.nan, 0.1), (0.0, 0.0, 0.0), (0.0, 0.0, math.inf)):
            with pytest.raises(InvalidInputError):
                sim.step(v, w, duration)


def test_settings_that_make_no_sense_are_refused() -> None:
    for make in (
        lambda: LidarConfig(beams=0),
        lambda: LidarConfig(field_of_view=7.0),
        lambda: LidarConfig(range_min=5.0, range_max=4.0),
        lambda: LidarConfig(rate=0.0),
        lambda: RobotConfig(radius=-0.1),
        lambda: RobotConfig(max_speed=math.inf),
        lambda: NoiseConfig(dropouts=1.5),
        lambda: NoiseConfig(distance=math.nan),
        lambda: SimConfig(heading=math.nan),
        lambda: SimConfig(lidar=LidarConfig(mount=(0.5, 0.0, 0.0))),
        lambda: noise_level("loud"),
        lambda: lidar_preset("laser"),
    ):
        with pytest.raises(InvalidInputError):
            make()


@pytest.mark.parametrize("name", list(LIDAR_PRESETS))
@pytest.mark.simulation
def test_every_lidar_preset_scans(plan: FloorPlan, name: str) -> None:
    lidar = lidar_preset(name)
    with Simulation(plan, [], SimConfig(lidar=lidar), 0) as sim:
        scan = sim.observe().scan
    assert scan.ranges.shape == (lidar.beams,)
    span = scan.angle_increment * (lidar.beams - (lidar.field_of_view < 6.28))
    assert span == pytest.approx(lidar.field_of_view)
    assert scan.angles[0] == pytest.approx(-lidar.field_of_view / 2)


def test_the_configuration_imports_nothing_heavy() -> None:
    code = "import sys, closedrooms.sim.config; print(*sorted({m.split('.')[0] for m in sys.modules}))"
    loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()
    assert not {"numpy", "shapely", "pybullet", "trimesh"} & set(loaded)


@pytest.mark.simulation
def test_pybullet_keeps_quiet_when_it_is_imported() -> None:
    code = "from closedrooms.sim.physics_world import PhysicsWorld\nwith PhysicsWorld(): pass"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout + done.stderr == ""


def test_the_levels_can_be_named() -> None:
    assert all(noise_level(name) is level for name, level in NOISE_LEVELS.items())
    assert SimConfig().noise == NOISE_LEVELS["medium"]


@pytest.mark.simulation
@pytest.mark.parametrize(("gap", "fits"), [(0.2002, True), (0.2, False), (0.19, False)])
def test_a_robot_starts_where_it_does_not_touch(plan: FloorPlan, gap: float, fits: bool) -> None:
    # The wall's face is at x = 0.08; the closed leaf of a door, and furniture, count as well.
    closed = Simulation(dataclasses.replace(plan, start=(1.95, 4.0 - 0.025 - gap, 0.0)), ["hinged"], SimConfig(), 0)
    for sim in (
        Simulation(dataclasses.replace(plan, start=(0.08 + gap, 2.0, 0.0)), [], SimConfig(), 0),
        Simulation(dataclasses.replace(plan, start=(1.0, 7.5 - gap, 0.0)), [], SimConfig(), 0),
        closed,
    ):
        if fits:
            with sim:
                pass
        else:
            with pytest.raises(InvalidInputError, match=r"is 0\.(200|190) m from a wall"), sim:
                pass


@pytest.mark.simulation
def test_sweeps_follow_each_other_at_the_rate_of_the_lidar(plan: FloorPlan) -> None:
    for rate in (5.0, 40.0):
        with Simulation(plan, [], SimConfig(lidar=LidarConfig(rate=rate)), 0) as sim:
            assert sim.period == pytest.approx(1.0 / rate)


@pytest.mark.simulation
def test_a_long_step_is_as_many_short_ones_whatever_moves_meanwhile(plan: FloorPlan) -> None:
    def after(pieces: int, **settings: object) -> tuple[float, ...]:
        config = SimConfig(noise=noise_level("none"), **settings)  # type: ignore[arg-type]
        with Simulation(plan, ["hinged"], config, 0) as sim:
            sim.open_door("hinged")
            for _ in range(pieces):
                sim.step(0.4, 0.3, 1.0 / pieces)
            people = [mover.outline.centroid.coords[0] for mover in sim.movers]
            return (*sim.world_T_robot.as_tuple(), sim.time, sim.door_states()["hinged"], *sum(people, ()))

    for settings in ({}, {"people": 2}):
        whole, cut = after(1, **settings), after(10, **settings)
        assert whole == pytest.approx(cut, abs=1e-3)
        assert whole[3] == pytest.approx(1.0)
        assert whole[4] == pytest.approx(0.5)


@pytest.mark.simulation
def test_the_path_that_a_rolling_sweep_needs_is_kept_and_no_more(plan: FloorPlan) -> None:
    config = SimConfig(lidar=LidarConfig(sweep="rolling", rate=10.0), noise=noise_level("none"))
    with Simulation(dataclasses.replace(plan, start=(2.0, 2.0, 0.0)), [], config, 0) as sim:
        for number in range(1, 30):
            sim.step(0.5, 0.0, 0.07)
            stamps = sim._path[:, 0]
            assert (np.diff(stamps) > 0).all()
            assert stamps[-1] == pytest.approx(0.07 * number)
            # From before the first beam on, and of what lies before that one row.
            begin = sim.time - 0.1
            assert stamps[0] <= max(begin, 0.0) + 1e-9
            assert np.sum(stamps <= begin) <= 1
            poses = sim._beam_poses()
            assert poses is not None
            assert poses.shape == (720, 3)
            expected = np.interp(sim.time - 0.1 * (1.0 - (np.arange(720) + 1) / 720), stamps, sim._path[:, 1])
            assert poses[:, 0] == pytest.approx(expected, abs=1e-6)
    with Simulation(plan, [], SimConfig(), 0) as sim:
        sim.step(0.5, 0.0, 0.5)
        assert sim._beam_poses() is None
        assert len(sim._path) == 1


@pytest.mark.simulation
def test_nobody_begins_at_the_robots_start(plan: FloorPlan) -> None:
    with Simulation(plan, [], SimConfig(people=15, clutter=15), 1) as sim:
        assert len(sim.movers) == 30
        away = [mover.outline.centroid.distance(shapely.Point(2.0, 2.0)) for mover in sim.movers]
    # Two radii and a metre.
    assert min(away) >= 1.4
    assert min(away) < 3.0
    with Simulation(plan, [], SimConfig(), 1) as sim:
        assert sim.movers == []


@pytest.mark.simulation
def test_unequal_wheels_count_by_the_distance_between_them(plan: FloorPlan) -> None:
    for radius in (0.15, 0.25):
        config = SimConfig(
            robot=RobotConfig(radius=radius), faults=FaultConfig(unequal_wheels=0.02), noise=noise_level("none")
        )
        with Simulation(dataclasses.replace(plan, start=(2.0, 2.0, 0.0)), [], config, 0) as sim:
            sim.step(1.0, 0.0, 3.0)
            driven = sim.map_T_robot.x
            # On a track of 1.5 radii.
            assert sim.observe().odometry.theta == pytest.approx(0.02 / (1.5 * radius) * driven)


@pytest.mark.simulation
def test_a_lost_scan_shows_no_phantoms_either(plan: FloorPlan) -> None:
    for lost, shown in ((0.0, True), (1.0, False)):
        config = SimConfig(faults=FaultConfig(lost_scans=lost, phantom_doors=50))
        with Simulation(plan, ["hinged"], config, 0) as sim:
            seen = [sim.observe() for _ in range(5)]
        assert any(observation.sightings for observation in seen) == shown
        assert all(np.isnan(observation.scan.ranges).all() != shown for observation in seen)
        if shown:
            names = {sighting.id for observation in seen for sighting in observation.sightings}
            assert "hinged" in names
            assert any(name.startswith("phantom") for name in names)
