"""The curvature of springs: against finite differences of the gradient."""

import numpy as np
import pytest
from spring_case import Case, at

from distretarget.solve.articulation import lever_arms
from distretarget.solve.curvature import factorise, scale, scale_gradient, spring_curvature, unscale


@pytest.mark.parametrize("kind", ["grounded", "between joints", "both"])
@pytest.mark.parametrize("seed", range(3))
def test_the_curvature_of_springs_at_rest_is_the_hessian_of_the_energy(seed, kind):
    case = Case(seed).without_residual()
    off = {"grounded": case.springs.b >= 0, "between joints": case.springs.b < 0, "both": False}[kind]
    case.springs.w[0, off] = 0.0
    n = 3 * len(case.stiffness)
    U = np.zeros((n, n))
    case.positions(np.zeros(case.shape))
    spring_curvature(case.body, case.scratch, at(case.springs, 0), U)
    factorise(U)
    U = np.triu(U)
    h = 1e-5
    steps = h * np.eye(n)
    slopes = [case.energy_and_gradient(step)[1] - case.energy_and_gradient(-step)[1] for step in steps]
    np.testing.assert_allclose(U.T @ U, np.array(slopes) / (2 * h), atol=1e-7)


def test_lever_arms_are_updated_with_the_curvature():
    case = Case(0)
    U = np.zeros((3 * len(case.stiffness),) * 2)
    case.positions(np.ones(case.shape))
    spring_curvature(case.body, case.scratch, at(case.springs, 0), U)
    arms = case.scratch.arms.copy()
    lever_arms(case.body, case.scratch)
    np.testing.assert_array_equal(case.scratch.arms, arms)
    case.positions(np.zeros(case.shape))
    lever_arms(case.body, case.scratch)
    assert np.abs(case.scratch.arms - arms).max() > 0.1


def test_scaled_unknowns_and_their_gradient_are_those_of_the_factor():
    draw = np.random.default_rng(0)
    H = draw.normal(size=(9, 9))
    U = H @ H.T + np.eye(9)
    factorise(U)
    v, gradient, z, back = draw.normal(size=(4, 3, 3))
    scale(U, v, z)
    np.testing.assert_allclose(z.ravel(), np.triu(U) @ v.ravel())
    unscale(U, z, back)
    np.testing.assert_allclose(back, v)
    scaled = gradient.copy()
    scale_gradient(U, scaled)
    np.testing.assert_allclose(np.triu(U).T @ scaled.ravel(), gradient.ravel())
