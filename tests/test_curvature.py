"""The curvature of springs: against finite differences of the gradient."""

import numpy as np
import pytest
from spring_case import Case, at

from distretarget.ik.curvature import Curvature, are_first, write_curvature
from distretarget.ik.springs import write_way


def curvature_at(case, v):
    """The active parts at a pose, and their curvature."""
    case.positions(v)
    curvature, springs = Curvature.of(case.body), at(case.springs, 0)
    count = len(springs.a)
    bones = write_way(springs, count, case.body, curvature.below)
    parts = write_curvature(bones, v, case.body, case.scratch, springs, count, curvature)
    return curvature.active[:parts], curvature.H[: 3 * parts, : 3 * parts]


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
    active, H = curvature_at(case, v)
    h = 1e-5
    steps = h * np.eye(v.size)
    slopes = [case.energy_and_gradient(v.ravel() + s)[1] - case.energy_and_gradient(v.ravel() - s)[1] for s in steps]
    unknowns = (3 * active[:, None] + np.arange(3)).ravel()
    hessian = np.array(slopes) / (2 * h)
    np.testing.assert_allclose(np.triu(H), np.triu(hessian[np.ix_(unknowns, unknowns)]), atol=1e-6)
    others = np.setdiff1d(np.arange(v.size), unknowns)
    np.testing.assert_allclose(hessian[others], np.diag(np.repeat(case.stiffness, 3))[others], atol=1e-6)


def test_only_parts_that_a_spring_acts_on_are_unknowns():
    case = Case(0)
    case.springs.A[:] = 0.0
    assert len(curvature_at(case, np.zeros(case.shape))[0]) == 0
    case.springs.A[0, -1] = np.eye(3)  # a grounded one
    way, joint = set(), int(case.springs.a[-1])
    while joint:
        joint = int(case.body.parents[joint])
        way.add(int(case.body.parts[joint]))
    assert set(curvature_at(case, np.zeros(case.shape))[0]) == way | {len(case.stiffness) - 1}


def test_a_curvature_says_which_bones_move():
    case = Case(0)
    v, springs = np.zeros(case.shape), at(case.springs, 0)
    case.positions(v)
    curvature, count = Curvature.of(case.body), len(springs.a)

    def moved():
        return write_way(springs, count, case.body, curvature.below)

    def is_for(bones):
        return are_first(curvature.bones, curvature.below.way, bones)

    everything = moved()
    assert everything > 0
    assert not is_for(everything)  # nothing is written yet
    write_curvature(everything, v, case.body, case.scratch, springs, count, curvature)
    assert is_for(everything)
    springs.A[:] *= 2.0  # other springs of the same joints
    assert is_for(moved())
    springs.A[springs.b >= 0] = 0.0
    assert 0 < moved() < everything
    assert not is_for(moved())
    springs.A[:] = 0.0
    assert moved() == 0
    assert not is_for(0)


def test_a_bone_of_no_length_is_no_unknown():
    case = Case(0)
    case.springs.A[:] = 0.0
    case.springs.A[0, -1] = np.eye(3)
    joint = int(case.springs.a[-1])
    case.bones[0, joint] = 0.0
    part = case.body.parts[case.body.parents[joint]]
    assert part not in curvature_at(case, np.zeros(case.shape))[0]


def test_both_ends_of_a_spring_move_with_what_carries_both():
    """So a spring between two children of the root turns neither the root nor moves its place."""
    case = Case(1)
    children = np.flatnonzero(case.body.parents == 0)[:2]
    case.springs.A[:] = 0.0
    case.springs.a[0], case.springs.b[0] = children
    case.springs.A[0, 0] = np.eye(3)
    assert set(curvature_at(case, np.zeros(case.shape))[0]) == {case.body.parts[0]}
