"""The spectral projected gradient method with a non-monotone line search.

Birgin, Martinez and Raydan, "Nonmonotone spectral projected gradient methods on convex sets", SIAM J.
Optim. 10 (2000), doi:10.1137/S1052623497330963, with the averaged line search of Zhang and Hager, SIAM J.
Optim. 14 (2004), doi:10.1137/S1052623403428208, and the adaptive step of Zhou, Gao and Dai, Comput. Optim. Appl. 35
(2006), doi:10.1007/s10589-006-6446-0. It knows no skeleton: a problem is two functions of an array with rows and
columns.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from distretarget.numerics.compiled import inlined
from distretarget.numerics.vectors import Array, Numbers, copy_to

ETA = 0.99  # weight of old values in the reference value of the line search; 0 makes it monotone
ARMIJO = 1e-4
KAPPA = 0.5  # the shorter Barzilai-Borwein step is taken where it is less than this part of the longer one
STEP_MIN = 1e-12
STEP_MAX = 1e12


class Reason(IntEnum):
    """Why the solver stopped."""

    CONVERGED = 0
    ITERATION_LIMIT = 1
    LINE_SEARCH_FAILED = 2


class Minimum(NamedTuple):
    """The result of the solver; the best iterate itself is in the array of variables that it was given."""

    value: float  # the objective at the best iterate
    iterations: int  # the number of steps
    evaluations: int  # the number of evaluations of objective and gradient, with that of the start
    reason: int  # why the solver stopped, a `Reason`


@dataclass(frozen=True, eq=False)
class Effort:
    """The solver's effort on each frame of a clip.

    Attributes:
        iterations: (frames,), the number of steps.
        evaluations: (frames,), the number of evaluations of objective and gradient.
        reasons: (frames,), why the solver stopped, a `Reason` each.
    """

    iterations: NDArray[np.int64]
    evaluations: NDArray[np.int64]
    reasons: NDArray[np.int64]

    @classmethod
    def from_log(cls, log: Array) -> Effort:
        """The effort in a log, (4, frames), written by `record`."""
        return cls(*log[1:].astype(np.int64))

    @property
    def not_converged(self) -> Numbers:
        """The frames that did not converge."""
        return np.flatnonzero(self.reasons != Reason.CONVERGED)

    @property
    def reason_names(self) -> list[str]:
        """Why the solver stopped, in words for each frame."""
        return [Reason(reason).name.lower().replace("_", " ") for reason in self.reasons.tolist()]


@inlined()
def record(minimum: Minimum, log: Array, frame: int) -> None:
    """Write value, iterations, evaluations and reason of a frame to column `frame` of `log`."""
    log[0, frame] = minimum.value
    log[1, frame] = minimum.iterations
    log[2, frame] = minimum.evaluations
    log[3, frame] = minimum.reason if np.isfinite(minimum.value) else Reason.LINE_SEARCH_FAILED.value


@inlined(fastmath=True)
def inner(a: Array, b: Array) -> float:
    """The sum of the products of all elements of two arrays with rows and columns."""
    total = 0.0
    for i in range(a.shape[0]):
        for j in range(a.shape[1]):
            total += a[i, j] * b[i, j]
    return total


@inlined(fastmath=True)
def _inner_with_change(d, g, g_new):  # type: ignore[no-untyped-def]
    """The sums of d y and of y y over all elements, where y = g_new - g."""
    dy, yy = 0.0, 0.0
    for i in range(d.shape[0]):
        for j in range(d.shape[1]):
            y = g_new[i, j] - g[i, j]
            dy += d[i, j] * y
            yy += y * y
    return dy, yy


@inlined()
def steepest(x, gradient, step, problem, d):  # type: ignore[no-untyped-def] # noqa: ARG001
    """Write the search direction where nothing is projected, d = -step gradient; return |d|^2."""
    for i in range(d.shape[0]):
        for j in range(d.shape[1]):
            d[i, j] = -step * gradient[i, j]
    return inner(d, d)


@inlined()
def _write_step(x, d, alpha, out):  # type: ignore[no-untyped-def]
    """Write out = x + alpha d."""
    for i in range(d.shape[0]):
        for j in range(d.shape[1]):
            out[i, j] = x[i, j] + alpha * d[i, j]


def scratch_for(shape: tuple[int, ...]) -> Array:
    """Return scratch of the method for problems with variables of this shape. It is zero, so that entries of the
    gradient that the objective never writes are 0.
    """
    return np.zeros((4, *shape))


def spectral_gradient(
    objective: Callable[..., Any], direction: Callable[..., Any], *, adaptive: bool
) -> Callable[..., Any]:
    """Return the method for one kind of problem, given as two compiled functions.

    objective(x, problem, gradient) -> float: returns the value at `x` and writes the gradient.
    direction(x, gradient, step, problem, d) -> float: writes d = P(x - step gradient) - x, where P projects onto the
        feasible set, and returns |d|^2; projection, gradient and |d| are those of the problem's metric, if it has one.
    adaptive: whether to take the shorter step of Barzilai and Borwein where their two steps differ much; only for
        problems without a metric of their own.

    Returns an `inlined` minimise(x, f, g, problem, tolerance, limit, scratch) -> Minimum, which overwrites `x`, an
    array with rows and columns, with the best iterate. `f` is the objective at `x` and `g` its gradient, which is
    overwritten too; `scratch` is `scratch_for(x.shape)`. It stops when the norm |d| of the search direction is at most
    `tolerance`, after `limit` iterations, or when no step of at least 1e-12 of the direction lowers the objective
    enough.
    """

    @inlined()
    def minimise(x, f, g, problem, tolerance, limit, scratch):  # type: ignore[no-untyped-def]
        d, g_new, x_new, x_best = scratch[0], scratch[1], scratch[2], scratch[3]
        copy_to(x_best, x)
        given, f_best = x, f
        C, Q = f, 1.0
        step = 1.0
        reason = Reason.ITERATION_LIMIT.value
        iterations, evaluations = 0, 1
        while True:
            # Search direction
            square = direction(x, g, step, problem, d)
            if np.sqrt(square) <= tolerance:
                reason = Reason.CONVERGED.value
                break
            if iterations == limit:
                break
            # Line search
            slope = inner(g, d)
            alpha = 1.0
            while True:
                _write_step(x, d, alpha, x_new)
                f_new = objective(x_new, problem, g_new)
                evaluations += 1
                if f_new <= C + ARMIJO * alpha * slope or alpha < STEP_MIN:
                    break
                alpha *= 0.5
            if alpha < STEP_MIN:
                reason = Reason.LINE_SEARCH_FAILED.value
                break
            iterations += 1
            # Barzilai-Borwein step; where the curvature is not positive the step grows tenfold, not to
            # STEP_MAX as in the paper, which would cost forty halvings.
            dy, yy = _inner_with_change(d, g, g_new)
            step = alpha * square / dy if dy > 0.0 else 10.0 * step
            if adaptive and dy > 0.0 and alpha * dy < KAPPA * step * yy:
                step = alpha * dy / yy
            step = min(max(step, STEP_MIN), STEP_MAX)
            # Averaged reference value
            C = (ETA * Q * C + f_new) / (ETA * Q + 1.0)
            Q = ETA * Q + 1.0
            x, x_new = x_new, x
            g, g_new = g_new, g
            f = f_new
            if f < f_best:
                f_best = f
                copy_to(x_best, x)
        copy_to(given, x_best)
        return Minimum(f_best, iterations, evaluations, reason)

    return minimise
