"""The paper's objective: solved postures, rotations from points, and over rotations; against other solvers."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from bodies import PERSON, matched, mirrored, moved, other_lengths, paths_of, person, sample, sample_target, swaying
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation

from distretarget import Motion, Options, retarget
from distretarget.baseline.rotation_copy import RootScale, rotation_copy
from distretarget.distances import distance_problem, posture_stress, stress_and_gradient
from distretarget.ik.articulation import Articulation, Scratch, pose_body, pose_gradient, stiffness_energy
from distretarget.ik.poses import fit_rotations, posed_motion
from distretarget.ik.spg import Reason
from distretarget.numerics.rotations import best_rotation
from distretarget.objectives.clip import Clip
from distretarget.objectives.paper import (
    PART_STIFFNESS,
    ROOT_STIFFNESS,
    aligned,
    off_plane,
    solve_poses,
    solve_postures,
)

TARGET = other_lengths(PERSON)
CASES = [("clap", "long_arms"), ("hands_on_hips", "child"), ("walk", "long_spine"), ("squat", "giant")]


@cache
def paper_of(name, body):
    source = sample(name)[::4]
    target = sample_target(body).for_source(source.rigid_skeleton).skeleton
    return source, retarget(source, target, Options(objective="paper"))


class Solved:
    """A motion of the person solved on another body, from the rotation copy."""

    def __init__(self, source, target=TARGET):
        self.source, self.matching = source, matched(source, target)
        self.clip = Clip.of(self.matching, RootScale.even(1.0))
        self.clip = replace(self.clip, root=self.clip.copy.root_positions)
        self.problem, self.copy, self.parts = self.clip.distances, self.clip.copy, self.clip.parts
        count = self.parts.max() + 1
        self.body = Articulation(target.parents, self.parts, np.append(np.full(count, PART_STIFFNESS), ROOT_STIFFNESS))
        self.scratch = Scratch.of(self.body)
        self.poses = solve_poses(self.clip, np.zeros((len(source), count + 1, 3)))
        root = self.copy.root_positions + self.poses.v[:, -1]
        self.motion = posed_motion(self.copy, self.poses.v, self.parts, root)

    def pose(self, frame):
        """The solved pose, the root's displacement in body sizes, (n,)."""
        v = np.array(self.poses.v[frame])
        v[-1] /= self.problem.body_size
        return v.ravel()

    def objective(self, flat, frame):
        """Eq. (2) and the stiffness terms, with the gradient, of a pose (n,)."""
        problem, x = self.problem, self.copy.positions[frame] / self.problem.body_size
        v, gradient = flat.reshape(self.poses.v[0].shape), np.empty(self.poses.v[0].shape)
        pose_body(v, self.body, x - x[self.copy.skeleton.parents], x[0], self.scratch)
        y = self.source.positions[frame, problem.sources]
        delta = problem.ratio * np.linalg.norm(y[:, None] - y, axis=-1)
        point_gradient = np.empty((3, len(problem)))
        points = np.ascontiguousarray(self.scratch.x[problem.targets].T)
        sigma = stress_and_gradient(points, delta, problem.priorities, point_gradient)
        self.scratch.gradient[:] = 0.0
        self.scratch.gradient[problem.targets] = point_gradient.T
        pose_gradient(v, self.body, self.scratch, gradient)
        return sigma + stiffness_energy(v, self.body), gradient.ravel()


SOLVED = Solved(swaying(PERSON, frames=12))


@pytest.mark.parametrize(("name", "body"), CASES)
def test_written_stress_lies_between_that_of_the_solved_points_and_the_copys(name, body):
    _, result = paper_of(name, body)
    assert np.all(result.written_stress <= result.copy_stress)
    assert np.all(result.written_stress >= result.free_stress)
    assert result.written_stress.mean() < 0.8 * result.copy_stress.mean()


@pytest.mark.parametrize(("name", "body"), CASES)
def test_written_bones_are_exact_and_every_frame_converges(name, body):
    _, result = paper_of(name, body)
    motion, parents = result.motion, result.motion.skeleton.parents[1:]
    bones = np.linalg.norm(motion.positions[:, 1:] - motion.positions[:, parents], axis=-1)
    np.testing.assert_allclose(bones, np.broadcast_to(motion.skeleton.lengths[1:], bones.shape), rtol=1e-9)
    assert np.all(result.effort.reasons == Reason.CONVERGED)


