"""Inverse kinematics: an objective on joint positions, minimised over the rotations of rigid bones. Compiled.

The unknowns are the deviations of parts and root from the rotation copy; the objective is any function of positions,
plus the stiffness terms. The spectral gradient method minimises it in the metric of its curvature (`curvature`), in
about three iterations a frame. The next frame reuses the curvature while the same bones move and few iterations
suffice. After a failed reuse, twice as many frames as before have to take few iterations until the next trial.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from distretarget.ik.articulation import Articulation, Scratch, pose_body, pose_gradient, stiffness_energy
from distretarget.ik.curvature import Curvature, are_first, factorise, solve_factored, write_curvature
from distretarget.ik.spg import Minimum, Reason, inner, record, scratch_for, spectral_gradient
from distretarget.ik.springs import write_moving_bones
from distretarget.numerics.compiled import inlined
from distretarget.numerics.vectors import F2, F3, Array, Numbers, clear, copy_to

ROUND_ITERATIONS = 30  # iterations before the curvature is recomputed
ROUNDS = 20  # rounds per frame, each but the first with a new curvature
FEW_ITERATIONS = 3  # the curvature is reused while frames take at most this many iterations
LONGEST_WAIT = 64  # at most this many frames with few iterations pass before the next trial
CONVERGED = Reason.CONVERGED.value


class CopiedBones(NamedTuple):
    """The rotation copy of a block of frames."""

    bones: F3  # (frames, joints, 3), from each joint's parent to it [solver units]
    root: F2  # (frames, 3), the root's path [solver units]


class Workspace(NamedTuple):
    """The work arrays of the solver, for one body."""

    scratch: Scratch  # the posed body
    curvature: Curvature  # its curvature
    gradient: F2  # (parts + 1, 3), the gradient at the start of a round
    descent: F3  # scratch of the spectral gradient method
    starts: F3  # (3, parts + 1, 3), the start poses

    @classmethod
    def of(cls, body: Articulation) -> Workspace:
        """Arrays for a body."""
        pose = (len(body.stiffness), 3)
        return cls(Scratch.of(body), Curvature.of(body), np.zeros(pose), scratch_for(pose), np.zeros((3, *pose)))


class _Problem(NamedTuple):
    """The problem of one frame for the spectral gradient method: the pose of a body, by its active parts."""

    body: Articulation  # the body
    terms: Any  # the terms of the objective
    bones: Array  # the rotation copy's bones in the frame
    root: Array  # the rotation copy's root in the frame
    scratch: Scratch  # of the body
    U: Array  # the factor of the curvature
    active: Numbers  # (active parts,), their numbers
    flat: Array  # scratch for the linear system


def pose_solver(
    terms_of: Callable[..., Any], energy: Callable[..., Any], like_springs: Callable[..., Any]
) -> Callable[..., Any]:
    """Return the solver for one kind of objective, which is given as three `inlined` functions.

    terms_of(given, frame, start) -> terms: the terms of a frame; it may overwrite `start`, which is zero, the rotation
        copy, with another start pose.
    energy(scratch, terms) -> float: the value at the positions `scratch.x`; it adds the gradient to `scratch.gradient`.
    like_springs(scratch, terms) -> (FrameSprings, int): springs, and how many of them count, that have the same
        Gauss-Newton curvature at `scratch.x`.

    Returns an `inlined` solve(body, copy, given, tolerance, v, first, log, work). It solves the frames of `copy`, the
    first of which is frame `first` of `v` and `log`, and writes their poses and efforts there. A frame starts from the
    best of three poses: that of `terms_of`, the previous frame's, and the linear extrapolation of the previous two. It
    stops when the norm of the search direction, in the metric of the curvature, is at most `tolerance` [square root of
    the objective].
    """
    pose_best = _best_start(energy)
    minimise = spectral_gradient(_objective(energy), _steepest_in_metric, adaptive=False)

    @inlined()
    def solve(body, copy, given, tolerance, v, first, log, work):  # type: ignore[no-untyped-def]
        scratch, curvature = work.scratch, work.curvature
        parts = 0
        quick, wait = 0, 1  # frames in a row that took few iterations, and how many of them reuse has to wait for
        for frame in range(len(copy.root)):
            clear(work.starts[0])
            terms, bones, root = terms_of(given, frame, work.starts[0]), copy.bones[frame], copy.root[frame]
            pose, count = v[first + frame], _warm_starts(v, first + frame, work.starts)
            iterations, evaluations = 0, 0
            for _ in range(ROUNDS):
                sigma, tried = pose_best(work.starts, count, body, bones, root, terms, scratch, pose, work.gradient)
                evaluations += tried
                springs, acting = like_springs(scratch, terms)
                moved = write_moving_bones(springs, acting, body, curvature.below)
                reused = quick >= wait and are_first(curvature.bones, curvature.below.moving_bones, moved)
                if not reused:
                    parts = write_curvature(moved, pose, body, scratch, springs, acting, curvature)
                    factorise(curvature.H, 3 * parts)
                if _reset_others(pose, curvature.place):  # joints may sink below the floor, where new terms act
                    copy_to(work.starts[0], pose)
                    count = 1
                    continue
                active = curvature.active[:parts]
                problem = _Problem(body, terms, bones, root, scratch, curvature.H, active, curvature.flat)
                minimum = minimise(pose, sigma, work.gradient, problem, tolerance, ROUND_ITERATIONS, work.descent)
                iterations += minimum.iterations
                evaluations += minimum.evaluations - 1  # the first of the method is that of the best start
                converged = minimum.reason == CONVERGED
                few = converged and minimum.iterations <= FEW_ITERATIONS
                quick = quick + 1 if few else 0
                if reused:
                    wait = 1 if few else 2 * wait if 2 * wait < LONGEST_WAIT else LONGEST_WAIT
                if converged:
                    break
                copy_to(work.starts[0], pose)
                count = 1
            record(Minimum(minimum.value, iterations, evaluations, minimum.reason), log, first + frame)

    return solve


def _objective(energy: Callable[..., Any]) -> Callable[..., Any]:
    """Return the objective of a `_Problem` in a pose, for the spectral gradient method, as an `inlined` function."""

    @inlined()
    def objective(v, problem, gradient):  # type: ignore[no-untyped-def]
        body, scratch = problem.body, problem.scratch
        pose_body(v, body, problem.bones, problem.root, scratch)
        potential = energy(scratch, problem.terms)
        pose_gradient(v, body, scratch, gradient)
        return potential + stiffness_energy(v, body)

    return objective


def _best_start(energy: Callable[..., Any]) -> Callable[..., Any]:
    """Return the choice of a start pose, as an `inlined` function."""

    @inlined()
    def pose_best(starts, count, body, bones, root, terms, scratch, pose, gradient):  # type: ignore[no-untyped-def]
        """Write the best of the first `count` starts to `pose`, and pose the body in it. Return the objective there,
        with its `gradient`, and the number of evaluations.
        """
        best, least, sigma, tried = 0, 0.0, 0.0, 0
        for trial in range(count + 1):
            if trial == count and best == count - 1:
                break  # the body has the best pose already
            start = starts[trial if trial < count else best]
            pose_body(start, body, bones, root, scratch)
            potential = energy(scratch, terms)
            sigma = potential + stiffness_energy(start, body)
            tried += 1
            if trial == 0 or sigma < least:
                least, best = sigma, trial
        copy_to(pose, starts[best])
        pose_gradient(pose, body, scratch, gradient)
        return sigma, tried

    return pose_best


@inlined(fastmath=True)
def _steepest_in_metric(v, gradient, step, problem, d):  # type: ignore[no-untyped-def] # noqa: ARG001
    """Write the direction of steepest descent in the metric H = U^T U, d = -step H^-1 gradient; return d^T H d."""
    solve_factored(problem.U, problem.active, gradient, d, problem.flat)
    for part in range(len(d)):
        for i in range(3):
            d[part, i] *= -step
    return -step * inner(gradient, d)


@inlined()
def _reset_others(v: Array, place: Numbers) -> bool:
    """Reset inactive parts, those without a `place`, to the rotation copy; return whether any changed."""
    reset = False
    for part in range(len(v)):
        if place[part] < 0 and (v[part, 0] != 0.0 or v[part, 1] != 0.0 or v[part, 2] != 0.0):
            clear(v[part])
            reset = True
    return reset


@inlined()
def _warm_starts(v: Array, frame: int, starts: Array) -> int:
    """Write the warm starts of a frame: the previous pose to `starts[1]`, and the linear extrapolation of the previous
    two poses to `starts[2]`. Return the number of starts.
    """
    if frame > 0:
        copy_to(starts[1], v[frame - 1])
    if frame > 1:
        for part in range(v.shape[1]):
            for i in range(3):
                starts[2, part, i] = 2.0 * v[frame - 1, part, i] - v[frame - 2, part, i]
    return (frame if frame < 2 else 2) + 1
