"""Poses of least energy: an objective on positions, minimised over rotations on exact bones. Compiled.

The unknowns are the deviations of the parts and of the root; the objective is any function of positions, plus the
stiffness terms. The spectral gradient method minimises it in the scaled unknowns z = U v (`curvature`), where some ten
iterations reach a tolerance at which nothing shakes.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from distretarget.solve.articulation import Articulation, Scratch, pose_body, pose_gradient, scratch_of
from distretarget.solve.curvature import factorise, scale, scale_gradient, spring_curvature, unscale
from distretarget.solve.spg import Minimum, Reason, copy_to, spectral_gradient, steepest, straight

Array = NDArray[np.float64]

ROUND_ITERATIONS = 30  # at most, until the curvature is computed anew
ROUNDS = 20  # at most, each with a new curvature
CURVATURE_FRAMES = 4  # a curvature serves this many frames ...
HARD_FRAME = 6  # ... or until a frame takes more iterations than this
CONVERGED = Reason.CONVERGED.value


class Frame(NamedTuple):
    """One frame of the copy, and the curvature in use.

    Attributes:
        bones: (joints, 3), the copy's bones [solver units].
        root: (3,), the place on the root's path [solver units].
        U: (n, n), the upper triangle of the Cholesky factor of the curvature, n = 3 (parts + 1).
        v: (parts + 1, 3), scratch for the pose.
    """

    bones: Array
    root: Array
    U: Array
    v: Array


def compile_pose_solver(energy: Callable[..., Any], like_springs: Callable[..., Any]) -> Callable[..., Any]:
    """Compile the solver of one kind of objective, given as two compiled functions.

    energy(scratch, terms) -> float: the value at the positions `scratch.x`; its gradient is added to
        `scratch.gradient`.
    like_springs(scratch, terms) -> Springs: springs with the same Gauss-Newton curvature at `scratch.x`.

    Returns a compiled solve(starts, count, body, scratch, frame, terms, tolerance, renew, out) -> Minimum. It starts
    from the best of the first `count` of `starts`, (starts, parts + 1, 3), and writes the pose it finds to `out`. It
    stops when the norm of the search direction in z is at most `tolerance` [square root of the objective]. `renew` says
    whether to begin with a new curvature in `frame.U`.
    """

    @njit(error_model="numpy", fastmath=True)
    def value(v, body, scratch, frame, terms, gradient):  # type: ignore[no-untyped-def]
        pose_body(v, body, frame.bones, frame.root, scratch)
        scratch.gradient[:] = 0.0
        return energy(scratch, terms) + pose_gradient(v, body, scratch, gradient)

    @njit(error_model="numpy", fastmath=True)
    def objective(z, problem, gradient):  # type: ignore[no-untyped-def]
        body, scratch, frame, terms = problem
        unscale(frame.U, z, frame.v)
        sigma = value(frame.v, body, scratch, frame, terms, gradient)
        scale_gradient(frame.U, gradient)
        return sigma

    minimise = spectral_gradient(objective, steepest, straight)

    @njit(error_model="numpy", fastmath=True)
    def solve(starts, count, body, scratch, frame, terms, tolerance, renew, out):  # type: ignore[no-untyped-def]
        gradient = np.empty_like(out)
        best = np.inf
        for start in range(count):
            sigma = value(starts[start], body, scratch, frame, terms, gradient)
            if sigma < best:
                best = sigma
                copy_to(out, starts[start])
        z = np.empty_like(out)
        iterations, evaluations = 0, count
        for attempt in range(ROUNDS):
            if renew or attempt > 0:
                pose_body(out, body, frame.bones, frame.root, scratch)
                spring_curvature(body, scratch, like_springs(scratch, terms), frame.U)
                factorise(frame.U)
            scale(frame.U, out, z)
            minimum = minimise(z, (body, scratch, frame, terms), tolerance, ROUND_ITERATIONS)
            unscale(frame.U, z, out)
            iterations += minimum.iterations
            evaluations += minimum.evaluations
            if minimum.reason == CONVERGED:
                break
        return Minimum(minimum.value, iterations, evaluations, minimum.reason)

    return solve


@njit(cache=True)
def solver_arrays(body: Articulation) -> tuple[Scratch, Array, Array, Array]:
    """What the solver of a body writes to: scratch, the factor U, a pose, and three poses to start from."""
    parts = len(body.stiffness) - 1
    U = np.zeros((3 * parts + 3, 3 * parts + 3))
    return scratch_of(len(body.parents), parts), U, np.zeros((parts + 1, 3)), np.zeros((3, parts + 1, 3))


@njit(cache=True)
def warm_starts(v: Array, frame: int, starts: Array) -> None:
    """Write the poses to start a frame from that the frames before it give: to `starts[1]` the pose before, to
    `starts[2]` the two poses before, continued at the same speed.
    """
    if frame > 0:
        copy_to(starts[1], v[frame - 1])
    if frame > 1:
        for part in range(v.shape[1]):
            for i in range(3):
                starts[2, part, i] = 2.0 * v[frame - 1, part, i] - v[frame - 2, part, i]


@njit(cache=True)
def needs_curvature(frame: int, last: Minimum) -> bool:
    """Whether a frame needs a new curvature, given its number and the minimum of the frame before."""
    return frame % CURVATURE_FRAMES == 0 or last.iterations > HARD_FRAME
