"""Forward kinematics and the rotations of a tree, against scipy joint by joint."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from distretarget.numerics.joint_paths import angles_to_bones, thirds_along, turns_along
from distretarget.numerics.kinematics import forward_kinematics, line_rotations, make_local, turn_parts, world_rotations
from distretarget.numerics.quaternions import rotation_products, turned_by
from distretarget.numerics.vectors import angles_between

FRAMES = 5
TREES = {
    "a single joint": [-1],
    "a chain": [-1, 0, 1, 2],
    "a star": [-1, 0, 0, 0],
    "a tree": [-1, 0, 1, 1, 0, 4, 2],
}

trees = pytest.mark.parametrize("parents", [np.array(tree, np.intp) for tree in TREES.values()], ids=TREES)


def rotations(joints, seed=0):
    """(frames, joints, 4), random."""
    draw = Rotation.random(FRAMES * joints, rng=np.random.default_rng(seed))
    return draw.as_quat().reshape(FRAMES, joints, 4)


def translations(joints):
    return np.random.default_rng(1).normal(size=(FRAMES, joints, 3))


def assert_same_rotations(found, expected):
    """Assert equality as rotations; a quaternion and its negative are equal."""
    np.testing.assert_allclose(np.abs((found * expected).sum(axis=-1)), 1.0, atol=1e-12)


def chained(parents, local):
    """(frames, joints, 4), world rotations joint by joint."""
    world = []
    for joint, parent in enumerate(parents):
        own = Rotation.from_quat(local[:, joint])
        world.append(world[parent] * own if parent >= 0 else own)
    return np.stack([turn.as_quat() for turn in world], axis=1)


@trees
def test_world_rotations_are_the_products_down_the_tree(parents):
    local = rotations(len(parents))
    assert_same_rotations(world_rotations(parents, local), chained(parents, local))


@trees
def test_positions_are_the_turned_translations_added_up(parents):
    offsets, world = translations(len(parents)), rotations(len(parents))
    expected = np.array(offsets)
    for joint, parent in enumerate(parents):
        if parent >= 0:
            expected[:, joint] = expected[:, parent] + Rotation.from_quat(world[:, parent]).apply(offsets[:, joint])
    np.testing.assert_allclose(forward_kinematics(parents, offsets, world), expected, atol=1e-12)


@trees
def test_local_rotations_are_the_inverse_of_world_rotations(parents):
    local = rotations(len(parents))
    made = world_rotations(parents, local)
    make_local(parents, made)
    np.testing.assert_allclose(made, local, atol=1e-12)
    make_local(parents, made)
    np.testing.assert_allclose(world_rotations(parents, made), local, atol=1e-12)


def test_products_are_those_of_scipy():
    first, second, of_first = rotations(3), rotations(4, seed=1)[0], np.array([2, 0, -1, 2])
    products = rotation_products(first, of_first, second)
    for joint in (0, 1, 3):
        expected = Rotation.from_quat(first[:, of_first[joint]]) * Rotation.from_quat(second[joint])
        assert_same_rotations(products[:, joint], expected.as_quat())
    np.testing.assert_array_equal(products[:, 2], np.tile([0.0, 0.0, 0.0, 1.0], (len(first), 1)))


def test_turned_rotations_are_those_of_scipy():
    vectors = np.random.default_rng(2).normal(size=(FRAMES, 3, 3))
    vectors[0], vectors[1] = 0.0, 1e-9 * vectors[1]
    parts, before = np.array([0, 2, -1, 0], np.intp), rotations(4)
    deviations = Rotation.from_rotvec(vectors[:, parts].reshape(-1, 3))
    expected = (deviations * Rotation.from_quat(before.reshape(-1, 4))).as_quat().reshape(before.shape)
    expected[:, 2] = before[:, 2]
    turn_parts(vectors, parts, before)
    assert_same_rotations(before, expected)


@trees
def test_without_frames_there_are_no_rotations_and_no_positions(parents):
    none = np.zeros((0, len(parents), 4))
    assert world_rotations(parents, none).shape == none.shape
    make_local(parents, none)
    assert forward_kinematics(parents, none[..., :3], none).shape == (0, len(parents), 3)


def test_arguments_stay_as_they_are():
    parents, local = np.array(TREES["a tree"], np.intp), rotations(7)
    before = local.copy()
    world_rotations(parents, local)
    rotation_products(local, np.arange(7), local[0])
    np.testing.assert_array_equal(local, before)


@trees
def test_what_is_measured_of_joints_is_what_plain_arrays_give(parents):
    local, joints = rotations(len(parents)), np.arange(len(parents))[::-1].copy()
    world = world_rotations(parents, local)
    turns = [Rotation.from_quat(world[:-1, joint]).inv() * Rotation.from_quat(world[1:, joint]) for joint in joints]
    found = turns_along(parents, local, joints)
    np.testing.assert_allclose(found, np.transpose([turn.magnitude() for turn in turns]), atol=1e-7)
    line = [len(parents) - 1]
    while parents[line[0]] >= 0:
        line.insert(0, parents[line[0]])
    last = line_rotations(np.array(line), local)
    np.testing.assert_allclose(last, world[:, -1], atol=1e-15)
    np.testing.assert_allclose(turned_by(last, np.arange(3.0)), Rotation.from_quat(last).apply([0, 1, 2]), atol=1e-14)


def test_what_is_measured_of_paths_is_what_plain_arrays_give():
    paths = np.random.default_rng(2).normal(size=(7, 4, 3))
    upper, lower, vectors = np.array([0, 1]), np.array([3, 2]), paths[:, :2] + 1.0
    thirds = np.linalg.norm(np.diff(paths[:, lower], 3, axis=0), axis=2).mean(axis=1)
    np.testing.assert_allclose(thirds_along(paths, lower), thirds)
    bones = paths[:, lower] - paths[:, upper]
    np.testing.assert_allclose(angles_to_bones(vectors, paths, upper, lower), angles_between(vectors, bones))
    assert (angles_to_bones(0.0 * vectors, paths, upper, lower) == 0.0).all()
    assert thirds_along(paths[:2], lower).size == 0
