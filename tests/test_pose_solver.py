"""Poses of least energy, compared with another solver; and the spectral gradient method on plain problems."""

from typing import NamedTuple

import numpy as np
import pytest
from scipy.optimize import minimize
from spring_case import Case

from distretarget.ik.pose_solver import FEW_ITERATIONS, ROUND_ITERATIONS
from distretarget.ik.spg import Minimum, Reason, record, scratch_for, spectral_gradient
from distretarget.ik.springs import Springs


class Quadratic(NamedTuple):
    curvature: np.ndarray
    minimum: np.ndarray


def quadratic(x, problem, gradient):
    gradient[:] = problem.curvature * (x - problem.minimum)
    return 0.5 * np.sum(problem.curvature * (x - problem.minimum) ** 2)


def rosenbrock(v, _, gradient):
    x, y = v[0]
    gradient[0, 0] = -400 * x * (y - x**2) - 2 * (1 - x)
    gradient[0, 1] = 200 * (y - x**2)
    return 100 * (y - x**2) ** 2 + (1 - x) ** 2


def uphill(x, problem, gradient):
    value = quadratic(x, problem, gradient)
    gradient[:] = -gradient
    return value


def steepest(_x, gradient, step, _problem, d):
    d[:] = -step * gradient
    return np.sum(d * d)


def into_unit_box(x, gradient, step, _problem, d):
    d[:] = np.minimum(np.maximum(x - step * gradient, -1.0), 1.0) - x
    return np.sum(d * d)


def steepest_in_metric(_x, gradient, step, problem, d):
    d[:] = -step * gradient / problem.curvature
    return np.sum(problem.curvature * d * d)


def solver(objective, direction, adaptive=False):
    """The method, run as Python, which takes x, the problem, the tolerance and the limit."""
    minimise = spectral_gradient(objective, direction, adaptive=adaptive)

    def solve(x, problem, tolerance, limit):
        gradient = np.empty(x.shape)
        value = objective(x, problem, gradient)
        return minimise(x, value, gradient, problem, tolerance, limit, scratch_for(x.shape))

    return solve


free = solver(quadratic, steepest)
boxed = solver(quadratic, into_unit_box)
curved = solver(rosenbrock, steepest)
lying = solver(uphill, steepest)
scaled = solver(quadratic, steepest_in_metric)
adaptive = solver(quadratic, steepest, adaptive=True)
ILL = Quadratic(np.array([[1.0, 10, 100, 1000]]), np.array([[3.0, -2, 0.5, -0.1]]))


def test_one_step_in_the_metric_of_its_curvature_solves_a_quadratic():
    x = np.zeros((1, 4))
    minimum = scaled(x, ILL, 1e-10, 10)
    assert (minimum.iterations, minimum.reason) == (1, Reason.CONVERGED)
    np.testing.assert_allclose(x, ILL.minimum, atol=1e-12)
    x = np.zeros((1, 4))
    found = free(x, ILL, 1e-11, 1000)
    np.testing.assert_allclose(x, ILL.minimum, atol=1e-8)
    assert found.reason == Reason.CONVERGED
    assert found.evaluations >= found.iterations + 1


def test_the_shorter_step_saves_evaluations_of_ill_conditioned_quadratics():
    """Summed over many problems: what one problem takes depends on the last bits of the processor's arithmetic."""
    random, shape, evaluations = np.random.default_rng(0), (1, 50), np.zeros(2)
    for _ in range(25):
        problem = Quadratic(np.geomspace(1.0, 1000.0, 50)[None], random.normal(size=shape))
        ends = np.zeros((2, *shape))
        found = [solve(x, problem, 1e-11, 2000) for solve, x in zip((adaptive, free), ends, strict=True)]
        assert [each.reason for each in found] == 2 * [Reason.CONVERGED]
        np.testing.assert_allclose(ends, [problem.minimum] * 2, atol=1e-8)
        evaluations += [each.evaluations for each in found]
    assert evaluations[0] < 0.95 * evaluations[1]


