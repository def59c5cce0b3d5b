"""One clip through all of it: source motion and target body in, target motion and figures out."""

from __future__ import annotations

import reprlib
from dataclasses import replace
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from distretarget.baseline.engine_root import RootFollows, find_engine_root
from distretarget.baseline.root import find_root_scale, root_path
from distretarget.baseline.rotation_copy import rotation_copy
from distretarget.baseline.world import RootOffset, find_world
from distretarget.body.axes import AXES
from distretarget.body.body import Body
from distretarget.distances import distance_problem, posture_stress
from distretarget.errors import MotionError, SettingsError
from distretarget.io.target import SkeletonEdit, Target
from distretarget.matching.matching import Matching, match
from distretarget.matching.pairing import JointMap
from distretarget.motion import Motion
from distretarget.numerics.shots import find_shots
from distretarget.result import RetargetResult
from distretarget.skeleton import LARGEST, SMALLEST, Skeleton
from distretarget.solve.chunks import Mapper, Progress
from distretarget.solve.contact import solve_contact
from distretarget.solve.fit_to_points import fit_rotations
from distretarget.solve.floor_heights import with_floor_heights
from distretarget.solve.free_points import Postures, solve_postures
from distretarget.solve.paper import solve_paper
from distretarget.solve.poses import PoseProblem, Poses
from distretarget.solve.resting_joints import Scene, find_resting_joints, with_resting_joints
from distretarget.solve.rigid_parts import part_of_joint, posed_motion, rigid_part_roots
from distretarget.solve.root_height import root_shift
from distretarget.solve.settings import ContactSettings
from distretarget.solve.stance import find_stance, hips_rise
from distretarget.solve.supports import no_supports

Array = NDArray[np.float64]
Objective = Literal["contact", "paper"]
OBJECTIVES: tuple[Objective, ...] = ("contact", "paper")
Held = Literal["hold", "feet", "free"]
SUPPORTS: tuple[Held, ...] = get_args(Held)
DEFAULT_SETTINGS = ContactSettings()


def retarget(
    source: Motion,
    target: Motion | Skeleton | Target | SkeletonEdit,
    *,
    objective: Objective = "contact",
    supports: Held = "hold",
    scene: Scene = "body",
    joint_map: JointMap | None = None,
    root_scale: float | None = None,
    source_up: str | None = None,
    target_up: str | None = None,
    root_offset: RootOffset | None = None,
    root_follows: RootFollows | None = None,
    settings: ContactSettings = DEFAULT_SETTINGS,
    mapper: Mapper = map,
    progress: Progress = lambda _frames: None,
) -> RetargetResult:
    """Retarget a motion to another body.

    Args:
        source: the motion to retarget.
        target: the body to retarget it to, with any names, rest pose and axes: what `load_target` returns, with the
            joint map of its file; a skeleton; or any motion of the body, which tells its axes, and how its limbs bend
            where its rest pose does not.
        objective: "contact" keeps what is near near and the rest as it was; "paper" minimises Eq. (2) of
            Mucherino, Goncalves, Bernardin, Hoyet, Multon, "A Distance-Based Approach for Human Posture Simulations",
            FedCSIS 2017.
        supports: what stays where it belongs while it rests on the world: "hold", feet and all other joints; "feet",
            feet alone; "free", nothing. The paper's objective has no such term.
        scene: where rails, walls, rungs and all else that stands still belongs, apart from the floor: "body", where the
            target's limbs meet it on average; "scaled", where it is in the source, scaled as the root's path.
        joint_map: source key for target keys, None for joints that nothing shall drive; its pairs go before those of
            the target's file. The other joints are matched by names or by shape.
        root_scale: target units per source unit of the root's path; the ratio of leg lengths if not given.
        source_up: the axis that points up in the source's file ("Y", "-Z", ...); found if not given (`world`).
        target_up: that of the target's file.
        root_offset: whether position channels of the source's root replace its OFFSET or are added; found if not given.
        root_follows: what a root on the floor of the target follows: "pelvis", on the floor; "source", the source's own
            root; or "nothing", it stays at the origin. Found if not given (`engine_root`); no effect on other targets.
        settings: what shapes the result of the contact objective; the paper's objective has none.
        mapper: solves the chunks of a long clip: `map`, or that of an executor, with the same result. The paper's
            objective starts each frame from the one before and has no chunks.
        progress: called with numbers of frames as they are solved.

    Raises:
        MatchingError: the two bodies cannot be matched.
        MapError: `joint_map` names joints that are not there.
        MotionError: the source has no frames, or positions too large to compute with, or a body has no extent; or
            the root is to follow the source's root, and the source has none on the floor.
        SettingsError: an argument is none of its choices, or of another kind.
    """
    _check_arguments(source, target, settings, root_scale)
    for name, value, known in (
        ("objective", objective, OBJECTIVES),
        ("source_up", source_up, (*AXES, None)),
        ("target_up", target_up, (*AXES, None)),
        ("root_offset", root_offset, (*get_args(RootOffset), None)),
        ("root_follows", root_follows, (*get_args(RootFollows), None)),
    ):
        if value not in known:
            raise SettingsError(f"{name} is {value!r}; expected one of {', '.join(map(repr, known))}")
    goal = _target_for(source, target)
    _check(source, goal.skeleton)
    bodies = Body.of_motion(source), Body.of(goal.skeleton, goal.motion)
    world = find_world(*bodies, source_up=source_up, target_up=target_up, root_offset=root_offset)
    source_body, target_body = world.to_target_axes(bodies[0]), bodies[1].with_up(world.up)
    matching = match(source_body, target_body, {**goal.map, **(joint_map or {})})
    scale = find_root_scale(matching) if root_scale is None else root_scale
    engine_root = find_engine_root(matching, scale, root_follows)
    copy = rotation_copy(matching, scale)
    problem = _pose_problem(matching, copy, root_path(copy, matching, scale))
    held, postures = no_supports(len(source)), None
    if objective == "paper":
        postures = solve_postures(problem.distances, problem.source, copy.positions)
        poses = solve_paper(problem, _fitted_poses(copy, problem, postures), progress)
    else:
        shots = find_shots(matching.source_motion.positions[:, source_body.regions.of_joint >= 0], source_body.unit / 2)
        feet = find_stance(matching, copy, scale, shots, settings)
        problem = problem.raised(np.outer(hips_rise(matching, feet, scale, shots), world.up_vector))
        resting = feet
        if supports == "hold":
            if others := find_resting_joints(feet, matching, problem, scale, shots, scene, settings):
                problem = problem.raised(root_shift(problem, feet, others, shots))
                resting = with_resting_joints(feet, others, problem, shots, settings)
            resting = with_floor_heights(resting, matching, problem, scale, settings)
        if supports == "free":
            settings = replace(settings, support_stiffness=0.0)
        else:
            held = resting
        poses = solve_contact(problem, resting, settings, mapper=mapper, progress=progress)
    motion, copy = (engine_root.placed(moved) for moved in (_posed(copy, poses, problem), copy))
    relative = (problem.distances.body_size / target_body.height) ** 2
    return RetargetResult(
        source=matching.source_motion,
        motion=motion,
        rotation_copy=copy,
        matching=matching,
        world=world,
        root_scale=scale,
        effort=poses.effort,
        supports=held,
        postures=postures,
        copy_stress=relative * posture_stress(problem.distances, problem.source, copy.positions),
        written_stress=relative * posture_stress(problem.distances, problem.source, motion.positions),
        free_stress=None if postures is None else relative * postures.stress,
    )