TURN = Rotation.from_rotvec([0.4, 2.0, -0.3])


@pytest.mark.parametrize("factor", [1.0, 0.31])
def test_a_body_of_the_same_proportions_has_no_stress(factor):
    source = swaying(PERSON)
    result = retarget(source, PERSON.with_offsets(factor * PERSON.offsets), Options(objective="paper"))
    assert result.written_stress.max() < 1e-12
    assert result.postures.effort.iterations.max() == 0
    np.testing.assert_allclose(result.motion.positions, factor * source.positions, atol=1e-6)


def test_stress_of_the_written_motion_is_what_its_positions_say():
    source, result = paper_of("clap", "long_arms")
    frame, target = 20, result.motion.skeleton
    x, y = source.positions[frame], result.motion.positions[frame]
    joints = np.arange(len(target))
    tau1, tau2, sizes = paths_of(source.skeleton), paths_of(target), target.path_sizes(joints)
    sigma = sum(
        (sizes.max() - sizes[u, v] + 2)
        / sizes.max()
        * (np.linalg.norm(y[u] - y[v]) - tau2[u, v] * np.linalg.norm(x[u] - x[v]) / tau1[u, v]) ** 2
        / 2
        for u in range(len(target))
        for v in range(u + 1, len(target))
    )
    height = np.ptp(target.rest_positions[:, 1])
    assert result.written_stress[frame] == pytest.approx(sigma / height**2, rel=1e-9)


def test_lbfgs_cannot_improve_a_solved_pose():
    frame = 7
    v = SOLVED.pose(frame)
    value, gradient = SOLVED.objective(v, frame)
    start = SOLVED.objective(np.zeros(v.size), frame)[0]
    options = {"ftol": 0, "gtol": 1e-10, "maxiter": 300}
    oracle = minimize(SOLVED.objective, v, args=(frame,), jac=True, method="L-BFGS-B", options=options)
    assert value < 0.9 * start
    assert oracle.fun >= value * (1 - 1e-4)
    assert np.abs(gradient).max() < 1e-4


def test_stiffness_hardly_adds_to_the_stress():
    stress = posture_stress(SOLVED.problem, SOLVED.source.positions, SOLVED.motion.positions)
    for frame, sigma in enumerate(stress):
        value = SOLVED.objective(SOLVED.pose(frame), frame)[0]
        assert sigma <= value <= 1.02 * sigma
    np.testing.assert_allclose(SOLVED.motion.root_positions, SOLVED.copy.root_positions, atol=1e-6)
    again = solve_poses(SOLVED.clip[:1], SOLVED.poses.v[:1])
    assert again.effort.iterations[0] <= 1 < SOLVED.poses.effort.iterations[0]
    np.testing.assert_allclose(again.v, SOLVED.poses.v[:1], atol=1e-3)


def solve(motion, target):
    matching = matched(motion, target)
    problem = distance_problem(motion.skeleton, target, matching.drivers)
    scale = target.longest_path / motion.skeleton.longest_path
    copy = rotation_copy(matching, RootScale.even(scale))
    return problem, copy, solve_postures(problem, motion.positions, copy.positions)


def test_postures_are_turned_to_the_rotation_copy():
    """The stress does not say which way a posture is turned, nor where it is."""
    problem, copy, postures = solve(swaying(person()), other_lengths(person()))
    points, solved = copy.positions[:, problem.targets], postures.positions
    np.testing.assert_allclose(solved.mean(axis=1), points.mean(axis=1), atol=1e-12)
    around = [x - x.mean(axis=1, keepdims=True) for x in (solved, points)]
    assert np.degrees(Rotation.from_quat(best_rotation(*around)).magnitude()).max() < 1e-4


def test_each_frame_is_solved_for_itself():
    motion = swaying(person())
    target = other_lengths(motion.skeleton)
    _, _, whole = solve(motion, target)
    later = motion[7:]
    _, _, part = solve(later, target)
    np.testing.assert_allclose(part.positions, whole.positions[7:], atol=1e-12)


