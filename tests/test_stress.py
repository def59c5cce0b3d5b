"""Eq. (1) and (2): compared with a naive version and finite differences, and their invariances."""

import numpy as np
import pytest
from scipy.optimize import approx_fprime
from scipy.spatial.transform import Rotation

from distretarget.distances import LANES, filled, stress_and_gradient, target_distances


def naive_stress(x, delta, pi):
    sigma = 0.0
    for u in range(x.shape[1]):
        for v in range(u):
            sigma += 0.5 * pi[u, v] * (np.linalg.norm(x[:, u] - x[:, v]) - delta[u, v]) ** 2
    return sigma


@pytest.fixture(params=[2, 3, 9])
def problem(request):
    draw = np.random.default_rng(request.param)
    x = draw.normal(size=(3, request.param))
    delta, pi = draw.uniform(0, 2, (2, request.param, request.param))
    delta, pi = delta + delta.T, pi + pi.T
    np.fill_diagonal(delta, 0), np.fill_diagonal(pi, 0)
    return x, delta, pi


def stress(x, delta, pi):
    return stress_and_gradient(x, delta, pi, np.empty_like(x))


def test_is_the_sum_of_the_equation(problem):
    assert stress(*problem) == pytest.approx(naive_stress(*problem), rel=1e-12)


def test_gradient_agrees_with_finite_differences(problem):
    x, delta, pi = problem
    gradient = np.empty_like(x)
    stress_and_gradient(x, delta, pi, gradient)
    expected = approx_fprime(x.ravel(), lambda y: naive_stress(y.reshape(x.shape), delta, pi), 1e-7)
    np.testing.assert_allclose(gradient.ravel(), expected, rtol=1e-5, atol=1e-5)


def test_columns_that_fill_vectors_count_nothing(problem):
    x, delta, pi = problem
    gradient, more = np.empty_like(x), np.zeros(filled(x).shape)
    sigma = stress_and_gradient(x, delta, pi, gradient)
    assert stress_and_gradient(*map(filled, problem), more) == pytest.approx(sigma, rel=1e-12)
    assert more.shape[1] % LANES == 0
    np.testing.assert_allclose(more[:, : x.shape[1]], gradient, rtol=1e-12, atol=1e-12)
    np.testing.assert_array_equal(more[:, x.shape[1] :], 0.0)


def test_sees_no_translation_rotation_or_mirror(problem):
    x, delta, pi = problem
    turned = Rotation.from_rotvec([0.3, -2, 0.7]).as_matrix() @ x + np.array([[5.0], [-3], [2]])
    assert stress(turned, delta, pi) == pytest.approx(stress(x, delta, pi), rel=1e-12)
    assert stress(-x, delta, pi) == pytest.approx(stress(x, delta, pi), rel=1e-12)


def test_coinciding_points_pull_with_no_force():
    x = np.zeros((3, 2))
    gradient = np.full_like(x, np.nan)
    sigma = stress_and_gradient(x, np.array([[0, 2.0], [2, 0]]), np.array([[0, 1.0], [1, 0]]), gradient)
    assert sigma == pytest.approx(2.0)
    np.testing.assert_array_equal(gradient, 0.0)


def test_target_distances_are_those_of_equation_1():
    x = np.random.default_rng(4).normal(size=(3, 6))
    ratio = np.random.default_rng(5).uniform(0.5, 2, (6, 6))
    delta = np.empty((6, 6))
    target_distances(x, ratio, delta)
    expected = ratio * np.linalg.norm(x[:, :, None] - x[:, None, :], axis=0)
    np.testing.assert_allclose(delta, expected, rtol=1e-14)
