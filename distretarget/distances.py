"""The paper's distance problem, Eq. (1) and (2): path lengths, priorities, stress and its gradient. Compiled."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from distretarget.numerics.compiled import compiled, inlined
from distretarget.skeleton import Skeleton

NEAREST = 1e-300  # least squared distance, so that coincident points exert no force [body sizes squared]
LANES = 8  # most numbers in a vector register


def filled(columns: NDArray[np.float64]) -> NDArray[np.float64]:
    """Arrays (..., columns) padded with columns of zeros to a multiple of `LANES`, so that loops are all vectors."""
    fill = -columns.shape[-1] % LANES
    return np.concatenate([columns, np.zeros((*columns.shape[:-1], fill))], axis=-1)


@inlined(fastmath=True)
def stress_and_gradient(
    x: NDArray[np.float64], delta: NDArray[np.float64], pi: NDArray[np.float64], gradient: NDArray[np.float64]
) -> float:
    """sigma(X) = 1/2 sum_{u<v} pi_uv (||x_u - x_v|| - delta_uv)^2, Eq. (2); its gradient is written to `gradient`.

    `x` and `gradient` are (3, columns), so that the inner loop runs along memory; `delta` and `pi` are
    (points, columns), symmetric, with zero diagonals. Padding columns (`filled`) need `pi` = 0; their gradient is not
    written.
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
def target_distances(x: NDArray[np.float64], ratio: NDArray[np.float64], delta: NDArray[np.float64]) -> None:
    """Write delta_uv = tau2_uv D_uv = (tau2_uv / tau1_uv) ||x_u - x_v||, Eq. (1).

    `x` is the source's posture, (3, columns); `ratio` is tau2 / tau1, (points, columns).
    """
    points, columns = ratio.shape
    for u in range(points):
        xu, yu, zu = x[0, u], x[1, u], x[2, u]
        for v in range(columns):
            dx, dy, dz = xu - x[0, v], yu - x[1, v], zu - x[2, v]
            delta[u, v] = ratio[u, v] * np.sqrt(dx * dx + dy * dy + dz * dz)


@dataclass(frozen=True, eq=False, kw_only=True)
class DistanceProblem:
    """The part of the problem that all frames share.

        minimise sigma(X) = 1/2 sum_{u<v} pi_uv (||x_u - x_v|| - delta_uv)^2,   delta = tau2 D    Eq. (2)

    A point is a joint or End Site that source and target share; joints that coincide on both skeletons are one point.
    Solvers take lengths in body sizes.

    Attributes:
        sources: (points,), the source joint at each point.
        targets: (points,), the target joint at each point.
        tau1, tau2: (points, points), path lengths on the source and on the target [file units].
        sizes: |P|, (points, points), the number of points on the path between two points, the larger of both bodies'.
        body_size: the largest path length of the target [target file units].
    """

    sources: NDArray[np.intp]
    targets: NDArray[np.intp]
    tau1: NDArray[np.float64]
    tau2: NDArray[np.float64]
    sizes: NDArray[np.intp]
    body_size: float

    def __len__(self) -> int:
        return len(self.targets)

    def __repr__(self) -> str:
        return f"<DistanceProblem of {len(self)} points, body size {self.body_size:g}>"

    @cached_property
    def ratio(self) -> NDArray[np.float64]:
        """tau2 / tau1, (points, points) [body sizes / source file unit]; 0 where tau1 is 0."""
        zeros = np.zeros_like(self.tau1)
        return np.divide(self.tau2 / self.body_size, self.tau1, out=zeros, where=self.tau1 > 0)

    @cached_property
    def priorities(self) -> NDArray[np.float64]:
        """pi_uv = (|Pmax| - |P_uv| + 2) / |Pmax|, (points, points).

        It is 0 on the diagonal and where tau1 is 0, since there the source gives no distance.
        """
        largest = self.sizes.max()
        return np.where(self.tau1 > 0, (largest - self.sizes + 2.0) / largest, 0.0)


