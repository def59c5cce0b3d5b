"""Rotations on exact bones: positions, their gradient, and which joints turn as one."""

from dataclasses import replace

import numpy as np
import pytest
from bodies import other_lengths, person, swaying
from scipy.spatial.transform import Rotation
from table_one import table_one

from distretarget import Motion, Skeleton
from distretarget.solve.articulation import (
    Body,
    hang,
    parts_of,
    pose_body,
    posed_motion,
    pull_back,
    rigid_heads,
    subtree_lengths,
    workspace,
)

PERSON = person()
STILL = ("LeftHip", "RightHip", "LeftCollar", "RightCollar", "LeftShoulder")


def held_still(motion, names):
    """The motion in which the named joints keep the rotation of its first frame."""
    rotations = np.array(motion.rotations)
    for name in names:
        joint = motion.skeleton.index(name)
        rotations[:, joint] = rotations[0, joint]
    return replace(motion, rotations=rotations)


def naive_positions(motion):
    """Forward kinematics, joint by joint."""
    positions, world = [motion.translations[:, 0]], [Rotation.from_quat(motion.rotations[:, 0])]
    for joint in range(1, len(motion.skeleton)):
        parent = motion.skeleton.parents[joint]
        positions.append(positions[parent] + world[parent].apply(np.array(motion.translations[:, joint])))
        world.append(world[parent] * Rotation.from_quat(motion.rotations[:, joint]))
    return np.stack(positions, axis=1)


def body_of(copy, holds=0.0):
    parts = parts_of(copy.skeleton, rigid_heads(copy))
    return Body(copy.skeleton.parents, parts, np.full(parts.max() + 2, holds))


def posed_by(v, body, copy, frame):
    work = workspace(len(body.parents), len(body.holds) - 1)
    bones = copy.positions[frame] - copy.positions[frame, copy.skeleton.parents]
    pose_body(v, body, bones, copy.positions[frame, 0], work)
    return work


COPY = held_still(swaying(other_lengths(PERSON), frames=5, angle=1.2), STILL)


def test_the_pose_of_no_deviation_is_the_copy():
    body = body_of(COPY)
    for frame in range(len(COPY)):
        work = posed_by(np.zeros((len(body.holds), 3)), body, COPY, frame)
        np.testing.assert_allclose(work.x, COPY.positions[frame], atol=1e-14)


@pytest.mark.parametrize("size", [1e-6, 0.5, 3.0])
def test_a_pose_stands_where_the_motion_written_from_it_does(size):
    body = body_of(COPY)
    v = np.random.default_rng(1).normal(size=(len(COPY), len(body.holds), 3))
    v *= size / np.linalg.norm(v, axis=-1, keepdims=True)
    motion = posed_motion(COPY, v, body.parts, COPY.root_positions + v[:, -1])
    expected = naive_positions(motion)
    np.testing.assert_allclose(motion.positions, expected, atol=1e-12)
    for frame in range(len(COPY)):
        work = posed_by(v[frame], body, COPY, frame)
        np.testing.assert_allclose(work.x, expected[frame], atol=1e-12)
        np.testing.assert_allclose(np.linalg.norm(work.bones[1:], axis=1), COPY.skeleton.lengths[1:], rtol=1e-12)


@pytest.mark.parametrize("copy", [COPY, swaying(table_one())], ids=["leaves at rest", "leaves that turn"])
def test_a_written_part_turns_as_one_and_leaves_that_turn_keep_the_rotations_of_the_copy(copy):
    body = body_of(copy)
    v = np.random.default_rng(2).normal(size=(len(copy), len(body.holds), 3))
    motion = posed_motion(copy, v, body.parts, copy.root_positions)
    for joint, below in enumerate(copy.skeleton.children):
        copied, written = (Rotation.from_quat(m.world_rotations[:, joint]) for m in (copy, motion))
        kept = not below and copy is not COPY
        expected = Rotation.identity() if kept else Rotation.from_rotvec(v[:, body.parts[joint]])
        assert (written.inv() * expected * copied).magnitude().max() < 1e-12
    assert motion.frame_time_text == copy.frame_time_text


@pytest.mark.parametrize("size", [0.0, 1e-5, 9e-5, 1.1e-4, 1.0, 3.0])
def test_the_gradient_is_that_of_finite_differences(size):
    draw = np.random.default_rng(3)
    body = body_of(COPY, holds=0.7)
    slope, curvature = draw.normal(size=(2, len(body.parents), 3))
    v = draw.normal(size=(len(body.holds), 3))
    v *= size / np.linalg.norm(v, axis=1, keepdims=True)

    def value(v):
        x = posed_by(v, body, COPY, 2).x
        return np.sum(slope * x + 0.5 * curvature * x**2) + 0.5 * np.sum(body.holds[:, None] * v**2)

    work, gradient = posed_by(v, body, COPY, 2), np.full_like(v, np.nan)
    work.pull[:] = slope + curvature * work.x
    held = pull_back(v, body, work, gradient)
    assert held == pytest.approx(0.35 * np.sum(v**2))
    h = 1e-5
    for i in np.ndindex(v.shape):
        step = np.zeros_like(v)
        step[i] = h
        assert gradient[i] == pytest.approx((value(v + step) - value(v - step)) / (2 * h), rel=1e-6, abs=1e-7)


