"""The curvature of springs: against finite differences of the gradient."""

import numpy as np
import pytest
from spring_case import Case, at

from distretarget.solve.articulation import lever_arms
from distretarget.solve.curvature import active_curvature, factorise, scale, scale_gradient, unscale


def curvature_at(case, v):
    """The curvature at a pose, and the active parts."""
    H, active = np.zeros((v.size, v.size)), np.zeros(len(v), np.intp)
    case.positions(v)
    return H, active[: active_curvature(v, case.body, case.scratch, at(case.springs, 0), H, active)]


@pytest.mark.parametrize("kind", ["grounded", "between joints", "both"])
@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("size", [0.0, 1e-5, 0.7, 2.5])
def test_the_curvature_of_springs_at_rest_is_the_hessian_of_the_energy(seed, kind, size):
    """At the copy's pose and far from it, where the unknowns are no small turns."""
    case = Case(seed)
    v = size * np.random.default_rng(seed).normal(size=case.shape)
    case.without_residual(v)
    off = {"grounded": case.springs.b >= 0, "between joints": case.springs.b < 0, "both": False}[kind]
    case.springs.A[0, off] = 0.0
    U, active = curvature_at(case, v)
    factorise(U, 3 * len(active))
    U = np.triu(U)[: 3 * len(active), : 3 * len(active)]
    h = 1e-5
    steps = h * np.eye(v.size)
    slopes = [case.energy_and_gradient(v.ravel() + s)[1] - case.energy_and_gradient(v.ravel() - s)[1] for s in steps]
    unknowns = (3 * active[:, None] + np.arange(3)).ravel()
    hessian = np.array(slopes) / (2 * h)
    np.testing.assert_allclose(U.T @ U, hessian[np.ix_(unknowns, unknowns)], atol=1e-6)
    others = np.setdiff1d(np.arange(v.size), unknowns)
    np.testing.assert_allclose(hessian[others], np.diag(np.repeat(case.stiffness, 3))[others], atol=1e-6)


def test_only_parts_that_a_spring_acts_on_are_unknowns():
    case = Case(0)
    case.springs.A[:] = 0.0
    assert len(curvature_at(case, np.zeros(case.shape))[1]) == 0
    case.springs.A[0, -1] = np.eye(3)  # a grounded one
    way, joint = set(), int(case.springs.a[-1])
    while joint:
        joint = int(case.body.parents[joint])
        way.add(int(case.body.parts[joint]))
    assert set(curvature_at(case, np.zeros(case.shape))[1]) == way | {len(case.stiffness) - 1}


def test_lever_arms_are_updated_with_the_curvature():
    case = Case(0)
    curvature_at(case, np.ones(case.shape))
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
    factorise(U, 9)
    active = np.array([0, 2, 3])
    v, gradient, back = draw.normal(size=(3, 5, 3))
    z, scaled = np.empty((2, 3, 3))
    scale(U, active, v, z)
    np.testing.assert_allclose(z.ravel(), np.triu(U) @ v[active].ravel())
    unscale(U, active, z, back)
    np.testing.assert_allclose(back[active], v[active])
    np.testing.assert_array_equal(back[[1, 4]], 0)
    scale_gradient(U, active, gradient, scaled)
    np.testing.assert_allclose(np.triu(U).T @ scaled.ravel(), gradient[active].ravel())
