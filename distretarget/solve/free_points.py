"""The paper's postures: every frame's points of least stress, each from the rotation copy.

A warm start from the frame before takes fewer iterations, but over a clip it drifts to mirrored postures, which the
stress cannot tell from the right ones. The rotation copy is on the right side, and makes each frame its own.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from distretarget.distances import DistanceProblem, columns
from distretarget.numerics.rotations import best_rotation
from distretarget.numerics.stress import stress_and_gradient, target_distances
from distretarget.solve.spg import Effort, copy_to, record, spectral_gradient, steepest, straight

TOLERANCE = 1e-9  # norm of the search direction [body sizes] at which a posture is solved
ITERATIONS = 2000  # at the most, per frame
FLAT = 1e-6  # a posture thinner than this [body sizes] counts as planar ...
NUDGE = 1e-4  # ... and starts this far [body sizes] off its plane
BLOCK = 256  # frames solved between two reports of progress


@dataclass(frozen=True, eq=False)
class Postures:
    """The solved points of every frame, and how well each is solved.

    Attributes:
        positions: (frames, points, 3) [target file units], turned as the rotation copy and with its centroid.
        stress: (frames,), sigma [body sizes squared].
        effort: what the solver took.
    """

    positions: NDArray[np.float64]
    stress: NDArray[np.float64]
    effort: Effort


class _Pairs(NamedTuple):
    delta: NDArray[np.float64]
    pi: NDArray[np.float64]


@njit(cache=True, error_model="numpy")
def _objective(x, problem, gradient):  # type: ignore[no-untyped-def]
    return stress_and_gradient(x, problem.delta, problem.pi, gradient)


_minimise = spectral_gradient(_objective, steepest, straight)


@njit(cache=True, error_model="numpy")
def _solve(source, starts, ratio, pi, solved, first, figures):  # type: ignore[no-untyped-def]
    """Solve frame by frame; distances are made per frame."""
    problem = _Pairs(np.empty_like(pi), pi)
    for t in range(len(source)):
        x = starts[t].copy()
        target_distances(source[t], ratio, problem.delta)
        minimum = _minimise(x, problem, TOLERANCE, ITERATIONS)
        copy_to(solved[t], x)
        record(minimum, figures, first + t)


def solve_postures(
    problem: DistanceProblem,
    source: NDArray[np.float64],
    copy: NDArray[np.float64],
    progress: Callable[[int], Any] = lambda _frames: None,
) -> Postures:
    """Minimise Eq. (2) in every frame.

    `source`, (frames, source joints, 3), and `copy`, (frames, target joints, 3), are the positions of the source and
    of its rotation copy on the target [file units], from which each frame starts. `progress` is called with numbers of
    frames as they are done.
    """
    copied = copy[:, problem.targets]
    centroids = copied.mean(axis=1, keepdims=True)
    C = columns((copied - centroids) / problem.body_size)
    S = columns(source[:, problem.sources] - source[:, problem.sources].mean(axis=1, keepdims=True))
    X = np.empty_like(C)
    figures = np.zeros((4, len(C)))
    for first in range(0, len(C), BLOCK):
        block = slice(first, first + BLOCK)
        _solve(S[block], off_plane(C[block]), problem.ratio, problem.priorities, X[block], first, figures)
        progress(len(C[block]))
    positions = aligned(X.transpose(0, 2, 1), C.transpose(0, 2, 1)) * problem.body_size + centroids
    return Postures(positions, figures[0], Effort(*figures[1:].astype(np.int64)))


def off_plane(x: NDArray[np.float64]) -> NDArray[np.float64]:
    """Postures, (frames, 3, points), moved off their plane or line where they lie in one.

    The gradient of a planar posture lies in its plane, so that a solver never leaves it. The points move by
    `NUDGE` across the plane, by turns to this side and to that; from a line, along both directions across.
    """
    x = np.array(x)
    axes, extents, _ = np.linalg.svd(x - x.mean(axis=2, keepdims=True), full_matrices=True)
    flat = np.ones((len(x), 3), bool)
    flat[:, : extents.shape[1]] = extents < FLAT
    waves = NUDGE * np.cos(np.outer(np.arange(1, 4), np.arange(x.shape[2])))
    return np.asarray(x + np.einsum("fix,fx,xp->fip", axes, flat, waves))


def aligned(x: NDArray[np.float64], onto: NDArray[np.float64]) -> NDArray[np.float64]:
    """Postures (frames, points, 3) turned about their centroids, by proper rotations, as near to others as they come;
    the centroids of the result are at the origin.
    """
    x = x - x.mean(axis=1, keepdims=True)
    return np.asarray(Rotation.from_quat(best_rotation(x, onto)[:, None]).apply(x))
