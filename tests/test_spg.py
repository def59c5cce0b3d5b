"""The solver on problems that have nothing to do with skeletons."""

from typing import NamedTuple

import numpy as np
import pytest

from distretarget.ik.spg import Minimum, Reason, record, scratch_for, spectral_gradient


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


def test_finds_the_minimum_of_an_ill_conditioned_quadratic():
    x = np.zeros((1, 4))
    found = free(x, ILL, 1e-11, 1000)
    np.testing.assert_allclose(x, ILL.minimum, atol=1e-8)
    assert found.reason == Reason.CONVERGED
    assert found.evaluations >= found.iterations + 1


def test_the_shorter_step_saves_evaluations_of_ill_conditioned_quadratics():
    """Summed over many problems: what one problem takes depends on the last bits of the processor's arithmetic."""
    random, shape, evaluations = np.random.default_rng(0), (1, 50), np.zeros(2)
    for _ in range(100):
        problem = Quadratic(np.geomspace(1.0, 1000.0, 50)[None], random.normal(size=shape))
        ends = np.zeros((2, *shape))
        found = [solve(x, problem, 1e-11, 2000) for solve, x in zip((adaptive, free), ends, strict=True)]
        assert [each.reason for each in found] == 2 * [Reason.CONVERGED]
        np.testing.assert_allclose(ends, [problem.minimum] * 2, atol=1e-8)
        evaluations += [each.evaluations for each in found]
    assert evaluations[0] < 0.95 * evaluations[1]


def test_projection_keeps_the_variables_in_the_feasible_set():
    x = np.zeros((1, 4))
    assert boxed(x, ILL, 1e-11, 1000).reason == Reason.CONVERGED
    np.testing.assert_allclose(x, np.clip(ILL.minimum, -1, 1), atol=1e-8)


def test_follows_a_curved_valley():
    x = np.array([[-1.2, 1.0]])
    assert curved(x, ILL, 1e-10, 5000).reason == Reason.CONVERGED
    np.testing.assert_allclose(x, 1.0, atol=1e-6)


def test_takes_no_step_from_a_minimum():
    x = ILL.minimum.copy()
    found = free(x, ILL, 1e-10, 1000)
    assert (found.value, found.iterations, found.evaluations, found.reason) == (0.0, 0, 1, Reason.CONVERGED)


def test_a_failed_line_search_is_not_converged():
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