def test_postures_are_never_mirrored():
    motion = swaying(person(), frames=200, angle=1.5)
    problem, copy, postures = solve(motion, other_lengths(motion.skeleton))
    x, c = (y - y.mean(axis=1, keepdims=True) for y in (postures.positions, copy.positions[:, problem.targets]))
    assert np.all(np.linalg.det(x.transpose(0, 2, 1) @ c) > 0)
    x = np.random.default_rng(3).normal(size=(5, 8, 3))
    x -= x.mean(axis=1, keepdims=True)
    turned = x @ Rotation.random(5, rng=np.random.default_rng(1)).as_matrix()
    np.testing.assert_allclose(aligned(turned, x), x, atol=1e-5)
    in_mirror = aligned(x * [-1, 1, 1], x)
    assert np.abs(in_mirror - x).max() > 0.1


def test_a_planar_start_leaves_its_plane():
    body = person()
    flat = body.with_offsets(body.offsets * [1, 1, 0])
    motion = swaying(flat, frames=2, angle=0.0)
    target = flat.with_lengths(flat.lengths * np.where(np.arange(len(flat)) % 2, 1.8, 0.7))
    _, copy, postures = solve(motion, target)
    assert np.ptp(copy.positions[0, :, 2]) == 0.0
    depth = np.linalg.svd(postures.positions[0] - postures.positions[0].mean(axis=0), compute_uv=False)[2]
    assert depth > 1e-2 * flat.longest_path


def test_off_plane_moves_flat_postures_only():
    solid = np.random.default_rng(0).normal(size=(1, 3, 10))
    np.testing.assert_array_equal(off_plane(solid), solid)
    for rank in (0, 1, 2):
        flat = solid * (np.arange(3) < rank)[:, None]
        extents = np.linalg.svd(off_plane(flat), compute_uv=False)
        assert np.all(extents > 1e-5)
        np.testing.assert_allclose(off_plane(flat), flat, atol=3e-4)


def test_frames_that_do_not_converge_are_listed():
    motion = swaying(person(), frames=3)
    _, _, postures = solve(motion, other_lengths(motion.skeleton))
    assert postures.effort.not_converged.size == 0
    reasons = np.array([0, Reason.ITERATION_LIMIT, Reason.LINE_SEARCH_FAILED])
    np.testing.assert_array_equal(replace(postures.effort, reasons=reasons).not_converged, [1, 2])


BODY = person()
ALL = np.arange(len(BODY))


def copy_of(motion, target):
    return rotation_copy(matched(motion, target), RootScale.even(1.0))


def test_points_that_fit_the_bones_are_reached_and_others_leave_their_lengths():
    reached = swaying(BODY, seed=5)
    copy = swaying(BODY, seed=6)
    copy = replace(copy, root_positions=reached.root_positions)
    joints = np.flatnonzero(~BODY.end_sites)
    result = fit_rotations(copy, reached.positions, ALL, ALL)
    np.testing.assert_allclose(result.positions[:, joints], reached.positions[:, joints], atol=1e-4)
    copy = copy_of(swaying(BODY), other_lengths(BODY))
    result = fit_rotations(copy, copy.positions, ALL, ALL)
    np.testing.assert_allclose(result.positions, copy.positions, atol=1e-9)
    np.testing.assert_allclose(result.world_rotations, copy.world_rotations, atol=1e-9)
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


def test_points_that_all_coincide_give_finite_rotations():
    copy = copy_of(swaying(BODY), other_lengths(BODY))
    result = fit_rotations(copy, np.zeros_like(copy.positions), ALL, ALL)
    assert isinstance(result, Motion)
    assert np.all(np.isfinite(result.rotations))


@pytest.mark.parametrize(
    ("elsewhere", "matrix", "of_target"),
    [
        (lambda motion: moved(motion, TURN, (3, 1, -2)), TURN.as_matrix(), np.eye(3)),
        (mirrored, np.diag([-1.0, 1, 1]), np.diag([-1.0, 1, 1])),
        (lambda motion: moved(motion, Rotation.identity(), scale=39.37), 39.37 * np.eye(3), 39.37 * np.eye(3)),
    ],
    ids=["turned and moved", "mirrored", "in inches"],
)
def test_postures_turn_flip_and_grow_with_the_source(elsewhere, matrix, of_target):
    motion, target = swaying(person()), other_lengths(person())
    _, _, plain = solve(motion, target)
    _, _, other = solve(elsewhere(motion), target.with_offsets(target.offsets @ of_target))
    np.testing.assert_allclose(other.stress, plain.stress, rtol=1e-9)
    shapes = [postures.positions - postures.positions[:, :1] for postures in (plain, other)]
    np.testing.assert_allclose(shapes[1], shapes[0] @ matrix.T, atol=1e-5 * np.abs(matrix).max())
