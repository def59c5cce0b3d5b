"""Retarget one clip: source motion and target in, target motion and figures out."""

from __future__ import annotations

from collections.abc import Mapping
from types import NoneType

from distretarget.baseline.rotation_copy import RootScale, find_root_scale
from distretarget.checks import check_callable, check_kind
from distretarget.ik.poses import Mapper, Progress, ignore_progress
from distretarget.motion import Motion
from distretarget.numerics.parallel import in_threads
from distretarget.objectives.contact import solve_contact
from distretarget.objectives.paper import solve_paper
from distretarget.objectives.settings import DEFAULT_SETTINGS, ContactSettings
from distretarget.pipeline.options import DEFAULT_OPTIONS, Options
from distretarget.pipeline.performer import match_performer
from distretarget.pipeline.result import RetargetResult
from distretarget.skeleton import JointMap, Skeleton
from distretarget.target import SkeletonEdit, Target


def retarget(
    source: Motion,
    target: Motion | Skeleton | Target | SkeletonEdit,
    options: Options = DEFAULT_OPTIONS,
    *,
    joint_map: JointMap | None = None,
    settings: ContactSettings = DEFAULT_SETTINGS,
    mapper: Mapper = in_threads,
    progress: Progress = ignore_progress,
) -> RetargetResult:
    """Retarget a motion to another body.

    Args:
        source: the motion to retarget.
        target: the body to retarget it to, with any names, rest pose and axes: the result of `load_target`, with the
            joint map of its file; a skeleton; or a motion of the body, which also shows its axes, and how its limbs
            bend where the rest pose does not.
        options: how to retarget it.
        joint_map: the source key for each target key, or None for joints that nothing should drive; it overrides the
            target file's map. All other joints are matched by names or by shape.
        settings: of the contact objective; the paper's objective has none.
        mapper: solves the chunks of a long clip: `map`, the `map` of an executor, or by default one thread per core.
            The result is the same. The paper's objective has no chunks.
        progress: called with the number of frames solved since the last call.

    Raises:
        MatchingError: the two bodies cannot be matched.
        MapError: `joint_map` names joints that are not there.
        MotionError: the source has no frames, or positions too large to compute with, or a body has no extent; or
            the root is to follow the source's root, and the source has none on the floor.
        SettingsError: an argument has the wrong type.
    """
    check_kind("source", source, Motion)
    check_kind("target", target, Motion, Skeleton, Target, SkeletonEdit)
    check_kind("options", options, Options)
    check_kind("joint_map", joint_map, Mapping, NoneType)
    check_kind("settings", settings, ContactSettings)
    check_callable("mapper", mapper)
    check_callable("progress", progress)
    match = match_performer(source, target, options, joint_map)
    performer = match.performer(RootScale.even(options.root_scale or find_root_scale(match.matching)), options)
    if options.objective == "paper":
        return performer.result(*solve_paper(performer.clip, progress))
    performer = performer.with_supports(options, settings)
    return performer.result(
        solve_contact(performer.clip, performer.supports, performer.settings, mapper=mapper, progress=progress)
    )
