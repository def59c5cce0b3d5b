"""The paper's distances, priorities and stress: the exact answers, and the gradient."""

import numpy as np
import pytest
from bodies import other_lengths, person, tree_of
from scipy.optimize import approx_fprime
from table_one import table_one

from distretarget.distances import LANES, distance_problem, padded, stress_and_gradient


def problem_of(source, target):
    return distance_problem(source, target, np.arange(len(target)))


def with_zero_bones(body, joints):
    offsets = np.array(body.offsets)
    offsets[[body.index(joint) for joint in joints]] = 0.0
    return body.with_offsets(offsets)


def test_joints_that_coincide_on_both_bodies_are_one_point():
    body = with_zero_bones(person(), ["LeftHip", "RightHip", "Head_End"])
    problem = problem_of(body, other_lengths(body))
    gone = {body.index(joint) for joint in ("LeftHip", "RightHip", "Head_End")}
    assert set(problem.targets) == set(range(len(body))) - gone
    knees = [list(problem.targets).index(body.index(f"{side}Knee")) for side in ("Left", "Right")]
    largest = 2 / (problem.priorities[problem.priorities > 0].min())
    assert problem.priorities[knees[0], 0] == 1.0
    assert problem.priorities[knees[0], knees[1]] == pytest.approx((largest - 3 + 2) / largest)


def test_a_bone_that_only_the_target_has_gets_no_priority():
    target = table_one()
    source = with_zero_bones(target, ["LeftHip"])
    problem = problem_of(source, target)
    hip = target.index("LeftHip")
    assert len(problem) == 22
    assert problem.priorities[0, hip] == 0.0
    assert problem.priorities[hip, target.index("LeftKnee")] == 1.0
    assert np.all(np.isfinite(problem.ratio))


def test_unmatched_joints_are_no_points():
    body = person()
    drivers = np.arange(len(body))
    drivers[body.end_sites] = -1
    problem = distance_problem(body, other_lengths(body), drivers)
    assert len(problem) == 22
    assert problem.priorities[np.triu_indices(22, 1)].min() == pytest.approx(1 / 6)
    body = tree_of([[0, 0, 0], [0, 2, 0]])
    problem = problem_of(body, body)
    np.testing.assert_array_equal(problem.priorities, [[0, 1], [1, 0]])
    np.testing.assert_allclose(problem.ratio, [[0, 0.5], [0.5, 0]])


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


def test_columns_that_fill_vectors_count_nothing(problem):
    x, delta, pi = problem
    gradient, more = np.empty_like(x), np.zeros(padded(x).shape)
    sigma = stress_and_gradient(x, delta, pi, gradient)
    assert stress_and_gradient(*map(padded, problem), more) == pytest.approx(sigma, rel=1e-12)
    assert more.shape[1] % LANES == 0
    np.testing.assert_allclose(more[:, : x.shape[1]], gradient, rtol=1e-12, atol=1e-12)
    np.testing.assert_array_equal(more[:, x.shape[1] :], 0.0)


def test_coinciding_points_pull_with_no_force():
    x = np.zeros((3, 2))
    gradient = np.full_like(x, np.nan)
    sigma = stress_and_gradient(x, np.array([[0, 2.0], [2, 0]]), np.array([[0, 1.0], [1, 0]]), gradient)
    assert sigma == pytest.approx(2.0)
    np.testing.assert_array_equal(gradient, 0.0)


def test_the_stress_is_the_sum_of_the_equation_and_its_gradient_that_of_finite_differences(problem):
    x, delta, pi = problem
    gradient = np.empty_like(x)
    assert stress_and_gradient(x, delta, pi, gradient) == pytest.approx(naive_stress(*problem), rel=1e-12)
    expected = approx_fprime(x.ravel(), lambda y: naive_stress(y.reshape(x.shape), delta, pi), 1e-7)
    np.testing.assert_allclose(gradient.ravel(), expected, rtol=1e-5, atol=1e-5)
