"""The paper's postures: the points of least stress in every frame, each solved from the rotation copy.

A start from the frame before takes fewer iterations, but over a clip it drifts to mirrored postures, whose stress is
the same. The rotation copy is never mirrored, and makes each frame independent of the others.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from distretarget.distances import DistanceProblem, columns
from distretarget.numerics.blocks import blocks_of
from distretarget.numerics.compiled import compiled, inlined
from distretarget.numerics.loops import copy_to
from distretarget.numerics.rotations import best_rotation
from distretarget.numerics.stress import filled, stress_and_gradient, target_distances
from distretarget.solve.chunks import Progress
from distretarget.solve.spg import Effort, record, scratch_for, spectral_gradient, steepest

POINT_TOLERANCE = 1e-9  # [body sizes] a posture is solved when the search direction is shorter than this
POINT_ITERATIONS = 2000  # at most, per frame
FLAT = 1e-6  # [body sizes] a posture thinner than this counts as planar ...
NUDGE = 1e-4  # [body sizes] ... and starts this far off its plane


@dataclass(frozen=True, eq=False)
class Postures:
    """The solved points of every frame, and how well each frame is solved.

    Attributes:
        positions: (frames, points, 3), turned to the rotation copy and with its centroid [target file units].
        stress: (frames,), sigma [body sizes squared].
        effort: what the solver took.
    """

    positions: NDArray[np.float64]
    stress: NDArray[np.float64]
    effort: Effort


class _Stress(NamedTuple):
    """The stress of one frame: target distances and priorities, (points, columns)."""

    delta: NDArray[np.float64]
    pi: NDArray[np.float64]


@inlined()
def _objective(x, problem, gradient):  # type: ignore[no-untyped-def]
    return stress_and_gradient(x, problem.delta, problem.pi, gradient)


_minimise = spectral_gradient(_objective, steepest, adaptive=True)


@compiled()
def _solve(source, starts, ratio, problem, solved, first, log, gradient, scratch):  # type: ignore[no-untyped-def]
    """Solve a block of frames, whose first is column `first` of `log`; distances are computed frame by frame."""
    for t in range(len(source)):
        copy_to(solved[t], starts[t])
        target_distances(source[t], ratio, problem.delta)
        sigma = _objective(solved[t], problem, gradient)
        minimum = _minimise(solved[t], sigma, gradient, problem, POINT_TOLERANCE, POINT_ITERATIONS, scratch)
        record(minimum, log, first + t)


def solve_postures(
    problem: DistanceProblem,
    source: NDArray[np.float64],
    copy: NDArray[np.float64],
    progress: Progress = lambda _frames: None,
) -> Postures:
    """Minimise Eq. (2) in every frame.

    `source`, (frames, source joints, 3), and `copy`, (frames, target joints, 3), are the positions of the source and of
    its rotation copy on the target [file units]; each frame starts from the copy. `progress` is called with numbers of
    solved frames.
    """
    points = copy[:, problem.targets]
    centroids = points.mean(axis=1, keepdims=True)
    C = columns((points - centroids) / problem.body_size)
    S = columns(source[:, problem.sources] - source[:, problem.sources].mean(axis=1, keepdims=True))
    X = np.empty_like(C)
    log = np.zeros((4, len(C)))
    ratio, priorities = filled(problem.ratio), filled(problem.priorities)
    shape = 3, ratio.shape[1]
    stress, gradient, scratch = _Stress(np.empty_like(ratio), priorities), np.zeros(shape), scratch_for(shape)
    for block in blocks_of(len(C)):
        x, solved = filled(off_plane(C[block])), np.empty((block.stop - block.start, *shape))
        _solve(filled(S[block]), x, ratio, stress, solved, block.start, log, gradient, scratch)
        X[block] = solved[:, :, : len(problem)]
        progress(block.stop - block.start)
    positions = aligned(X.transpose(0, 2, 1), C.transpose(0, 2, 1)) * problem.body_size + centroids
    return Postures(positions, log[0], Effort.from_log(log))


def off_plane(x: NDArray[np.float64]) -> NDArray[np.float64]:
    """Postures, (frames, 3, points), with those that lie in a plane or on a line moved off it.

    The gradient of a planar posture lies in its plane, so that a solver never leaves it. The points move by at most
    `NUDGE` across the plane, some to one side and some to the other; off a line they move along both directions across.
    """
    x = np.array(x)
    axes, extents, _ = np.linalg.svd(x - x.mean(axis=2, keepdims=True), full_matrices=True)
    flat = np.ones((len(x), 3), bool)
    flat[:, : extents.shape[1]] = extents < FLAT
    waves = NUDGE * np.cos(np.outer(np.arange(1, 4), np.arange(x.shape[2])))
    return np.asarray(x + np.einsum("fix,fx,xp->fip", axes, flat, waves))


def aligned(x: NDArray[np.float64], onto: NDArray[np.float64]) -> NDArray[np.float64]:
    """Postures (frames, points, 3) turned about their centroids, by proper rotations, as near as possible to `onto`.

    The centroids of the result are at the origin.
    """
    x = x - x.mean(axis=1, keepdims=True)
    return np.asarray(Rotation.from_quat(best_rotation(x, onto)[:, None]).apply(x))
