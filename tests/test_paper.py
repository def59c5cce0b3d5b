"""The paper's objective over rotations: exact answers, bounds, and another solver from the solution."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from bodies import PERSON, matched, other_lengths, paths_of, sample, sample_target, swaying
from scipy.optimize import minimize

from distretarget import Options, retarget
from distretarget.baseline.rotation_copy import RootScale
from distretarget.distances import posture_stress, stress_and_gradient
from distretarget.ik.articulation import Articulation, Scratch, pose_body, pose_gradient, stiffness_energy
from distretarget.ik.poses import posed_motion
from distretarget.ik.spg import Reason
from distretarget.numerics.parallel import BLOCK_FRAMES
from distretarget.objectives.clip import Clip
from distretarget.objectives.paper import PART_STIFFNESS, ROOT_STIFFNESS, solve_poses

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
        self.body = Articulation.of(target, self.parts, np.append(np.full(count, PART_STIFFNESS), ROOT_STIFFNESS))
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


@pytest.mark.parametrize("factor", [1.0, 0.31])
def test_a_body_of_the_same_proportions_has_no_stress(factor):
    source = swaying(PERSON)
    result = retarget(source, PERSON.with_offsets(factor * PERSON.offsets), Options(objective="paper"))
    assert result.written_stress.max() < 1e-12
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


@pytest.mark.parametrize("frame", [0, 7])
def test_lbfgs_cannot_improve_a_solved_pose(frame):
    v = SOLVED.pose(frame)
    value, gradient = SOLVED.objective(v, frame)
    start = SOLVED.objective(np.zeros(v.size), frame)[0]
    options = {"ftol": 0, "gtol": 1e-10, "maxiter": 300}
    oracle = minimize(SOLVED.objective, v, args=(frame,), jac=True, method="L-BFGS-B", options=options)
    assert value < 0.9 * start
    assert oracle.fun >= value * (1 - 1e-4)
    assert np.abs(gradient).max() < 1e-4


def test_lbfgs_from_the_copy_finds_nothing_better_in_the_first_frame():
    v = SOLVED.pose(0)
    options = {"ftol": 0, "gtol": 1e-10, "maxiter": 400}
    oracle = minimize(SOLVED.objective, np.zeros(v.size), args=(0,), jac=True, method="L-BFGS-B", options=options)
    assert SOLVED.objective(v, 0)[0] == pytest.approx(oracle.fun, rel=1e-4)


def test_stiffness_hardly_adds_to_the_stress():
    stress = posture_stress(SOLVED.problem, SOLVED.source.positions, SOLVED.motion.positions)
    for frame, sigma in enumerate(stress):
        value = SOLVED.objective(SOLVED.pose(frame), frame)[0]
        assert sigma <= value <= 1.02 * sigma


def test_the_root_stays_on_its_path():
    np.testing.assert_allclose(SOLVED.motion.root_positions, SOLVED.copy.root_positions, atol=1e-6)


def test_a_guess_that_is_better_than_the_copy_is_used():
    again = solve_poses(SOLVED.clip[:1], SOLVED.poses.v[:1])
    assert again.effort.iterations[0] <= 1 < SOLVED.poses.effort.iterations[0]
    np.testing.assert_allclose(again.v, SOLVED.poses.v[:1], atol=1e-3)


def test_progress_counts_every_frame():
    source, seen = swaying(PERSON, frames=BLOCK_FRAMES + 1), []
    retarget(source, PERSON, Options(objective="paper"), progress=seen.append)
    assert sum(seen) == BLOCK_FRAMES + 1
    assert len(seen) > 1
