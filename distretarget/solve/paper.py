"""The paper's objective, Eq. (2), solved over the rotations of exact bones instead of free points."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from distretarget.distances import DistanceProblem
from distretarget.numerics.blocks import blocks_of
from distretarget.numerics.compiled import inlined
from distretarget.numerics.loops import copy_to
from distretarget.numerics.stress import stress_and_gradient, target_distances
from distretarget.solve.articulation import Articulation, Scratch
from distretarget.solve.chunks import Progress
from distretarget.solve.pose_solver import Clip, Workspace, compile_pose_solver
from distretarget.solve.poses import PoseProblem, Poses
from distretarget.solve.spg import Effort
from distretarget.solve.springs import Springs

Array = NDArray[np.float64]

PART_STIFFNESS = 1e-4  # keeps what the stress does not see (twist, the turn of the whole body) near the rotation copy
ROOT_STIFFNESS = 1.0  # keeps the root on its path, which the stress does not see either
POSE_TOLERANCE = 1e-5  # a frame is solved when the search direction, in the metric of the curvature, is shorter


class Terms(NamedTuple):
    """The stress of one frame.

    Attributes:
        points: (points,), the joint at each point.
        delta, pi: (points, points), target distances [body sizes] and priorities.
        x, gradient: (3, points), scratch.
        priorities: (springs,), pi of each pair that counts.
        springs: one for each of these, scratch for the curvature.
    """

    points: NDArray[np.intp]
    delta: Array
    pi: Array
    x: Array
    gradient: Array
    priorities: Array
    springs: Springs


class Given(NamedTuple):
    """A block of frames.

    Attributes:
        source: (frames, 3, points), the source's points [source file units].
        guess: (frames, parts + 1, 3), a pose to start each frame from.
        ratio: (points, points), tau2 / tau1 [body sizes / source file unit].
        terms: of a frame, scratch.
    """

    source: Array
    guess: Array
    ratio: Array
    terms: Terms


def solve_paper(problem: PoseProblem, guess: Array, progress: Progress = lambda _frames: None) -> Poses:
    """Minimise Eq. (2) over the rotations in every frame of a clip; lengths are in body sizes.

    `guess`, (frames, parts + 1, 3), has a pose for each frame, to start from where it is better than the poses before.
    `progress` is called with numbers of solved frames.
    """
    distances, unit = problem.distances, problem.distances.body_size
    parts = int(problem.parts.max()) + 1
    stiffness = np.append(np.full(parts, PART_STIFFNESS), ROOT_STIFFNESS)
    body = Articulation.of(problem.skeleton, problem.parts, stiffness)
    bones, root = np.ascontiguousarray(problem.bones / unit), np.ascontiguousarray(problem.root / unit)
    S = np.ascontiguousarray(problem.source[:, distances.sources].transpose(0, 2, 1))
    v = np.zeros((len(problem), parts + 1, 3))
    log = np.zeros((4, len(problem)))
    terms, work = _terms(distances), Workspace.of(body)
    for block in blocks_of(len(problem)):
        clip, given = Clip(bones[block], root[block]), Given(S[block], guess[block], distances.ratio, terms)
        _solve(body, clip, given, POSE_TOLERANCE, v, block.start, log, work)
        progress(block.stop - block.start)
    v[:, -1] *= unit
    return Poses(v, Effort.from_log(log))


def _terms(distances: DistanceProblem) -> Terms:
    points = len(distances)
    u, v = np.triu_indices(points, 1)
    on = distances.priorities[u, v] > 0
    u, v = u[on], v[on]
    springs = Springs(
        a=distances.targets[u],
        b=distances.targets[v],
        rest=np.zeros((len(u), 3)),
        A=np.zeros((len(u), 3, 3)),
    )
    square, columns = np.zeros((points, points)), np.zeros((3, points))
    return Terms(
        distances.targets, square, distances.priorities, columns, columns.copy(), distances.priorities[u, v], springs
    )


@inlined(fastmath=True)
def _stress(scratch: Scratch, terms: Terms) -> float:
    for point, joint in enumerate(terms.points):
        for i in range(3):
            terms.x[i, point] = scratch.x[joint, i]
    sigma = stress_and_gradient(terms.x, terms.delta, terms.pi, terms.gradient)
    for point, joint in enumerate(terms.points):
        for i in range(3):
            scratch.gradient[joint, i] += terms.gradient[i, point]
    return sigma


@inlined(fastmath=True)
def _pair_springs(scratch: Scratch, terms: Terms) -> tuple[Springs, int]:
    """A spring along each pair, as stiff as its priority."""
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
def _terms_of(given: Given, frame: int, start: Array) -> Terms:
    copy_to(start, given.guess[frame])
    target_distances(given.source[frame], given.ratio, given.terms.delta)
    return given.terms


_solve = compile_pose_solver(_terms_of, _stress, _pair_springs)
