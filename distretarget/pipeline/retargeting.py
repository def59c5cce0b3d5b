"""One clip through all of it: source motion and target body in, target motion and figures out."""

from __future__ import annotations

from collections.abc import Mapping
from types import NoneType
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from distretarget.baseline.engine_root import RootFollows
from distretarget.baseline.rotation_copy import RootScale, find_root_scale
from distretarget.baseline.world import RootOffset
from distretarget.checks import check_callable, check_choice, check_kind, check_number
from distretarget.ik.poses import Mapper, PoseProblem, Progress
from distretarget.ik.rigid_parts import fit_rotations
from distretarget.motion import Motion
from distretarget.numerics.parallel import in_threads
from distretarget.objectives.contact import solve_contact
from distretarget.objectives.paper import Postures, solve_paper, solve_postures
from distretarget.objectives.resting_joints import Environment
from distretarget.objectives.settings import DEFAULT_SETTINGS, ContactSettings
from distretarget.pipeline.performer import HoldMode, Prepared, matched_performer, with_supports
from distretarget.pipeline.result import RetargetResult
from distretarget.skeleton import AXES, LARGEST, SMALLEST, JointMap, Skeleton
from distretarget.target import SkeletonEdit, Target

Array = NDArray[np.float64]
Objective = Literal["contact", "paper"]
OBJECTIVES: tuple[Objective, ...] = ("contact", "paper")
SUPPORTS: tuple[HoldMode, ...] = get_args(HoldMode)


def retarget(
    source: Motion,
    target: Motion | Skeleton | Target | SkeletonEdit,
    *,
    objective: Objective = "contact",
    supports: HoldMode = "hold",
    scene: Environment = "body",
    joint_map: JointMap | None = None,
    root_scale: float | None = None,
    source_up: str | None = None,
    target_up: str | None = None,
    root_offset: RootOffset | None = None,
    root_follows: RootFollows | None = None,
    settings: ContactSettings = DEFAULT_SETTINGS,
    mapper: Mapper = in_threads,
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
        mapper: solves the chunks of a long clip, all with the same result: `map`, that of an executor, or a thread for
            each core if not given. The paper's objective starts each frame from the one before and has no chunks.
        progress: called with numbers of frames as they are solved.

    Raises:
        MatchingError: the two bodies cannot be matched.
        MapError: `joint_map` names joints that are not there.
        MotionError: the source has no frames, or positions too large to compute with, or a body has no extent; or
            the root is to follow the source's root, and the source has none on the floor.
        SettingsError: an argument is none of its choices, or of another kind.
    """
    check_kind("source", source, Motion)
    check_kind("target", target, Motion, Skeleton, Target, SkeletonEdit)
    check_kind("joint_map", joint_map, Mapping, NoneType)
    check_kind("settings", settings, ContactSettings)
    check_callable("mapper", mapper)
    check_callable("progress", progress)
    check_options(
        objective=objective,
        supports=supports,
        scene=scene,
        root_scale=root_scale,
        source_up=source_up,
        target_up=target_up,
        root_offset=root_offset,
        root_follows=root_follows,
    )
    performer = matched_performer(
        source, target, joint_map=joint_map, source_up=source_up, target_up=target_up, root_offset=root_offset
    )
    scale = RootScale.even(find_root_scale(performer.matching) if root_scale is None else root_scale)
    prepared = performer.prepared(scale, root_follows)
    if objective == "paper":
        return _by_paper(prepared, progress)
    prepared = with_supports(prepared, supports, scene, settings)
    poses = solve_contact(prepared.problem, prepared.supports, prepared.settings, mapper=mapper, progress=progress)
    return prepared.result(poses)


def check_options(
    *,
    objective: object,
    supports: object,
    scene: object,
    root_scale: object,
    source_up: object,
    target_up: object,
    root_offset: object,
    root_follows: object,
) -> None:
    """Check the arguments of `retarget` with these names.

    Raises:
        SettingsError: one is none of its choices, or of another kind.
    """
    check_choice("objective", objective, OBJECTIVES)
    check_choice("supports", supports, SUPPORTS)
    check_choice("scene", scene, get_args(Environment))
    check_choice("source_up", source_up, (*AXES, None))
    check_choice("target_up", target_up, (*AXES, None))
    check_choice("root_offset", root_offset, (*get_args(RootOffset), None))
    check_choice("root_follows", root_follows, (*get_args(RootFollows), None))
    if root_scale is not None:
        check_number("root_scale", root_scale, SMALLEST, LARGEST)


def _by_paper(prepared: Prepared, progress: Progress) -> RetargetResult:
    """Retarget by the paper's objective."""
    postures = solve_postures(prepared.problem.distances, prepared.problem.source, prepared.copy.positions)
    poses = solve_paper(prepared.problem, _fitted_poses(prepared.copy, prepared.problem, postures), progress)
    return prepared.result(poses, postures)


def _fitted_poses(copy: Motion, problem: PoseProblem, postures: Postures) -> Array:
    """(frames, parts + 1, 3), the poses that turn the copy's bones to the solved points; the root stays."""
    points = np.array(copy.positions)
    points[:, problem.distances.targets] = postures.positions
    fitted = fit_rotations(copy, points, problem.distances.targets, problem.roots)
    roots = np.unique(problem.parts, return_index=True)[1]
    before, after = (Rotation.from_quat(motion.world_rotations[:, roots]) for motion in (copy, fitted))
    return np.pad((after * before.inv()).as_rotvec(), ((0, 0), (0, 1), (0, 0)))
