"""The distance problem of the paper: which points, what target distances, what priorities."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from distretarget.skeleton import Skeleton


@dataclass(frozen=True, eq=False)
class DistanceProblem:
    """What is the same in every frame of the problem

        minimise sigma(X) = 1/2 sum_{u<v} pi_uv (||x_u - x_v|| - delta_uv)^2,   delta = tau2 D.

    A point is a joint or End Site that source and target share; those that coincide on both skeletons are one
    point. Lengths are in units of body size.

    Attributes:
        targets: (points,), the target joint at each point.
        sources: (points,), the source joint at each point.
        ratio: (points, points), tau2 / tau1 [body sizes / source file unit]; 0 where tau1 is 0.
        priorities: pi, (points, points), zero on the diagonal and where tau1 is 0, which says nothing.
        body_size: the largest path length of the target [target file units].
    """

    targets: NDArray[np.intp]
    sources: NDArray[np.intp]
    ratio: NDArray[np.float64]
    priorities: NDArray[np.float64]
    body_size: float

    def __len__(self) -> int:
        return len(self.targets)

    def __repr__(self) -> str:
        return f"<DistanceProblem of {len(self)} points, body size {self.body_size:g}>"


def distance_problem(source: Skeleton, target: Skeleton, drivers: NDArray[np.intp]) -> DistanceProblem:
    """The problem for a pair of skeletons.

    `drivers`, (target joints,), is the source joint that drives each target joint, -1 for none.
    """
    points = point_of_joint(source, target, drivers)
    targets = np.unique(points[points >= 0])
    sources = drivers[targets]
    tau1 = source.path_lengths[np.ix_(sources, sources)]
    tau2 = target.path_lengths[np.ix_(targets, targets)]
    body_size = float(target.path_lengths.max())
    ratio = np.divide(tau2 / body_size, tau1, out=np.zeros_like(tau1), where=tau1 > 0)
    sizes = np.maximum(
        _point_path_sizes(target, targets)[np.ix_(targets, targets)],
        _point_path_sizes(source, sources)[np.ix_(sources, sources)],
    )
    return DistanceProblem(targets, sources, ratio, np.where(tau1 > 0, priorities(sizes), 0.0), body_size)


def priorities(sizes: NDArray[np.float64]) -> NDArray[np.float64]:
    """pi_uv = (|Pmax| - |P_uv| + 2) / |Pmax| from the path sizes |P|, (points, points); zero on the diagonal."""
    largest = sizes.max()
    pi = (largest - sizes + 2.0) / largest
    np.fill_diagonal(pi, 0.0)
    return pi


def point_of_joint(source: Skeleton, target: Skeleton, drivers: NDArray[np.intp]) -> NDArray[np.intp]:
    """(target joints,), the joint that stands for each joint's point: itself, or the ancestor with which it
    coincides on both skeletons; -1 for joints that are no point."""
    points = np.where(drivers >= 0, np.arange(len(target)), -1)
    coincide = (target.lengths == 0.0) & (source.lengths[drivers] == 0.0)
    for joint in np.flatnonzero((points >= 0) & coincide):
        parent = target.parents[joint]
        if parent >= 0 and points[parent] >= 0 and source.parents[drivers[joint]] == drivers[parent]:
            points[joint] = points[parent]
    return points


def _point_path_sizes(skeleton: Skeleton, points: NDArray[np.intp]) -> NDArray[np.float64]:
    """|P| over a skeleton's own tree, (joints, joints), counting the given joints only."""
    counted = np.zeros(len(skeleton))
    counted[points] = 1.0
    return skeleton.path_sums(counted) + 1.0
