"""Springs: energy and gradient against a naive version; stiffness of parts, and how far resting joints give way."""

from dataclasses import replace

import numpy as np
import pytest
from bodies import PERSON, matched, sample_target, swaying
from spring_case import Case, at, naive_energy, random_springs

from distretarget.baseline.rotation_copy import RootScale
from distretarget.ik.articulation import Articulation, Scratch
from distretarget.ik.holds import write_compliance
from distretarget.ik.springs import FrameSprings, joined, spring_energy
from distretarget.objectives.clip import Clip
from distretarget.objectives.contact import (
    ADDED_LENGTH,
    BASE_STIFFNESS,
    LOOSE_FACTOR,
    ROOT_STIFFNESS,
    TRUNK_FACTOR,
    part_stiffness,
)
from distretarget.objectives.supports import no_supports, support_springs


def scratch_of(joints):
    """Scratch arrays for a body of so many joints."""
    root = np.array([-1] + [0] * (joints - 1))
    return Scratch.of(Articulation(root, np.zeros(joints, np.intp), np.ones(2)))


@pytest.mark.parametrize("seed", range(3))
def test_springs_have_the_energy_and_the_gradient_of_their_definition(seed):
    draw = np.random.default_rng(seed)
    scratch, springs = scratch_of(8), at(random_springs(draw, 8), 0)
    scratch.x[:] = draw.normal(size=(8, 3))
    scratch.gradient[:] = before = draw.normal(size=(8, 3))
    assert spring_energy(scratch, springs, len(springs.a)) == pytest.approx(naive_energy(scratch.x, springs))
    for i in np.ndindex(8, 3):
        step = np.zeros((8, 3))
        step[i] = 0.5
        slope = naive_energy(scratch.x + step, springs) - naive_energy(scratch.x - step, springs)
        assert scratch.gradient[i] - before[i] == pytest.approx(slope, abs=1e-9)


def test_only_the_first_springs_count():
    draw = np.random.default_rng(1)
    scratch, springs = scratch_of(8), at(random_springs(draw, 8), 0)
    scratch.x[:] = draw.normal(size=(8, 3))
    first = FrameSprings(*(values[:5] for values in springs))
    assert spring_energy(scratch, springs, 5) == pytest.approx(naive_energy(scratch.x, first))
    assert spring_energy(scratch, springs, 0) == 0


def test_joined_springs_are_those_of_both():
    draw = np.random.default_rng(0)
    one, other = (random_springs(draw, 8, frames=3, count=count) for count in (5, 9))
    both = joined(one, other)
    scratch = scratch_of(8)
    scratch.x[:] = draw.normal(size=(8, 3))
    for frame in range(3):
        energies = [spring_energy(scratch, at(springs, frame), len(springs.a)) for springs in (one, other, both)]
        assert energies[2] == pytest.approx(energies[0] + energies[1])


FEET = "LeftAnkle LeftToe RightAnkle RightToe"


def clip_on(target):
    """A short clip of the person, on a target."""
    return Clip.of(matched(swaying(PERSON, frames=2), target), RootScale.even(1.0))


@pytest.mark.parametrize("names", ["Hips Chest LeftCollar LeftShoulder LeftElbow LeftHip LeftKnee", FEET])
def test_stiffness_grows_in_proportion_to_the_share_of_the_body_that_a_part_carries(names):
    """The share is that of the lengths of all bones; were it squared, say, arms and neck would hardly resist. A foot is
    five times as stiff: it turns least where the leg gives way to a place on the floor, so that the sole stays flat.
    """
    clip = clip_on(PERSON)
    stiffness, whole = part_stiffness(clip), PERSON.lengths.sum()
    for joint in map(PERSON.index, names.split()):
        carried = PERSON.lengths[[*PERSON.subtree(joint)]].sum() / whole
        bones = PERSON.lengths[list(PERSON.children[joint])].sum() / clip.unit
        usual = BASE_STIFFNESS * (bones + ADDED_LENGTH) * (1.0 + TRUNK_FACTOR * carried)
        np.testing.assert_allclose(stiffness[clip.parts[joint]], (5.0 if names == FEET else 1.0) * usual)


def test_a_root_on_the_floor_does_not_tip():
    """The parts above the pelvis carry all of the body on a long lever: the least turn would tip the body over."""
    rig = sample_target("rigs/unreal_t").skeleton
    clip = clip_on(rig)
    root, pelvis = part_stiffness(clip)[clip.parts[[rig.index("root"), rig.index("pelvis")]]]
    assert root > 1e5 * pelvis


def test_only_fingers_that_nothing_drives_are_loose(monkeypatch):
    rig = sample_target("rigs/unreal_t").skeleton
    clip = clip_on(rig)
    fingers = {f"{finger}_01_{side}" for finger in ("thumb", "index", "middle", "ring", "pinky") for side in "lr"}
    assert {
        rig.names[joint] for joint in clip.roots if rig.children[joint] and clip.parts[joint] in clip.loose_parts
    } == fingers
    loose = part_stiffness(clip)
    monkeypatch.setattr("distretarget.objectives.contact.LOOSE_FACTOR", 1.0)
    stiff = part_stiffness(clip)
    changed = np.flatnonzero(stiff != loose)
    np.testing.assert_array_equal(changed, clip.loose_parts)
    np.testing.assert_allclose(loose[changed], LOOSE_FACTOR * stiff[changed])
    assert not len(clip_on(PERSON).loose_parts)


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


def test_stiffness_grows_with_what_a_part_carries_and_head_and_hands_are_stiff():
    clip = clip_on(PERSON)
    stiffness = part_stiffness(clip)
    at = {name: stiffness[clip.parts[PERSON.index(name)]] for name in PERSON.names}
    assert at["LeftShoulder"] == at["RightShoulder"]
    assert stiffness[-1] == ROOT_STIFFNESS
    assert at["Hips"] > 5 * at["LeftElbow"]
    assert min(at["LeftWrist"], at["Neck"]) > at["LeftElbow"]
