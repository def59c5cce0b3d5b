"""Forward kinematics, and Euler angles of all orders, against scipy and naive versions."""

from itertools import permutations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from distretarget.numerics.euler import euler_angles, from_euler_angles, restrict, write_channel_rotations
from distretarget.numerics.joint_paths import angles_to_bones, thirds_along, turns_along
from distretarget.numerics.kinematics import joint_positions, line_rotations, make_local, turn_parts, world_rotations
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
    np.testing.assert_allclose(joint_positions(parents, offsets[:, 0], offsets, world), expected, atol=1e-12)


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
    vectors = np.random.default_rng(2).normal(size=(FRAMES, 3, 3))
    vectors[0], vectors[1] = 0.0, 1e-9 * vectors[1]
    parts, before = np.array([0, 2, -1, 0], np.intp), rotations(4)
    deviations = Rotation.from_rotvec(vectors[:, parts].reshape(-1, 3))
    expected = (deviations * Rotation.from_quat(before.reshape(-1, 4))).as_quat().reshape(before.shape)
    expected[:, 2] = before[:, 2]
    turn_parts(vectors, parts, before)
    assert_same_rotations(before, expected)


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


ORDERS = ["".join(axes) for axes in permutations("XYZ")]
SHORT_ORDERS = ["".join(axes) for count in (1, 2) for axes in permutations("XYZ", count)]
NEAR_LOCK = [0.0, 1e-16, 1e-14, 1e-13, 1e-12, 1e-10, 1e-8, 1e-5, 1e-3, -1e-15, -1e-12, -1e-9, -1e-5]

angle = st.floats(-10, 10)
near_lock = st.builds(lambda sign, gap: sign * (np.pi / 2 - gap), st.sampled_from([-1, 1]), st.sampled_from(NEAR_LOCK))
triple = st.tuples(angle, angle | near_lock, angle)


def error(rotations, axes, angles):
    """The largest angle [rad] between rotations and those that the angles make."""
    assert np.all(np.isfinite(angles))
    return np.max((Rotation.from_quat(rotations).inv() * Rotation.from_euler(axes, angles)).magnitude())


def walk(rng, frames=300):
    """Angles (frames, 3) that change by less than 0.2 rad per frame and pass every gimbal lock."""
    return np.cumsum(rng.uniform(-0.2, 0.2, (frames, 3)), axis=0)


@pytest.mark.parametrize("axes", [*SHORT_ORDERS, *ORDERS])
def test_rotations_of_angles_are_those_of_scipy(axes):
    angles = np.random.default_rng(5).uniform(-9, 9, (40, 3, len(axes)))
    expected = Rotation.from_euler(axes, angles.reshape(-1, len(axes))).as_quat()
    np.testing.assert_allclose(from_euler_angles(angles, axes).reshape(-1, 4), expected, atol=1e-15)


@settings(max_examples=300)
@given(st.sampled_from(ORDERS), st.lists(triple, min_size=1, max_size=6))
def test_three_angles_make_the_rotation_at_and_near_gimbal_lock(axes, triples):
    rotations = Rotation.from_euler(axes, triples).as_quat()
    assert error(rotations, axes, euler_angles(rotations, axes)) < 1e-12


@pytest.mark.parametrize("axes", ORDERS)
def test_angles_come_back_as_they_went_in_when_they_move_slowly(axes):
    angles = walk(np.random.default_rng(7), 1000)
    assert np.ptp(angles, axis=0).min() > np.pi / 2
    signs = np.random.default_rng(8).choice([-1.0, 1.0], (1000, 1))
    rotations = signs * Rotation.from_euler(axes, angles).as_quat()
    np.testing.assert_allclose(euler_angles(rotations, axes), angles, atol=1e-9)


@pytest.mark.parametrize("axes", ORDERS)
@pytest.mark.parametrize("middle", [np.pi / 2, -np.pi / 2])
def test_at_gimbal_lock_the_first_angle_stays_continuous(axes, middle):
    angles = np.array([[0.3, middle - 0.1, 0.2], [0.5, middle, -0.4], [2.5, middle, 0.1], [0.35, middle - 0.1, 0.2]])
    rotations = Rotation.from_euler(axes, angles).as_quat()
    found = euler_angles(rotations, axes)
    assert error(rotations, axes, found) < 1e-12
    np.testing.assert_allclose(found[:, 0], [found[0, 0], found[0, 0], found[0, 0], found[3, 0]], atol=1e-9)
    np.testing.assert_allclose(found[[0, 3]], angles[[0, 3]], atol=1e-9)