def test_follows_a_curved_valley_into_bounds_to_a_minimum_or_says_that_it_failed():
    x = np.array([[-1.2, 1.0]])
    assert curved(x, ILL, 1e-10, 5000).reason == Reason.CONVERGED
    np.testing.assert_allclose(x, 1.0, atol=1e-6)
    x = np.zeros((1, 4))
    assert boxed(x, ILL, 1e-11, 1000).reason == Reason.CONVERGED
    np.testing.assert_allclose(x, np.clip(ILL.minimum, -1, 1), atol=1e-8)
    x = ILL.minimum.copy()
    found = free(x, ILL, 1e-10, 1000)
    assert (found.value, found.iterations, found.evaluations, found.reason) == (0.0, 0, 1, Reason.CONVERGED)
    x = np.zeros((1, 4))
    found = lying(x, ILL, 1e-10, 1000)
    assert found.reason == Reason.LINE_SEARCH_FAILED
    assert found.value == pytest.approx(quadratic(x, ILL, np.empty((1, 4))))


@pytest.mark.parametrize("limit", range(1, 40, 3))
def test_returns_the_best_iterate_though_the_search_is_not_monotone(limit):
    x = np.array([[-1.2, 1.0]])
    found = curved(x, ILL, 1e-12, limit)
    assert found.iterations == limit
    assert found.reason == Reason.ITERATION_LIMIT
    assert found.value == pytest.approx(rosenbrock(x, ILL, np.empty((1, 2))))
    shorter = np.array([[-1.2, 1.0]])
    assert found.value <= curved(shorter, ILL, 1e-12, limit - 1).value


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_a_value_that_is_no_number_is_not_converged(value):
    """Where nothing can move, the direction is zero and the method stops at once, whatever the value."""
    log = np.zeros((4, 2))
    record(Minimum(value, 0, 1, Reason.CONVERGED), log, 1)
    assert log[3].tolist() == [0, Reason.LINE_SEARCH_FAILED]


@pytest.mark.parametrize("seed", range(6))
def test_the_minimum_is_that_of_lbfgs_from_the_same_start(seed):
    case = Case(seed)
    v, log = case.solved()
    options = {"ftol": 0, "gtol": 1e-9, "maxiter": 5000}
    start = np.zeros(v[0].size)
    oracle = minimize(case.energy_and_gradient, start, jac=True, method="L-BFGS-B", options=options)
    assert log[3, 0] == Reason.CONVERGED
    assert log[0, 0] == pytest.approx(oracle.fun, rel=1e-6)
    assert log[0, 0] == pytest.approx(case.energy(v[0]), rel=1e-12)
    np.testing.assert_allclose(case.positions(v[0]), case.positions(oracle.x.reshape(case.shape)), atol=1e-4)


def test_a_start_at_the_minimum_is_used():
    case = Case(2, frames=2)
    for values in (case.bones, case.root, *case.springs[2:]):
        values[1] = values[0]
    v, log = case.solved()
    assert log[1, 0] > 0
    assert log[1, 1] <= 1
    np.testing.assert_allclose(v[1], v[0], atol=1e-5)
    case = Case(3, frames=2)
    worse = 2.5 * np.random.default_rng(0).normal(size=(1, *case.shape))
    v, log = case.solved(before=worse)
    expected, once = case.solved(before=np.zeros_like(worse))
    assert log[0, 1] == pytest.approx(once[0, 1], rel=1e-9)
    assert case.energy(worse[0], 1) > case.energy(np.zeros(case.shape), 1)
    np.testing.assert_allclose(v[1], expected[1], atol=1e-9)


def test_the_two_poses_before_are_continued():
    """If the deviation grows at constant speed, extrapolation starts at the minimum."""
    case = Case(4, frames=3)
    case.stiffness[:], springs = 1e-9, case.springs
    springs.A[:] = 0.0
    speed = np.random.default_rng(5).normal(size=case.shape) * 0.1
    before = np.array([speed, 2 * speed])
    springs.A[2, springs.b < 0] = 100.0 * np.eye(3)
    springs.rest[2] = case.positions(3 * speed, 2)[springs.a]
    _, log = case.solved(before=before)
    assert log[0, 2] < 1e-6
    assert log[1, 2] <= 3


