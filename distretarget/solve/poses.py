"""Poses of least energy: an objective on positions, minimised over rotations on exact bones. Compiled.

The unknowns are the deviations of the parts and of the root, the objective any function of positions plus the holds.
It is minimised by the spectral gradient method in the variables z = U v, where U^T U is the Gauss-Newton curvature: in
them the objective is round, and a dozen iterations reach a tolerance at which nothing shakes.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from distretarget.body.legs import Legs
from distretarget.distances import DistanceProblem
from distretarget.skeleton import Skeleton
from distretarget.solve.articulation import Body, Work, hang, pose_body, pull_back, workspace
from distretarget.solve.spg import Effort, Minimum, Reason, copy_to, spectral_gradient, steepest, straight

Array = NDArray[np.float64]

ITERATIONS = 30  # at the most, before the curvature is made anew ...
ROUNDS = 20  # ... which it is so often at the most
REFRESH = 4  # frames for which a curvature serves ...
SLOW = 6  # ... unless a frame needs more iterations than this
SOFTEST = 0.01  # the scaling takes no direction for softer than this, so that no step turns a part right round
EMPTY = 1e-9  # springs weaker than this are left out
CONVERGED = Reason.CONVERGED.value


@dataclass(frozen=True, eq=False)
class Clip:
    """What an objective needs of a clip.

    Attributes:
        skeleton: of the target.
        legs: its legs; None where it has none.
        unit: its body unit [target file units].
        parts: (joints,), its rigid parts.
        problem: the points that source and target share.
        source: (frames, source joints, 3), positions [source file units].
        copy: (frames, joints, 3), positions of the rotation copy [target file units].
        root: (frames, 3), the path the root keeps to [target file units].
        frame_time: [s].
    """

    skeleton: Skeleton
    legs: Legs | None
    unit: float
    parts: NDArray[np.intp]
    problem: DistanceProblem
    source: Array
    copy: Array
    root: Array
    frame_time: float

    def __len__(self) -> int:
        return len(self.copy)

    def __getitem__(self, frames: slice) -> Clip:
        return replace(self, source=self.source[frames], copy=self.copy[frames], root=self.root[frames])

    @property
    def bones(self) -> Array:
        """(frames, joints, 3), the copy's bones, from each joint's parent to it [target file units]."""
        return np.asarray(self.copy - self.copy[:, self.skeleton.parents])


@dataclass(frozen=True, eq=False)
class Poses:
    """The solved poses of a motion.

    Attributes:
        v: (frames, parts + 1, 3), the deviation of each part from the rotation copy [rad], last the root's displacement
            from its path [target file units].
        effort: what the solver took.
    """

    v: Array
    effort: Effort

    def __getitem__(self, frames: slice) -> Poses:
        return Poses(self.v[frames], self.effort[frames])


class Frame(NamedTuple):
    """One frame of the copy, and the curvature in use.

    Attributes:
        bones: (joints, 3), the copy's bones [solver units].
        root: (3,), where the root should be.
        U: (n, n), the upper triangle of the Cholesky factor of the curvature, n = 3 (parts + 1).
        v: (parts + 1, 3), scratch for the pose.
    """

    bones: Array
    root: Array
    U: Array
    v: Array


class Springs(NamedTuple):
    """Springs between two positions, or between one and a place in the world.

    The spring s pulls r = x[a[s]] - x[b[s]] - rest[s], or r = x[a[s]] - rest[s] where b[s] is -1, towards zero, with
    the energy 1/2 w r^T (k I + (1 - k) e e^T) r: fully along the unit vector e, by the part k across it.

    Attributes:
        a, b: (springs,), joints.
        rest, e: (springs, 3).
        w, k: (springs,); k is 1 where b is -1.
    """

    a: NDArray[np.intp]
    b: NDArray[np.intp]
    rest: Array
    e: Array
    w: Array
    k: Array


@njit(cache=True, error_model="numpy", fastmath=True)
def spring_energy(work: Work, springs: Springs) -> float:
    """The energy of springs at `work.x`; the gradient is added to `work.pull`."""
    energy = 0.0
    r, force = np.empty(3), np.empty(3)
    for s in range(len(springs.a)):
        if springs.w[s] < EMPTY:
            continue
        a, b, k, e = springs.a[s], springs.b[s], springs.k[s], springs.e[s]
        for i in range(3):
            r[i] = work.x[a, i] - springs.rest[s, i] - (work.x[b, i] if b >= 0 else 0.0)
        along = (1.0 - k) * (e[0] * r[0] + e[1] * r[1] + e[2] * r[2])
        for i in range(3):
            force[i] = springs.w[s] * (k * r[i] + along * e[i])
            energy += 0.5 * force[i] * r[i]
            work.pull[a, i] += force[i]
            if b >= 0:
                work.pull[b, i] -= force[i]
    return energy


def pose_solver(energy: Callable[..., Any], stiffen: Callable[..., Any], tolerance: float) -> Callable[..., Any]:
    """Compile the solver of one kind of objective, given as two compiled functions.

    `tolerance` is the norm of the search direction in z [square root of the objective] at which a pose is solved.

    energy(work, terms) -> float: the value for the positions `work.x`; its gradient is added to `work.pull`.
    stiffen(work, terms) -> Springs: springs with the same Gauss-Newton curvature at `work.x`.

    Returns a compiled solve(starts, count, body, work, frame, terms, fresh, out) -> Minimum, which writes to `out` the
    pose found from the best of the first `count` of `starts`, (starts, parts + 1, 3); `fresh` asks for a new curvature
    in `frame.U`.
    """

    @njit(error_model="numpy", fastmath=True)
    def value(v, body, work, frame, terms, gradient):  # type: ignore[no-untyped-def]
        pose_body(v, body, frame.bones, frame.root, work)
        work.pull[:] = 0.0
        return energy(work, terms) + pull_back(v, body, work, gradient)

    @njit(error_model="numpy", fastmath=True)
    def objective(z, problem, gradient):  # type: ignore[no-untyped-def]
        body, work, frame, terms = problem
        _unscale(frame.U, z, frame.v)
        sigma = value(frame.v, body, work, frame, terms, gradient)
        _scale_gradient(frame.U, gradient)
        return sigma

    minimise = spectral_gradient(objective, steepest, straight)

    @njit(error_model="numpy", fastmath=True)
    def solve(starts, count, body, work, frame, terms, fresh, out):  # type: ignore[no-untyped-def]
        gradient = np.empty_like(out)
        best = np.inf
        for start in range(count):
            sigma = value(starts[start], body, work, frame, terms, gradient)
            if sigma < best:
                best = sigma
                copy_to(out, starts[start])
        z = np.empty_like(out)
        iterations, evaluations = 0, count
        for turn in range(ROUNDS):
            if fresh or turn > 0:
                pose_body(out, body, frame.bones, frame.root, work)
                _curvature(body, work, stiffen(work, terms), frame.U)
                _factorise(frame.U)
            _scale(frame.U, out, z)
            minimum = minimise(z, (body, work, frame, terms), tolerance, ITERATIONS)
            _unscale(frame.U, z, out)
            iterations += minimum.iterations
            evaluations += minimum.evaluations
            if minimum.reason == CONVERGED:
                break
        return Minimum(minimum.value, iterations, evaluations, minimum.reason)

    return solve


@njit(cache=True)
def scratch_arrays(body: Body) -> tuple[Work, Array, Array, Array]:
    """What the solver of a body writes to: work, the curvature's factor, a pose, and three poses to start from."""
    parts = len(body.holds) - 1
    U = np.zeros((3 * parts + 3, 3 * parts + 3))
    return workspace(len(body.parents), parts), U, np.zeros((parts + 1, 3)), np.zeros((3, parts + 1, 3))


