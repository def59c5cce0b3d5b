"""One clip through all of it: source motion and target skeleton in, target motion and figures out."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from distretarget.articulation import parts_of, posed_motion, rigid_heads
from distretarget.body import height
from distretarget.contact import solve_contact
from distretarget.distances import DistanceProblem, distance_problem
from distretarget.errors import MotionError
from distretarget.footing import Stance, find_stance, no_stance, root_path
from distretarget.footing import root_scale as leg_ratio
from distretarget.matching import match
from distretarget.motion import Motion
from distretarget.paper import solve_paper
from distretarget.points import Postures, posture_stress, solve_postures
from distretarget.poses import Clip, Poses
from distretarget.rotation_copy import rotation_copy
from distretarget.skeleton import Skeleton
from distretarget.spg import Effort
from distretarget.swing import swing

Objective = Literal["contact", "paper"]
OBJECTIVES: tuple[Objective, ...] = ("contact", "paper")


@dataclass(frozen=True, eq=False)
class RetargetResult:
    """A retargeted motion and what it took.

    Attributes:
        motion: on the target, with the source's frames and frame time.
        copy: the rotation copy, the baseline.
        drivers: (target joints,), the source joint that drives each target joint, -1 for none.
        root_scale: target units per source unit of the root's path.
        effort: what the solver took for each frame.
        stance: the feet at rest and where they belong; no feet for the paper's objective.
        postures: the paper's solved points; None for the contact objective, which needs none.
        copy_stress, written_stress: (frames,), Eq. (2) divided by the squared height of the target's rest pose, of the
            rotation copy and of `motion`.
        free_stress: (frames,), the same of the solved points; None without them.
    """

    motion: Motion
    copy: Motion
    drivers: NDArray[np.intp]
    root_scale: float
    effort: Effort
    stance: Stance
    postures: Postures | None
    copy_stress: NDArray[np.float64]
    written_stress: NDArray[np.float64]
    free_stress: NDArray[np.float64] | None

    def __repr__(self) -> str:
        return f"<RetargetResult of {len(self.motion)} frames, mean stress {self.written_stress.mean():.3g}>"


def retarget(
    source: Motion,
    target: Skeleton,
    *,
    objective: Objective = "contact",
    hold_feet: bool = True,
    joint_map: Mapping[str, str] | None = None,
    root_scale: float | None = None,
    progress: Callable[[int], Any] = lambda _frames: None,
) -> RetargetResult:
    """Carry a motion over to another body.

    Args:
        source: the motion to carry over.
        target: the body to carry it to; its joints have the names of the source's, or `joint_map` says which.
        objective: "contact" keeps what is near near and the rest as it was; "paper" minimises Eq. (2) of
            Mucherino, Goncalves, Bernardin, Hoyet, Multon, "A Distance-Based Approach for Human Posture Simulations",
            FedCSIS 2017.
        hold_feet: whether feet at rest stay where they belong; the paper's objective has no such term.
        joint_map: source key for target keys whose names differ.
        root_scale: target units per source unit of the root's path; the ratio of leg lengths if not given.
        progress: called with numbers of frames as they are solved.

    Raises:
        MatchingError: the source lacks joints of the target.
        MotionError: the source has no frames, or positions too large to compute with, or a body has no extent.
    """
    _check(source, target)
    skeleton = source.rigid_skeleton
    drivers = match(skeleton, target, joint_map)
    scale = leg_ratio(skeleton, target, drivers) if root_scale is None else root_scale
    copy = rotation_copy(source, target, drivers, scale * source.positions[:, drivers[0]])
    problem = distance_problem(skeleton, target, drivers)
    parts = parts_of(target, rigid_heads(copy))
    root = root_path(source, copy, drivers, scale)
    clip = Clip(target, parts, problem, source.positions, copy.positions, root, source.frame_time)
    stance, postures = no_stance(len(source)), None
    if objective == "paper":
        postures = solve_postures(problem, source.positions, copy.positions)
        poses = solve_paper(clip, _swung(copy, problem, postures, parts), progress)
    else:
        if hold_feet:
            stance = find_stance(source, target, drivers, scale)
        poses = solve_contact(clip, stance, progress)
    motion = _written(copy, poses, clip)
    relative = (problem.body_size / height(target)) ** 2
    return RetargetResult(
        motion,
        copy,
        drivers,
        scale,
        poses.effort,
        stance,
        postures,
        relative * posture_stress(problem, source.positions, copy.positions),
        relative * posture_stress(problem, source.positions, motion.positions),
        None if postures is None else relative * postures.stress,
    )


def _written(copy: Motion, poses: Poses, clip: Clip) -> Motion:
    """The motion of the poses; where joints have fewer than three rotation channels, as near to it as these allow."""
    skeleton = clip.skeleton
    motion = posed_motion(copy, poses.v, clip.parts, clip.root + poses.v[:, -1])
    if any(0 < len(skeleton.rotation_axes(joint)) < 3 for joint in range(len(skeleton))):
        moved = replace(copy, translations=motion.translations)
        return swing(moved, motion.positions, np.arange(1, len(skeleton)))
    return motion


def _swung(copy: Motion, problem: DistanceProblem, postures: Postures, parts: NDArray[np.intp]) -> NDArray[np.float64]:
    """(frames, parts + 1, 3), the poses that swing the copy's bones to the solved points; the root stays."""
    points = np.array(copy.positions)
    points[:, problem.targets] = postures.positions
    swung = swing(copy, points, problem.targets)
    heads = np.unique(parts, return_index=True)[1]
    ours, theirs = (Rotation.from_quat(motion.world_rotations[:, heads]) for motion in (swung, copy))
    return np.pad((ours * theirs.inv()).as_rotvec(), ((0, 0), (0, 1), (0, 0)))


def _check(source: Motion, target: Skeleton) -> None:
    if not len(source):
        raise MotionError("the source has no frames; there is nothing to retarget")
    if not np.abs(source.positions).max() < 1e100:
        raise MotionError("the source has positions beyond 1e100; its OFFSETs or position channels must be wrong")
    for body, name in ((source.skeleton, "source"), (target, "target")):
        if not body.path_lengths.max() > 0:
            raise MotionError(f"no bone of the {name} has a length; its OFFSETs are all zero")
