"""Resting joints on their way: drawn the share of the way that their weight says, whatever their stiffness."""

from dataclasses import replace

import numpy as np
import pytest
from spring_case import Case

from distretarget.objectives.supports import no_supports, support_springs, write_compliance


def stance_at(case, joint, weights, away):
    """One joint that belongs `away` from its place in the copy."""
    x = np.array([case.positions(np.zeros(case.shape), frame)[joint] for frame in range(len(weights))])
    return replace(
        no_supports(len(weights)),
        joints=np.array([joint]),
        regions=np.array([0]),
        weights=np.array(weights)[:, None],
        places=(x + away)[:, None],
    )


@pytest.mark.parametrize("seed", range(3))
def test_the_compliance_is_the_way_a_joint_moves_under_a_small_force(seed):
    case, joint, h = Case(seed), 7, 1e-6
    M = np.empty((3, 3))
    write_compliance(case.body, case.bones[0], joint, np.empty(case.shape), M)
    for axis in range(3):
        case.springs.A[:] = 0.0
        case.springs.a[0], case.springs.b[0] = joint, -1
        case.springs.A[0, 0] = h * np.eye(3)
        at_rest = case.positions(np.zeros(case.shape))[joint]
        case.springs.rest[0, 0] = at_rest + np.eye(3)[axis]
        v, _ = case.solved()
        np.testing.assert_allclose((case.positions(v[0])[joint] - at_rest) / h, M[axis], rtol=1e-3, atol=1e-4)


@pytest.mark.parametrize("stiffness", [1e3, 1e5])
def test_a_foot_goes_the_share_of_its_weight(stiffness):
    weights, away = np.array([0.0, 0.1, 0.5, 0.9, 1.0]), np.array([0.004, -0.002, 0.003])
    case = Case(1, frames=5)
    stance = stance_at(case, 7, weights, away)
    case.springs = support_springs(stance, case.body, case.bones, 1.0, stiffness)
    v, _ = case.solved()
    copy = stance.places[:, 0] - away
    gone = [(case.positions(v[t], t)[7] - copy[t]) @ away / (away @ away) for t in range(5)]
    np.testing.assert_allclose(gone, weights, atol=0.02)


def test_feet_without_stiffness_are_free():
    case = Case(2, frames=2)
    springs = support_springs(stance_at(case, 5, np.array([0.4, 1.0]), np.ones(3)), case.body, case.bones, 1.0, 0.0)
    assert not springs.A.any()