def distance_problem(source: Skeleton, target: Skeleton, drivers: NDArray[np.intp]) -> DistanceProblem:
    """The problem of a pair of skeletons.

    `drivers`, (target joints,), is the source joint that drives each target joint, -1 for none.
    """
    points = point_of_joint(source, target, drivers)
    targets = np.unique(points[points >= 0])
    sources = drivers[targets]
    source_pairs, target_pairs = np.ix_(sources, sources), np.ix_(targets, targets)
    source_sizes = _point_path_sizes(source, sources)[source_pairs]
    target_sizes = _point_path_sizes(target, targets)[target_pairs]
    return DistanceProblem(
        sources=sources,
        targets=targets,
        tau1=source.path_lengths[source_pairs],
        tau2=target.path_lengths[target_pairs],
        sizes=np.maximum(source_sizes, target_sizes),
        body_size=float(target.path_lengths.max()),
    )


def point_of_joint(source: Skeleton, target: Skeleton, drivers: NDArray[np.intp]) -> NDArray[np.intp]:
    """(target joints,), the target joint whose point each joint is: itself, or the ancestor with which it coincides on
    both skeletons; -1 for joints without a driver, which are not points.
    """
    points = np.where(drivers >= 0, np.arange(len(target)), -1)
    coincide = (target.lengths == 0.0) & (source.lengths[drivers] == 0.0)
    for joint in np.flatnonzero((points >= 0) & coincide):
        parent = target.parents[joint]
        if parent >= 0 and points[parent] >= 0 and source.parents[drivers[joint]] == drivers[parent]:
            points[joint] = points[parent]
    return points


def _point_path_sizes(skeleton: Skeleton, points: NDArray[np.intp]) -> NDArray[np.intp]:
    """|P| along the tree of a skeleton, (joints, joints), counting the given joints only."""
    return skeleton.path_counts(np.isin(np.arange(len(skeleton)), points)) + 1


def posture_stress(
    problem: DistanceProblem, source: NDArray[np.float64], result: NDArray[np.float64]
) -> NDArray[np.float64]:
    """(frames,), the stress sigma of postures, Eq. (2) [body sizes squared].

    `source`, (frames, source joints, 3) [source file units], gives the distances D; `result`, (frames, target joints,
    3) [target file units], are the postures.
    """
    tau = 1.0 / np.where(problem.ratio > 0, problem.ratio, 1.0)  # where the ratio is 0, so is the priority
    x, y = (source, problem.sources, tau), (result, problem.targets, np.full_like(tau, problem.body_size))
    return 0.5 * differences_of_distances(x, y, problem.priorities, 2)


def differences_of_distances(
    x: tuple[NDArray[np.float64], NDArray[np.intp], NDArray[np.float64]],
    y: tuple[NDArray[np.float64], NDArray[np.intp], NDArray[np.float64]],
    weights: NDArray[np.float64],
    power: Literal[1, 2],
) -> NDArray[np.float64]:
    """(frames,), the sum over all pairs u < v of weights_uv | ||x_u - x_v|| / tau_uv - ||y_u - y_v|| / tau'_uv |^power.

    `x` and `y` are each positions, (frames, joints, 3), the joint at each point, (points,), and the length tau that
    each distance is divided by, (points, points); `weights` is (points, points). It is exactly 0 for equal x and y.
    """
    scratch, sums = np.empty((2, 3, len(weights))), np.empty(len(y[0]))
    _write_differences(*x, *y, weights, power, scratch, sums)
    return sums


@compiled(fastmath=True)
def _write_differences(x, of_x, tau_x, y, of_y, tau_y, weights, power, scratch, sums):  # type: ignore[no-untyped-def]
    points, p, q = len(of_x), scratch[0], scratch[1]
    for frame in range(len(sums)):
        for point in range(points):
            for i in range(3):
                p[i, point], q[i, point] = x[frame, of_x[point], i], y[frame, of_y[point], i]
        total = 0.0
        for u in range(points):
            for v in range(u):
                one = np.sqrt((p[0, u] - p[0, v]) ** 2 + (p[1, u] - p[1, v]) ** 2 + (p[2, u] - p[2, v]) ** 2)
                other = np.sqrt((q[0, u] - q[0, v]) ** 2 + (q[1, u] - q[1, v]) ** 2 + (q[2, u] - q[2, v]) ** 2)
                difference = abs(one / tau_x[u, v] - other / tau_y[u, v])
                total += weights[u, v] * (difference if power == 1 else difference * difference)
        sums[frame] = total


def columns(positions: NDArray[np.float64]) -> NDArray[np.float64]:
    """Positions (frames, points, 3) as a contiguous array (frames, 3, points)."""
    return np.ascontiguousarray(positions.transpose(0, 2, 1))
