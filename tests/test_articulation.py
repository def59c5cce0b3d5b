"""Bodies of exact bones and rigid parts: poses, gradient and curvature against naive versions."""

from dataclasses import replace

import numpy as np
import pytest
from bodies import PERSON, held_still, matched, other_lengths, person, sample_target, swaying, tree_of
from scipy.spatial.transform import Rotation
from spring_case import Case, at
from table_one import table_one

from distretarget.ik.articulation import Articulation, Scratch, pose_body, pose_gradient, stiffness_energy
from distretarget.ik.curvature import Curvature, are_first, write_curvature
from distretarget.ik.poses import part_of_joint, posed_motion, subtree_lengths
from distretarget.ik.springs import write_moving_bones
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
    return Articulation(copy.skeleton.parents, parts, np.full(parts.max() + 2, stiffness))


def posed_by(v, body, copy, frame):
    scratch = Scratch.of(body)
    bones = copy.positions[frame] - copy.positions[frame, copy.skeleton.parents]
    pose_body(v, body, bones, copy.positions[frame, 0], scratch)
    return scratch


@pytest.mark.parametrize("size", [0.0, 1e-6, 0.5, 3.0])
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


def curvature_at(case, v):
    """The active parts at a pose, and their curvature."""
    case.positions(v)
    curvature, springs = Curvature.of(case.body), at(case.springs, 0)
    count = len(springs.a)
    bones = write_moving_bones(springs, count, case.body, curvature.below)
    parts = write_curvature(bones, v, case.body, case.scratch, springs, count, curvature)
    return curvature.active[:parts], curvature.H[: 3 * parts, : 3 * parts]


@pytest.mark.parametrize("kind", ["grounded", "between joints", "both"])
@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("size", [0.0, 1e-5, 0.7, 2.5])
def test_the_curvature_of_springs_at_rest_is_the_hessian_of_the_energy(seed, kind, size):
    """At the copy's pose and far from it, where the unknowns are no small turns."""
    case = Case(seed)
    v = size * np.random.default_rng(seed).normal(size=case.shape)
    case.without_residual(v)
    off = {"grounded": case.springs.b >= 0, "between joints": case.springs.b < 0, "both": False}[kind]
    case.springs.A[0, off] = 0.0
    active, H = curvature_at(case, v)
    h = 1e-5
    steps = h * np.eye(v.size)
    slopes = [case.energy_and_gradient(v.ravel() + s)[1] - case.energy_and_gradient(v.ravel() - s)[1] for s in steps]
    unknowns = (3 * active[:, None] + np.arange(3)).ravel()
    hessian = np.array(slopes) / (2 * h)
    np.testing.assert_allclose(np.triu(H), np.triu(hessian[np.ix_(unknowns, unknowns)]), atol=1e-6)
    others = np.setdiff1d(np.arange(v.size), unknowns)
    np.testing.assert_allclose(hessian[others], np.diag(np.repeat(case.stiffness, 3))[others], atol=1e-6)


def test_only_parts_that_a_spring_acts_on_are_unknowns():
    case = Case(0)
    case.springs.A[:] = 0.0
    assert len(curvature_at(case, np.zeros(case.shape))[0]) == 0
    case.springs.A[0, -1] = np.eye(3)  # a grounded one
    way, joint = set(), int(case.springs.a[-1])
    while joint:
        joint = int(case.body.parents[joint])
        way.add(int(case.body.parts[joint]))
    assert set(curvature_at(case, np.zeros(case.shape))[0]) == way | {len(case.stiffness) - 1}
    case = Case(0)
    case.springs.A[:] = 0.0
    case.springs.A[0, -1] = np.eye(3)
    joint = int(case.springs.a[-1])
    case.bones[0, joint] = 0.0
    part = case.body.parts[case.body.parents[joint]]
    assert part not in curvature_at(case, np.zeros(case.shape))[0]


def test_a_curvature_says_which_bones_move():
    case = Case(0)
    v, springs = np.zeros(case.shape), at(case.springs, 0)
    case.positions(v)
    curvature, count = Curvature.of(case.body), len(springs.a)

    def moved():
        return write_moving_bones(springs, count, case.body, curvature.below)

    def is_for(bones):
        return are_first(curvature.bones, curvature.below.moving_bones, bones)

    everything = moved()
    assert everything > 0
    assert not is_for(everything)  # nothing is written yet
    write_curvature(everything, v, case.body, case.scratch, springs, count, curvature)
    assert is_for(everything)
    springs.A[:] *= 2.0  # other springs of the same joints
    assert is_for(moved())
    springs.A[springs.b >= 0] = 0.0
    assert 0 < moved() < everything
    assert not is_for(moved())
    springs.A[:] = 0.0
    assert moved() == 0
    assert not is_for(0)


def test_both_ends_of_a_spring_move_with_what_carries_both():
    """So a spring between two children of the root turns neither the root nor moves its place."""
    case = Case(1)
    children = np.flatnonzero(case.body.parents == 0)[:2]
    case.springs.A[:] = 0.0
    case.springs.a[0], case.springs.b[0] = children
    case.springs.A[0, 0] = np.eye(3)
    assert set(curvature_at(case, np.zeros(case.shape))[0]) == {case.body.parts[0]}


HELD = held_still(swaying(other_lengths(PERSON), frames=5, angle=1.2), STILL)
ROOTS = rigid_part_roots(matched(PERSON, PERSON, dict.fromkeys(STILL)))


@pytest.mark.parametrize("copy", [HELD, swaying(table_one())], ids=["leaves at rest", "leaves that turn"])
def test_a_written_part_turns_as_one_and_leaves_that_turn_keep_the_rotations_of_the_copy(copy):
    parts = part_of_joint(copy.skeleton, ROOTS if copy is HELD else np.arange(len(copy.skeleton)))
    v = np.random.default_rng(2).normal(size=(len(copy), parts.max() + 2, 3))
    motion = posed_motion(copy, v, parts, copy.root_positions)
    for joint, below in enumerate(copy.skeleton.children):
        before, after = (Rotation.from_quat(m.world_rotations[:, joint]) for m in (copy, motion))
        kept = not below and copy is not HELD
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
    carriers = {name for name, below in zip(PERSON.names, PERSON.children, strict=True) if below}
    parts = dict(zip(PERSON.names, part_of_joint(PERSON, ROOTS), strict=True))
    assert len(set(parts.values())) == len(carriers - set(STILL))
    assert parts["LeftHip"] == parts["RightHip"] == parts["Hips"]
    assert parts["LeftShoulder"] == parts["RightCollar"] == parts["Chest3"]
    assert parts["RightShoulder"] != parts["Chest3"]
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
    body = other_lengths(PERSON)
    arm = [body.index(name) for name in ("Hips", "Chest", "Chest2", "Chest3", "LeftCollar", "LeftShoulder")]
    sums = subtree_lengths(body, np.array(arm[-1:]))
    np.testing.assert_allclose(sums[arm], np.cumsum(body.lengths[arm][::-1])[::-1])
    assert not np.delete(sums, arm).any()
