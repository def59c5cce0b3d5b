"""Resting joints on their way: drawn the share of the way that their weight says, whatever their stiffness."""

from dataclasses import replace

import numpy as np
import pytest
from spring_case import Case

from distretarget.ik.holds import write_compliance
from distretarget.objectives.supports import no_supports, support_springs


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


def hand_at(case, joint, fingers, weights, away):
    """A region of so many joints, all in the place of one joint, that belong `away` from their place in the copy."""
    one = stance_at(case, joint, weights, away)
    columns = np.zeros(fingers, np.intp)
    return replace(
        one,
        joints=one.joints[columns],
        regions=one.regions[columns],
        weights=one.weights[:, columns],
        places=one.places[:, columns],
    )


@pytest.mark.parametrize(("fingers", "held_as"), [(1, 1), (2, 2), (3, 2), (20, 2)])
def test_a_hand_of_many_joints_is_held_no_firmer_than_two_joints(fingers, held_as):
    """Otherwise a hand with fingers would outweigh everything else that the body rests on."""
    case, k = Case(3), 5000.0
    springs = support_springs(hand_at(case, 7, fingers, [1.0], np.zeros(3)), case.body, case.bones, 1.0, k)
    np.testing.assert_allclose(springs.A[0].sum(axis=0), held_as * k * np.eye(3), rtol=1e-9)


@pytest.mark.parametrize("fingers", [1, 2, 20])
def test_a_hand_goes_the_share_of_its_weight_whatever_number_of_joints_it_has(fingers):
    case, away = Case(1), np.array([0.004, -0.002, 0.003])
    hand = hand_at(case, 7, fingers, [0.5], away)
    case.springs = support_springs(hand, case.body, case.bones, 1.0, 1e5)
    v, _ = case.solved()
    gone = case.positions(v[0])[7] - (hand.places[0, 0] - away)
    assert gone @ away / (away @ away) == pytest.approx(0.5, abs=0.02)


def test_other_regions_take_nothing_from_the_stiffness_of_a_hand():
    case, k = Case(3), 5000.0
    hands = replace(hand_at(case, 7, 4, [1.0], np.zeros(3)), regions=np.array([0, 0, 1, 1]))
    springs = support_springs(hands, case.body, case.bones, 1.0, k)
    np.testing.assert_allclose(springs.A[0], np.broadcast_to(k * np.eye(3), (4, 3, 3)), rtol=1e-9)


def test_feet_without_stiffness_are_free():
    case = Case(2, frames=2)
    springs = support_springs(stance_at(case, 5, np.array([0.4, 1.0]), np.ones(3)), case.body, case.bones, 1.0, 0.0)
    assert not springs.A.any()