def test_no_solved_pose_lies_above_any_of_its_starts():
    case = Case(5, frames=12)
    v, log = case.solved()
    for frame in range(2, 12):
        starts = [np.zeros(case.shape), v[frame - 1], 2 * v[frame - 1] - v[frame - 2]]
        assert log[0, frame] <= min(case.energy(start, frame) for start in starts) * (1 + 1e-12)


@pytest.mark.parametrize("seed", range(4))
def test_a_curvature_that_serves_several_frames_leads_to_the_same_minima(seed):
    case, frames = Case(seed, frames=16), 16
    for values in (case.bones, case.root, *case.springs[2:]):
        values[:] = values[0]
    drift = np.random.default_rng(seed).normal(size=case.springs.rest.shape[1:])
    case.springs.rest[:] += 2e-4 * np.arange(frames)[:, None, None] * drift
    case.springs.A[: frames // 2, 1:] = 0.0  # other springs set in, which move other bones
    v, log = case.solved()
    assert np.count_nonzero(log[1] <= FEW_ITERATIONS) >= frames // 2
    for frame in range(1, frames):
        anew, once = case.solved(before=v[:frame])
        assert log[0, frame] == pytest.approx(once[0, frame], rel=1e-9)
        np.testing.assert_allclose(v[frame], anew[frame], atol=1e-5)


def test_the_curvature_of_the_frame_before_is_tried_ever_more_rarely_where_it_does_not_serve():
    """Each failure costs many iterations; springs whose stiffness changes from frame to frame allow few of them."""
    case, frames, draw = Case(0, frames=96), 96, np.random.default_rng(0)
    for values in (case.bones, case.root, *case.springs[2:]):
        values[:] = values[0]
    case.without_residual()
    case.springs.rest[:] += 1e-3 * draw.normal(size=case.springs.rest.shape)
    case.springs.A[:] *= 10.0 ** draw.uniform(-1.5, 1.5, (frames, len(case.springs.a)))[..., None, None]
    _, log = case.solved()
    assert 2 < np.count_nonzero(log[1] > FEW_ITERATIONS) < 12


@pytest.mark.parametrize(("stiffer", "farther"), [(1e6, 1.0), (1.0, 1e4)])
def test_frames_that_do_not_converge_are_reported_and_no_worse_than_their_start(stiffer, farther):
    case = Case(6)
    case.springs.A[:] *= stiffer
    case.springs.rest[:] *= farther
    v, log = case.solved()
    assert log[3, 0] != Reason.CONVERGED
    assert log[0, 0] == pytest.approx(case.energy(v[0]), rel=1e-9)
    assert log[0, 0] < case.energy(np.zeros(case.shape))


def test_springs_without_weight_may_be_anything():
    case = Case(7, frames=2)
    expected, _ = case.solved()
    case.springs = Springs(
        *(np.append(joints, [0, 1]) for joints in case.springs[:2]),
        *(np.concatenate([values, np.full_like(values[:, :2], 1e30)], axis=1) for values in case.springs[2:]),
    )
    case.springs.A[:, -2:] = 0.0
    v, _ = case.solved()
    np.testing.assert_array_equal(v, expected)


def test_every_frame_also_starts_from_the_copy_whatever_the_frames_before_took():
    """The first frame takes several rounds; in the second the copy itself is the minimum, and is found at once."""
    case = Case(6, frames=2).without_residual()
    case.springs.A[0] *= 1e4
    case.springs.rest[0] = 10.0 * np.random.default_rng(0).normal(size=case.springs.rest[0].shape)
    v, log = case.solved()
    assert log[1, 0] > ROUND_ITERATIONS
    assert log[1, 1] == 0
    np.testing.assert_array_equal(v[1], 0.0)
