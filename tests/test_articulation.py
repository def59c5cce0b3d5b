"""Rotations on exact bones: positions, lever arms, and the gradient with respect to a pose."""

import numpy as np
import pytest
from bodies import held_still, matched, other_lengths, person, swaying
from scipy.spatial.transform import Rotation

from distretarget.ik.articulation import Articulation, Scratch, pose_body, pose_gradient, stiffness_energy
from distretarget.ik.poses import part_of_joint, posed_motion
from distretarget.objectives.clip import rigid_part_roots

STILL = ("LeftHip", "RightHip", "LeftCollar", "RightCollar", "LeftShoulder")
COPY = held_still(swaying(other_lengths(person()), frames=5, angle=1.2), STILL)


def naive_positions(motion):
    """Forward kinematics, joint by joint."""
    positions, world = [motion.translations[:, 0]], [Rotation.from_quat(motion.rotations[:, 0])]
    for joint in range(1, len(motion.skeleton)):
        parent = motion.skeleton.parents[joint]
        positions.append(positions[parent] + world[parent].apply(np.array(motion.translations[:, joint])))
        world.append(world[parent] * Rotation.from_quat(motion.rotations[:, joint]))
    return np.stack(positions, axis=1)


def body_of(copy, stiffness=0.0):
    roots = rigid_part_roots(matched(copy.skeleton, copy.skeleton, dict.fromkeys(STILL)))
    parts = part_of_joint(copy.skeleton, roots)
    return Articulation.of(copy.skeleton, parts, np.full(parts.max() + 2, stiffness))


def posed_by(v, body, copy, frame):
    scratch = Scratch.of(body)
    bones = copy.positions[frame] - copy.positions[frame, copy.skeleton.parents]
    pose_body(v, body, bones, copy.positions[frame, 0], scratch)
    return scratch


def test_the_pose_of_no_deviation_is_the_copy():
    body = body_of(COPY)
    for frame in range(len(COPY)):
        scratch = posed_by(np.zeros((len(body.stiffness), 3)), body, COPY, frame)
        np.testing.assert_allclose(scratch.x, COPY.positions[frame], atol=1e-14)


@pytest.mark.parametrize("size", [1e-6, 0.5, 3.0])
def test_a_pose_stands_where_the_motion_written_from_it_does(size):
    body = body_of(COPY)
    v = np.random.default_rng(1).normal(size=(len(COPY), len(body.stiffness), 3))
    v *= size / np.linalg.norm(v, axis=-1, keepdims=True)
    motion = posed_motion(COPY, v, body.parts, COPY.root_positions + v[:, -1])
    expected = naive_positions(motion)
    np.testing.assert_allclose(motion.positions, expected, atol=1e-12)
    for frame in range(len(COPY)):
        scratch = posed_by(v[frame], body, COPY, frame)
        np.testing.assert_allclose(scratch.x, expected[frame], atol=1e-12)
        np.testing.assert_allclose(np.linalg.norm(scratch.bones[1:], axis=1), COPY.skeleton.lengths[1:], rtol=1e-12)


@pytest.mark.parametrize("size", [0.0, 1e-5, 9e-5, 1.1e-4, 1.0, 3.0])
def test_the_gradient_is_that_of_finite_differences(size):
    draw = np.random.default_rng(3)
    body = body_of(COPY, stiffness=0.7)
    slope, curvature = draw.normal(size=(2, len(body.parents), 3))
    v = draw.normal(size=(len(body.stiffness), 3))
    v *= size / np.linalg.norm(v, axis=1, keepdims=True)

    def value(v):
        x = posed_by(v, body, COPY, 2).x
        return np.sum(slope * x + 0.5 * curvature * x**2) + 0.5 * np.sum(body.stiffness[:, None] * v**2)

    scratch, gradient = posed_by(v, body, COPY, 2), np.full_like(v, np.nan)
    scratch.gradient[:] = slope + curvature * scratch.x
    held = stiffness_energy(v, body)
    pose_gradient(v, body, scratch, gradient)
    assert held == pytest.approx(0.35 * np.sum(v**2))
    h = 1e-5
    for i in np.ndindex(v.shape):
        step = np.zeros_like(v)
        step[i] = h
        assert gradient[i] == pytest.approx((value(v + step) - value(v - step)) / (2 * h), rel=1e-6, abs=1e-7)
