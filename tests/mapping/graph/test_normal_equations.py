"""One damped step of the sparse system, against the dense one."""

import numpy as np
import pytest

from closedrooms.core.pose import Pose2
from closedrooms.mapping.graph.normal_equations import LARGEST_TURN, Pattern
from closedrooms.mapping.graph.pose_graph import Edge, _errors, _jacobians, _squared, optimise


def problem(seed: int, poses: int = 7, loops: int = 4) -> tuple[np.ndarray, np.ndarray, list[np.ndarray]]:
    rng = np.random.default_rng(seed)
    source = np.concatenate((np.arange(poses - 1), rng.integers(0, poses - 2, loops)))
    target = np.concatenate((np.arange(1, poses), np.full(loops, poses - 1)))
    count = len(source)
    half = rng.normal(size=(count, 3, 3))
    information = half @ half.transpose(0, 2, 1) + np.eye(3)
    arrays = [
        rng.normal(size=(count, 3, 3)),
        rng.normal(size=(count, 3, 3)),
        rng.normal(scale=0.1, size=(count, 3)),
        information,
    ]
    return source, target, arrays


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("damping", [0.0, 0.3])
def test_a_step_solves_the_damped_normal_equations(seed: int, damping: float) -> None:
    source, target, (to_a, to_b, errors, information) = problem(seed)
    step = Pattern(source, target, 7).solve(to_a, to_b, errors, information, damping)
    jacobian = np.zeros((3 * len(source), 21))
    weight = np.zeros((3 * len(source),) * 2)
    for number, (a, b) in enumerate(zip(source, target, strict=True)):
        rows = slice(3 * number, 3 * number + 3)
        jacobian[rows, 3 * a : 3 * a + 3] += to_a[number]
        jacobian[rows, 3 * b : 3 * b + 3] += to_b[number]
        weight[rows, rows] = information[number]
    # The first pose does not move.
    free = jacobian[:, 3:]
    hessian = free.T @ weight @ free
    hessian += np.diag(damping * np.diag(hessian) + 1e-9)
    expected = np.linalg.solve(hessian, -free.T @ weight @ errors.ravel()).reshape(-1, 3)
    turn = np.abs(expected[:, 2]).max()
    if turn > LARGEST_TURN:
        expected *= LARGEST_TURN / turn
    assert step.shape == (7, 3)
    assert step[0].tolist() == [0.0, 0.0, 0.0]
    assert step[1:] == pytest.approx(expected, rel=1e-6, abs=1e-9)


def test_no_pose_turns_by_more_than_an_eighth_at_once() -> None:
    source, target, (to_a, to_b, errors, information) = problem(1)
    small = Pattern(source, target, 7).solve(to_a, to_b, 1e-3 * errors, information, 0.1)
    large = Pattern(source, target, 7).solve(to_a, to_b, 1e3 * errors, information, 0.1)
    assert np.abs(large[:, 2]).max() == pytest.approx(np.pi / 4)
    assert large / np.abs(large).max() == pytest.approx(small / np.abs(small).max(), abs=1e-9)


@pytest.mark.parametrize("seed", range(3))
def test_derivatives_are_those_of_finite_differences(seed: int) -> None:
    rng = np.random.default_rng(seed)
    poses = rng.normal(size=(4, 3))
    source, target = np.array([0, 1, 2, 0]), np.array([1, 2, 3, 3])
    measured = rng.normal(scale=0.3, size=(4, 3))
    to_a, to_b = _jacobians(poses, source, target, measured)
    for edge in range(4):
        for ends, found in ((source, to_a), (target, to_b)):
            for axis in range(3):
                shift = np.zeros((4, 3))
                shift[ends[edge], axis] = 1e-6
                slope = (
                    _errors(poses + shift, source, target, measured) - _errors(poses - shift, source, target, measured)
                ) / 2e-6
                assert found[edge][:, axis] == pytest.approx(slope[edge], abs=1e-6)


def test_an_edge_is_off_by_what_leads_from_its_measurement_to_its_poses() -> None:
    rng = np.random.default_rng(5)
    a, b, measured = (Pose2(*values) for values in rng.normal(size=(3, 3)))
    x = np.array([a.as_tuple(), b.as_tuple()])
    errors = _errors(x, np.array([0]), np.array([1]), np.array([measured.as_tuple()]))
    expected = measured.inverse() @ (a.inverse() @ b)
    assert errors[0] == pytest.approx(expected.as_tuple())
    information = np.diag([1.0, 4.0, 9.0])
    assert _squared(errors, information[None])[0] == pytest.approx(errors[0] @ information @ errors[0])


def line(*loops: Edge) -> list[Edge]:
    return [*(Edge(n, n + 1, Pose2(1.0), np.diag([100.0, 100.0, 100.0]), 1.0) for n in range(3)), *loops]


def test_a_loop_has_half_its_weight_at_the_kernel() -> None:
    # A spring from the first to the last of four poses in a row, that wants it 2 m farther than the others do.
    start = np.array([(0.0, 0, 0), (1.0, 0, 0), (2.0, 0, 0), (3.0, 0, 0)])
    information = np.diag([25.0, 25.0, 25.0])
    solution = optimise(start, line(Edge(0, 3, Pose2(5.0), information, 1.0, loop=True)), kernel=4.0, iterations=100)
    # Cauchy: three springs of 100 in a row are one of 33.3; the loop pulls by 25 off / (1 + 25 off^2 / 16).
    off = 5.0 - solution.poses[3, 0]
    assert 100.0 / 3.0 * (2.0 - off) == pytest.approx(25.0 * off / (1.0 + 25.0 * off**2 / 16.0), rel=1e-3)
    assert solution.errors[-1] == pytest.approx(25.0 * off**2, rel=1e-6)
    assert solution.errors[:3] == pytest.approx([100.0 * ((2.0 - off) / 3.0) ** 2] * 3, rel=1e-2)
    # What is measured is pulled by its whole weight.
    whole = optimise(start, line(Edge(0, 3, Pose2(5.0), information, 1.0)), kernel=4.0, iterations=100)
    assert 5.0 - whole.poses[3, 0] == pytest.approx(2.0 * (100.0 / 3.0) / (100.0 / 3.0 + 25.0), rel=1e-3)
    # And headings come out between -pi and pi.
    turned = np.array([(0.0, 0, 0), (1.0, 0, 7.0), (2.0, 0, -7.0), (3.0, 0, 3.2)])
    assert np.abs(optimise(turned, line(), kernel=4.0).poses[:, 2]).max() <= np.pi


def test_a_guess_far_off_is_damped_until_it_gets_better() -> None:
    rng = np.random.default_rng(0)
    angles = np.linspace(0.0, 5.0, 12)
    truth = [Pose2(3 * np.cos(t), 3 * np.sin(t), t + np.pi / 2) for t in angles]
    edges = [
        Edge(i, i + 1, truth[i].inverse() @ truth[i + 1], np.diag([100.0, 100.0, 400.0]), 1.0)
        for i in range(len(truth) - 1)
    ]
    edges.append(Edge(0, 11, truth[0].inverse() @ truth[11], np.diag([100.0, 100.0, 400.0]), 1.0))
    exact = np.array([pose.as_tuple() for pose in truth])
    guess = exact + rng.normal(scale=0.8, size=exact.shape)
    guess[0] = exact[0]
    solution = optimise(guess, edges, kernel=4.0, iterations=60)
    assert solution.errors.sum() < 1e-4
    assert solution.poses[:, :2] == pytest.approx(exact[:, :2], abs=1e-3)
