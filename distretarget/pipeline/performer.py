"""A source on its way to a target: matched, prepared for the solver, and made a result of its poses."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from distretarget.baseline.engine_root import EngineRoot, RootFollows, find_engine_root
from distretarget.baseline.rotation_copy import RootScale, root_path, rotation_copy
from distretarget.baseline.world import World, find_world
from distretarget.body.body import Body
from distretarget.distances import distance_problem
from distretarget.errors import MotionError
from distretarget.ik.poses import PoseProblem, Poses
from distretarget.ik.rigid_parts import LEAST_TURN, fit_rotations, part_of_joint, posed_motion, rigid_part_roots
from distretarget.matching.matching import Matching, match
from distretarget.motion import Motion
from distretarget.numerics.time_series import find_shots
from distretarget.numerics.vectors import extent
from distretarget.objectives.floor_heights import with_floor_heights
from distretarget.objectives.foot_lock import find_stance, hips_rise
from distretarget.objectives.paper import Postures
from distretarget.objectives.resting_joints import find_resting_joints, root_shift, with_resting_joints
from distretarget.objectives.settings import DEFAULT_SETTINGS, ContactSettings
from distretarget.objectives.supports import Supports, no_supports
from distretarget.pipeline.options import DEFAULT_OPTIONS, Options
from distretarget.pipeline.result import RetargetResult
from distretarget.pipeline.soundness import check_finite, check_places
from distretarget.skeleton import LARGEST, SMALLEST, JointMap, Skeleton
from distretarget.target import SkeletonEdit, Target

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Performer:
    """A source matched to its target.

    Attributes:
        world: how the source's world is taken into the target's.
        matching: which joint drives which.
    """

    world: World
    matching: Matching

    def prepared(self, scale: RootScale, root_follows: RootFollows | None = None) -> Prepared:
        """Return what the solvers need to know, with nothing that rests.

        Raises:
            MotionError: the root is to follow the source's root, and the source has none on the floor.
        """
        engine_root = find_engine_root(self.matching, scale, root_follows)
        copy = rotation_copy(self.matching, scale)
        return Prepared(
            performer=self,
            scale=scale,
            engine_root=engine_root,
            copy=copy,
            problem=_pose_problem(self.matching, copy, root_path(copy, self.matching, scale)),
            supports=no_supports(len(copy)),
            settings=DEFAULT_SETTINGS,
        )


def matched_performer(
    source: Motion,
    target: Motion | Skeleton | Target | SkeletonEdit,
    options: Options = DEFAULT_OPTIONS,
    joint_map: JointMap | None = None,
) -> Performer:
    """Match a source to its target; arguments and errors are those of `retarget`."""
    goal = _target_for(source, target)
    _check(source, goal.skeleton)
    bodies = Body.of_motion(source), _target_body(goal)
    source_up, target_up, root_offset = options.source_up, options.target_up, options.root_offset
    world = find_world(*bodies, source_up=source_up, target_up=target_up, root_offset=root_offset)
    source_body, target_body = world.to_target_axes(bodies[0]), bodies[1].with_up(world.up)
    return Performer(world, match(source_body, target_body, {**goal.map, **(joint_map or {})}))


@dataclass(frozen=True, eq=False, kw_only=True)
class Prepared:
    """What the solvers need to know of a performer, and what makes a result of their poses.

    Attributes:
        performer: source and target.
        scale: from the source's world to the target's.
        engine_root: what a root on the floor follows.
        copy: the rotation copy.
        problem: the clip as solvers take it.
        supports: what rests.
        settings: of the contact objective.
    """

    performer: Performer
    scale: RootScale
    engine_root: EngineRoot
    copy: Motion
    problem: PoseProblem
    supports: Supports
    settings: ContactSettings

    def result(self, poses: Poses, postures: Postures | None = None) -> RetargetResult:
        """Return the result of the poses, and of the paper's solved points where there are any.

        Raises:
            MotionError: a frame of the result is wrong, and which.
        """
        matching = self.performer.matching
        posed = _posed(self.copy, poses, self.problem)
        motion, copy = (self.engine_root.placed(moved) for moved in (posed, self.copy))
        check_finite(motion)
        check_places(posed, self.problem.copy_on_path, matching)
        free = self.settings.support_stiffness == 0.0
        return RetargetResult(
            source=matching.source_motion,
            motion=motion,
            rotation_copy=copy,
            matching=matching,
            world=self.performer.world,
            root_scale=self.scale.height,
            effort=poses.effort,
            supports=no_supports(len(motion)) if free else self.supports,
            postures=postures,
            distances=self.problem.distances,
        )


def with_supports(prepared: Prepared, options: Options, settings: ContactSettings) -> Prepared:
    """Return the same with what rests in the source, and the root where that asks for it; for the arguments see
    `retarget`.
    """
    matching, scale, problem = prepared.performer.matching, prepared.scale, prepared.problem
    source, up = matching.source, matching.source.up_vector
    shots = find_shots(matching.source_motion.positions, np.flatnonzero(source.regions.of_joint >= 0), source.unit / 2)
    feet = find_stance(matching, prepared.copy, scale, shots, settings)
    problem = problem.raised(np.outer(hips_rise(matching, feet, scale, shots), up))
    supports = feet
    if options.supports == "hold":
        if others := find_resting_joints(feet, matching, problem, scale, shots, options.environment, settings):
            problem = problem.raised(root_shift(problem, feet, others, shots))
            supports = with_resting_joints(feet, others, problem, shots, settings)
        supports = with_floor_heights(supports, matching, problem, scale, settings)
    if options.supports == "free":
        settings = replace(settings, support_stiffness=0.0)
    return replace(prepared, problem=problem, supports=supports, settings=settings)


def _target_body(target: Target) -> Body:
    return _body_at_rest(target.skeleton) if target.motion is None else Body.of(target.skeleton, target.motion)


@lru_cache(maxsize=1)
def _body_at_rest(skeleton: Skeleton) -> Body:
    """The body of a target, which stays the same for all clips that are retargeted to it one after the other."""
    return Body.of(skeleton)


def _target_for(source: Motion, target: Motion | Skeleton | Target | SkeletonEdit) -> Target:
    """The target with all that is known of it."""
    match target:
        case Motion():
            return Target(target.rigid_skeleton, {}, "", target)
        case Skeleton():
            return Target(target, {}, "")
        case _:
            return target.for_source(source.rigid_skeleton)


def _pose_problem(matching: Matching, copy: Motion, root: Array) -> PoseProblem:
    """What the solvers need to know of a clip whose root keeps to the path `root`, (frames, 3) [target file units]."""
    source, body = matching.source_motion, matching.target
    distances = distance_problem(matching.source.skeleton, body.skeleton, matching.drivers)
    roots = rigid_part_roots(matching)
    return PoseProblem(
        skeleton=body.skeleton,
        legs=body.legs,
        unit=body.unit,
        roots=roots,
        parts=part_of_joint(body.skeleton, roots),
        distances=distances,
        regions=matching.regions,
        source=source.positions,
        copy=copy.positions,
        root=root,
        frame_time=source.frame_time,
    )


def _posed(copy: Motion, poses: Poses, problem: PoseProblem) -> Motion:
    """The motion of the poses; where joints have fewer than three rotation channels, as near to it as these allow."""
    skeleton = problem.skeleton
    motion = posed_motion(copy, poses.v, problem.parts, problem.root + poses.v[:, -1])
    if any(_lacks_channels(motion, joint) for joint in range(len(skeleton))):
        moved = replace(copy, root_positions=motion.root_positions)
        return fit_rotations(moved, motion.positions, np.arange(1, len(skeleton)), problem.roots)
    return motion


def _lacks_channels(motion: Motion, joint: int) -> bool:
    """Whether a joint may turn in a way that its channels cannot say: it has one or two, or none and carries a bone."""
    axes = motion.skeleton.rotation_axes(joint)
    if axes or not motion.skeleton.children[joint]:
        return 0 < len(axes) < 3
    return bool(np.abs(motion.rotations[:, joint, :3]).max(initial=0.0) > LEAST_TURN)


def _check(source: Motion, target: Skeleton) -> None:
    if not len(source):
        raise MotionError("the source has no frames; there is nothing to retarget")
    if not extent(source.positions) <= LARGEST:
        raise MotionError(f"the source has positions beyond {LARGEST:g}; OFFSETs or position channels must be wrong")
    for body, name in ((source.skeleton, "source"), (target, "target")):
        if not body.lengths.max() >= SMALLEST:
            raise MotionError(f"no bone of the {name} has a length; its OFFSETs are all below {SMALLEST:g}")
