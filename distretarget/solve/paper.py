"""The paper's objective, Eq. (2), solved over the rotations of exact bones instead of free points."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from distretarget.distances import DistanceProblem
from distretarget.numerics.stress import stress_and_gradient, target_distances
from distretarget.solve.articulation import Body, Work
from distretarget.solve.poses import (
    Clip,
    Frame,
    Poses,
    Springs,
    continue_poses,
    needs_curvature,
    pose_solver,
    scratch_arrays,
)
from distretarget.solve.spg import Effort, Minimum, copy_to, record

Array = NDArray[np.float64]

HOLD = 1e-4  # holds what the stress does not see (twist, the turn of the whole body) to the rotation copy
TOLERANCE = 1e-5  # see `pose_solver`
ROOT = 1.0  # the stress does not see the root's place: it stays on its path
BLOCK = 256  # frames solved between two reports of progress


class Terms(NamedTuple):
    """The stress of one frame.

    Attributes:
        points: (points,), the joint at each point.
        delta, pi: (points, points), target distances [body sizes] and priorities.
        x, gradient: (3, points), scratch.
        springs: one per pair, scratch for the curvature.
    """

    points: NDArray[np.intp]
    delta: Array
    pi: Array
    x: Array
    gradient: Array
    springs: Springs


@njit(cache=True, error_model="numpy", fastmath=True)
def _stress(work: Work, terms: Terms) -> float:
    for point, joint in enumerate(terms.points):
        for i in range(3):
            terms.x[i, point] = work.x[joint, i]
    sigma = stress_and_gradient(terms.x, terms.delta, terms.pi, terms.gradient)
    for point, joint in enumerate(terms.points):
        for i in range(3):
            work.pull[joint, i] += terms.gradient[i, point]
    return sigma


@njit(cache=True, error_model="numpy", fastmath=True)
def _pair_springs(work: Work, terms: Terms) -> Springs:
    """A spring along each pair, as stiff as its priority."""
    springs = terms.springs
    for s in range(len(springs.a)):
        square = 0.0
        for i in range(3):
            springs.e[s, i] = work.x[springs.a[s], i] - work.x[springs.b[s], i]
            square += springs.e[s, i] ** 2
        for i in range(3):
            springs.e[s, i] /= np.sqrt(max(square, 1e-30))
    return springs


_solve_pose = pose_solver(_stress, _pair_springs, TOLERANCE)


@njit(cache=True, error_model="numpy")
def _solve(body, bones, root, source, ratio, terms, guess, v, first, figures):  # type: ignore[no-untyped-def]
    """Solve the frames from `first` on, each from the best of: the guess, the pose before, the two before continued."""
    work, U, scratch, starts = scratch_arrays(body)
    last = Minimum(0.0, 0, 0, 0)
    for t in range(len(bones)):
        at = first + t
        count = min(at, 2) + 1
        copy_to(starts[0], guess[t])
        continue_poses(v, at, starts)
        target_distances(source[t], ratio, terms.delta)
        frame = Frame(bones[t], root[t], U, scratch)
        last = _solve_pose(starts, count, body, work, frame, terms, needs_curvature(t, last), v[at])
        record(last, figures, at)


def solve_paper(clip: Clip, guess: Array, progress: Callable[[int], Any] = lambda _frames: None) -> Poses:
    """Minimise Eq. (2) over the rotations in every frame of a clip; lengths are in body sizes.

    `guess`, (frames, parts + 1, 3), has poses to start from where they are better than the frame before. `progress` is
    called with numbers of frames as they are done.
    """
    problem, unit = clip.problem, clip.problem.body_size
    count = int(clip.parts.max()) + 1
    body = Body(clip.skeleton.parents, clip.parts, np.append(np.full(count, HOLD), ROOT))
    bones, root = clip.bones / unit, clip.root / unit
    S = np.ascontiguousarray(clip.source[:, problem.sources].transpose(0, 2, 1))
    v = np.zeros((len(clip), count + 1, 3))
    figures = np.zeros((4, len(clip)))
    terms = _terms(problem)
    for start in range(0, len(clip), BLOCK):
        block = slice(start, min(start + BLOCK, len(clip)))
        _solve(body, bones[block], root[block], S[block], problem.ratio, terms, guess[block], v, start, figures)
        progress(block.stop - start)
    v[:, -1] *= unit
    return Poses(v, Effort(*figures[1:].astype(np.int64)))


def _terms(problem: DistanceProblem) -> Terms:
    points = len(problem)
    u, v = np.triu_indices(points, 1)
    on = problem.priorities[u, v] > 0
    u, v = u[on], v[on]
    directions = np.zeros((len(u), 3))
    springs = Springs(
        problem.targets[u],
        problem.targets[v],
        directions,
        directions.copy(),
        problem.priorities[u, v],
        np.zeros(len(u)),
    )
    square, columns = np.zeros((points, points)), np.zeros((3, points))
    return Terms(problem.targets, square, problem.priorities, columns, columns.copy(), springs)