@njit(cache=True)
def continue_poses(v: Array, frame: int, starts: Array) -> None:
    """Write two poses to start a frame from, as far as there are frames before it: to `starts[1]` the pose before, to
    `starts[2]` the two before continued.
    """
    if frame > 0:
        copy_to(starts[1], v[frame - 1])
    if frame > 1:
        for part in range(v.shape[1]):
            for i in range(3):
                starts[2, part, i] = 2.0 * v[frame - 1, part, i] - v[frame - 2, part, i]


@njit(cache=True)
def needs_curvature(frame: int, last: Minimum) -> bool:
    """Whether a frame needs a new curvature, given its number and how the frame before it went."""
    return frame % REFRESH == 0 or last.iterations > SLOW


@njit(cache=True, error_model="numpy", fastmath=True)
def _curvature(body: Body, work: Work, springs: Springs, H: Array) -> None:
    """The upper triangle of the curvature of springs and holds with respect to the pose; the arms are made anew.

    A small turn w of a part moves the difference of two positions by w x q, q being the difference of their arms, so
    that a spring A contributes [q]^T A [q'] for each pair of parts.
    """
    hang(body, work)
    parts = len(work.turns)
    H[:] = 0.0
    for i in range(3 * parts + 3):
        H[i, i] = max(body.holds[i // 3], SOFTEST)
    on = np.empty(parts, np.intp)
    Q = np.empty((parts, 3))
    for s in range(len(springs.a)):
        if springs.w[s] < EMPTY:
            continue
        a, b = springs.a[s], springs.b[s]
        count = 0
        for part in range(parts):
            size = 0.0
            for i in range(3):
                Q[count, i] = work.arms[a, part, i] - (work.arms[b, part, i] if b >= 0 else 0.0)
                size += Q[count, i] ** 2
            if size > 0.0:
                on[count] = part
                count += 1
        _add_spring(springs.w[s], springs.k[s], springs.e[s], Q, on, count, b < 0, H)


@njit(cache=True, error_model="numpy", fastmath=True)
def _add_spring(w, k, e, Q, on, count, grounded, H):  # type: ignore[no-untyped-def]
    """Add one spring's blocks for the parts `on`; a grounded spring feels the root's displacement too."""
    root = len(H) - 3
    for m in range(count):
        row = 3 * on[m]
        q = Q[m]
        mx, my, mz = q[1] * e[2] - q[2] * e[1], q[2] * e[0] - q[0] * e[2], q[0] * e[1] - q[1] * e[0]
        for n in range(m, count):
            column = 3 * on[n]
            p = Q[n]
            dot = q[0] * p[0] + q[1] * p[1] + q[2] * p[2]
            nx, ny, nz = p[1] * e[2] - p[2] * e[1], p[2] * e[0] - p[0] * e[2], p[0] * e[1] - p[1] * e[0]
            along = (mx, my, mz), (nx, ny, nz)
            for i in range(3):
                H[row + i, column + i] += w * k * dot
                for j in range(3):
                    H[row + i, column + j] += w * ((1.0 - k) * along[0][i] * along[1][j] - k * p[i] * q[j])
        if grounded:
            H[row, root + 1] -= w * q[2]
            H[row, root + 2] += w * q[1]
            H[row + 1, root] += w * q[2]
            H[row + 1, root + 2] -= w * q[0]
            H[row + 2, root] -= w * q[1]
            H[row + 2, root + 1] += w * q[0]
    if grounded:
        for i in range(3):
            H[root + i, root + i] += w


@njit(cache=True, error_model="numpy", fastmath=True)
def _factorise(H: Array) -> None:
    """Cholesky: U with U^T U = H in place of the upper triangle of H."""
    n = len(H)
    for i in range(n):
        for k in range(i):
            if H[k, i] != 0.0:
                for j in range(i, n):
                    H[i, j] -= H[k, i] * H[k, j]
        scale = 1.0 / np.sqrt(H[i, i])
        for j in range(i, n):
            H[i, j] *= scale


@njit(cache=True, error_model="numpy", fastmath=True)
def _scale(U: Array, v: Array, z: Array) -> None:
    """The product z = U v, written."""
    flat_v, flat_z = v.reshape(v.size), z.reshape(z.size)
    for i in range(len(U)):
        total = 0.0
        for j in range(i, len(U)):
            total += U[i, j] * flat_v[j]
        flat_z[i] = total


@njit(cache=True, error_model="numpy", fastmath=True)
def _unscale(U: Array, z: Array, v: Array) -> None:
    """The v with U v = z, written."""
    flat_v, flat_z = v.reshape(v.size), z.reshape(z.size)
    for i in range(len(U) - 1, -1, -1):
        total = flat_z[i]
        for j in range(i + 1, len(U)):
            total -= U[i, j] * flat_v[j]
        flat_v[i] = total / U[i, i]


@njit(cache=True, error_model="numpy", fastmath=True)
def _scale_gradient(U: Array, gradient: Array) -> None:
    """The gradient with respect to z, in place of that with respect to v: g with U^T g = gradient."""
    flat = gradient.reshape(gradient.size)
    for i in range(len(U)):
        flat[i] /= U[i, i]
        for j in range(i + 1, len(U)):
            flat[j] -= U[i, j] * flat[i]
