"""One clip through all of it: source motion and target skeleton in, target motion and figures out."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from distretarget.articulation import swing
from distretarget.body import height
from distretarget.distances import DistanceProblem, distance_problem
from distretarget.errors import MotionError
from distretarget.footing import root_scale as leg_ratio
from distretarget.matching import match
from distretarget.motion import Motion
from distretarget.points import Postures, posture_stress, solve_postures
from distretarget.rotation_copy import rotation_copy
from distretarget.skeleton import Skeleton


@dataclass(frozen=True, eq=False)
class RetargetResult:
    """A retargeted motion and what it took.

    Attributes:
        motion: on the target, with the source's frames and frame time.
        copy: the rotation copy, the baseline.
        postures: the solved points and what the solver says of each frame.
        root_scale: target units per source unit of the root's path.
        copy_stress, free_stress, written_stress: (frames,), Eq. (2) divided by the squared height of the target's
            rest pose, of the rotation copy, the solved points and `motion`.
    """

    motion: Motion
    copy: Motion
    postures: Postures
    root_scale: float
    copy_stress: NDArray[np.float64]
    free_stress: NDArray[np.float64]
    written_stress: NDArray[np.float64]

    def __repr__(self) -> str:
        return f"<RetargetResult of {len(self.motion)} frames, mean stress {self.written_stress.mean():.3g}>"


def retarget(
    source: Motion,
    target: Skeleton,
    *,
    joint_map: Mapping[str, str] | None = None,
    root_scale: float | None = None,
    progress: Callable[[int], Any] = lambda frames: None,
) -> RetargetResult:
    """Carry a motion over to another body by its normalised joint distances.

    Mucherino, Goncalves, Bernardin, Hoyet, Multon, "A Distance-Based Approach for Human Posture Simulations",
    FedCSIS 2017: solve each frame's points, then turn the target's bones towards them.

    Args:
        source: the motion to carry over.
        target: the body to carry it to; its joints have the names of the source's, or `joint_map` says which.
        joint_map: source key for target keys whose names differ.
        root_scale: target units per source unit of the root's path; the ratio of leg lengths if not given.
        progress: called with numbers of frames as they are solved.

    Raises:
        MatchingError: the source lacks joints of the target.
        MotionError: the source has no frames, or positions too large to compute with, or a body has no extent.
    """
    skeleton = source.rigid_skeleton
    _check(source, target)
    drivers = match(skeleton, target, joint_map)
    scale = leg_ratio(skeleton, target, drivers) if root_scale is None else root_scale
    copy = rotation_copy(source, target, drivers, scale * source.positions[:, drivers[0]])
    problem = distance_problem(skeleton, target, drivers)
    postures = solve_postures(problem, source.positions, copy.positions, progress)
    points = np.array(copy.positions)
    points[:, problem.targets] = postures.positions
    motion = swing(copy, points, problem.targets)
    unit = (problem.body_size / height(target)) ** 2
    return RetargetResult(
        motion,
        copy,
        postures,
        scale,
        unit * posture_stress(problem, source.positions, copy.positions),
        unit * postures.stress,
        unit * posture_stress(problem, source.positions, motion.positions),
    )


def _check(source: Motion, target: Skeleton) -> None:
    if not len(source):
        raise MotionError("the source has no frames; there is nothing to retarget")
    if not np.abs(source.positions).max() < 1e100:
        raise MotionError("the source has positions beyond 1e100; its OFFSETs or position channels must be wrong")
    for body, name in ((source.skeleton, "source"), (target, "target")):
        if not body.path_lengths.max() > 0:
            raise MotionError(f"no bone of the {name} has a length; its OFFSETs are all zero")
