"""Solved postures: exact answers, invariances, and another solver from the same start."""

from dataclasses import replace

import numpy as np
import pytest
from bodies import matched, mirrored, moved, other_lengths, person, swaying
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation
from table_one import table_one

from distretarget.baseline.rotation_copy import RootScale, rotation_copy
from distretarget.distances import distance_problem, posture_stress, stress_and_gradient
from distretarget.ik.spg import Reason
from distretarget.numerics.rotations import best_rotation
from distretarget.objectives.paper import aligned, off_plane, solve_postures


def solve(motion, target):
    matching = matched(motion, target)
    problem = distance_problem(motion.skeleton, target, matching.drivers)
    scale = target.longest_path / motion.skeleton.longest_path
    copy = rotation_copy(matching, RootScale.even(scale))
    return problem, copy, solve_postures(problem, motion.positions, copy.positions)


def test_the_same_skeleton_is_solved_at_the_start():
    motion = swaying(person())
    _, _, postures = solve(motion, motion.skeleton)
    assert postures.stress.max() < 1e-24
    assert postures.effort.iterations.max() == 0
    np.testing.assert_allclose(postures.positions, motion.positions, atol=1e-12)


def test_every_bone_scaled_by_s_gives_s_times_the_posture():
    motion = swaying(person())
    _, _, postures = solve(motion, motion.skeleton.with_offsets(7.3 * motion.skeleton.offsets))
    assert postures.stress.max() < 1e-24
    np.testing.assert_allclose(postures.positions, 7.3 * motion.positions, atol=1e-10)


def test_stress_agrees_with_lbfgs_from_the_same_start():
    motion = swaying(table_one(), frames=6)
    target = other_lengths(motion.skeleton)
    for frame in range(6):
        one = motion[frame : frame + 1]
        problem, copy, postures = solve(one, target)
        delta = problem.ratio * np.linalg.norm(one.positions[0][:, None] - one.positions[0], axis=-1)

        def objective(x, delta=delta, pi=problem.priorities):
            gradient = np.empty((3, 22))
            return stress_and_gradient(x.reshape(3, 22), delta, pi, gradient), gradient.ravel()

        start = (copy.positions[0].T / problem.body_size).ravel()
        oracle = minimize(objective, start, jac=True, method="L-BFGS-B", options={"ftol": 0, "gtol": 1e-10})
        assert postures.effort.reasons[0] == Reason.CONVERGED
        assert postures.stress[0] == pytest.approx(oracle.fun, rel=1e-6)


def test_postures_are_turned_to_the_rotation_copy():
    """The stress does not say which way a posture is turned, nor where it is."""
    problem, copy, postures = solve(swaying(person()), other_lengths(person()))
    points, solved = copy.positions[:, problem.targets], postures.positions
    np.testing.assert_allclose(solved.mean(axis=1), points.mean(axis=1), atol=1e-12)
    around = [x - x.mean(axis=1, keepdims=True) for x in (solved, points)]
    assert np.degrees(Rotation.from_quat(best_rotation(*around)).magnitude()).max() < 1e-4


def test_postures_turn_with_the_source():
    motion, turn = swaying(person()), Rotation.from_rotvec([0.4, 2.0, -0.3])
    target = other_lengths(motion.skeleton)
    _, _, straight = solve(motion, target)
    _, _, turned = solve(moved(motion, turn, (3, 1, -2)), target)
    np.testing.assert_allclose(turned.stress, straight.stress, rtol=1e-9)
    shape = straight.positions - straight.positions[:, :1]
    expected = np.einsum("ij,fpj->fpi", turn.as_matrix(), shape)
    np.testing.assert_allclose(turned.positions - turned.positions[:, :1], expected, atol=1e-5)


def test_a_mirrored_source_gives_the_mirrored_postures():
    motion = swaying(person())
    target = other_lengths(motion.skeleton)
    _, _, straight = solve(motion, target)
    _, _, flipped = solve(mirrored(motion), target.with_offsets([-1, 1, 1] * target.offsets))
    np.testing.assert_allclose(flipped.stress, straight.stress, rtol=1e-9)
    np.testing.assert_allclose(flipped.positions, [-1, 1, 1] * straight.positions, atol=1e-5)


def test_units_do_not_matter():
    motion = swaying(person())
    target = other_lengths(motion.skeleton)
    _, _, metres = solve(motion, target)
    _, _, inches = solve(moved(motion, Rotation.identity(), scale=39.37), target.with_offsets(39.37 * target.offsets))
    np.testing.assert_allclose(inches.positions, 39.37 * metres.positions, atol=39.37e-5)
    np.testing.assert_allclose(inches.stress, metres.stress, rtol=1e-9)


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


def test_stress_of_the_solved_points_is_below_that_of_the_copy_and_is_what_the_solver_says():
    motion = swaying(person())
    problem, copy, postures = solve(motion, other_lengths(motion.skeleton))
    points = np.array(copy.positions)
    points[:, problem.targets] = postures.positions
    np.testing.assert_allclose(posture_stress(problem, motion.positions, points), postures.stress, rtol=1e-9)
    assert np.all(postures.stress < posture_stress(problem, motion.positions, copy.positions))


def test_alignment_is_a_proper_rotation_and_undoes_one():
    x = np.random.default_rng(3).normal(size=(5, 8, 3))
    x -= x.mean(axis=1, keepdims=True)
    turned = x @ Rotation.random(5, rng=np.random.default_rng(1)).as_matrix()
    np.testing.assert_allclose(aligned(turned, x), x, atol=1e-5)
    in_mirror = aligned(x * [-1, 1, 1], x)
    assert np.abs(in_mirror - x).max() > 0.1
