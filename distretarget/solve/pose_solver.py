"""Poses of least energy: an objective on positions, minimised over rotations on exact bones. Compiled.

The unknowns are the deviations of the parts and of the root; the objective is any function of positions, plus the
stiffness terms. The spectral gradient method minimises it in the scaled unknowns z = U v (`curvature`), where about
three iterations reach a tolerance at which nothing shakes.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from distretarget.numerics.compiled import inlined
from distretarget.solve.articulation import Articulation, Scratch, pose_body, pose_gradient, scratch_of
from distretarget.solve.curvature import Parts, active_curvature, factorise, scale, scale_gradient, unscale
from distretarget.solve.spg import Minimum, Reason, copy_to, spectral_gradient, steepest, straight

Array = NDArray[np.float64]

ROUND_ITERATIONS = 30  # at most, until the curvature is computed anew
ROUNDS = 20  # at most, each with a new curvature
CONVERGED = Reason.CONVERGED.value


class Frame(NamedTuple):
    """One frame of the copy.

    Attributes:
        bones: (joints, 3), the copy's bones [solver units].
        root: (3,), the place on the root's path [solver units].
    """

    bones: Array
    root: Array


class Unknowns(NamedTuple):
    """Scratch arrays of the unknowns of one body.

    Attributes:
        U: (n, n), the upper triangle of the Cholesky factor of the curvature in its front, n = 3 (parts + 1).
        active: (parts + 1,), the numbers of the parts that are unknowns in its front.
        v, gradient: (parts + 1, 3), a pose, and a gradient with respect to it.
    """

    U: Array
    active: Parts
    v: Array
    gradient: Array


def compile_pose_solver(energy: Callable[..., Any], like_springs: Callable[..., Any]) -> Callable[..., Any]:
    """Compile the solver of one kind of objective, given as two compiled functions.

    energy(scratch, terms) -> float: the value at the positions `scratch.x`; its gradient is added to
        `scratch.gradient`.
    like_springs(scratch, terms) -> Springs: springs with the same Gauss-Newton curvature at `scratch.x`.

    Returns a compiled solve(starts, count, body, scratch, unknowns, frame, terms, tolerance, out) -> Minimum. It starts
    from the best of the first `count` of `starts`, (starts, parts + 1, 3), and writes the pose it finds to `out`. It
    stops when the norm of the search direction in z is at most `tolerance` [square root of the objective].
    """

    @inlined(fastmath=True)
    def value(v, body, scratch, frame, terms, gradient):  # type: ignore[no-untyped-def]
        pose_body(v, body, frame.bones, frame.root, scratch)
        scratch.gradient[:] = 0.0
        return energy(scratch, terms) + pose_gradient(v, body, scratch, gradient)

    @inlined(fastmath=True)
    def objective(z, problem, gradient):  # type: ignore[no-untyped-def]
        active, body, scratch, unknowns, frame, terms = problem
        unscale(unknowns.U, active, z, unknowns.v)
        sigma = value(unknowns.v, body, scratch, frame, terms, unknowns.gradient)
        scale_gradient(unknowns.U, active, unknowns.gradient, gradient)
        return sigma

    minimise = spectral_gradient(objective, steepest, straight)

    @inlined(fastmath=True)
    def solve(starts, count, body, scratch, unknowns, frame, terms, tolerance, out):  # type: ignore[no-untyped-def]
        best = np.inf
        for start in range(count):
            sigma = value(starts[start], body, scratch, frame, terms, unknowns.gradient)
            if sigma < best:
                best = sigma
                copy_to(out, starts[start])
        iterations, evaluations = 0, count
        for _ in range(ROUNDS):
            pose_body(out, body, frame.bones, frame.root, scratch)
            springs = like_springs(scratch, terms)
            active = unknowns.active[: active_curvature(out, body, scratch, springs, unknowns.U, unknowns.active)]
            factorise(unknowns.U, 3 * len(active))
            z = np.empty((len(active), 3))
            scale(unknowns.U, active, out, z)
            problem = active, body, scratch, unknowns, frame, terms
            minimum = minimise(z, problem, tolerance, ROUND_ITERATIONS)
            unscale(unknowns.U, active, z, out)
            iterations += minimum.iterations
            evaluations += minimum.evaluations
            if minimum.reason == CONVERGED:
                break
        return Minimum(minimum.value, iterations, evaluations, minimum.reason)

    return solve


@inlined()
def solver_arrays(body: Articulation) -> tuple[Scratch, Unknowns, Array]:
    """What the solver of a body writes to: scratch, the unknowns, and three poses to start from."""
    parts = len(body.stiffness)
    pose = np.zeros((parts, 3))
    unknowns = Unknowns(np.zeros((3 * parts, 3 * parts)), np.zeros(parts, np.intp), pose, np.zeros_like(pose))
    return scratch_of(len(body.parents), parts - 1), unknowns, np.zeros((3, parts, 3))


@inlined()
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
