"""The paper's distance problem, Eq. (1) and (2): path lengths, priorities, stress and its gradient. Compiled."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from distretarget.numerics.compiled import Out, compiled, inlined
from distretarget.numerics.parallel import over_blocks
from distretarget.numerics.vectors import F1, F2, F3, I1, Array
from distretarget.skeleton import Skeleton

MOST_POINTS = 400  # a body with more keeps those on its longest branches: time and memory grow with pairs
NEAREST = 1e-300  # least squared distance, so that coincident points exert no force [body sizes squared]
LANES = 8  # the most floats in a SIMD register


def padded(columns: Array) -> Array:
    """Pad an array (..., columns) with zeros to a multiple of `LANES` columns, so that SIMD loops have no remainder."""
    fill = -columns.shape[-1] % LANES
    return np.concatenate([columns, np.zeros((*columns.shape[:-1], fill))], axis=-1)


@inlined(fastmath=True)
def stress_and_gradient(x: Array, delta: Array, pi: Array, gradient: Array) -> float:
    """Return sigma(X) = 1/2 sum_{u<v} pi_uv (||x_u - x_v|| - delta_uv)^2, Eq. (2), and write its gradient.

    `x` and `gradient` are (3, columns), so that the inner loop runs along memory; `delta` and `pi` are
    (points, columns), symmetric, with zero diagonals. Padding columns (`padded`) need zeros in `pi`; their gradient is
    not written.
    """
    sigma = 0.0
    points, columns = delta.shape
    for u in range(points):
        xu, yu, zu = x[0, u], x[1, u], x[2, u]
        gx, gy, gz = 0.0, 0.0, 0.0
        for v in range(columns):
            dx, dy, dz = xu - x[0, v], yu - x[1, v], zu - x[2, v]
            distance = np.sqrt(max(dx * dx + dy * dy + dz * dz, NEAREST))
            force = pi[u, v] * (distance - delta[u, v])
            sigma += force * (distance - delta[u, v])
            gx += force / distance * dx
            gy += force / distance * dy
            gz += force / distance * dz
        gradient[0, u], gradient[1, u], gradient[2, u] = gx, gy, gz
    return 0.25 * sigma


@inlined(fastmath=True)
def target_distances(x: Array, ratio: Array, delta: Array) -> None:
    """Write delta_uv = tau2_uv D_uv = (tau2_uv / tau1_uv) ||x_u - x_v||, Eq. (1), for the source's posture `x`, (3,
    columns); `ratio`, (points, columns), is tau2 / tau1.
    """
    points, columns = ratio.shape
    for u in range(points):
        xu, yu, zu = x[0, u], x[1, u], x[2, u]
        for v in range(columns):
            dx, dy, dz = xu - x[0, v], yu - x[1, v], zu - x[2, v]
            delta[u, v] = ratio[u, v] * np.sqrt(dx * dx + dy * dy + dz * dz)


@dataclass(frozen=True, eq=False, kw_only=True)
class DistanceProblem:
    """The constants of the distance problem, which all frames share.

        minimise sigma(X) = 1/2 sum_{u<v} pi_uv (||x_u - x_v|| - delta_uv)^2,   delta = tau2 D    Eq. (2)

    A point is a joint or End Site with a driver; joints that coincide on both skeletons are one point. Solvers use body
    sizes as the unit of length. At most `MOST_POINTS` points count, those on the target's longest branches.
    """

    sources: NDArray[np.intp]  # (points,), the source joint at each point
    targets: NDArray[np.intp]  # (points,), the target joint at each point
    tau1: Array  # (points, points), path lengths on the source [source file units]
    tau2: Array  # (points, points), path lengths on the target [target file units]
    # |P|, (points, points), the number of points on the path between two points; the larger number of the two bodies
    sizes: NDArray[np.intp]
    body_size: float  # the largest path length of the target [target file units]

    def __len__(self) -> int:
        return len(self.targets)

    def __repr__(self) -> str:
        return f"<DistanceProblem of {len(self)} points, body size {self.body_size:g}>"

    @cached_property
    def ratio(self) -> Array:
        """tau2 / tau1, (points, points) [body sizes per source file unit]; 0 where tau1 is 0."""
        return np.divide(self.tau2 / self.body_size, self.tau1, out=np.zeros_like(self.tau1), where=self.tau1 > 0)

    @cached_property
    def priorities(self) -> Array:
        """pi_uv = (|Pmax| - |P_uv| + 2) / |Pmax|, (points, points); 0 where tau1 is 0."""
        largest = self.sizes.max()
        return np.where(self.tau1 > 0, (largest - self.sizes + 2.0) / largest, 0.0)


def distance_problem(source: Skeleton, target: Skeleton, drivers: NDArray[np.intp]) -> DistanceProblem:
    """Return the problem of two skeletons; `drivers`, (target joints,), are the source joints, -1 for none."""
    points = point_of_joint(source, target, drivers)
    targets = target.on_longest_branches(np.unique(points[points >= 0]), MOST_POINTS)
    sources = drivers[targets]
    return DistanceProblem(
        sources=sources,
        targets=targets,
        tau1=source.paths_among(sources),
        tau2=target.paths_among(targets),
        sizes=np.maximum(source.path_sizes(sources, sources), target.path_sizes(targets, targets)),
        body_size=target.longest_path,
    )


def point_of_joint(source: Skeleton, target: Skeleton, drivers: NDArray[np.intp]) -> NDArray[np.intp]:
    """(target joints,), the joint that stands for each target joint in the problem: itself, or the ancestor with which
    it coincides on both skeletons; -1 without a driver.
    """
    points = np.where(drivers >= 0, np.arange(len(target)), -1)
    coincide = (target.lengths == 0.0) & (source.lengths[drivers] == 0.0)
    for joint in np.flatnonzero((points >= 0) & coincide):
        parent = target.parents[joint]
        if parent >= 0 and points[parent] >= 0 and source.parents[drivers[joint]] == drivers[parent]:
            points[joint] = points[parent]
    return points


def posture_stress(problem: DistanceProblem, source: Array, result: Array) -> Array:
    """(frames,), the stress sigma of the postures `result`, Eq. (2) [body sizes squared]; exactly 0 for the source.

    `source`, (frames, source joints, 3), and `result`, (frames, target joints, 3), are positions [file units of each].
    """
    ratio = np.where(problem.ratio > 0, problem.ratio, 1.0)  # a ratio of 0 has the priority 0
    stress, weights = np.empty(len(result)), problem.priorities
    x, y = (np.ascontiguousarray(positions) for positions in (source, result))
    x_scale, y_scale = ratio, np.full_like(ratio, 1.0 / problem.body_size)

    def write(block: slice) -> None:
        points = x[block], problem.sources, x_scale, y[block], problem.targets, y_scale
        _write_stress(*points, weights, np.empty((2, 3, len(weights))), stress[block])

    over_blocks(write, len(stress), len(weights))
    return 0.5 * stress


@compiled(fastmath=True)
def _write_stress(
    x: F3, x_ids: I1, x_scale: F2, y: F3, y_ids: I1, y_scale: F2, weights: F2, scratch: Out[F3], stress: Out[F1]
) -> None:
    """Write the sum over pairs u < v of weights_uv (x_scale_uv ||x_u - x_v|| - y_scale_uv ||y_u - y_v||)^2."""
    points, p, q = len(x_ids), scratch[0], scratch[1]
    for frame in range(len(stress)):
        for point in range(points):
            for i in range(3):
                p[i, point], q[i, point] = x[frame, x_ids[point], i], y[frame, y_ids[point], i]
        total = 0.0
        for u in range(points):
            for v in range(u):
                one = np.sqrt((p[0, u] - p[0, v]) ** 2 + (p[1, u] - p[1, v]) ** 2 + (p[2, u] - p[2, v]) ** 2)
                other = np.sqrt((q[0, u] - q[0, v]) ** 2 + (q[1, u] - q[1, v]) ** 2 + (q[2, u] - q[2, v]) ** 2)
                difference = one * x_scale[u, v] - other * y_scale[u, v]
                total += weights[u, v] * difference * difference
        stress[frame] = total


def columns(positions: Array) -> Array:
    """Return positions (frames, points, 3) as a contiguous array (frames, 3, points)."""
    return np.ascontiguousarray(positions.transpose(0, 2, 1))
