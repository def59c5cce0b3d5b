"""Poses of least energy: springs against a naive version, their curvature, and another solver from the same start."""

import numpy as np
import pytest
from bodies import person, swaying
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation

from distretarget import Skeleton
from distretarget.solve.articulation import Body, hang, parts_of, pose_body, pull_back, workspace
from distretarget.solve.contact import _solve
from distretarget.solve.poses import Springs, _curvature, _factorise, spring_energy
from distretarget.solve.spg import Reason

PERSON = person()


def random_springs(draw, joints, frames=1, count=12, grounded=4):
    """Springs with the frames in front, the last few of them grounded."""
    a = draw.integers(0, joints, count)
    b = (a + draw.integers(1, joints, count)) % joints
    b[count - grounded :] = -1
    e = draw.normal(size=(frames, count, 3))
    e /= np.linalg.norm(e, axis=-1, keepdims=True)
    k = np.where(b < 0, 1.0, draw.uniform(0, 1, (frames, count)))
    return Springs(a, b, draw.normal(size=(frames, count, 3)), e, draw.uniform(0.5, 3, (frames, count)), k)


def at(springs, frame):
    return Springs(springs.a, springs.b, *(values[frame] for values in springs[2:]))


def naive_energy(x, springs):
    energy = 0.0
    for a, b, rest, e, w, k in zip(*springs, strict=True):
        r = x[a] - rest - (x[b] if b >= 0 else 0)
        energy += 0.5 * w * r @ (k * np.eye(3) + (1 - k) * np.outer(e, e)) @ r
    return energy


class Case:
    """A small body in one posture per frame, its holds and springs."""

    def __init__(self, seed, frames=1, joints=8):
        draw = np.random.default_rng(seed)
        parents = [-1] + [int(draw.integers(max(0, joint - 3), joint)) for joint in range(1, joints)]
        names = tuple(f"j{joint}" for joint in range(joints))
        channels = (("Zrotation", "Xrotation", "Yrotation"),) * joints
        skeleton = Skeleton(names, parents, 0.4 * draw.normal(size=(joints, 3)), channels, [False] * joints)
        copy = swaying(skeleton, frames, seed=seed)
        self.parts = parts_of(skeleton, np.arange(joints))
        self.holds = draw.uniform(0.3, 1.0, self.parts.max() + 2)
        self.body = Body(skeleton.parents, self.parts, self.holds)
        self.bones = copy.positions - copy.positions[:, skeleton.parents]
        self.root = np.array(copy.positions[:, 0])
        self.springs = random_springs(draw, joints, frames)
        self.work = workspace(joints, self.parts.max() + 1)

    @property
    def shape(self):
        return len(self.holds), 3

    def positions(self, v, frame=0):
        pose_body(v, self.body, self.bones[frame], self.root[frame], self.work)
        return self.work.x.copy()

    def energy(self, v, frame=0):
        held = 0.5 * np.sum(self.holds[:, None] * v**2)
        return naive_energy(self.positions(v, frame), at(self.springs, frame)) + held

    def energy_and_gradient(self, flat, frame=0):
        v, gradient = flat.reshape(self.shape), np.empty(self.shape)
        self.positions(v, frame)
        self.work.pull[:] = 0.0
        value = spring_energy(self.work, at(self.springs, frame))
        return value + pull_back(v, self.body, self.work, gradient), gradient.ravel()

    def without_residual(self):
        """The same with springs at rest in the copy's posture."""
        for frame in range(len(self.root)):
            x, b = self.positions(np.zeros(self.shape), frame), self.springs.b
            self.springs.rest[frame] = x[self.springs.a] - np.where(b[:, None] >= 0, x[b], 0.0)
        return self

    def solved(self, before=None):
        """The poses of all frames, the first of which may be given, and the figures of the solver."""
        v, figures = np.zeros((len(self.root), *self.shape)), np.zeros((4, len(self.root)))
        first = 0
        if before is not None:
            first = len(before)
            v[:first] = before
        rows = Springs(*self.springs[:2], *(values[first:] for values in self.springs[2:]))
        _solve(self.body, self.bones[first:], self.root[first:], rows, v, first, figures)
        return v, figures


@pytest.mark.parametrize("seed", range(3))
def test_springs_have_the_energy_and_the_gradient_of_their_definition(seed):
    draw = np.random.default_rng(seed)
    work, springs = workspace(8, 2), at(random_springs(draw, 8), 0)
    work.x[:] = draw.normal(size=(8, 3))
    work.pull[:] = before = draw.normal(size=(8, 3))
    assert spring_energy(work, springs) == pytest.approx(naive_energy(work.x, springs))
    for i in np.ndindex(8, 3):
        step = np.zeros((8, 3))
        step[i] = 0.5
        slope = naive_energy(work.x + step, springs) - naive_energy(work.x - step, springs)
        assert work.pull[i] - before[i] == pytest.approx(slope, abs=1e-9)


def test_a_spring_along_its_axis_does_not_feel_what_happens_across():
    work = workspace(2, 1)
    axis, across = np.array([0.6, 0.8, 0.0]), np.array([0.8, -0.6, 2.0])
    springs = Springs(np.array([0]), np.array([1]), np.zeros((1, 3)), axis[None], np.array([4.0]), np.array([0.0]))
    work.x[0] = 0.5 * axis + across
    assert spring_energy(work, springs) == pytest.approx(0.5)
    np.testing.assert_allclose(work.pull, [2 * axis, -2 * axis])


