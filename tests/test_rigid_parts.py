"""Rigid parts: which joints turn together, what they carry, and the motion written from their deviations."""

from dataclasses import replace

import numpy as np
import pytest
from bodies import PERSON, held_still, matched, other_lengths, sample_target, swaying, tree_of
from scipy.spatial.transform import Rotation
from table_one import table_one

from distretarget.ik.poses import part_of_joint, posed_motion, subtree_lengths
from distretarget.objectives.clip import rigid_part_roots

STILL = ("LeftHip", "RightHip", "LeftCollar", "RightCollar", "LeftShoulder")
COPY = held_still(swaying(other_lengths(PERSON), frames=5, angle=1.2), STILL)
ROOTS = rigid_part_roots(matched(PERSON, PERSON, dict.fromkeys(STILL)))


@pytest.mark.parametrize("copy", [COPY, swaying(table_one())], ids=["leaves at rest", "leaves that turn"])
def test_a_written_part_turns_as_one_and_leaves_that_turn_keep_the_rotations_of_the_copy(copy):
    parts = part_of_joint(copy.skeleton, ROOTS if copy is COPY else np.arange(len(copy.skeleton)))
    v = np.random.default_rng(2).normal(size=(len(copy), parts.max() + 2, 3))
    motion = posed_motion(copy, v, parts, copy.root_positions)
    for joint, below in enumerate(copy.skeleton.children):
        before, after = (Rotation.from_quat(m.world_rotations[:, joint]) for m in (copy, motion))
        kept = not below and copy is not COPY
        expected = Rotation.identity() if kept else Rotation.from_rotvec(v[:, parts[joint]])
        assert (after.inv() * expected * before).magnitude().max() < 1e-12
    assert motion.frame_time_text == copy.frame_time_text


def test_joints_that_follow_their_parents_belong_to_them():
    expected = {name: name for name in PERSON.names}
    expected |= {"LeftHip": "Hips", "RightHip": "Hips", "LeftCollar": "Chest3", "RightCollar": "Chest3"}
    expected["LeftShoulder"] = "Chest3"
    assert {name: PERSON.names[root] for name, root in zip(PERSON.names, ROOTS, strict=True)} == expected


def test_joints_that_the_source_drives_are_free_even_if_they_do_not_turn():
    still = held_still(swaying(PERSON), PERSON.names)
    np.testing.assert_array_equal(rigid_part_roots(matched(still, PERSON)), np.arange(len(PERSON)))


def test_joints_without_rotation_channels_are_rigid():
    knee = PERSON.index("LeftKnee")
    channels = tuple(() if joint == knee else names for joint, names in enumerate(PERSON.channels))
    roots = rigid_part_roots(matched(PERSON, replace(PERSON, channels=channels)))
    assert roots[knee] == PERSON.index("LeftHip")
    np.testing.assert_array_equal(np.delete(roots, knee), np.delete(np.arange(len(PERSON)), knee))


def test_a_finger_that_nothing_drives_is_a_part_and_the_palm_is_not():
    rig = sample_target("rigs/mixamo_t").skeleton
    roots = rigid_part_roots(matched(PERSON, rig))
    thumb, wrist = (rig.index(f"mixamorig:LeftHand{end}") for end in ("Thumb1", ""))
    assert roots[wrist] == wrist
    assert {roots[joint] for joint in rig.subtree(thumb) if rig.children[joint]} == {thumb}


def test_parts_count_from_the_root_and_leaves_are_their_parents():
    parts = part_of_joint(PERSON, ROOTS)
    assert parts[0] == 0
    np.testing.assert_array_equal(np.unique(parts), np.arange(parts.max() + 1))
    for joint, below in enumerate(PERSON.children):
        if not below:
            assert parts[joint] == parts[PERSON.parents[joint]]
    firsts = np.unique(parts, return_index=True)[1]
    assert np.all(np.diff(firsts) > 0)


def test_as_many_parts_as_joints_that_turn_and_carry_bones():
    carriers = {name for name, below in zip(PERSON.names, PERSON.children, strict=True) if below}
    parts = dict(zip(PERSON.names, part_of_joint(PERSON, ROOTS), strict=True))
    assert len(set(parts.values())) == len(carriers - set(STILL))
    assert parts["LeftHip"] == parts["RightHip"] == parts["Hips"]
    assert parts["LeftShoulder"] == parts["RightCollar"] == parts["Chest3"]
    assert parts["RightShoulder"] != parts["Chest3"]


def test_a_lone_root_is_one_part():
    np.testing.assert_array_equal(part_of_joint(tree_of([[0, 0, 0]]), np.arange(1)), [0])


def test_subtree_lengths_are_sums_over_the_bones_at_and_below():
    body = other_lengths(PERSON)
    expected = np.zeros(len(body))
    for joint in range(len(body)):
        above = joint
        while above >= 0:
            expected[above] += body.lengths[joint]
            above = body.parents[above]
    np.testing.assert_allclose(subtree_lengths(body, np.arange(len(body))), expected)
    assert subtree_lengths(body, np.arange(len(body)))[0] == pytest.approx(body.lengths.sum())


def test_what_carries_nothing_that_counts_has_no_length():
    body = other_lengths(PERSON)
    arm = [body.index(name) for name in ("Hips", "Chest", "Chest2", "Chest3", "LeftCollar", "LeftShoulder")]
    sums = subtree_lengths(body, np.array(arm[-1:]))
    np.testing.assert_allclose(sums[arm], np.cumsum(body.lengths[arm][::-1])[::-1])
    assert not np.delete(sums, arm).any()
