"""The stress of a frame, minimised over free points and over the rotations of rigid bones. Compiled."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from distretarget.distances import stress_and_gradient, target_distances
from distretarget.ik.articulation import Articulation, Scratch
from distretarget.ik.pose_solver import CopiedBones, Workspace, pose_solver
from distretarget.ik.spg import record, spectral_gradient, steepest
from distretarget.ik.springs import FrameSprings
from distretarget.numerics.compiled import Out, compiled, inlined
from distretarget.numerics.vectors import F1, F2, F3, I1, Array, copy_to

POINT_TOLERANCE = 1e-9  # [body sizes] a posture is solved when the search direction is shorter than this
POINT_ITERATIONS = 2000  # at most, per frame


class UserDistances(NamedTuple):
    """Pairs of points whose distances a user sets: they replace delta and pi, Eq. (2)."""

    u: I1  # (pairs,), the first point
    v: I1  # (pairs,), the second point
    delta: F1  # (pairs,), the user's distance [body sizes]
    pi: F1  # (pairs,), the user's priority
    paper_pi: F1  # (pairs,), the priority of the paper
    weight: F2  # (frames, pairs), blend weight of the user's distance and priority, 0 to 1

    def of_frames(self, frames: slice) -> UserDistances:
        """Return those of some frames."""
        return self._replace(weight=self.weight[frames])


def no_distances(frames: int) -> UserDistances:
    """Return no pairs."""
    none, nothing = np.zeros(0, np.intp), np.zeros(0)
    return UserDistances(none, none, nothing, nothing, nothing, np.zeros((frames, 0)))


@inlined()
def _put_distances(set_by_user: UserDistances, frame: int, delta: Array, pi: Array) -> None:
    """Blend the distances and priorities that a user sets into those of a frame, (points, columns) each."""
    for n in range(len(set_by_user.u)):
        u, v, w = set_by_user.u[n], set_by_user.v[n], set_by_user.weight[frame, n]
        value = delta[u, v] + w * (set_by_user.delta[n] - delta[u, v])
        priority = set_by_user.paper_pi[n] + w * (set_by_user.pi[n] - set_by_user.paper_pi[n])
        delta[u, v] = delta[v, u] = value
        pi[u, v] = pi[v, u] = priority


class Stress(NamedTuple):
    """The stress of one frame: target distances and priorities, (points, columns)."""

    delta: F2
    pi: F2


@inlined()
def _objective(x, problem, gradient):  # type: ignore[no-untyped-def]
    return stress_and_gradient(x, problem.delta, problem.pi, gradient)


_minimise = spectral_gradient(_objective, steepest, adaptive=True)


@compiled()
def solve_points(
    source: F3,
    starts: F3,
    ratio: F2,
    problem: Stress,
    set_by_user: UserDistances,
    solved: Out[F3],
    first: int,
    log: Out[F2],
    gradient: Out[F2],
    scratch: Out[F3],
) -> None:
    """Solve a block of frames, the first of which is column `first` of `log`; distances are computed frame by frame."""
    for t in range(len(source)):
        copy_to(solved[t], starts[t])
        target_distances(source[t], ratio, problem.delta)
        _put_distances(set_by_user, t, problem.delta, problem.pi)
        sigma = _objective(solved[t], problem, gradient)
        minimum = _minimise(solved[t], sigma, gradient, problem, POINT_TOLERANCE, POINT_ITERATIONS, scratch)
        record(minimum, log, first + t)


class PaperTerms(NamedTuple):
    """The stress of one frame."""

    points: I1  # (points,), the joint at each point
    delta: F2  # (points, points), target distances [body sizes]
    pi: F2  # (points, points), priorities
    x: F2  # (3, points), scratch
    gradient: F2  # (3, points), scratch
    priorities: F1  # (springs,), pi of each pair whose pi is not 0
    springs: FrameSprings  # one for each of these pairs, scratch for the curvature


class PaperFrames(NamedTuple):
    """A block of frames."""

    source: F3  # (frames, 3, points), the source's points [source file units]
    guess: F3  # (frames, parts + 1, 3), the start pose of each frame
    ratio: F2  # (points, points), tau2 / tau1 [body sizes / source file unit]
    terms: PaperTerms  # those of one frame, scratch
    set_by_user: UserDistances  # distances in place of the source's
    springs: I1  # (pairs,), the spring of each of them


@inlined(fastmath=True)
def _stress(scratch: Scratch, terms: PaperTerms) -> float:
    for point, joint in enumerate(terms.points):
        for i in range(3):
            terms.x[i, point] = scratch.x[joint, i]
    sigma = stress_and_gradient(terms.x, terms.delta, terms.pi, terms.gradient)
    for point, joint in enumerate(terms.points):
        for i in range(3):
            scratch.gradient[joint, i] += terms.gradient[i, point]
    return sigma


@inlined(fastmath=True)
def _pair_springs(scratch: Scratch, terms: PaperTerms) -> tuple[FrameSprings, int]:
    """A spring along each pair, with its priority as stiffness."""
    springs = terms.springs
    for s in range(len(springs.a)):
        a, b = scratch.x[springs.a[s]], scratch.x[springs.b[s]]
        square = 1e-30
        for i in range(3):
            square += (a[i] - b[i]) ** 2
        for i in range(3):
            for j in range(3):
                springs.A[s, i, j] = terms.priorities[s] * (a[i] - b[i]) * (a[j] - b[j]) / square
    return springs, len(springs.a)


@inlined()
def _terms_of(given: PaperFrames, frame: int, start: Array) -> PaperTerms:
    copy_to(start, given.guess[frame])
    target_distances(given.source[frame], given.ratio, given.terms.delta)
    _put_distances(given.set_by_user, frame, given.terms.delta, given.terms.pi)
    for n in range(len(given.springs)):
        if given.springs[n] >= 0:
            given.terms.priorities[given.springs[n]] = given.terms.pi[given.set_by_user.u[n], given.set_by_user.v[n]]
    return given.terms


_solve_poses = pose_solver(_terms_of, _stress, _pair_springs)


@compiled()
def solve_paper_frames(
    body: Articulation,
    copy: CopiedBones,
    given: PaperFrames,
    tolerance: float,
    v: Out[F3],
    first: int,
    log: Out[F2],
    work: Workspace,
) -> None:
    """Solve the frames of `copy` over rotations, see `pose_solver`."""
    _solve_poses(body, copy, given, tolerance, v, first, log, work)