@pytest.mark.parametrize("kind", ["grounded", "between joints", "both"])
@pytest.mark.parametrize("seed", range(3))
def test_the_curvature_of_springs_at_rest_is_the_hessian_of_the_energy(seed, kind):
    case = Case(seed).without_residual()
    off = {"grounded": case.springs.b >= 0, "between joints": case.springs.b < 0, "both": False}[kind]
    case.springs.w[0, off] = 0.0
    n = 3 * len(case.holds)
    U = np.zeros((n, n))
    case.positions(np.zeros(case.shape))
    _curvature(case.body, case.work, at(case.springs, 0), U)
    _factorise(U)
    U = np.triu(U)
    h = 1e-5
    steps = h * np.eye(n)
    slopes = [case.energy_and_gradient(step)[1] - case.energy_and_gradient(-step)[1] for step in steps]
    np.testing.assert_allclose(U.T @ U, np.array(slopes) / (2 * h), atol=1e-7)


def test_arms_are_made_anew_with_the_curvature():
    case = Case(0)
    U = np.zeros((3 * len(case.holds),) * 2)
    case.positions(np.ones(case.shape))
    _curvature(case.body, case.work, at(case.springs, 0), U)
    arms = case.work.arms.copy()
    hang(case.body, case.work)
    np.testing.assert_array_equal(case.work.arms, arms)
    case.positions(np.zeros(case.shape))
    hang(case.body, case.work)
    assert np.abs(case.work.arms - arms).max() > 0.1


@pytest.mark.parametrize("seed", range(6))
def test_the_minimum_is_that_of_lbfgs_from_the_same_start(seed):
    case = Case(seed)
    v, figures = case.solved()
    options = {"ftol": 0, "gtol": 1e-9, "maxiter": 5000}
    start = np.zeros(v[0].size)
    oracle = minimize(case.energy_and_gradient, start, jac=True, method="L-BFGS-B", options=options)
    assert figures[3, 0] == Reason.CONVERGED
    assert figures[0, 0] == pytest.approx(oracle.fun, rel=1e-6)
    assert figures[0, 0] == pytest.approx(case.energy(v[0]), rel=1e-12)
    np.testing.assert_allclose(case.positions(v[0]), case.positions(oracle.x.reshape(case.shape)), atol=1e-4)


def test_springs_at_rest_take_no_iteration():
    v, figures = Case(1, frames=3).without_residual().solved()
    np.testing.assert_array_equal(figures[1], 0)
    np.testing.assert_allclose(v, 0.0)


def test_a_start_at_the_minimum_is_used():
    case = Case(2, frames=2)
    for values in (case.bones, case.root, *case.springs[2:]):
        values[1] = values[0]
    v, figures = case.solved()
    assert figures[1, 0] > 0
    assert figures[1, 1] <= 1
    np.testing.assert_allclose(v[1], v[0], atol=1e-5)


def test_a_start_worse_than_the_copy_is_not_used():
    case = Case(3, frames=2)
    worse = 2.5 * np.random.default_rng(0).normal(size=(1, *case.shape))
    v, figures = case.solved(before=worse)
    fresh, once = case.solved(before=np.zeros_like(worse))
    assert figures[0, 1] == pytest.approx(once[0, 1], rel=1e-9)
    assert case.energy(worse[0], 1) > case.energy(np.zeros(case.shape), 1)
    np.testing.assert_allclose(v[1], fresh[1], atol=1e-9)


def test_the_two_poses_before_are_continued():
    """Where the deviation grows evenly, the continued pose is the minimum."""
    case = Case(4, frames=3)
    case.holds[:], springs = 1e-9, case.springs
    springs.w[:] = 0.0
    speed = np.random.default_rng(5).normal(size=case.shape) * 0.1
    before = np.array([speed, 2 * speed])
    springs.w[2, springs.b < 0] = 100.0
    springs.rest[2] = case.positions(3 * speed, 2)[springs.a]
    _, figures = case.solved(before=before)
    assert figures[0, 2] < 1e-6
    assert figures[1, 2] <= 3


def test_no_solved_pose_lies_above_any_of_its_starts():
    case = Case(5, frames=12)
    v, figures = case.solved()
    for frame in range(2, 12):
        starts = [np.zeros(case.shape), v[frame - 1], 2 * v[frame - 1] - v[frame - 2]]
        assert figures[0, frame] <= min(case.energy(start, frame) for start in starts) * (1 + 1e-12)


@pytest.mark.parametrize(("stiffer", "farther"), [(1e6, 1.0), (1.0, 1e4)])
def test_frames_that_do_not_converge_are_reported_and_no_worse_than_their_start(stiffer, farther):
    case = Case(6)
    case.springs.w[:] *= stiffer
    case.springs.rest[:] *= farther
    v, figures = case.solved()
    assert figures[3, 0] != Reason.CONVERGED
    assert figures[0, 0] == pytest.approx(case.energy(v[0]), rel=1e-9)
    assert figures[0, 0] < case.energy(np.zeros(case.shape))


def test_springs_without_weight_may_be_anything():
    case = Case(7, frames=2)
    expected, _ = case.solved()
    case.springs = Springs(
        *(np.append(joints, [0, 1]) for joints in case.springs[:2]),
        *(np.concatenate([values, np.full_like(values[:, :2], 1e30)], axis=1) for values in case.springs[2:]),
    )
    case.springs.w[:, -2:] = 0.0
    v, _ = case.solved()
    np.testing.assert_array_equal(v, expected)


def test_a_turned_world_turns_the_solution():
    case = Case(8)
    straight, figures = case.solved()
    turn = Rotation.from_rotvec([0.3, -1.2, 0.5])
    for values in (case.bones, case.root, case.springs.rest, case.springs.e):
        values[0] = turn.apply(values[0])
    turned, again = case.solved()
    assert again[0, 0] == pytest.approx(figures[0, 0], rel=1e-9)
    np.testing.assert_allclose(turned[0], turn.apply(straight[0]), atol=1e-4)