def _check_arguments(source: object, target: object, settings: object, root_scale: object) -> None:
    """Check the kinds of arguments, which type checkers see and scripts may not.

    Raises: SettingsError: one is of another kind, or the scale is no number above 0.
    """
    for name, value, kinds in (
        ("source", source, (Motion,)),
        ("target", target, (Motion, Skeleton, Target, SkeletonEdit)),
        ("settings", settings, (ContactSettings,)),
    ):
        if not isinstance(value, kinds):
            wanted = " or ".join(kind.__name__ for kind in kinds)
            raise SettingsError(f"{name} is {reprlib.repr(value)}; expected a {wanted}")
    if root_scale is not None and not (isinstance(root_scale, int | float) and SMALLEST <= root_scale <= LARGEST):
        raise SettingsError(f"root_scale is {root_scale!r}; expected a number from {SMALLEST:g} to {LARGEST:g}")


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
    if any(0 < len(skeleton.rotation_axes(joint)) < 3 for joint in range(len(skeleton))):
        moved = replace(copy, translations=motion.translations)
        return fit_rotations(moved, motion.positions, np.arange(1, len(skeleton)), problem.roots)
    return motion


def _fitted_poses(copy: Motion, problem: PoseProblem, postures: Postures) -> Array:
    """(frames, parts + 1, 3), the poses that turn the copy's bones to the solved points; the root stays."""
    points = np.array(copy.positions)
    points[:, problem.distances.targets] = postures.positions
    fitted = fit_rotations(copy, points, problem.distances.targets, problem.roots)
    roots = np.unique(problem.parts, return_index=True)[1]
    before, after = (Rotation.from_quat(motion.world_rotations[:, roots]) for motion in (copy, fitted))
    return np.pad((after * before.inv()).as_rotvec(), ((0, 0), (0, 1), (0, 0)))


def _check(source: Motion, target: Skeleton) -> None:
    if not len(source):
        raise MotionError("the source has no frames; there is nothing to retarget")
    if not np.abs(source.positions).max() <= LARGEST:
        raise MotionError(f"the source has positions beyond {LARGEST:g}; OFFSETs or position channels must be wrong")
    for body, name in ((source.skeleton, "source"), (target, "target")):
        if not body.lengths.max() >= SMALLEST:
            raise MotionError(f"no bone of the {name} has a length; its OFFSETs are all below {SMALLEST:g}")
