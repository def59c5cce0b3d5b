"""Poses of least energy: an objective on positions, minimised over rotations on exact bones. Compiled.

The unknowns are the deviations of the parts and of the root; the objective is any function of positions, plus the
stiffness terms. The spectral gradient method minimises it in the metric of its curvature (`curvature`), where about
three iterations reach a tolerance at which nothing shakes.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from distretarget.numerics.compiled import inlined
from distretarget.solve.articulation import (
    Articulation,
    Scratch,
    pose_body,
    pose_gradient,
    scratch_of,
    stiffness_energy,
)
from distretarget.solve.cholesky import factorise, solve_factored
from distretarget.solve.curvature import Numbers, active_curvature
from distretarget.solve.spg import Minimum, Reason, copy_to, inner, spectral_gradient, straight

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


def compile_pose_solver(energy: Callable[..., Any], like_springs: Callable[..., Any]) -> Callable[..., Any]:
    """Compile the solver of one kind of objective, given as two compiled functions.

    energy(scratch, terms) -> float: the value at the positions `scratch.x`; its gradient is added to
        `scratch.gradient`.
    like_springs(scratch, terms) -> Springs: springs with the same Gauss-Newton curvature at `scratch.x`.

    Returns a compiled solve(starts, count, body, scratch, frame, terms, tolerance, out) -> Minimum. It starts from the
    best of the first `count` of `starts`, (starts, parts + 1, 3), and writes the pose it finds to `out`. It stops when
    the norm of the search direction, in the metric of the curvature, is at most `tolerance` [square root of the
    objective].
    """

    @inlined(fastmath=True)
    def value(v, body, scratch, frame, terms):  # type: ignore[no-untyped-def]
        pose_body(v, body, frame.bones, frame.root, scratch)
        scratch.gradient[:] = 0.0
        return energy(scratch, terms) + stiffness_energy(v, body)

    @inlined(fastmath=True)
    def objective(v, problem, gradient):  # type: ignore[no-untyped-def]
        _, _, body, scratch, frame, terms = problem
        sigma = value(v, body, scratch, frame, terms)
        pose_gradient(v, body, scratch, gradient)
        return sigma

    minimise = spectral_gradient(objective, _steepest_in_metric, straight)

    @inlined(fastmath=True)
    def solve(starts, count, body, scratch, frame, terms, tolerance, out):  # type: ignore[no-untyped-def]
        best = np.inf
        for start in range(count):
            sigma = value(starts[start], body, scratch, frame, terms)
            if sigma < best:
                best = sigma
                copy_to(out, starts[start])
        iterations, evaluations = 0, count
        for _ in range(ROUNDS):
            pose_body(out, body, frame.bones, frame.root, scratch)
            active, H = active_curvature(out, body, scratch, like_springs(scratch, terms))
            factorise(H)
            _reset_others(out, active)
            minimum = minimise(out, (H, active, body, scratch, frame, terms), tolerance, ROUND_ITERATIONS)
            iterations += minimum.iterations
            evaluations += minimum.evaluations
            if minimum.reason == CONVERGED:
                break
        return Minimum(minimum.value, iterations, evaluations, minimum.reason)

    return solve


@inlined(fastmath=True)
def _steepest_in_metric(v, gradient, step, problem, d):  # type: ignore[no-untyped-def] # noqa: ARG001
    """Write the direction of steepest descent in the metric H = U^T U, d = -step H^-1 gradient; return d^T H d."""
    U, active = problem[:2]
    solve_factored(U, active, gradient, d)
    flat = d.ravel()
    for i in range(flat.size):
        flat[i] *= -step
    return -step * inner(gradient, d)


@inlined()
def _reset_others(v: Array, active: Numbers) -> None:
    """Let the parts that are not active keep the copy's rotation."""
    kept = v.copy()
    v[:] = 0.0
    for part in active:
        copy_to(v[part], kept[part])


@inlined()
def solver_arrays(body: Articulation) -> tuple[Scratch, Array]:
    """What the solver of a body writes to: scratch, and three poses to start from."""
    parts = len(body.stiffness)
    return scratch_of(len(body.parents), parts - 1), np.zeros((3, parts, 3))


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