def test_a_lock_in_the_first_frame_leaves_the_first_angle_zero():
    found = euler_angles(Rotation.from_euler("ZXY", [[0.5, np.pi / 2, 0.25]]).as_quat(), "ZXY")
    np.testing.assert_allclose(found, [[0.0, np.pi / 2, 0.75]], atol=1e-7)


@settings(max_examples=200)
@given(st.sampled_from(ORDERS), st.lists(triple, min_size=1, max_size=4))
def test_no_equivalent_triple_is_nearer_to_the_frame_before(axes, triples):
    found = euler_angles(Rotation.from_euler(axes, triples).as_quat(), axes)
    before = np.concatenate([np.zeros((1, 3)), found[:-1]])
    for twin in (found, found * [1, -1, 1] + np.pi):
        away = np.abs(np.remainder(twin - before + np.pi, 2 * np.pi) - np.pi)
        assert np.all(np.linalg.norm(found - before, axis=1) <= np.linalg.norm(away, axis=1) + 1e-6)


@settings(max_examples=200)
@given(st.sampled_from(SHORT_ORDERS), st.lists(st.tuples(angle, near_lock | angle), min_size=1, max_size=6))
def test_fewer_axes_reproduce_the_rotations_they_can_make(axes, pairs):
    rotations = Rotation.from_euler(axes, np.array(pairs)[:, : len(axes)]).as_quat()
    angles = euler_angles(rotations, axes)
    assert angles.shape == (len(pairs), len(axes))
    assert error(rotations, axes, angles) < 2e-11
    np.testing.assert_allclose(np.abs(np.sum(restrict(rotations, axes) * rotations, axis=1)), 1.0, atol=1e-12)


@settings(max_examples=200)
@given(st.sampled_from("XYZ"), triple, angle)
def test_no_rotation_about_one_axis_is_nearer(axis, angles, other):
    rotation = Rotation.from_euler("XYZ", angles)
    nearest = Rotation.from_quat(restrict(rotation.as_quat()[None], axis)[0])
    other = Rotation.from_euler(axis, other)
    assert (rotation.inv() * nearest).magnitude() <= (rotation.inv() * other).magnitude() + 1e-7


@pytest.mark.parametrize("order", ORDERS)
def test_two_axes_keep_the_direction_of_the_third(order):
    rotations = Rotation.random(500, rng=2)
    missing = np.eye(3)["XYZ".index(order[2])]
    kept = Rotation.from_quat(restrict(rotations.as_quat(), order[:2]))
    np.testing.assert_allclose(kept.apply(missing), rotations.apply(missing), atol=1e-9)
    assert np.all((kept.inv() * rotations).magnitude() <= np.pi / 2 + 1e-9)


def test_no_axes_leave_nothing_three_leave_everything_and_one_turns_on():
    rotations = Rotation.random(5, rng=3).as_quat()
    assert euler_angles(rotations, "").shape == (5, 0)
    np.testing.assert_array_equal(restrict(rotations, ""), np.tile([0, 0, 0, 1], (5, 1)))
    rotations = Rotation.random(5, rng=3).as_quat()
    np.testing.assert_array_equal(restrict(rotations, "YXZ"), rotations)
    angles = np.linspace(0, 20, 100)[:, None]
    np.testing.assert_allclose(euler_angles(Rotation.from_euler("Y", angles).as_quat(), "Y"), angles, atol=1e-12)


@pytest.mark.parametrize("axes", ["ZXY", "ZX", "Y"])
def test_rotations_of_channels_are_those_of_their_angles_and_no_other_joint_is_written(axes):
    values = np.random.default_rng(0).uniform(-400, 400, (5, 9))
    columns, joints = np.array([[7, 2, 4], [0, 1, 3]])[:, : len(axes)], np.array([2, 0])
    rotations = np.full((5, 4, 4), 9.0)
    write_channel_rotations(values, columns, axes, joints, rotations)
    np.testing.assert_array_equal(rotations[:, joints], from_euler_angles(np.radians(values[:, columns]), axes))
    np.testing.assert_array_equal(rotations[:, [1, 3]], 9.0)