def test_a_small_turn_of_a_part_moves_joints_across_their_arms():
    body = body_of(COPY)
    v = np.random.default_rng(4).normal(size=(len(body.holds), 3))
    work = posed_by(v, body, COPY, 1)
    hang(body, work)
    w = np.array([0.3, -0.2, 0.5])
    for part in range(len(body.holds) - 1):
        ends = []
        for h in (1e-6, -1e-6):
            turned = v.copy()
            turned[part] = (Rotation.from_rotvec(h * w) * Rotation.from_rotvec(v[part])).as_rotvec()
            ends.append(posed_by(turned, body, COPY, 1).x)
        np.testing.assert_allclose(np.cross(w, work.arms[:, part]), (ends[0] - ends[1]) / 2e-6, atol=1e-8)


def test_joints_that_never_turn_belong_to_the_joint_above():
    heads = rigid_heads(COPY)
    expected = {name: name for name in PERSON.names}
    expected |= {"LeftHip": "Hips", "RightHip": "Hips", "LeftCollar": "Chest3", "RightCollar": "Chest3"}
    expected["LeftShoulder"] = "Chest3"
    assert {name: PERSON.names[head] for name, head in zip(PERSON.names, heads, strict=True)} == expected


def test_a_joint_that_turns_by_a_hundredth_of_a_degree_is_not_rigid():
    rotations = np.array(COPY.rotations)
    hip = PERSON.index("LeftHip")
    rotations[3, hip] = (Rotation.from_rotvec([1.7e-4, 0, 0]) * Rotation.from_quat(rotations[3, hip])).as_quat()
    assert rigid_heads(replace(COPY, rotations=rotations))[hip] == hip


@pytest.mark.parametrize("frame", [0, 41, 99])
def test_a_joint_that_turns_in_a_single_bad_frame_only_is_still(frame):
    clip = held_still(swaying(PERSON, frames=100), STILL)
    rotations = np.array(clip.rotations)
    rotations[frame] = Rotation.random(len(PERSON), rng=np.random.default_rng(0)).as_quat()
    np.testing.assert_array_equal(rigid_heads(replace(clip, rotations=rotations)), rigid_heads(clip))
    rotations[30:60] = rotations[frame]
    np.testing.assert_array_equal(rigid_heads(replace(clip, rotations=rotations)), np.arange(len(PERSON)))


def test_a_quaternion_and_its_negative_are_the_same_rotation():
    signs = np.where(np.arange(len(COPY)) % 2, -1.0, 1.0)[:, None, None]
    np.testing.assert_array_equal(rigid_heads(replace(COPY, rotations=signs * COPY.rotations)), rigid_heads(COPY))


def test_in_a_single_frame_only_joints_that_coincide_are_rigid():
    body = PERSON.with_offsets(PERSON.offsets * (np.array(PERSON.names) != "Chest2")[:, None])
    heads = rigid_heads(swaying(body, frames=1))
    chest2 = PERSON.index("Chest2")
    assert heads[chest2] == PERSON.index("Chest")
    np.testing.assert_array_equal(np.delete(heads, chest2), np.delete(np.arange(len(body)), chest2))


def test_joints_without_rotation_channels_are_rigid():
    knee = PERSON.index("LeftKnee")
    channels = tuple(() if joint == knee else names for joint, names in enumerate(PERSON.channels))
    heads = rigid_heads(swaying(replace(PERSON, channels=channels)))
    assert heads[knee] == PERSON.index("LeftHip")
    np.testing.assert_array_equal(np.delete(heads, knee), np.delete(np.arange(len(PERSON)), knee))


def test_parts_count_from_the_root_and_leaves_are_their_parents():
    parts = parts_of(PERSON, rigid_heads(COPY))
    assert parts[0] == 0
    np.testing.assert_array_equal(np.unique(parts), np.arange(parts.max() + 1))
    for joint, below in enumerate(PERSON.children):
        if not below:
            assert parts[joint] == parts[PERSON.parents[joint]]
    firsts = np.unique(parts, return_index=True)[1]
    assert np.all(np.diff(firsts) > 0)


def test_as_many_parts_as_joints_that_turn_and_carry_bones():
    carriers = {name for name, below in zip(PERSON.names, PERSON.children, strict=True) if below}
    parts = dict(zip(PERSON.names, parts_of(PERSON, rigid_heads(COPY)), strict=True))
    assert len(set(parts.values())) == len(carriers - set(STILL))
    assert parts["LeftHip"] == parts["RightHip"] == parts["Hips"]
    assert parts["LeftShoulder"] == parts["RightCollar"] == parts["Chest3"]
    assert parts["RightShoulder"] != parts["Chest3"]


def test_a_lone_root_is_one_part():
    point = Skeleton(("a",), [-1], [[0, 0, 0]], (("Zrotation",),), [False])
    np.testing.assert_array_equal(parts_of(point, np.arange(1)), [0])
    still = Motion(point, np.zeros((3, 1, 3)), np.tile([0.0, 0, 0, 1], (3, 1, 1)), "1")
    np.testing.assert_array_equal(rigid_heads(still), [0])


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
