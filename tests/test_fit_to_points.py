"""Rotations from points: exact bones, the source's twist, rigid parts, joints with few channels."""

from dataclasses import replace

import numpy as np
import pytest
from bodies import matched, other_lengths, person, swaying
from scipy.spatial.transform import Rotation

from distretarget import Motion
from distretarget.baseline.rotation_copy import RootScale, rotation_copy
from distretarget.ik.poses import fit_rotations

BODY = person()
ALL = np.arange(len(BODY))


def copy_of(motion, target):
    return rotation_copy(matched(motion, target), RootScale.even(1.0))


def test_the_copys_own_points_give_the_copy():
    copy = copy_of(swaying(BODY), other_lengths(BODY))
    result = fit_rotations(copy, copy.positions, ALL, ALL)
    np.testing.assert_allclose(result.positions, copy.positions, atol=1e-9)
    np.testing.assert_allclose(result.world_rotations, copy.world_rotations, atol=1e-9)


def test_points_that_fit_the_bones_are_reached():
    reached = swaying(BODY, seed=5)
    copy = swaying(BODY, seed=6)
    copy = replace(copy, root_positions=reached.root_positions)
    joints = np.flatnonzero(~BODY.end_sites)
    result = fit_rotations(copy, reached.positions, ALL, ALL)
    np.testing.assert_allclose(result.positions[:, joints], reached.positions[:, joints], atol=1e-4)


def test_bones_keep_their_lengths_whatever_the_points():
    copy = copy_of(swaying(BODY), other_lengths(BODY))
    points = copy.positions + np.random.default_rng(0).normal(scale=0.2, size=copy.positions.shape)
    bones = np.linalg.norm(
        np.diff(fit_rotations(copy, points, ALL, ALL).positions[:, [BODY.parents[1:], ALL[1:]]], axis=1), axis=-1
    )
    np.testing.assert_allclose(bones[:, 0], np.broadcast_to(copy.skeleton.lengths[1:], bones[:, 0].shape), rtol=1e-12)


def test_twist_is_the_copys():
    """A bone turns with the least rotation: none of it about the bone."""
    copy = copy_of(swaying(BODY), other_lengths(BODY))
    points = copy.positions + np.random.default_rng(0).normal(scale=0.05, size=copy.positions.shape)
    result = fit_rotations(copy, points, ALL, ALL)
    elbow, wrist = BODY.index("LeftElbow"), BODY.index("LeftWrist")
    before, after = (Rotation.from_quat(motion.world_rotations[:, elbow]) for motion in (copy, result))
    turn = (after * before.inv()).as_rotvec()
    bone = copy.positions[:, wrist] - copy.positions[:, elbow]
    assert np.linalg.norm(turn, axis=1).min() > 1e-3
    np.testing.assert_allclose(np.einsum("fi,fi->f", turn, bone), 0, atol=1e-9)


def test_joints_below_which_nothing_is_solved_keep_the_copys_world_rotation():
    copy = copy_of(swaying(BODY), other_lengths(BODY))
    points = copy.positions + np.random.default_rng(0).normal(scale=0.1, size=copy.positions.shape)
    result = fit_rotations(copy, points, np.flatnonzero(~BODY.end_sites), ALL)
    head = BODY.index("Head")
    same = np.abs(np.einsum("fi,fi->f", result.world_rotations[:, head], copy.world_rotations[:, head]))
    np.testing.assert_allclose(same, 1.0, atol=1e-12)


def test_a_joint_that_follows_its_parent_stays_rigid():
    knee, collar = BODY.index("LeftKnee"), BODY.index("LeftCollar")
    copy = copy_of(swaying(BODY), BODY)
    roots = np.where(collar == ALL, BODY.index("Chest3"), ALL)
    points = copy.positions + np.random.default_rng(0).normal(scale=0.1, size=copy.positions.shape)
    result = fit_rotations(copy, points, ALL, roots)
    np.testing.assert_allclose(np.abs(np.sum(result.rotations * copy.rotations, axis=-1))[:, collar], 1, atol=1e-12)
    assert np.abs(np.sum(result.rotations * copy.rotations, axis=-1))[:, knee].min() < 1 - 1e-6


@pytest.mark.parametrize("axes", ["", "X", "ZY"])
def test_joints_turn_as_far_as_their_channels_allow(axes):
    elbow = BODY.index("RightElbow")
    channels = list(BODY.channels)
    channels[elbow] = tuple(f"{axis}rotation" for axis in axes)
    body = replace(BODY, channels=tuple(channels))
    copy = copy_of(swaying(BODY), body)
    points = copy.positions + np.random.default_rng(0).normal(scale=0.1, size=copy.positions.shape)
    local = fit_rotations(copy, points, ALL, ALL).rotations[:, elbow]
    if axes:
        angles = Rotation.from_quat(local).as_euler(axes + "XYZ".translate(dict.fromkeys(map(ord, axes))))
        np.testing.assert_allclose(angles[:, len(axes) :], 0, atol=1e-9)
        assert np.ptp(angles[:, 0]) > 0.1
    else:
        np.testing.assert_array_equal(np.abs(local), [[0, 0, 0, 1]] * len(copy))


def lowered(angle):
    """The same body with another rest pose: arms turned down by `angle` [rad] about the body's forward axis."""
    offsets = np.array(BODY.offsets)
    for side, sign in (("Left", -1), ("Right", 1)):
        turn = Rotation.from_rotvec([0, 0, sign * angle])
        for joint in (f"{side}Elbow", f"{side}Wrist", f"{side}Wrist_End"):
            offsets[BODY.index(joint)] = turn.apply(offsets[BODY.index(joint)])
    return BODY.with_offsets(offsets)


@pytest.mark.parametrize("angle", [0.3, 0.8, 1.4])
def test_the_targets_rest_pose_does_not_show_in_the_posture(angle):
    motion = swaying(BODY)
    copy = copy_of(motion, lowered(angle))
    np.testing.assert_allclose(copy.positions, motion.positions, atol=1e-9)


def test_points_that_all_coincide_give_finite_rotations():
    copy = copy_of(swaying(BODY), other_lengths(BODY))
    result = fit_rotations(copy, np.zeros_like(copy.positions), ALL, ALL)
    assert isinstance(result, Motion)
    assert np.all(np.isfinite(result.rotations))
