"""Springs: energy and gradient against a naive version; and the stiffness of parts, which give way or do not."""

import numpy as np
import pytest
from bodies import PERSON, matched, sample_target, swaying
from spring_case import at, naive_energy, random_springs, stiffer_along

from distretarget.baseline.rotation_copy import RootScale
from distretarget.ik.articulation import Articulation, Scratch
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


def test_a_spring_along_its_axis_does_not_feel_what_happens_across():
    scratch = scratch_of(2)
    axis, across = np.array([0.6, 0.8, 0.0]), np.array([0.8, -0.6, 2.0])
    A = stiffer_along(axis[None], np.array([4.0]), np.array([0.0]))
    springs = FrameSprings(np.array([0]), np.array([1]), np.zeros((1, 3)), A)
    scratch.x[0] = 0.5 * axis + across
    assert spring_energy(scratch, springs, len(springs.a)) == pytest.approx(0.5)
    np.testing.assert_allclose(scratch.gradient, [2 * axis, -2 * axis])


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


def test_stiffness_grows_with_what_a_part_carries_and_head_hands_and_feet_are_stiff():
    clip = clip_on(PERSON)
    parts = clip.parts
    stiffness = part_stiffness(clip)
    at = {name: stiffness[parts[PERSON.index(name)]] for name in PERSON.names}
    assert at["Hips"] > at["Chest"] > at["LeftShoulder"] > at["LeftElbow"]
    assert at["LeftShoulder"] == at["RightShoulder"]
    assert stiffness[-1] == ROOT_STIFFNESS
    assert at["Hips"] > 5 * at["LeftElbow"]
    assert at["LeftAnkle"] > at["LeftKnee"]
    assert at["LeftWrist"] > at["LeftElbow"]
    assert at["Neck"] > at["LeftElbow"]


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
